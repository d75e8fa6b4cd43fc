//! `firsthit compare REFERENCE IMAGE...`: how pictures differ from a reference.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use clap::Args;
use firsthit_measure::picture::{self, Comparison, PIXELS_PER_DEGREE};
use firsthit_render::film::Picture;
use firsthit_render::output::{self, Format};
use firsthit_render::{View, ViewTransform};
use serde::Serialize;

use crate::console::{Console, print, print_json, visible};
use crate::error::Failure;
use crate::measured::check_target;

const EXAMPLES: &str = "\
Examples:
  firsthit compare reference.exr mine.exr
  firsthit compare reference.exr a.exr b.exr c.npy --json
  firsthit compare before.png after.png --heatmap difference.png

What the columns say (over all pixels and red, green and blue; x the image, r the reference):
  mse         mean of (x - r)^2, linear radiance
  relMSE      mean of (x - r)^2 / (r^2 + 0.01)
  trimmed     the same without the worst 0.1 % of the pixels
  mean ratio  mean of the image over mean of the reference
  PSNR, FLIP  of what a display shows: clipped to 1, with the sRGB curve
  worst block the block of 8 x 8 pixels whose mean is off most: where, and by what share

Exit codes: 0 compared, 1 a file cannot be read or the sizes differ, 2 wrong usage.";

#[derive(Args, Debug)]
#[command(args_override_self = true, after_help = EXAMPLES)]
pub(crate) struct CompareArgs {
    /// What is right: .exr, .hdr and .npy hold radiance, .png is taken as sRGB
    #[arg(value_name = "REFERENCE")]
    reference: PathBuf,

    /// What is compared with it, of the same size
    #[arg(value_name = "IMAGE", required = true)]
    images: Vec<PathBuf>,

    /// Print JSON
    #[arg(long)]
    json: bool,

    /// Write a PNG of where the image differs: its FLIP, black 0, pale yellow 1
    #[arg(long, value_name = "FILE")]
    heatmap: Option<PathBuf>,

    /// Print results and errors only
    #[arg(short, long)]
    quiet: bool,
}

/// The answer as JSON.
#[derive(Serialize)]
struct Report {
    reference: String,
    width: u32,
    height: u32,
    images: Vec<Row>,
}

#[derive(Serialize)]
struct Row {
    image: String,
    #[serde(flatten)]
    comparison: Comparison,
}

/// Compares the pictures of the arguments.
pub(crate) fn run(args: &CompareArgs) -> Result<(), Failure> {
    if let Some(file) = &args.heatmap {
        if args.images.len() > 1 {
            return Err(Failure::usage("--heatmap: shows one image; name only one"));
        }
        if !matches!(Format::from_path(file), Ok(Format::Png)) {
            return Err(Failure::usage(format_args!("--heatmap: {}: must be a .png", file.display())));
        }
        let read: Vec<PathBuf> = args.images.iter().chain([&args.reference]).cloned().collect();
        check_target(file, &read)?;
    }
    let reference = picture::read(&args.reference)?;
    let mut images = Vec::new();
    for path in &args.images {
        let image = picture::read(path)?;
        let comparison = picture::compare(&reference, &image).map_err(|e| at(path, &e))?;
        images.push(Row { image: path.display().to_string(), comparison });
        if let Some(file) = &args.heatmap {
            heatmap(file, &reference, &image).map_err(|e| at(path, &e))?;
            Console::new(args.quiet, false).say(format_args!("wrote {}", file.display()));
        }
    }
    let report = Report {
        reference: args.reference.display().to_string(),
        width: reference.width,
        height: reference.height,
        images,
    };
    if args.json { print_json(&report) } else { print(table(&report.images).as_bytes()) }
}

fn at(path: &Path, error: &dyn std::fmt::Display) -> Failure {
    Failure::failed(format_args!("{}: {error}", path.display()))
}

fn heatmap(file: &Path, reference: &Picture, image: &Picture) -> Result<(), Box<dyn std::error::Error>> {
    let view = View { transform: ViewTransform::Srgb, ..View::default() };
    let map = picture::flip_map(reference, image, &view, PIXELS_PER_DEGREE)?;
    output::write_picture(file, &picture::heat(reference.width, &map), &view)?;
    Ok(())
}

fn table(rows: &[Row]) -> String {
    let mut out = String::new();
    let _ = writeln!(
        out,
        "{:>10} {:>10} {:>10} {:>10} {:>7} {:>8}  {:24} image",
        "mse", "relMSE", "trimmed", "mean ratio", "PSNR", "FLIP", "worst block"
    );
    for Row { image, comparison: c } in rows {
        let b = &c.worst_block;
        let block = format!("{},{}: {:.2} %", b.x, b.y, 100.0 * b.difference);
        let _ = writeln!(
            out,
            "{:10.3e} {:10.3e} {:10.3e} {:10.5} {:7.2} {:8.5}  {block:24} {}",
            c.mse,
            c.rel_mse,
            c.trimmed_rel_mse,
            c.mean_ratio,
            c.psnr,
            c.flip,
            visible(image)
        );
        if c.not_finite > 0 {
            let _ = writeln!(out, "  {} pixels are not finite and count nowhere else", c.not_finite);
        }
    }
    out
}
