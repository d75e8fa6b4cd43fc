//! The command line, once: parsing, `--help`, completions, the manual page and the keys of the configuration file
//! all come from these definitions.

use std::path::PathBuf;
use std::time::Duration;

use clap::{Args, Parser, Subcommand};
use firsthit_geometry::Precision;
use firsthit_import::{AnimationChoice, Play, UpAxis};
use firsthit_render::sampler::SamplerChoice;
use firsthit_render::{
    CameraChoice, Crop, EffectOverrides, FilterChoice, IntegratorChoice, TextureFilter, ViewTransform,
};
use glam::DVec3;

use crate::accuracy::AccuracyArgs;
use crate::bench::BenchArgs;
use crate::compare::CompareArgs;
use crate::load::LoadArgs;
use crate::query::QueryArgs;
use crate::values::{self, AovList, Color, Explain, Hdri, Plane, Resolution, Switch};

const EXAMPLES: &str = "\
Examples:
  firsthit render helmet.glb                        writes helmet.png
  firsthit render scan.obj --up +Z -o scan.exr --aov depth,normal
  firsthit render chair.glb --camera-azimuth-angle 40 --resolution 1920x1080 --spp 64
  firsthit inspect helmet.glb --json                what is in the file
  firsthit query closest helmet.glb --rays rays.csv what each ray meets first
  firsthit completions bash > /etc/bash_completion.d/firsthit

Exit codes: 0 done, 1 loading or rendering failed, 2 wrong usage, 130 interrupted.";

const RENDER_EXAMPLES: &str = "\
Examples:
  firsthit render helmet.glb
      Frame the model, light it with the studio and write helmet.png: by path tracing, until it looks clean, for at
      most a minute.
  firsthit render helmet.glb --integrator whitted
      A quick look: direct light, mirrors and glass, without the light that surfaces send to each other.
  firsthit render room.glb --camera 0 -s 256 -t 2 -o room.exr
      The file's first camera, 256 samples per pixel on two threads, as OpenEXR.
  firsthit render engine.obj --up +Z --clip-plane 1,0,0,0
      A section view: only what lies at x <= 0 is shown.
  firsthit render car.glb --hdri sunset.hdr --hdri-rotation 90 --exposure -0.5
      Lit by an environment map, half a stop darker.
  firsthit render car.glb --effects auto,-shadows,+ao
      What the scene calls for, without shadows and with ambient occlusion.
  firsthit render car.glb -o - | display -
      PNG on standard output.
  firsthit render fox.glb --animation Run --animation-time 0.4s
      A moment of an animation.
  firsthit render fox.glb --animation Run --frames 0..48 --fps 24 -s 64 -o run_%04d.png
      Two seconds of it, one file for each frame.

A `firsthit.toml` in the current folder (or the file of --config) may set any long option by its name, for example
  resolution = \"1920x1080\"
  spp = 64
  camera-position = [3, 1, 4]
The command line wins over it. Paths in it are relative to the current folder.

Exit codes: 0 done, 1 loading or rendering failed, 2 wrong usage, 130 interrupted (the image so far is written).";

const MERGE_EXAMPLES: &str = "\
Examples:
  firsthit render a.glb --samples-range 0..512 --checkpoint first.sums -o first.png       on one machine
  firsthit render a.glb --samples-range 512..1024 --checkpoint second.sums -o second.png  on another
  firsthit merge first.sums second.sums -o a.png                                          as if all on one";

const INSPECT_EXAMPLES: &str = "\
Examples:
  firsthit inspect helmet.glb
  firsthit inspect helmet.glb --json | jq .triangles
  firsthit inspect helmet.glb --timing
  firsthit inspect car.obj --only 'wheel*'";

/// Renders models: one command from an OBJ, glTF or scene file to an image.
#[derive(Debug, Parser)]
#[command(name = "firsthit", version, max_term_width = 110, after_help = EXAMPLES, arg_required_else_help = true)]
pub(crate) struct Cli {
    /// What to do.
    #[command(subcommand)]
    pub(crate) command: Command,
}

