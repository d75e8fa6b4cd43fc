//! `firsthit merge`: shares of a picture into one.

use std::fs::File;
use std::io::BufReader;
use std::path::{Path, PathBuf};

use firsthit_render::output::{BitDepth, WriteOptions, write_checkpoint, write_film};
use firsthit_render::{Checkpoint, CheckpointReader, View, ViewTransform};

use crate::args::MergeArgs;
use crate::error::Failure;
use crate::target::{Target, writable};

/// A checkpoint in a file.
type Share = CheckpointReader<BufReader<File>>;

/// Opens a checkpoint: only the words about its picture are read.
pub(crate) fn open(path: &Path) -> Result<Share, Failure> {
    let file = File::open(path).map_err(|e| at(path, &e))?;
    CheckpointReader::new(BufReader::new(file)).map_err(|e| at(path, &e))
}

/// Reads the rest of it.
pub(crate) fn read(share: Share, path: &Path) -> Result<Checkpoint, Failure> {
    share.read().map_err(|e| at(path, &e))
}

fn at(path: &Path, error: &dyn std::fmt::Display) -> Failure {
    Failure::failed(format_args!("{}: {error}", path.display()))
}

/// Joins the shares and writes the picture.
pub(crate) fn run(args: &MergeArgs) -> Result<(), Failure> {
    let target = Target::new(Some(&args.output), &args.output)?;
    if target == Target::Stdout {
        return Err(Failure::usage("merge writes to a file").hint("-o FILE"));
    }
    if let Some(path) = &args.checkpoint {
        writable(path)?;
    }
    let mut shares = Vec::new();
    for path in &args.shares {
        shares.push((open(path)?, path));
    }
    // All are looked at before any film, which may be large, is read.
    shares.sort_by_key(|(share, _)| share.first_sample());
    let mut shares = shares.into_iter();
    let Some((share, first)) = shares.next() else {
        return Err(Failure::usage("there are no shares to merge"));
    };
    let picture = share.picture().to_owned();
    if let Some((_, path)) = shares.as_slice().iter().find(|(other, _)| other.picture() != picture) {
        let words = format_args!("{}: it is of another picture than {}", path.display(), first.display());
        return Err(Failure::failed(words).hint("shares have the same model and options but --samples-range"));
    }
    let mut all = read(share, first)?;
    let read_too = || args.shares.iter().map(PathBuf::as_path);
    let aovs = all.film.aovs().to_vec();
    target.spare(&aovs, read_too())?;
    if let Some(path) = &args.checkpoint {
        target.spare_from(path, &aovs, read_too())?;
    }
    for (share, path) in shares {
        all.join(&read(share, path)?).map_err(|e| at(path, &e))?;
    }
    let backdrop = args.background_color.map(|color| match args.tone_mapping {
        ViewTransform::None => color.linear(),
        _ => color.0,
    });
    let view = View { transform: args.tone_mapping, exposure: args.exposure as f32, backdrop };
    let bit_depth = if args.bit_depth == 16 { BitDepth::Sixteen } else { BitDepth::Eight };
    write_film(&args.output, &all.film, &WriteOptions { view, bit_depth }).map_err(Failure::failed)?;
    if let Some(path) = &args.checkpoint {
        write_checkpoint(path, &all.sums(), &picture).map_err(Failure::failed)?;
    }
    Ok(())
}
