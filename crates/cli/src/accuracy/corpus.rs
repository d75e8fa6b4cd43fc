//! `firsthit accuracy --corpus`: the hard cases of a folder.

use std::path::Path;

use firsthit_measure::corpus::{self, Engine};

use super::AccuracyArgs;
use crate::console::{message, print, print_json, visible};
use crate::error::{Exit, Failure};

/// Complaints shown; `--json` has all.
const SHOWN: usize = 20;

/// Runs every engine at the tiers asked for; the exit code tells whether all required answers are right.
pub(crate) fn run(args: &AccuracyArgs, folder: &Path) -> Result<Exit, Failure> {
    let cases = corpus::read(folder).map_err(|e| {
        let hint = "a folder of .jsonl files with one case a line, as tests/corpus/README.md describes them";
        Failure::failed(e).hint(hint)
    })?;
    let report = corpus::run(&cases, &Engine::all(), &args.tiers());
    if args.json {
        print_json(&report)?;
    } else {
        print(visible_lines(&report.to_string()).as_bytes())?;
    }
    if report.passed() {
        return Ok(Exit::Done);
    }
    for complaint in report.failures.iter().take(SHOWN) {
        message(format_args!("failed: {complaint}"));
    }
    if report.failures.len() > SHOWN {
        message(format_args!("failed: and {} more (--json lists them all)", report.failures.len() - SHOWN));
    }
    Ok(Exit::Failed)
}

/// Names of groups come from files.
fn visible_lines(text: &str) -> String {
    text.lines().map(|line| format!("{}\n", visible(line))).collect()
}