#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// Render a model to an image.
    Render(Box<RenderArgs>),
    /// Say what is in a model: triangles, materials, cameras, extensions, effects, quality.
    Inspect(InspectArgs),
    /// Answer rays from a file: what they meet first, whether, how often, or everything.
    Query(QueryArgs),
    /// Measure what accuracy costs in time, and check the hard cases.
    Accuracy(AccuracyArgs),
    /// Measure how fast builds and queries are, obvhs's own traversals beside them.
    Bench(BenchArgs),
    /// Say in numbers how pictures differ from a reference.
    Compare(CompareArgs),
    /// Join shares of one picture, rendered anywhere, into one.
    Merge(MergeArgs),
    /// Print a script that completes this program's options in a shell.
    Completions {
        /// The shell.
        shell: clap_complete::Shell,
    },
    /// Print a manual page (roff).
    Man {
        /// The page of one command instead of the program's.
        #[arg(value_parser = ["render", "inspect", "query", "merge", "accuracy", "bench", "compare", "completions", "man"])]
        command: Option<String>,
    },
}

#[derive(Args, Debug)]
#[command(args_override_self = true, after_help = RENDER_EXAMPLES, next_line_help = false)]
pub(crate) struct RenderArgs {
    /// The model or scene: .obj, .ply, .stl, .gltf, .glb, .toml, .json (also with .zst, .gz)
    #[arg(value_name = "MODEL")]
    pub(crate) model: PathBuf,

    #[command(flatten)]
    pub(crate) output: OutputArgs,
    #[command(flatten)]
    pub(crate) quality: QualityArgs,
    #[command(flatten)]
    pub(crate) camera: CameraArgs,
    #[command(flatten)]
    pub(crate) scene: SceneArgs,
    #[command(flatten)]
    pub(crate) load: LoadArgs,
    #[command(flatten)]
    pub(crate) animation: AnimationArgs,
    #[command(flatten)]
    pub(crate) run: RunArgs,
}

#[derive(Args, Debug)]
#[command(next_help_heading = "Image")]
pub(crate) struct OutputArgs {
    /// Where to write: .png, .exr or .hdr; `-` is PNG on standard output [default: the model's name with .png]
    #[arg(short, long, value_name = "FILE")]
    pub(crate) output: Option<PathBuf>,

    /// Width and height in pixels, as 1280x720 or 1280,720 [default: the scene file's, else 1280x720]
    #[arg(long, value_name = "WxH", value_parser = values::resolution)]
    pub(crate) resolution: Option<Resolution>,

    /// Render only this window, in pixels from the upper left; the image has the window's size
    #[arg(long, value_name = "X,Y,W,H", value_parser = values::crop)]
    pub(crate) crop: Option<Crop>,

    /// Brighten a PNG by this many stops, darken it if negative; .exr and .hdr keep the scene's radiance
    #[arg(long, value_name = "EV", default_value = "0", value_parser = values::number, allow_hyphen_values = true)]
    pub(crate) exposure: f64,

    /// How radiance becomes the colours of a PNG: pbr-neutral, agx, srgb or none (linear) [default: pbr-neutral for
    /// light, srgb for albedo and occlusion, none for other values]
    #[arg(long, value_name = "NAME", value_parser = values::tone_mapping)]
    pub(crate) tone_mapping: Option<ViewTransform>,

    /// Bits per channel of a PNG
    #[arg(long, value_name = "8|16", default_value = "8", value_parser = values::bit_depth)]
    pub(crate) bit_depth: u8,

    /// Pictures beside the colour, comma-separated: layers of an .exr, else files NAME.depth.exr and so on
    #[arg(long, value_name = "LIST", value_parser = values::aovs)]
    pub(crate) aov: Option<AovList>,
}

