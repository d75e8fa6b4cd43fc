//! The options of `firsthit accuracy`.

use std::path::PathBuf;

use clap::Args;
use firsthit_geometry::Precision;

const EXAMPLES: &str = "\
Examples:
  firsthit accuracy --corpus tests/corpus
      Every engine at every tier on a folder of exact hard cases.
  firsthit accuracy --corpus tests/corpus --json | jq '.corpus[] | select(.failed > 0)'

Exit codes: 0 done, 1 failed (also: a required case was answered wrong), 2 wrong usage, 130 interrupted.";

#[derive(Args, Debug)]
#[command(args_override_self = true, after_help = EXAMPLES)]
pub(crate) struct AccuracyArgs {
    /// Run the hard cases of this folder (.jsonl files) on every engine
    #[arg(long, value_name = "DIR", required = true)]
    pub(crate) corpus: Option<PathBuf>,

    /// Only these tiers of precision, comma-separated [default: all]
    #[arg(long, value_name = "LIST", value_delimiter = ',')]
    pub(crate) precision: Vec<Precision>,

    /// Print JSON
    #[arg(long)]
    pub(crate) json: bool,
}

impl AccuracyArgs {
    /// The tiers asked for, from the cheapest to the most careful.
    pub(crate) fn tiers(&self) -> Vec<Precision> {
        let wanted = |p: &Precision| self.precision.is_empty() || self.precision.contains(p);
        Precision::ALL.into_iter().filter(wanted).collect()
    }
}
