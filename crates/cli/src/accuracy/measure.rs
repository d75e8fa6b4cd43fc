//! `firsthit accuracy MODEL...`: measures, prints and writes.

use std::fs;
use std::path::{Path, PathBuf};

use firsthit_import::Imported;
use firsthit_measure::report::{self, Charts};
use firsthit_measure::result::Accuracy;
use firsthit_measure::{Options, Subject};
use firsthit_render::Monitor as _;
use firsthit_render::output;

use super::{AccuracyArgs, csv, table};
use crate::console::{Console, print, print_json};
use crate::error::{Exit, Failure};
use crate::interrupt::Interrupt;
use crate::progress::{Progress, Style};

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
    let mut subjects = Vec::new();
    for path in &args.models {
        let options = firsthit_import::Options { up: args.up, ..Default::default() };
        let Imported { scene, report } = firsthit_import::open(path, &options)?;
        console.warnings(&report, false)?;
        let subject = Subject::new(name(path, &args.models), scene);
        if subject.triangles() == 0 {
            let failure = Failure::failed(format_args!("{}: there is no triangle to aim at", path.display()));
            return Err(failure.hint("analytic shapes are measured beside any model: --builtin"));
        }
        subjects.push(subject);
    }
    if args.builtin {
        subjects.push(Subject::builtin());
    }
    Ok(subjects)
}

/// The file's name; the whole path where two models have the same.
fn name(path: &Path, all: &[PathBuf]) -> String {
    let same = all.iter().filter(|other| other.file_name() == path.file_name()).count();
    match path.file_name() {
        Some(name) if same < 2 => name.to_string_lossy().into_owned(),
        _ => path.display().to_string(),
    }
}

/// Refuses in time what cannot be written, and what would replace a model.
fn check_target(file: &Path, models: &[PathBuf]) -> Result<(), Failure> {
    let folder = file.parent().filter(|p| !p.as_os_str().is_empty());
    if let Some(folder) = folder.filter(|f| !f.is_dir()) {
        let failure = Failure::failed(format_args!("{}: there is no folder {}", file.display(), folder.display()));
        return Err(failure.hint(format_args!("mkdir -p {}", folder.display())));
    }
    if file.is_dir() {
        return Err(Failure::failed(format_args!("{}: this is a folder, not a file", file.display())));
    }
    if let Ok(full) = file.canonicalize()
        && models.iter().any(|m| m.canonicalize().is_ok_and(|m| m == full))
    {
        return Err(Failure::failed(format_args!("{}: this is one of the models", file.display())));
    }
    output::try_path(file).map_err(Failure::failed)
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

fn write(path: &Path, text: &str, console: Console) -> Result<(), Failure> {
    fs::write(path, text).map_err(|e| Failure::failed(format_args!("{}: {e}", path.display())))?;
    console.say(format_args!("wrote {}", path.display()));
    Ok(())
}