#[derive(Args, Debug)]
#[command(next_help_heading = "Quality")]
pub(crate) struct QualityArgs {
    /// Samples per pixel; with --noise-threshold or --time-limit the most of them [default: with path at most 1024, as
    /// the noise asks for, else 16]
    #[arg(short, long, visible_alias = "samples", value_name = "N",
          value_parser = clap::value_parser!(u32).range(1..))]
    pub(crate) spp: Option<u32>,

    /// Take samples until the estimated noise of each tile of the image is below this; 0.1 is rough, 0.01 clean
    /// [default: 0.03 with path, unless --spp is given]
    #[arg(long, value_name = "E", value_parser = values::positive)]
    pub(crate) noise_threshold: Option<f64>,

    /// Take no more samples after this time, as 30s, 5m or 1h [default: 60s with path, unless --spp or
    /// --noise-threshold is given]
    #[arg(long, value_name = "TIME", value_parser = values::time)]
    pub(crate) time_limit: Option<Duration>,

    /// Keep all that has been summed in this file: more than once a minute, on Ctrl-C, at the time limit and at the end
    #[arg(long, value_name = "FILE")]
    pub(crate) checkpoint: Option<PathBuf>,

    /// Go on with what --checkpoint kept, with the same model and options; more samples may be asked for
    #[arg(long, value_name = "FILE")]
    pub(crate) resume: Option<PathBuf>,

    /// Take only samples A to B-1 of each pixel (A a multiple of 16): a share, for `firsthit merge` of --checkpoint files
    #[arg(long, value_name = "A..B", value_parser = values::samples, conflicts_with_all = ["spp", "noise_threshold"])]
    pub(crate) samples_range: Option<(u32, u32)>,

    /// Where sample points come from: sobol, or independent random numbers for comparison
    #[arg(long, value_name = "NAME", default_value = "sobol", value_parser = values::sampler)]
    pub(crate) sampler: SamplerChoice,

    /// How samples of a pixel weigh by their place: auto, box or blackman-harris
    #[arg(long, value_name = "NAME", default_value = "auto", value_parser = values::filter)]
    pub(crate) filter: FilterChoice,

    /// Most bounces of a path; 1 is direct light [default: the scene file's, else 16]
    #[arg(long, value_name = "N")]
    pub(crate) max_depth: Option<u32>,

    /// Seed of the samples: the same seed gives the same bits, with any number of threads
    #[arg(long, value_name = "N", default_value = "0")]
    pub(crate) seed: u64,

    /// How light is computed: path (as auto), light (paths from the lights), whitted, direct, ao, or the name of an --aov as the picture
    #[arg(long, value_name = "NAME", default_value = "auto", value_parser = values::integrator)]
    pub(crate) integrator: IntegratorChoice,

    /// `auto`: what the scene calls for; `auto,-shadows,+ao` changes that; a plain list replaces it; `none`
    #[arg(long, value_name = "LIST", default_value = "auto", value_parser = values::effects, allow_hyphen_values = true)]
    pub(crate) effects: EffectOverrides,

    /// How carefully rays meet surfaces: fast, robust (no leaks), double or exact
    #[arg(long, value_name = "TIER", default_value = "robust")]
    pub(crate) precision: Precision,

    /// Keep the light that bounces between the facets of rough surfaces; glTF's own formulas lose it
    #[arg(long, value_name = "on|off", default_value = "on", value_parser = values::switch)]
    pub(crate) energy_compensation: Switch,

    /// Start shadow rays of coarse smooth meshes on the curved surface that is meant
    #[arg(long, value_name = "on|off", default_value = "on", value_parser = values::switch)]
    pub(crate) shadow_terminator: Switch,

    /// Textures: trilinear (with smaller copies) or bilinear (the image alone; the samples do the rest)
    #[arg(long, value_name = "NAME", default_value = "trilinear", value_parser = values::texture_filter)]
    pub(crate) texture_filter: TextureFilter,
}

/// From where something is seen.
#[derive(Args, Clone, Debug, Default, PartialEq)]
#[command(next_help_heading = "Camera")]
pub(crate) struct ViewArgs {
    /// A camera of the file by name or by number from 0; `auto` frames the model
    #[arg(long, value_name = "NAME|INDEX|auto", default_value = "auto", value_parser = values::camera)]
    pub(crate) camera: CameraChoice,

