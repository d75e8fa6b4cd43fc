//! What it buys that scenes are rendered by kernels without the effects that they do not call for.
//!
//! `cargo run --release -p firsthit-benches --bin effects -- [--instructions] [--record] [MODEL...]`

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::Parser;
use firsthit_benches::effects::{By, SCENES, Work, counted_render, instructions, markdown, measure, stage};
use firsthit_benches::record::Record;

/// Renders models by the kernel chosen for each and by the one for everything, in turn.
#[derive(Debug, Parser)]
#[command(name = "effects", max_term_width = 110)]
struct Args {
    /// Models [default: those of the project]
    models: Vec<PathBuf>,
    /// Timed repetitions
    #[arg(long, value_name = "N", default_value = "9", value_parser = clap::value_parser!(u16).range(1..))]
    reps: u16,
    /// Width of the pictures; they are 4 by 3
    #[arg(long, value_name = "N", default_value = "160", value_parser = clap::value_parser!(u32).range(1..=4096))]
    width: u32,
    /// Samples of a pixel
    #[arg(long, value_name = "N", default_value = "16", value_parser = clap::value_parser!(u32).range(1..=4096))]
    spp: u32,
    /// Count instructions by valgrind too
    #[arg(long)]
    instructions: bool,
    /// Render once by one kernel, chosen or full, and do nothing else: for valgrind, perf and the like
    #[arg(long, value_name = "KERNEL", value_parser = kernel)]
    only: Option<By>,
    /// Print JSON
    #[arg(long)]
    json: bool,
    /// Write effects-DATE.json and effects-DATE.md too, into this folder or benches/record
    #[arg(long, value_name = "DIR", num_args = 0..=1, require_equals = true,
          default_missing_value = concat!(env!("CARGO_MANIFEST_DIR"), "/record"))]
    record: Option<PathBuf>,
    /// A sentence for the record, as about the state of the machine; may be given several times
    #[arg(long, value_name = "TEXT")]
    note: Vec<String>,
}

fn kernel(name: &str) -> Result<By, String> {
    let found = By::NAMES.iter().find(|(_, n)| *n == name).map(|(by, _)| *by);
    found.ok_or_else(|| "expected chosen or full".into())
}

fn main() -> ExitCode {
    // One thread, and this one: that is what can be timed and counted.
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).use_current_thread().build();
    match pool.map_err(|e| e.to_string()).and_then(|pool| pool.install(|| start(Args::parse()))) {
        Ok(()) => ExitCode::SUCCESS,
        Err(message) => {
            eprintln!("error: {message}");
            ExitCode::FAILURE
        }
    }
}

/// Instructions of a sample: what more samples take more, so that what is done once does not count.
fn of_a_sample(model: &Path, by: By, width: u32) -> Result<Option<f64>, String> {
    const FEW: u32 = 2;
    const MANY: u32 = 10;
    let [few, many] = [FEW, MANY].map(|spp| instructions(model, by, Work { width, spp }));
    let samples = f64::from(width * (width * 3 / 4).max(1) * (MANY - FEW));
    Ok(few?.zip(many?).map(|(few, many)| (many as f64 - few as f64) / samples))
}

fn start(args: Args) -> Result<(), String> {
    let work = Work { width: args.width, spp: args.spp };
    let assets = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../assets"));
    let models = if args.models.is_empty() { SCENES.map(|s| assets.join(s)).to_vec() } else { args.models };
    if let Some(by) = args.only {
        for model in &models {
            counted_render(&stage(model, by)?, work)?;
        }
        return Ok(());
    }
    let mut rows = Vec::new();
    for model in &models {
        let mut row = measure(model, work, args.reps.into())?;
        eprintln!("{}: {}, full / chosen {:.3}", row.scene, row.kernel, row.time);
        if args.instructions {
            // Under valgrind a few pixels are enough: the numbers hardly change.
            let width = work.width.div_ceil(3);
            let counts = [of_a_sample(model, By::Chosen, width)?, of_a_sample(model, By::Full, width)?];
            if let [Some(chosen), Some(full)] = counts {
                row.instructions = Some(full / chosen);
                row.instructions_per_sample = Some(chosen);
                eprintln!("{}: instructions, full / chosen {:.3}", row.scene, full / chosen);
            }
        }
        rows.push(row);
    }
    let record = Record::new(1, args.reps.into(), args.note, rows);
    let tables = markdown(&record.rows);
    if args.json {
        println!("{}", serde_json::to_string_pretty(&record).map_err(|e| e.to_string())?);
    } else {
        println!("{tables}");
    }
    if let Some(folder) = &args.record {
        let text = format!("# Kernels, {}\n\n{}\n{tables}", record.date, record.circumstances());
        let files = record.write_as(folder, "effects-", &text).map_err(|e| format!("{}: {e}", folder.display()))?;
        eprintln!("wrote {} and {}", files[0].display(), files[1].display());
    }
    Ok(())
}
