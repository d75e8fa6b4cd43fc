//! Every answer against all triangles, decided exactly: how many are wrong.
//!
//! `cargo run --release -p firsthit-benches --bin brute -- [--random N] [--aimed M] [--only rays|points|regions] [--json FILE] MODEL...`

use std::io::{IsTerminal, Write as _, stderr};
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};

use clap::{Parser, ValueEnum};
use firsthit_benches::brute::run::{Plan, Watch, run};
use firsthit_benches::brute::tally::{Row, table};
use firsthit_benches::model::Model;
use firsthit_benches::record::Record;

/// Asks rays and points of a scene at the exact tier, and judges every answer by all triangles, without a tree. Then the
/// same of the mesh scaled by powers of two.
#[derive(Debug, Parser)]
#[command(name = "brute", max_term_width = 110)]
struct Args {
    /// Model files
    #[arg(value_name = "MODEL", required = true)]
    models: Vec<String>,
    /// Rays, and points, in and around each model's box
    #[arg(long, value_name = "N", default_value_t = 100_000)]
    random: usize,
    /// Rays, and points, at corners, edges and the like
    #[arg(long, value_name = "M", default_value_t = 20_000)]
    aimed: usize,
    /// Ask rays alone, points alone, or regions alone
    #[arg(long, value_name = "WHAT")]
    only: Option<Only>,
    /// Powers of two by which the model is scaled, comma-separated
    #[arg(long, value_name = "LIST", value_delimiter = ',', default_value = "-40,20", allow_hyphen_values = true)]
    exponents: Vec<i32>,
    /// Ask one of so many chunks of 256 queries at these scales too
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::builder::RangedU64ValueParser::<usize>::new().range(1..))]
    scaled_every: usize,
    /// Seed of rays and points
    #[arg(long, value_name = "S", default_value_t = 1)]
    seed: u64,
    /// Write the numbers to this file
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// A sentence for that file, as about the state of the machine; may be given several times
    #[arg(long, value_name = "TEXT")]
    note: Vec<String>,
}

#[derive(Clone, Copy, Debug, PartialEq, ValueEnum)]
enum Only {
    Rays,
    Points,
    Regions,
}

fn main() -> ExitCode {
    match all(Args::parse()) {
        Ok(0) => ExitCode::SUCCESS,
        Ok(wrong) => {
            eprintln!("{wrong} wrong answers");
            ExitCode::FAILURE
        }
        Err(message) => {
            eprintln!("error: {message}");
            ExitCode::from(2)
        }
    }
}

fn all(args: Args) -> Result<u64, String> {
    let stop = Arc::new(AtomicBool::new(false));
    let flag = stop.clone();
    ctrlc::set_handler(move || flag.store(true, Relaxed)).map_err(|e| e.to_string())?;
    let plan = Plan {
        random: args.random,
        aimed: args.aimed,
        rays: args.only.is_none_or(|only| only == Only::Rays),
        points: args.only.is_none_or(|only| only == Only::Points),
        regions: args.only.is_none_or(|only| only == Only::Regions),
        exponents: args.exponents,
        scaled_every: args.scaled_every,
        seed: args.seed,
    };
    let mut rows: Vec<Row> = Vec::new();
    let mut notes = args.note;
    for word in &args.models {
        let model = Model::open(word)?;
        let say = |what: &str, done: f64, wrong: u64| {
            if stderr().is_terminal() {
                eprint!("\r{}: {what}: {:3.0} %, {wrong} wrong   ", model.name, done * 100.0);
                let _ = stderr().flush();
            }
        };
        let outcome = run(&model, &plan, &Watch { stop: &stop, say: &say })?;
        let edges = outcome.edges;
        let note = format!(
            "{}: {} triangles, {} edges; {} of an odd number of triangles, {} turned, {} of more than two; \
             {} self-intersections; distances off by at most {:.2} units, winding numbers by {:.1e}; {:.0} s",
            model.name,
            model.mesh.triangles.len(),
            edges.all,
            edges.ends,
            edges.turned,
            edges.crowded,
            outcome.self_intersections,
            outcome.worst_distance,
            outcome.worst_winding,
            outcome.seconds
        );
        eprintln!("\r{note}");
        outcome.tally.failures.iter().for_each(|f| eprintln!("  {f}"));
        notes.push(note);
        rows.extend(outcome.tally.rows);
        if outcome.interrupted {
            notes.push("Interrupted.".into());
            break;
        }
    }
    print!("{}", table(&rows));
    let wrong = rows.iter().map(|r| r.wrong).sum();
    if let Some(file) = args.json {
        notes.push(format!("Seed {}; of 2000 queries one is put to all triangles without a sieve.", plan.seed));
        Record::new(1, 1, notes, rows).write_json(&file)?;
    }
    Ok(wrong)
}
