//! The options of `firsthit query`.

use std::path::PathBuf;

use clap::{Args, ValueEnum};
use firsthit_accel::Crossings;
use firsthit_geometry::Precision;
use firsthit_import::UpAxis;

use super::table::Format;

const EXAMPLES: &str = "\
Rays are rows of ox,oy,oz,dx,dy,dz or ox,oy,oz,dx,dy,dz,t_min,t_max: CSV (a line with these names may come first), one JSON
array or object a line, or a NumPy array of (n, 6) or (n, 8) numbers; the content tells which. The direction need not be
unit: t counts its lengths. Without t_min and t_max a ray goes from 0 to infinity; null is infinity in JSON. A ray with a
NaN meets nothing.

Answers, in the order of the rays:
  closest  hit,t,instance,geometry,primitive,u,v,nx,ny,nz    a miss has t = inf (null in JSON) and ids of -1
  any      hit
  count    count
  all      ray, then the columns of closest: a row for each hit, sorted along the ray
The normal is by the winding of the triangle. Numbers read back as exactly what they were; a .npy file has them all as
64-bit floats. Memory is bounded, however many rays there are.

Examples:
  firsthit query closest bunny.obj --rays rays.csv -o hits.csv
  firsthit query any house.glb --rays sight.npy -o seen.npy
  echo 0,0,9,0,0,-1 | firsthit query all box.glb --format jsonl
  firsthit query count part.glb --rays - --precision exact < rays.jsonl

Exit codes: 0 done, 1 a file cannot be read or written or has a bad row, 2 wrong usage, 130 interrupted.";

/// A question.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Question {
    /// What each ray meets first
    Closest,
    /// Whether each ray meets anything
    Any,
    /// Everything that each ray meets
    All,
    /// How often each ray meets something
    Count,
}

impl Question {
    /// Whether it matters how hits at an edge are counted.
    pub(super) fn counts(self) -> bool {
        matches!(self, Self::All | Self::Count)
    }
}

/// How hits at edges count.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Counted {
    /// Each crossing of a surface once
    Surfaces,
    /// Each triangle that has the point
    Triangles,
}

impl From<Counted> for Crossings {
    fn from(counted: Counted) -> Self {
        match counted {
            Counted::Surfaces => Self::Surfaces,
            Counted::Triangles => Self::Triangles,
        }
    }
}

#[derive(Args, Debug)]
#[command(args_override_self = true, after_help = EXAMPLES)]
pub(crate) struct QueryArgs {
    /// What to ask
    #[arg(value_name = "QUESTION", value_enum, hide_possible_values = false)]
    pub(crate) question: Question,

    /// The model or scene: .obj, .ply, .stl, .gltf, .glb, .toml, .json (also with .zst, .gz)
    #[arg(value_name = "MODEL")]
    pub(crate) model: PathBuf,

    /// The rays; `-` is standard input
    #[arg(long, value_name = "FILE", default_value = "-")]
    pub(crate) rays: PathBuf,

    /// Where to write: .csv, .jsonl or .npy; `-` is standard output
    #[arg(short, long, value_name = "FILE", default_value = "-")]
    pub(crate) output: PathBuf,

    /// How to write [default: as the name of the output says, else csv]
    #[arg(long, value_name = "FORMAT", value_enum)]
    pub(crate) format: Option<Format>,

    /// Of `all` and `count`: what counts where a ray passes through an edge or a vertex [default: triangles]
    #[arg(long, value_name = "WHAT", value_enum)]
    pub(crate) crossings: Option<Counted>,

    /// How carefully rays meet surfaces: fast, robust (no leaks), double or exact
    #[arg(long, value_name = "TIER", default_value = "robust")]
    pub(crate) precision: Precision,

    /// The file's upward axis: +X, -X, +Y, -Y, +Z or -Z [default: what the format says, else +Y]
    #[arg(long, value_name = "AXIS", allow_hyphen_values = true)]
    pub(crate) up: Option<UpAxis>,

    /// Threads to answer with [default: one per core]
    #[arg(short, long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub(crate) threads: Option<u16>,

    /// Take every warning about the model as an error
    #[arg(long)]
    pub(crate) strict: bool,

    /// Print errors only
    #[arg(short, long)]
    pub(crate) quiet: bool,
}
