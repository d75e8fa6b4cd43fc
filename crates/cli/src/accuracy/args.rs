//! The options of `firsthit accuracy`.

use std::path::PathBuf;

use crate::values;
use clap::{ArgGroup, Args};
use firsthit_geometry::Precision;
use firsthit_import::UpAxis;
use firsthit_measure::Effort;
use firsthit_measure::scenario::Scenario;
use firsthit_measure::workload::RayKind;

const EXAMPLES: &str = "\
Examples:
  firsthit accuracy dragon.glb
      Nanoseconds a ray and errors of every tier on this model and machine, and which tier to use.
  firsthit accuracy dragon.glb sponza.obj --html accuracy.html --svg accuracy.svg
      The same of two models, with a page and charts.
  firsthit accuracy --builtin --quick --rays aimed --precision fast,robust
  firsthit accuracy --corpus tests/corpus
      Every engine at every tier on a folder of exact hard cases.
  firsthit accuracy --scenarios --thorough
      What must hold on whole meshes: no leaks, exact parity, no self-hits, builds that do not degenerate.
  firsthit accuracy --scenarios --only S1 --count 1e9 --precision robust
      A thousand million rays from inside closed meshes; Ctrl-C stops, --from continues.

Exit codes: 0 done, 1 failed (also: a required case was answered wrong), 2 wrong usage, 130 interrupted (what was
measured so far is printed).";

#[derive(Args, Debug)]
#[command(args_override_self = true, after_help = EXAMPLES)]
#[command(group = ArgGroup::new("what").required(true).multiple(true).args(["models", "builtin", "corpus", "scenarios"]))]
pub(crate) struct AccuracyArgs {
    /// Models to measure: .obj, .ply, .stl, .gltf, .glb, .toml, .json (also with .zst, .gz)
    #[arg(value_name = "MODEL")]
    pub(crate) models: Vec<PathBuf>,

    /// Measure the built-in model, a closed bumpy sphere
    #[arg(long)]
    pub(crate) builtin: bool,

    /// Run the hard cases of this folder (.jsonl files) on every engine instead
    #[arg(long, value_name = "DIR", conflicts_with_all = ["models", "builtin", "csv", "html", "svg"])]
    pub(crate) corpus: Option<PathBuf>,

    /// Run the scenarios on whole meshes instead; those about leaks on the closed MODELs, if given
    #[arg(long, conflicts_with_all = ["corpus", "csv", "html", "svg", "rays"])]
    pub(crate) scenarios: bool,

    /// Only these scenarios, comma-separated: S1, S2, ... [default: all]
    #[arg(long, value_name = "LIST", value_delimiter = ',', value_parser = values::scenario, requires = "scenarios")]
    pub(crate) only: Vec<Scenario>,

    /// So many rays (or what else a scenario counts), as in 1e9 [default: by scenario and effort]
    #[arg(long, value_name = "N", value_parser = values::count, requires = "scenarios")]
    pub(crate) count: Option<u64>,

    /// Continue scenario S1 after so many rays
    #[arg(long, value_name = "N", value_parser = values::count, requires = "scenarios", default_value = "0")]
    pub(crate) from: u64,

    /// Seconds instead of a minute: fewer rays, no pictures, and the robust tier's guards are not measured one by one
    #[arg(long, overrides_with = "thorough")]
    pub(crate) quick: bool,

    /// Minutes instead of one: more rays and repetitions
    #[arg(long, overrides_with = "quick")]
    pub(crate) thorough: bool,

    /// Only these tiers of precision, comma-separated [default: all]
    #[arg(long, value_name = "LIST", value_delimiter = ',')]
    pub(crate) precision: Vec<Precision>,

    /// Only these kinds of rays, comma-separated: primary, shadow, incoherent, aimed [default: all]
    #[arg(long, value_name = "LIST", value_delimiter = ',')]
    pub(crate) rays: Vec<RayKind>,

    /// Seed of all rays
    #[arg(long, value_name = "N", default_value = "1")]
    pub(crate) seed: u64,

    /// The models' upward axis: +X, -X, +Y, -Y, +Z or -Z [default: what the format says, else +Y]
    #[arg(long, value_name = "AXIS", allow_hyphen_values = true)]
    pub(crate) up: Option<UpAxis>,

    /// Print JSON
    #[arg(long)]
    pub(crate) json: bool,

    /// Print comma-separated values, one line for each model, tier or guard, and kind of rays
    #[arg(long, conflicts_with = "json")]
    pub(crate) csv: bool,

    /// Write a page with charts and tables, which needs no network
    #[arg(long, value_name = "FILE")]
    pub(crate) html: Option<PathBuf>,

    /// Write the charts; of several the name is made from this one
    #[arg(long, value_name = "FILE")]
    pub(crate) svg: Option<PathBuf>,

    /// Show progress, also where standard error is no terminal
    #[arg(long, overrides_with = "no_progress")]
    pub(crate) progress: bool,

    /// Show no progress
    #[arg(long, overrides_with = "progress")]
    pub(crate) no_progress: bool,

    /// Print results and errors only
    #[arg(short, long)]
    pub(crate) quiet: bool,
}

impl AccuracyArgs {
    /// The tiers asked for, from the cheapest to the most careful.
    pub(crate) fn tiers(&self) -> Vec<Precision> {
        let wanted = |p: &Precision| self.precision.is_empty() || self.precision.contains(p);
        Precision::ALL.into_iter().filter(wanted).collect()
    }

    /// The kinds of rays asked for.
    pub(crate) fn rays(&self) -> Vec<RayKind> {
        RayKind::ALL.into_iter().filter(|k| self.rays.is_empty() || self.rays.contains(k)).collect()
    }

    pub(crate) fn effort(&self) -> Effort {
        match (self.quick, self.thorough) {
            (true, _) => Effort::Quick,
            (_, true) => Effort::Thorough,
            _ => Effort::Normal,
        }
    }
}
