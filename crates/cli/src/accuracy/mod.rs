//! `firsthit accuracy`: what accuracy costs in time, and whether the hard cases are answered right.

mod args;
mod corpus;
mod csv;
mod measure;
mod scenarios;
mod table;

pub(crate) use args::AccuracyArgs;

use crate::error::{Exit, Failure};

/// Measures or checks what the arguments ask for.
pub(crate) fn run(args: &AccuracyArgs) -> Result<Exit, Failure> {
    match &args.corpus {
        Some(folder) => corpus::run(args, folder),
        None if args.scenarios => scenarios::run(args),
        None => measure::run(args),
    }
}
