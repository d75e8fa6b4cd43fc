//! `firsthit accuracy`: what accuracy costs in time, and whether the hard cases are answered right.

mod args;
mod corpus;

pub(crate) use args::AccuracyArgs;

use crate::error::{Exit, Failure};

/// Measures or checks what the arguments ask for.
pub(crate) fn run(args: &AccuracyArgs) -> Result<Exit, Failure> {
    match &args.corpus {
        Some(folder) => corpus::run(args, folder),
        None => Ok(Exit::Done),
    }
}
