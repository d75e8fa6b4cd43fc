//! Closest points, signed distances, inside and outside: firsthit beside parry3d and bvh; and what one query a call costs.
//!
//! `taskset -c 1 cargo run --release -p firsthit-benches --bin points -- [--count N] [--reps N] [--json FILE] MODEL...`

use std::path::PathBuf;
use std::process::ExitCode;

use clap::Parser;
use firsthit_benches::model::Model;
use firsthit_benches::points::{race, table};
use firsthit_benches::record::Record;

/// Times queries about points, engines in turn on the same points, on the thread it is called from.
#[derive(Debug, Parser)]
#[command(name = "points", max_term_width = 110)]
struct Args {
    /// Model files
    #[arg(value_name = "MODEL", required = true)]
    models: Vec<String>,
    /// Points of a kind; parry3d and bvh get a quarter of them
    #[arg(long, value_name = "N", default_value = "100000", value_parser = clap::value_parser!(u32).range(4..))]
    count: u32,
    /// Timed repetitions
    #[arg(long, value_name = "N", default_value = "5", value_parser = clap::value_parser!(u16).range(1..))]
    reps: u16,
    /// Write the numbers to this file
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// A sentence for that file, as about the state of the machine; may be given several times
    #[arg(long, value_name = "TEXT")]
    note: Vec<String>,
}

fn main() -> ExitCode {
    match run(Args::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(message) => {
            eprintln!("error: {message}");
            ExitCode::FAILURE
        }
    }
}

fn run(args: Args) -> Result<(), String> {
    let mut rows = Vec::new();
    for word in &args.models {
        rows.extend(race(&Model::open(word)?, args.count as usize, args.reps.into())?);
    }
    print!("{}", table(&rows));
    if let Some(file) = args.json {
        Record::new(1, args.reps.into(), args.note, rows).write_json(&file)?;
    }
    Ok(())
}
