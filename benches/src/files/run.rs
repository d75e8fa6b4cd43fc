//! The command line of the files program.

use std::fs;
use std::path::PathBuf;
use std::process::ExitCode;

use clap::Parser;

use super::{End, Row, inventory, load, page, render, sheet};
use crate::record::Record;

const AFTER: &str = "\
The program is the `firsthit` that lies beside this one: `cargo build --release -p firsthit-cli` first. What is known of the
files is read from gltf-inventory.csv and obj-inventory.csv in the folder, where they are.

Exit codes: 0 all is as it should be, 1 something is not: it is named.";

/// Loads every model file of a folder, each in a process of its own, and tells what came of it.
#[derive(Debug, Parser)]
#[command(name = "files", max_term_width = 110, after_help = AFTER)]
struct Args {
    /// The folder
    folder: PathBuf,
    /// Render every file that loads into this folder, and put the pictures on sheets there
    #[arg(long, value_name = "DIR")]
    render: Option<PathBuf>,
    /// Write the tables as a page
    #[arg(long, value_name = "FILE")]
    markdown: Option<PathBuf>,
    /// Write all as JSON
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Only files with this in their path; may be given several times
    #[arg(long, value_name = "TEXT")]
    only: Vec<String>,
    /// A sentence for the page, as about the state of the machine; may be given several times
    #[arg(long, value_name = "TEXT")]
    note: Vec<String>,
}

/// Runs the program; its exit code says whether all is as it should be.
#[must_use]
pub fn main() -> ExitCode {
    match run(&Args::parse()) {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::FAILURE,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::FAILURE
        }
    }
}

type Error = Box<dyn std::error::Error>;

fn run(args: &Args) -> Result<bool, Error> {
    let program = std::env::current_exe()?.with_file_name("firsthit").with_extension(std::env::consts::EXE_EXTENSION);
    if !program.exists() {
        return Err(format!("{} is not there: cargo build --release -p firsthit-cli", program.display()).into());
    }
    if let Some(folder) = &args.render {
        fs::create_dir_all(folder)?;
    }
    let mut rows = Vec::new();
    for (file, known) in inventory::of(&args.folder)? {
        if !args.only.is_empty() && !args.only.iter().any(|part| file.contains(part)) {
            continue;
        }
        let mut row = load(&program, &args.folder, &file, known)?;
        if let (Some(into), End::Loaded) = (&args.render, row.end) {
            row.picture = Some(render(&program, &args.folder, &file, into)?);
        }
        eprintln!("{:8} {:6.2} s {file}", row.end.name(), row.seconds);
        rows.push(row);
    }
    let record = Record::new(1, 1, args.note.clone(), rows);
    write(args, &record)?;
    let mut well = true;
    for (what, files) in page::faults(&record.rows) {
        println!("{what}: {}", files.len());
        files.iter().for_each(|f| println!("  {f}"));
        well &= files.is_empty();
    }
    Ok(well)
}

fn write(args: &Args, record: &Record<Row>) -> Result<(), Error> {
    if let Some(path) = &args.json {
        record.write_json(path)?;
    }
    if let Some(path) = &args.markdown {
        fs::write(path, page::page(record)).map_err(|e| format!("{}: {e}", path.display()))?;
    }
    if let Some(folder) = &args.render {
        let pictures = record.rows.iter().filter_map(|r| Some((r.file.clone(), r.picture.as_ref()?)));
        let made = pictures.filter(|(_, p)| p.end == End::Loaded).map(|(name, p)| (name, p.path.clone()));
        println!("{} sheets", sheet::write(folder, &made.collect::<Vec<_>>())?);
    }
    Ok(())
}
