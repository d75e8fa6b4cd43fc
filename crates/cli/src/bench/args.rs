//! The options of `firsthit bench`.

use std::path::PathBuf;

use clap::{ArgGroup, Args};
use firsthit_accel::{BuildQuality, Layout, Level};
use firsthit_geometry::Precision;
use firsthit_import::UpAxis;
use firsthit_measure::bench::BenchRays;

use crate::values::{self, Resolution};

const EXAMPLES: &str = "\
Examples:
  firsthit bench dragon.glb
      Build time, memory and million rays a second of the fast and the robust tier, obvhs's own traversals beside them.
  firsthit bench dragon.glb sponza.obj --html bench.html
      The same of two models, with a page of bars and charts.
  firsthit bench dragon.glb --precision robust --build fast,balanced,high --rays diffuse
  firsthit bench dragon.glb --layout wide8 --simd scalar,avx2,avx512 --json
  firsthit bench --render tests/references/cornell helmet.glb --spp 4,16,64
      Seconds, error and efficiency of path tracing by samples per pixel, and where the time goes. A folder with scene.json
      and ref.exr is compared with that picture; of other models time and rays are told.

The environment variable FIRSTHIT_SIMD forces the level of instructions, here and in render, inspect and accuracy MODEL;
--simd wins over it.

Exit codes: 0 done, 1 failed, 2 wrong usage, 130 interrupted (what was measured so far is printed).";

#[derive(Args, Debug)]
#[command(args_override_self = true, after_help = EXAMPLES)]
#[command(group = ArgGroup::new("what").required(true).multiple(true).args(["models", "builtin", "render"]))]
pub(crate) struct BenchArgs {
    /// Models to measure: .obj, .ply, .stl, .gltf, .glb, .toml, .json (also with .zst, .gz), or a folder with one of them
    #[arg(value_name = "MODEL")]
    pub(crate) models: Vec<PathBuf>,

    /// Measure the built-in model, a bumpy sphere
    #[arg(long)]
    pub(crate) builtin: bool,

    /// Render instead, by path tracing: time, error and efficiency [default: of the built-in model]
    #[arg(long, conflicts_with_all = ["rays", "layout", "precision", "simd", "build", "no_peers", "count", "html"])]
    pub(crate) render: bool,

    /// With --render: samples per pixel, comma-separated [default: 4,16,64,256; with --quick 4,16]
    #[arg(long, value_name = "LIST", value_delimiter = ',', requires = "render",
        value_parser = clap::value_parser!(u32).range(1..=1 << 20))]
    pub(crate) spp: Vec<u32>,

    /// With --render: width and height in pixels of scenes that do not say [default: 640x360]
    #[arg(long, value_name = "WxH", requires = "render", value_parser = values::resolution)]
    pub(crate) resolution: Option<Resolution>,

    /// Only these kinds of rays, comma-separated: primary, shadow, ao, diffuse, random [default: all]
    #[arg(long, value_name = "LIST", value_delimiter = ',')]
    pub(crate) rays: Vec<BenchRays>,

    /// Only these memory layouts, comma-separated: bvh2, wide8, compact8 [default: all]
    #[arg(long, value_name = "LIST", value_delimiter = ',', value_parser = values::layout)]
    pub(crate) layout: Vec<Layout>,

    /// These tiers of precision, comma-separated [default: fast,robust]
    #[arg(long, value_name = "LIST", value_delimiter = ',')]
    pub(crate) precision: Vec<Precision>,

    /// Which instructions queries may use, comma-separated: scalar, avx2, avx512 [default: the best there are]
    #[arg(long, value_name = "LIST", value_delimiter = ',')]
    pub(crate) simd: Vec<Level>,

    /// How trees are built, comma-separated: fast, balanced, high [default: balanced]
    #[arg(long, value_name = "LIST", value_delimiter = ',', value_parser = values::build)]
    pub(crate) build: Vec<BuildQuality>,

    /// Leave obvhs's own traversals out
    #[arg(long)]
    pub(crate) no_peers: bool,

    /// Threads of builds and of queries [default: 1; with --render one, then one per core]
    #[arg(short, long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub(crate) threads: Option<u16>,

    /// Rays of each kind
    #[arg(long, value_name = "N", default_value = "65536", value_parser = clap::value_parser!(u32).range(1..=1 << 26))]
    pub(crate) count: u32,

    /// Fewer repetitions
    #[arg(long)]
    pub(crate) quick: bool,

    /// Seed of all rays [default: 1; with --render 0]
    #[arg(long, value_name = "N")]
    pub(crate) seed: Option<u64>,

    /// The models' upward axis: +X, -X, +Y, -Y, +Z or -Z [default: what the format says, else +Y]
    #[arg(long, value_name = "AXIS", allow_hyphen_values = true)]
    pub(crate) up: Option<UpAxis>,

    /// Print JSON
    #[arg(long)]
    pub(crate) json: bool,

    /// Write a page with bars, charts and tables, which needs no network
    #[arg(long, value_name = "FILE")]
    pub(crate) html: Option<PathBuf>,

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
