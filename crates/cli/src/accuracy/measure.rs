//! `firsthit accuracy MODEL...`: measures, prints and writes.

use std::path::Path;

use firsthit_measure::report::{self, Charts};
use firsthit_measure::result::Accuracy;
use firsthit_measure::{Options, Subject};
use firsthit_render::Monitor as _;

use super::{AccuracyArgs, csv, table};
use crate::console::{Console, print, print_json};
use crate::error::{Exit, Failure};
use crate::interrupt::Interrupt;
use crate::measured::{self, check_target, write};
use crate::progress::{Progress, Style};
use crate::simd;

/// Measures the models of the arguments.
pub(crate) fn run(args: &AccuracyArgs) -> Result<Exit, Failure> {
    let console = Console::new(args.quiet, false);
    for file in args.html.iter().chain(&args.svg) {
        check_target(file, &args.models)?;
    }
    let interrupt = Interrupt::listen(console, "printing what was measured so far");
    let subjects = subjects(args, console)?;
    interrupt.begin();
    let progress =
        Progress::new(Style::new(args.progress, args.no_progress, args.quiet), "measuring", interrupt.clone());
    let options = Options {
        effort: args.effort(),
        seed: args.seed,
        tiers: args.tiers(),
        rays: args.rays(),
        simd: simd::level()?,
        ..Options::default()
    };
    let accuracy = firsthit_measure::run(&subjects, &options, &progress);
    progress.finish();
    let accuracy = accuracy.map_err(Failure::failed)?;

    if args.json {
        print_json(&accuracy)?;
    } else if args.csv {
        print(csv::text(&accuracy).as_bytes())?;
    } else {
        print(table::text(&accuracy).as_bytes())?;
    }
    if let Some(path) = &args.html {
        write(path, &report::html(&accuracy), console)?;
    }
    if let Some(path) = &args.svg {
        write_charts(path, &accuracy, console)?;
    }
    Ok(if progress.cancelled() { Exit::Interrupted } else { Exit::Done })
}

/// The models of the arguments.
pub(super) fn subjects(args: &AccuracyArgs, console: Console) -> Result<Vec<Subject>, Failure> {
    let mut subjects = measured::subjects(&args.models, args.up, console)?;
    if args.builtin {
        subjects.push(Subject::builtin());
    }
    Ok(subjects)
}

/// One sheet goes to the file itself; several to files beside it, named after their models.
fn write_charts(path: &Path, accuracy: &Accuracy, console: Console) -> Result<(), Failure> {
    match report::svg(accuracy, Charts::Sheets).as_slice() {
        [] => Err(Failure::failed("there is nothing to draw: no tier was measured")),
        [(_, svg)] => write(path, svg, console),
        several => {
            let stem = path.file_stem().unwrap_or_default().to_string_lossy();
            several
                .iter()
                .try_for_each(|(name, svg)| write(&path.with_file_name(format!("{stem}-{name}.svg")), svg, console))
        }
    }
}
