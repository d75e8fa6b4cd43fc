//! What is read of a model, and how far it is trusted: options of `render`, `inspect` and `query`.

use clap::Args;
use firsthit_import::{Limits, Options};

use crate::values;

#[derive(Args, Clone, Debug, Default)]
#[command(next_help_heading = "Loading")]
pub(crate) struct LoadArgs {
    /// Read only what is called so: objects and groups (OBJ), nodes with all below them and meshes (glTF), objects of
    /// scene files; `*` stands for any characters; may be given several times
    #[arg(long, value_name = "NAME", action = clap::ArgAction::Append)]
    pub(crate) only: Vec<String>,

    /// The most that the files may unpack to and the scene may hold, as 500MB or 2GiB [default: 256 MiB and 64 bytes
    /// for each byte of the files]
    #[arg(long, value_name = "SIZE", value_parser = values::size)]
    pub(crate) limit_memory: Option<u64>,

    /// Read files outside the model's folder too, if the model names them
    #[arg(long)]
    pub(crate) allow_outside: bool,
}

impl LoadArgs {
    /// What a reader is told by them.
    pub(crate) fn options(&self) -> Options {
        let limits = Limits { memory: self.limit_memory, allow_outside: self.allow_outside, ..Limits::default() };
        Options { only: self.only.clone(), limits, ..Options::default() }
    }
}
