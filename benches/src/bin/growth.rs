//! Time of a ray as one mesh grows from 1,000 triangles to 10 million.
//!
//! `cargo run --release -p firsthit-benches --bin growth -- [--json] [--svg FILE] [--sizes N,N,...]`

use std::path::PathBuf;
use std::process::ExitCode;

use clap::Parser;
use firsthit_benches::growth::{Course, cache_size, run};
use firsthit_geometry::Precision;

/// Measures how the time of a ray grows with the number of triangles of one mesh.
#[derive(Debug, Parser)]
#[command(name = "growth", max_term_width = 110)]
struct Args {
    /// Numbers of triangles, about
    #[arg(
        long,
        value_name = "LIST",
        value_delimiter = ',',
        default_value = "1000,3000,10000,30000,100000,300000,1000000,3000000,10000000"
    )]
    sizes: Vec<usize>,
    /// Tiers
    #[arg(long, value_name = "LIST", value_delimiter = ',', default_value = "robust,fast")]
    precision: Vec<Precision>,
    /// Rays of each kind
    #[arg(long, value_name = "N", default_value = "262144", value_parser = clap::value_parser!(u32).range(1..))]
    count: u32,
    /// Timed repetitions; the best counts
    #[arg(long, value_name = "N", default_value = "5", value_parser = clap::value_parser!(u16).range(1..))]
    reps: u16,
    /// Size of the processor's largest cache, in MiB [default: what the system says, or 32]
    #[arg(long, value_name = "MIB")]
    cache: Option<u64>,
    /// Print JSON
    #[arg(long)]
    json: bool,
    /// Draw a chart too
    #[arg(long, value_name = "FILE")]
    svg: Option<PathBuf>,
}

fn main() -> ExitCode {
    match start(Args::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(message) => {
            eprintln!("error: {message}");
            ExitCode::FAILURE
        }
    }
}

fn start(args: Args) -> Result<(), String> {
    let course = Course {
        sizes: args.sizes,
        precisions: args.precision,
        rays: args.count as usize,
        repetitions: args.reps.into(),
        cache: args.cache.map_or_else(|| cache_size().unwrap_or(32 << 20), |mib| mib << 20),
    };
    let growth = run(&course, &|line| eprintln!("{line}")).map_err(|e| e.to_string())?;
    if args.json {
        println!("{}", serde_json::to_string_pretty(&growth).map_err(|e| e.to_string())?);
    } else {
        println!("{}", growth.markdown());
    }
    if let Some(path) = args.svg {
        std::fs::write(&path, growth.svg()).map_err(|e| format!("{}: {e}", path.display()))?;
    }
    Ok(())
}
