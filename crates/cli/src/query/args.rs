//! The options of `firsthit query`.

use std::path::PathBuf;

use clap::{Args, ValueEnum};
use firsthit_accel::{Crossings, SignMethod};
use firsthit_geometry::Precision;
use firsthit_import::UpAxis;

use super::table::Format;
use crate::args::ViewArgs;
use crate::load::LoadArgs;
use crate::values::{self, Resolution};

const EXAMPLES: &str = "\
Rays are rows of ox,oy,oz,dx,dy,dz or ox,oy,oz,dx,dy,dz,t_min,t_max: CSV (a line with these names may come first), one JSON
array or object a line, or a NumPy array of (n, 6) or (n, 8) numbers; the content tells which. The direction need not be
unit: t counts its lengths. Without t_min and t_max a ray goes from 0 to infinity; null is infinity in JSON. A ray with a
NaN meets nothing.

Points are rows of x,y,z in the same formats.

Answers, in the order of the rays or points:
  closest  hit,t,instance,geometry,primitive,u,v,nx,ny,nz    a miss has t = inf (null in JSON) and ids of -1
  any      hit
  count    count
  all      ray, then the columns of closest: a row for each hit, sorted along the ray
  visible  instance,geometry,name,material,pixels,share: without rays, for each part of the model in how many pixels of
           the camera's picture it is the first thing to be seen; what is seen most comes first
  closest-point    distance,x,y,z,instance,geometry,primitive,u,v,nx,ny,nz: of the surface's nearest point
  distance         distance
  signed-distance  distance, negative inside
  contains         inside
  winding-number   winding: 1 inside of a closed mesh, 0 outside, a fraction where it is open
The normal is by the winding of the triangle. Numbers read back as exactly what they were; a .npy file has them all as
64-bit floats. Memory is bounded, however many rays there are.

Examples:
  firsthit query closest bunny.obj --rays rays.csv -o hits.csv
  firsthit query any house.glb --rays sight.npy -o seen.npy
  echo 0,0,9,0,0,-1 | firsthit query all box.glb --format jsonl
  firsthit query count part.glb --rays - --precision exact < rays.jsonl
  firsthit query signed-distance part.glb --points samples.npy -o distances.npy
  firsthit query visible car.glb --camera-azimuth-angle 40

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
    /// Which parts the camera sees
    Visible,
    /// The nearest point of the surface
    ClosestPoint,
    /// How far the surface is
    Distance,
    /// How far the surface is, negative inside
    SignedDistance,
    /// Whether points are inside
    Contains,
    /// How often the surface winds around points
    WindingNumber,
}

impl Question {
    /// Whether it matters how hits at an edge are counted.
    pub(super) fn counts(self) -> bool {
        matches!(self, Self::All | Self::Count)
    }

    /// Whether it is asked of rays.
    pub(super) fn has_rays(self) -> bool {
        matches!(self, Self::Closest | Self::Any | Self::All | Self::Count)
    }

    /// Whether inside and outside matter.
    pub(super) fn has_sides(self) -> bool {
        matches!(self, Self::SignedDistance | Self::Contains | Self::WindingNumber)
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

/// How inside is told from outside.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Sign {
    /// By what is right for the model: winding, for closed meshes of mixed orientation parity
    Auto,
    /// By the winding number, which holes do not upset
    Winding,
    /// The same by sums over clusters of triangles: for meshes that are hardly connected
    FastWinding,
    /// By the crossings of a ray
    Parity,
    /// By the normals at the nearest point
    Pseudonormal,
    /// By the crossings of a ray, decided exactly
    Exact,
}

impl Sign {
    /// The method; `None`: what is right.
    pub(super) fn method(self) -> Option<SignMethod> {
        Some(match self {
            Self::Auto => return None,
            Self::Winding => SignMethod::Winding,
            Self::FastWinding => SignMethod::FastWinding { accuracy: 2.0 },
            Self::Parity => SignMethod::Parity { votes: 1 },
            Self::Pseudonormal => SignMethod::Pseudonormal,
            Self::Exact => SignMethod::Exact,
        })
    }
}

#[derive(Args, Debug)]
#[command(args_override_self = true, after_help = EXAMPLES)]
pub(crate) struct QueryArgs {
    /// What to ask
    #[arg(value_name = "QUESTION", value_enum)]
    pub(crate) question: Question,

    /// The model or scene: .obj, .ply, .stl, .gltf, .glb, .toml, .json (also with .zst, .gz)
    #[arg(value_name = "MODEL")]
    pub(crate) model: PathBuf,

    /// The rays; `-` is standard input [default: -]
    #[arg(long, value_name = "FILE")]
    pub(crate) rays: Option<PathBuf>,

    /// The points; `-` is standard input [default: -]
    #[arg(long, value_name = "FILE")]
    pub(crate) points: Option<PathBuf>,

    /// Where to write: .csv, .jsonl or .npy; `-` is standard output
    #[arg(short, long, value_name = "FILE", default_value = "-")]
    pub(crate) output: PathBuf,

    /// How to write [default: as the name of the output says, else csv]
    #[arg(long, value_name = "FORMAT", value_enum)]
    pub(crate) format: Option<Format>,

    /// Of `all` and `count`: what counts where a ray passes through an edge or a vertex [default: triangles]
    #[arg(long, value_name = "WHAT", value_enum)]
    pub(crate) crossings: Option<Counted>,

    /// Of `signed-distance`, `contains` and `winding-number`: how inside is told from outside [default: auto]
    #[arg(long, value_name = "METHOD", value_enum)]
    pub(crate) sign: Option<Sign>,

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

    /// Of `visible`: width and height of the picture in pixels [default: 1280x720]
    #[arg(long, value_name = "WxH", value_parser = values::resolution)]
    pub(crate) resolution: Option<Resolution>,

    #[command(flatten)]
    pub(crate) load: LoadArgs,

    #[command(flatten)]
    pub(crate) view: ViewArgs,
}
