//! `firsthit merge`: shares of a picture into one.

use std::fs::File;
use std::io::BufReader;
use std::path::Path;

use firsthit_render::output::{BitDepth, WriteOptions, write_checkpoint, write_film};
use firsthit_render::{Checkpoint, View};

use crate::args::MergeArgs;
use crate::error::Failure;

/// Reads a checkpoint with the words about its picture.
pub(crate) fn read(path: &Path) -> Result<(Checkpoint, String), Failure> {
    let at = |e: &dyn std::fmt::Display| Failure::failed(format_args!("{}: {e}", path.display()));
    let file = File::open(path).map_err(|e| at(&e))?;
    Checkpoint::read(&mut BufReader::new(file)).map_err(|e| at(&e))
}

/// Joins the shares and writes the picture.
pub(crate) fn run(args: &MergeArgs) -> Result<(), Failure> {
    let mut shares = Vec::new();
    for path in &args.shares {
        let (share, picture) = read(path)?;
        shares.push((share, picture, path));
    }
    shares.sort_by_key(|(share, ..)| share.samples().start);
    let mut shares = shares.into_iter();
    let Some((mut all, picture, first)) = shares.next() else {
        return Err(Failure::usage("there are no shares to merge"));
    };
    for (share, other, path) in shares {
        if other != picture {
            let words = format_args!("{}: it is of another picture than {}", path.display(), first.display());
            return Err(Failure::failed(words).hint("shares have the same model and options but --samples-range"));
        }
        all.join(&share).map_err(|e| Failure::failed(format_args!("{}: {e}", path.display())))?;
    }
    let view = View { transform: args.tone_mapping, exposure: args.exposure as f32, backdrop: None };
    write_film(&args.output, &all.film, &WriteOptions { view, bit_depth: BitDepth::Eight }).map_err(Failure::failed)?;
    if let Some(path) = &args.checkpoint {
        write_checkpoint(path, &all.sums(), &picture).map_err(Failure::failed)?;
    }
    Ok(())
}