    /// Where the camera stands, in world units
    #[arg(long, value_name = "X,Y,Z", value_parser = values::vector, allow_hyphen_values = true)]
    pub(crate) camera_position: Option<DVec3>,

    /// The point it looks at, in world units
    #[arg(long, value_name = "X,Y,Z", value_parser = values::vector, allow_hyphen_values = true)]
    pub(crate) camera_focal_point: Option<DVec3>,

    /// Its upward direction
    #[arg(long, value_name = "X,Y,Z", value_parser = values::direction, allow_hyphen_values = true)]
    pub(crate) camera_view_up: Option<DVec3>,

    /// Its full vertical angle of view, in degrees
    #[arg(long, value_name = "DEG", value_parser = values::view_angle, allow_hyphen_values = true)]
    pub(crate) camera_view_angle: Option<f64>,

    /// Turn it around the focal point, counter-clockwise seen from above
    #[arg(long, value_name = "DEG", default_value = "0", value_parser = values::number, allow_hyphen_values = true)]
    pub(crate) camera_azimuth_angle: f64,

    /// Turn it around the focal point, upwards
    #[arg(long, value_name = "DEG", default_value = "0", value_parser = values::number, allow_hyphen_values = true)]
    pub(crate) camera_elevation_angle: f64,

    /// Above 1: closer
    #[arg(long, value_name = "F", value_parser = values::positive, allow_hyphen_values = true)]
    pub(crate) camera_zoom_factor: Option<f64>,

    /// Parallel projection
    #[arg(long)]
    pub(crate) camera_orthographic: bool,
}

#[derive(Args, Debug)]
#[command(next_help_heading = "Camera")]
pub(crate) struct CameraArgs {
    #[command(flatten)]
    pub(crate) view: ViewArgs,

    /// Diameter of its lens, in world units: what is not in focus is blurred; 0 is a pinhole [default: the scene file's]
    #[arg(long, value_name = "WIDTH", value_parser = values::number)]
    pub(crate) aperture: Option<f64>,

    /// Into how many steps the time is cut while the shutter is open, where something moves
    #[arg(long, value_name = "N", default_value = "16", value_parser = clap::value_parser!(u32).range(1..=4096))]
    pub(crate) motion_steps: u32,

    /// How far away along its line of sight things are sharp, in world units [default: the scene file's, else the focal
    /// point]
    #[arg(long, value_name = "DISTANCE", value_parser = values::positive)]
    pub(crate) focus_distance: Option<f64>,
}

#[derive(Args, Debug)]
#[command(next_help_heading = "Scene")]
pub(crate) struct SceneArgs {
    /// The file's upward axis: +X, -X, +Y, -Y, +Z or -Z [default: what the format says, else +Y]
    #[arg(long, value_name = "AXIS", allow_hyphen_values = true)]
    pub(crate) up: Option<UpAxis>,

    /// A variant of the file's materials, by name or by number from 0 (`inspect` lists them) [default: the file's]
    #[arg(long, value_name = "NAME|INDEX")]
    pub(crate) variant: Option<String>,

    /// A scene of the file, by name or by number from 0 (glTF; `inspect` lists them) [default: the file's]
    #[arg(long, value_name = "NAME|INDEX")]
    pub(crate) scene: Option<String>,

    /// Draw points (glTF's) as balls of this radius, in units of their mesh [default: a 400th of the extent of all of
    /// them, if there are at most 10,000]
    #[arg(long, value_name = "RADIUS", value_parser = values::positive)]
    pub(crate) points: Option<f64>,

    /// Draw lines (glTF's) as rods of this radius, in units of their mesh [default: as for points]
    #[arg(long, value_name = "RADIUS", value_parser = values::positive)]
    pub(crate) lines: Option<f64>,

    /// Light from around: an image by longitude and latitude (.hdr, .exr), or studio, white, black
    /// [default: the scene's, else the studio where there is no light]
    #[arg(long, value_name = "FILE|studio|white|black", value_parser = values::hdri)]
    pub(crate) hdri: Option<Hdri>,

