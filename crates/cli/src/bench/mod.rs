//! `firsthit bench MODEL...`: how fast builds and queries are, on this model and machine.

mod args;
mod render;
mod table;

use std::time::Duration;

use firsthit_accel::BuildQuality;
use firsthit_measure::bench::{self, BenchOptions};
use firsthit_measure::{MeasureError, Subject, report};
use firsthit_render::Monitor as _;

pub(crate) use args::BenchArgs;

use crate::console::{Console, print, print_json};
use crate::error::{Exit, Failure};
use crate::interrupt::Interrupt;
use crate::progress::{Progress, Style};
use crate::{measured, simd};

/// Measures the models of the arguments.
pub(crate) fn run(args: &BenchArgs) -> Result<Exit, Failure> {
    let console = Console::new(args.quiet, false);
    if args.render {
        return render::run(args, console);
    }
    let options = options(args)?;
    if let Some(file) = &args.html {
        measured::check_target(file, &args.models)?;
    }
    let interrupt = Interrupt::listen(console, "printing what was measured so far");
    let mut subjects = measured::subjects(&args.models, args.up, console)?;
    if args.builtin {
        subjects.push(Subject::builtin());
    }
    interrupt.begin();
    let style = Style::new(args.progress, args.no_progress, args.quiet);
    let progress = Progress::new(style, "measuring", interrupt.clone());
    let bench = bench::run(&subjects, &options, &progress);
    progress.finish();
    let bench = bench.map_err(|e| match e {
        MeasureError::Level(_) => Failure::usage(e),
        _ => Failure::failed(e),
    })?;
    if args.json {
        print_json(&bench)?;
    } else {
        print(table::text(&bench).as_bytes())?;
    }
    if let Some(path) = &args.html {
        measured::write(path, &report::bench_html(&bench), console)?;
    }
    Ok(if progress.cancelled() { Exit::Interrupted } else { Exit::Done })
}

/// What is wanted, each once; else what is usual.
fn or<T: Clone + PartialEq>(wanted: &[T], otherwise: Vec<T>) -> Vec<T> {
    let mut each = Vec::new();
    for item in wanted {
        if !each.contains(item) {
            each.push(item.clone());
        }
    }
    if each.is_empty() { otherwise } else { each }
}

fn options(args: &BenchArgs) -> Result<BenchOptions, Failure> {
    let usual = BenchOptions::default();
    Ok(BenchOptions {
        rays: or(&args.rays, usual.rays),
        layouts: or(&args.layout, usual.layouts),
        precisions: or(&args.precision, usual.precisions),
        levels: or(&args.simd, simd::forced()?.map_or(usual.levels, |level| vec![level])),
        builds: or(&args.build, vec![BuildQuality::default()]),
        peers: !args.no_peers,
        threads: args.threads.map_or(usual.threads, Into::into),
        count: args.count as usize,
        seed: args.seed.unwrap_or(usual.seed),
        budget: if args.quick { Duration::from_secs(2) } else { usual.budget },
    })
}
