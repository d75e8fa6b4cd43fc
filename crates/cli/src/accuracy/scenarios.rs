//! `firsthit accuracy --scenarios`: what must hold on whole meshes.

use firsthit_measure::Effort;
use firsthit_measure::scenario::{self, Outcome, Settings};
use serde::Serialize;

use super::AccuracyArgs;
use super::measure::subjects;
use crate::console::{Console, print, print_json, visible};
use crate::error::{Exit, Failure};
use crate::interrupt::Interrupt;
use crate::progress::{Progress, Style};

/// The JSON of `--scenarios --json`.
#[derive(Serialize)]
struct Report {
    scenarios: Vec<Outcome>,
    skipped: Vec<Skipped>,
}

#[derive(Serialize)]
struct Skipped {
    id: &'static str,
    why: &'static str,
}

/// Runs the scenarios that the arguments ask for; the exit code tells whether everything held.
pub(crate) fn run(args: &AccuracyArgs) -> Result<Exit, Failure> {
    let console = Console::new(args.quiet, false);
    let subjects = subjects(args, console)?;
    if let Some(open) = subjects.iter().find(|s| !s.closed) {
        let failure = Failure::failed(format_args!("{}: this model is not closed: a ray may leave it", open.name));
        return Err(failure.hint("firsthit inspect MODEL says how many edges have one side only"));
    }
    let interrupt = Interrupt::listen(console, "printing what was found so far");
    interrupt.begin();
    let style = Style::new(args.progress, args.no_progress, args.quiet);
    let progress = Progress::new(style, "running", interrupt.clone());
    let settings = Settings {
        factor: match args.effort() {
            Effort::Quick => 1,
            Effort::Normal => 5,
            Effort::Thorough => 50,
        },
        count: args.count,
        from: args.from,
        seed: args.seed,
        tiers: args.tiers(),
        subjects,
        monitor: &progress,
    };
    let wanted = if args.only.is_empty() { scenario::ALL.to_vec() } else { args.only.clone() };
    let outcomes = scenario::run(&wanted, &settings);
    progress.finish();

    let passed = outcomes.iter().all(Outcome::passed);
    let skipped: Vec<Skipped> =
        if args.only.is_empty() { scenario::MISSING.map(|(id, why)| Skipped { id, why }).into() } else { Vec::new() };
    if args.json {
        print_json(&Report { scenarios: outcomes, skipped })?;
    } else {
        let mut text: String =
            outcomes.iter().flat_map(|o| o.to_string().lines().map(line).collect::<Vec<_>>()).collect();
        skipped.iter().for_each(|s| text += &line(&format!("{:4} skipped {}", s.id, s.why)));
        print(text.as_bytes())?;
    }
    Ok(match (passed, interrupt.requested()) {
        (false, _) => Exit::Failed,
        (true, true) => Exit::Interrupted,
        (true, false) => Exit::Done,
    })
}

/// Names come from files.
fn line(text: &str) -> String {
    format!("{}\n", visible(text))
}
