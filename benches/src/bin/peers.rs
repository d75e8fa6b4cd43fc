//! firsthit beside its peers: engines take turns on the same rays in one run, and every answer is checked against a
//! reference in double precision.
//!
//! `cargo run --release -p firsthit-benches --bin peers -- [--json] [--reps N] MODEL...`

use std::path::PathBuf;
use std::process::ExitCode;

use clap::Parser;
use firsthit_accel::Level;
use firsthit_benches::engine::named;
use firsthit_benches::memory::Counting;
use firsthit_benches::model::Model;
use firsthit_benches::race::{Course, race};
use firsthit_benches::rays::{Kind, PICTURE};
use firsthit_benches::record::Record;
use firsthit_benches::summary;

#[global_allocator]
static ALLOCATOR: Counting = Counting;

const AFTER: &str = "\
Embree takes part where the environment variable EMBREE_LIB names a libembree4; tinybvh with --features tinybvh.
FIRSTHIT_SIMD=scalar|avx2|avx512 forces the level of firsthit's instructions.

On a machine that others use too, believe the best of the repetitions, and ratios within one run only:
  taskset -c 1 target/release/peers --reps 7 forest bunny.obj --engines firsthit-robust,embree-robust";

/// Races ray-query engines on the same rays, and checks every answer.
#[derive(Debug, Parser)]
#[command(name = "peers", max_term_width = 110, after_help = AFTER)]
struct Args {
    /// Model files, folders with one model in them, or the generated `forest` and `terrain`
    #[arg(value_name = "MODEL", required = true)]
    models: Vec<String>,
    /// Print JSON
    #[arg(long)]
    json: bool,
    /// Timed repetitions
    #[arg(long, value_name = "N", default_value = "5", value_parser = clap::value_parser!(u16).range(1..))]
    reps: u16,
    /// Only these engines, comma-separated
    #[arg(long, value_name = "LIST", value_delimiter = ',')]
    engines: Vec<String>,
    /// Only these rays: primary, shadow, ao, diffuse
    #[arg(long, visible_alias = "rays", value_name = "LIST", value_delimiter = ',')]
    sets: Vec<Kind>,
    /// Rays of each kind
    #[arg(long, value_name = "N", default_value_t = PICTURE * PICTURE)]
    count: usize,
    /// Threads of builds and of rays
    #[arg(long, value_name = "N", default_value = "1", value_parser = clap::value_parser!(u16).range(1..=1024))]
    threads: u16,
    /// Build each tree so many times; the quickest counts
    #[arg(long, value_name = "N", default_value = "1", value_parser = clap::value_parser!(u16).range(1..))]
    builds: u16,
    /// Write DATE.json and DATE.md too, into this folder or benches/record
    #[arg(long, value_name = "DIR", num_args = 0..=1, require_equals = true,
          default_missing_value = concat!(env!("CARGO_MANIFEST_DIR"), "/record"))]
    record: Option<PathBuf>,
    /// A sentence for the record, as about the state of the machine; may be given several times
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
    let course = Course {
        engines: named(&args.engines)?,
        kinds: if args.sets.is_empty() { Kind::ALL.to_vec() } else { args.sets },
        count: args.count.max(1),
        repetitions: args.reps.into(),
        builds: args.builds.into(),
        simd: simd()?,
    };
    let threads = usize::from(args.threads);
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().map_err(|e| e.to_string())?;
    let mut rows = Vec::new();
    for word in &args.models {
        // One model at a time in memory.
        rows.extend(race(&Model::open(word)?, &course, &pool, &|line| eprintln!("{line}"))?);
    }
    let record = Record::new(threads, course.repetitions, args.note, rows);
    if args.json {
        println!("{}", serde_json::to_string_pretty(&record).map_err(|e| e.to_string())?);
    } else {
        println!("{}", summary::tables(&record.rows).trim_start());
        println!("{}", summary::figures(&record.rows));
    }
    if let Some(folder) = &args.record {
        let files = record.write(folder).map_err(|e| format!("{}: {e}", folder.display()))?;
        files.iter().for_each(|f| eprintln!("wrote {}", f.display()));
    }
    Ok(())
}

fn simd() -> Result<Option<Level>, String> {
    let Some(word) = std::env::var_os("FIRSTHIT_SIMD") else { return Ok(None) };
    let level: Level = word.to_string_lossy().parse().map_err(|e| format!("FIRSTHIT_SIMD: {e}"))?;
    match level.is_available() {
        true => Ok(Some(level)),
        false => Err(format!("FIRSTHIT_SIMD: this processor has no {level}")),
    }
}