    /// Turn it counter-clockwise, seen from +Y
    #[arg(long, value_name = "DEG", default_value = "0", value_parser = values::number, allow_hyphen_values = true)]
    pub(crate) hdri_rotation: f64,

    /// One colour behind the model: sRGB from 0 to 1, or #rrggbb; a PNG shows exactly it
    #[arg(long, value_name = "R,G,B", value_parser = values::color, overrides_with = "no_background")]
    pub(crate) background_color: Option<Color>,

    /// Transparent where there is no surface
    #[arg(long, overrides_with = "background_color")]
    pub(crate) no_background: bool,

    /// Show only what lies inside this box, in world units
    #[arg(long, value_name = "X0,Y0,Z0,X1,Y1,Z1", value_parser = values::clip_box, allow_hyphen_values = true)]
    pub(crate) clip_box: Option<(DVec3, DVec3)>,

    /// Show only where NX x + NY y + NZ z <= D, in world units; may be given several times
    #[arg(long, value_name = "NX,NY,NZ,D", value_parser = values::plane, allow_hyphen_values = true, action = clap::ArgAction::Append)]
    pub(crate) clip_plane: Vec<Plane>,
}

/// Without any of these nothing is played: everything is where the file has it.
#[derive(Args, Debug)]
#[command(next_help_heading = "Animation (glTF)")]
pub(crate) struct AnimationArgs {
    /// Which animation is played: by name, by number from 0 (`inspect` lists them), or all at once [default: the first]
    #[arg(long, value_name = "NAME|INDEX|all", value_parser = values::animation)]
    pub(crate) animation: Option<AnimationChoice>,

    /// The moment to show, as 1.25s, 1.25 or 40ms; before its first key and after its last an animation stands still
    #[arg(long, value_name = "TIME", value_parser = values::moment, allow_hyphen_values = true)]
    pub(crate) animation_time: Option<f64>,

    /// The moment of this frame: its number / --fps
    #[arg(long, value_name = "N", conflicts_with = "animation_time")]
    pub(crate) frame: Option<u32>,

    /// Render frames A to B-1, each to a file of its own: -o NAME_%04d.png
    #[arg(long, value_name = "A..B", value_parser = values::frames,
          conflicts_with_all = ["animation_time", "frame", "checkpoint", "resume", "samples_range"])]
    pub(crate) frames: Option<(u32, u32)>,

    /// Frames in a second
    #[arg(long, value_name = "F", default_value = "24", value_parser = values::positive)]
    pub(crate) fps: f64,

    /// Render no frame whose file is there
    #[arg(long, requires = "frames")]
    pub(crate) skip_existing: bool,

    /// For how long the shutter is open from that moment on, as 20ms: what moves meanwhile, vertices and cameras too, is
    /// blurred (see --motion-steps); lights are not
    #[arg(long, value_name = "TIME", value_parser = values::time)]
    pub(crate) shutter: Option<Duration>,
}

impl AnimationArgs {
    /// The moment that is asked for; that of the first frame.
    pub(crate) fn play(&self) -> Option<Play> {
        let first = self.frames.map(|(first, _)| first).or(self.frame);
        let asked = first.is_some() || self.animation_time.is_some();
        (asked || self.animation.is_some() || self.shutter.is_some()).then(|| Play {
            animation: self.animation.clone().unwrap_or_default(),
            time: self.animation_time.unwrap_or_else(|| self.time_of(first.unwrap_or(0))),
            shutter: self.shutter.map_or(0.0, |s| s.as_secs_f64()),
        })
    }

    /// When a frame is.
    pub(crate) fn time_of(&self, frame: u32) -> f64 {
        f64::from(frame) / self.fps
    }
}

#[derive(Args, Debug)]
#[command(next_help_heading = "Program")]
pub(crate) struct RunArgs {
    /// Threads to render with [default: one per core]
    #[arg(short, long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub(crate) threads: Option<u16>,

    /// Read options from this file [default: firsthit.toml in the current folder, if there]
    #[arg(long, value_name = "FILE", overrides_with = "no_config")]
    pub(crate) config: Option<PathBuf>,

