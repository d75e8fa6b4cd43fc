//! The `firsthit` program: from a model to an image with one command.
#![forbid(unsafe_code)]

mod accuracy;
mod args;
mod bench;
mod compare;
mod config;
mod console;
mod error;
mod hdri;
mod inspect;
mod interrupt;
mod load;
mod measured;
mod merge;
mod progress;
mod query;
mod render;
mod report;
mod sequence;
mod shot;
mod simd;
mod target;
mod values;

use std::ffi::OsString;
use std::process::ExitCode;

use clap::CommandFactory;
use clap::error::{ContextKind, ContextValue, ErrorKind};

use crate::args::{Cli, Command};
use crate::config::Stop;
use crate::error::{Exit, Failure};

fn main() -> ExitCode {
    let argv: Vec<OsString> = std::env::args_os().collect();
    let exit = match config::parse(&argv) {
        Ok((cli, config)) => run(cli.command, config.as_deref()).unwrap_or_else(|failure| fail(&failure)),
        Err(Stop::Failure(failure)) => fail(&failure),
        Err(Stop::Clap(error)) => explain_usage(&error),
    };
    exit.into()
}

fn run(command: Command, config: Option<&std::path::Path>) -> Result<Exit, Failure> {
    match command {
        Command::Render(args) => render::run(&args, config),
        Command::Inspect(args) => inspect::run(&args).map(|()| Exit::Done),
        Command::Query(args) => query::run(&args),
        Command::Accuracy(args) => accuracy::run(&args),
        Command::Bench(args) => bench::run(&args),
        Command::Compare(args) => compare::run(&args).map(|()| Exit::Done),
        Command::Merge(args) => merge::run(&args).map(|()| Exit::Done),
        Command::Completions { shell } => {
            let mut script = Vec::new();
            clap_complete::generate(shell, &mut Cli::command(), "firsthit", &mut script);
            console::print(&script).map(|()| Exit::Done)
        }
        Command::Man { command } => {
            let mut page = Vec::new();
            clap_mangen::Man::new(manual(command.as_deref()))
                .source(concat!("firsthit ", env!("CARGO_PKG_VERSION")))
                .render(&mut page)
                .map_err(|e| Failure::failed(format_args!("manual page: {e}")))?;
            console::print(&page).map(|()| Exit::Done)
        }
    }
}

/// The command that a manual page is about.
fn manual(name: Option<&str>) -> clap::Command {
    let mut program = Cli::command();
    program.build();
    name.and_then(|name| program.find_subcommand(name)).unwrap_or(&program).clone()
}

fn fail(failure: &Failure) -> Exit {
    console::message(failure);
    failure.exit
}

/// Prints clap's answer: help and version to standard output, mistakes to standard error.
fn explain_usage(error: &clap::Error) -> Exit {
    // A reader that has seen enough of the help is no error.
    let _ = error.print();
    if error.kind() == ErrorKind::InvalidSubcommand
        && let Some(ContextValue::String(word)) = error.get(ContextKind::InvalidSubcommand)
        && (word.contains('.') || std::path::Path::new(word).exists())
    {
        console::message(format_args!("\n hint: to render a model: firsthit render {word}"));
    }
    if error.use_stderr() { Exit::Usage } else { Exit::Done }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_definitions_are_consistent() {
        Cli::command().debug_assert();
    }

    #[test]
    fn every_option_is_documented() {
        let mut program = Cli::command();
        program.build();
        for command in std::iter::once(&program).chain(program.get_subcommands()) {
            for arg in command.get_arguments() {
                assert!(arg.get_help().is_some(), "{} {}", command.get_name(), arg.get_id());
            }
        }
    }
}