    /// Read no configuration file
    #[arg(long, overrides_with = "config")]
    pub(crate) no_config: bool,

    /// Take every warning about the model as an error
    #[arg(long)]
    pub(crate) strict: bool,

    /// Say what was chosen and why, and what each effect cost; `ablate`: also how much the image changes without each,
    /// from small renders
    #[arg(long, value_name = "WHAT", num_args = 0..=1, require_equals = true, default_value = "nothing",
          default_missing_value = "costs", value_parser = values::explain, hide_default_value = true)]
    pub(crate) explain: Explain,

    /// Print a report of the render as JSON on standard output
    #[arg(long)]
    pub(crate) json: bool,

    /// Show progress, also where standard error is no terminal
    #[arg(long, overrides_with = "no_progress")]
    pub(crate) progress: bool,

    /// Show no progress
    #[arg(long, overrides_with = "progress")]
    pub(crate) no_progress: bool,

    /// Print errors only
    #[arg(short, long, overrides_with = "verbose")]
    pub(crate) quiet: bool,

    /// Print all warnings and what is being done
    #[arg(short, long, overrides_with = "quiet")]
    pub(crate) verbose: bool,
}

#[derive(Args, Debug)]
#[command(args_override_self = true, after_help = MERGE_EXAMPLES)]
pub(crate) struct MergeArgs {
    /// The checkpoints of the shares, in any order
    #[arg(value_name = "SHARE", required = true)]
    pub(crate) shares: Vec<PathBuf>,

    /// Where to write: .png, .exr or .hdr
    #[arg(short, long, value_name = "FILE")]
    pub(crate) output: PathBuf,

    /// Keep the sums in this file too
    #[arg(long, value_name = "FILE")]
    pub(crate) checkpoint: Option<PathBuf>,

    /// Brighten a PNG by this many stops, darken it if negative
    #[arg(long, value_name = "EV", default_value = "0", value_parser = values::number, allow_hyphen_values = true)]
    pub(crate) exposure: f64,

    /// How radiance becomes the colours of a PNG: pbr-neutral, agx, srgb or none (linear); shares of occlusion or albedo
    /// want srgb, those of other values none, as `render` chooses by itself
    #[arg(long, value_name = "NAME", default_value = "pbr-neutral", value_parser = values::tone_mapping)]
    pub(crate) tone_mapping: ViewTransform,

    /// Bits per channel of a PNG
    #[arg(long, value_name = "8|16", default_value = "8", value_parser = values::bit_depth)]
    pub(crate) bit_depth: u8,

    /// One colour behind the model in a PNG, where the shares are transparent (as they are with the same option of
    /// `render`): sRGB from 0 to 1, or #rrggbb
    #[arg(long, value_name = "R,G,B", value_parser = values::color)]
    pub(crate) background_color: Option<Color>,
}

#[derive(Args, Debug)]
#[command(args_override_self = true, after_help = INSPECT_EXAMPLES)]
pub(crate) struct InspectArgs {
    /// The model or scene: .obj, .ply, .stl, .gltf, .glb, .toml, .json (also with .zst, .gz)
    #[arg(value_name = "MODEL")]
    pub(crate) model: PathBuf,

    /// Print JSON
    #[arg(long)]
    pub(crate) json: bool,

    /// The file's upward axis: +X, -X, +Y, -Y, +Z or -Z [default: what the format says, else +Y]
    #[arg(long, value_name = "AXIS", allow_hyphen_values = true)]
    pub(crate) up: Option<UpAxis>,

    /// The tier of precision that the trees are built for: fast, robust, double or exact
    #[arg(long, value_name = "TIER", default_value = "robust")]
    pub(crate) precision: Precision,

    /// Take every warning about the model as an error
    #[arg(long)]
    pub(crate) strict: bool,

    /// Say how long each stage of loading took, and the whole compared to decoding its images alone; images that no ray
    /// sees are left out
    #[arg(long)]
    pub(crate) timing: bool,

    #[command(flatten)]
    pub(crate) load: LoadArgs,
}
