//! The configuration file: options of `render` by their long names, put before those of the command line.
//!
//! Its entries become arguments, so that they are parsed, checked and explained by the same definitions, and a later
//! (typed) option overrides an earlier one.

use std::ffi::OsString;
use std::fs::File;
use std::io::{self, Read};
use std::path::{Path, PathBuf};

use clap::parser::ValueSource;
use clap::{Arg, ArgAction, CommandFactory, Parser};
use toml::{Table, Value};

use crate::args::{Cli, Command};
use crate::error::Failure;

/// Read where `--config` names no other file.
const IMPLICIT: &str = "firsthit.toml";

/// The largest file that is read.
const MOST_BYTES: u64 = 1 << 20;

/// Options that say where options come from.
const NO_KEYS: [&str; 3] = ["config", "no-config", "help"];

/// Why there is no command line to follow.
#[derive(Debug)]
pub(crate) enum Stop {
    /// Wrong usage; or `--help` or `--version`, which clap prints.
    Clap(clap::Error),
    /// The configuration file is at fault.
    Failure(Failure),
}

/// Parses the command line, with the configuration file's options before its own. Also returns that file.
pub(crate) fn parse(argv: &[OsString]) -> Result<(Cli, Option<PathBuf>), Stop> {
    let typed = Cli::try_parse_from(argv).map_err(Stop::Clap)?;
    let Command::Render(args) = &typed.command else { return Ok((typed, None)) };
    let path = match &args.run.config {
        Some(path) => path.clone(),
        None if !args.run.no_config && Path::new(IMPLICIT).is_file() => IMPLICIT.into(),
        None => return Ok((typed, None)),
    };
    let text = read(&path).map_err(|e| Stop::Failure(Failure::failed(format_args!("{}: {e}", path.display()))))?;
    let configured = arguments(&text, argv).map_err(|cause| {
        let failure = Failure::usage(format_args!("{}: {cause}", path.display()));
        Stop::Failure(
            failure.hint("--no-config goes without the configuration file; `firsthit render --help` lists the options"),
        )
    })?;
    // `render` is the second word: the program has no options before its commands.
    let (head, tail) = argv.split_at(2);
    let merged = head.iter().chain(&configured).chain(tail);
    let cli = Cli::try_parse_from(merged).map_err(Stop::Clap)?;
    Ok((cli, Some(path)))
}

/// The text of the file. What has no end, or none in sight, is refused.
fn read(path: &Path) -> io::Result<String> {
    let refused = |cause: &str| Err(io::Error::new(io::ErrorKind::InvalidInput, cause));
    // Asked before it is opened: opening a pipe waits for a writer.
    if !std::fs::metadata(path)?.is_file() {
        return refused("this is no regular file");
    }
    let mut text = String::new();
    File::open(path)?.take(MOST_BYTES + 1).read_to_string(&mut text)?;
    if text.len() as u64 > MOST_BYTES { refused("a configuration file has at most 1 MiB") } else { Ok(text) }
}

/// The file's entries as arguments, but for those that add to a list which the command line begins anew, and those that
/// what was typed excludes.
fn arguments(text: &str, argv: &[OsString]) -> Result<Vec<OsString>, String> {
    let table: Table = text.parse().map_err(|e: toml::de::Error| e.to_string().trim_end().to_owned())?;
    let mut program = Cli::command();
    program.build();
    let typed = program.clone().try_get_matches_from(argv).ok();
    let typed = typed.as_ref().and_then(|m| m.subcommand_matches("render"));
    let Some(render) = program.find_subcommand("render") else { return Err("no render command".into()) };

    let mut out = Vec::new();
    for (key, value) in &table {
        let option = |name: &str| render.get_arguments().find(|a| has_long(a, name));
        let arg = option(key).filter(|_| !NO_KEYS.contains(&key.as_str()));
        let Some(arg) = arg else {
            let hyphened = key.replace('_', "-");
            let hint = if hyphened != *key && option(&hyphened).is_some() {
                format!(" (it is '{hyphened}')")
            } else {
                String::new()
            };
            return Err(format!("unknown option '{key}'{hint}"));
        };
        let words = words(arg, key, value, |name| option(name).is_some()).map_err(|e| format!("{key}: {e}"))?;
        check(&words).map_err(|e| format!("{key}: {e}"))?;
        let list = matches!(arg.get_action(), ArgAction::Append);
        let is_typed =
            |a: &Arg| typed.is_some_and(|m| m.value_source(a.get_id().as_str()) == Some(ValueSource::CommandLine));
        let excludes = |a: &Arg, b: &Arg| render.get_arg_conflicts_with(a).iter().any(|c| c.get_id() == b.get_id());
        let excluded = render.get_arguments().any(|a| (excludes(a, arg) || excludes(arg, a)) && is_typed(a));
        if !(excluded || list && is_typed(arg)) {
            out.extend(words.into_iter().map(OsString::from));
        }
    }
    Ok(out)
}

fn has_long(arg: &Arg, name: &str) -> bool {
    arg.get_long() == Some(name) || arg.get_all_aliases().is_some_and(|all| all.contains(&name))
}

/// One entry as words of a command line.
fn words(arg: &Arg, key: &str, value: &Value, exists: impl Fn(&str) -> bool) -> Result<Vec<String>, String> {
    // A value that may be left out is one more thing than on and off.
    let optional = arg.get_num_args().is_some_and(|n| n.min_values() == 0) && value.is_bool();
    if optional || !arg.get_action().takes_values() {
        let Value::Boolean(on) = value else { return Err("expected true or false".into()) };
        let opposite = format!("no-{key}");
        return Ok(match on {
            true => vec![format!("--{key}")],
            false if exists(&opposite) => vec![format!("--{opposite}")],
            false => Vec::new(),
        });
    }
    let several = matches!(arg.get_action(), ArgAction::Append);
    match value {
        Value::Array(items) if several && !items.iter().all(is_number) => {
            items.iter().map(|item| Ok(format!("--{key}={}", scalar_or_list(item)?))).collect()
        }
        value => Ok(vec![format!("--{key}={}", scalar_or_list(value)?)]),
    }
}

fn is_number(value: &Value) -> bool {
    value.is_integer() || value.is_float()
}

fn scalar_or_list(value: &Value) -> Result<String, String> {
    match value {
        Value::String(s) => Ok(s.clone()),
        Value::Integer(i) => Ok(i.to_string()),
        Value::Float(x) => Ok(x.to_string()),
        Value::Array(items) => Ok(items.iter().map(scalar_or_list).collect::<Result<Vec<_>, _>>()?.join(",")),
        Value::Boolean(_) | Value::Datetime(_) | Value::Table(_) => {
            Err("expected a text, a number or a list of them".into())
        }
    }
}

/// Parses an entry alone, so that the error names it.
fn check(words: &[String]) -> Result<(), String> {
    let line = ["firsthit", "render"].into_iter().chain(words.iter().map(String::as_str)).chain(["--", "MODEL"]);
    Cli::try_parse_from(line).map(|_| ()).map_err(|e| {
        let text = e.to_string();
        let first = text.lines().next().unwrap_or_default();
        first.strip_prefix("error: ").unwrap_or(first).to_owned()
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::args::RenderArgs;

    /// The command line `firsthit render m.obj TYPED` with this file.
    fn with(text: &str, typed: &[&str]) -> Result<RenderArgs, String> {
        let argv: Vec<OsString> = ["firsthit", "render", "m.obj"].iter().chain(typed).map(OsString::from).collect();
        let configured = arguments(text, &argv)?;
        let merged = argv[..2].iter().chain(&configured).chain(&argv[2..]);
        match Cli::try_parse_from(merged).map_err(|e| e.to_string())?.command {
            Command::Render(args) => Ok(*args),
            other => Err(format!("{other:?}")),
        }
    }

    #[test]
    fn every_kind_of_option_may_be_set() {
        let text = r#"
            spp = 4
            resolution = "64x32"
            crop = [1, 2, 3, 4]
            exposure = -0.5
            camera-position = [-1, 2.5, 3]
            aov = ["depth", "normal"]
            effects = "auto,-shadows"
            no-background = true
            json = false
            progress = false
            clip-plane = [[1, 0, 0, 5], "0,-1,0,2"]
        "#;
        let args = with(text, &[]).unwrap();
        assert_eq!(args.quality.spp, Some(4));
        assert_eq!(args.output.resolution.map(|r| (r.width, r.height)), Some((64, 32)));
        assert_eq!(args.output.crop.map(|c| c.height), Some(4));
        assert_eq!(args.output.exposure, -0.5);
        assert_eq!(args.camera.view.camera_position.map(|p| p.x), Some(-1.0));
        assert_eq!(args.output.aov.as_ref().map(|a| a.0.len()), Some(2));
        assert!(args.scene.no_background && !args.run.json && args.run.no_progress && !args.run.progress);
        assert_eq!(args.scene.clip_plane.len(), 2);
        assert_eq!(args.scene.clip_plane[1].normal.y, -1.0);
    }

    #[test]
    fn the_command_line_wins() {
        let text = "samples = 4\nno-background = true\nclip-plane = [1, 0, 0, 5]\nquiet = true\nconfig-less = 1";
        assert!(with(text, &[]).unwrap_err().contains("unknown option 'config-less'"));
        let text = text.replace("config-less = 1", "progress = true");
        let typed = ["-s", "9", "--background-color", "1,1,1", "--clip-plane", "0,1,0,1", "-v", "--no-progress"];
        let args = with(&text, &typed).unwrap();
        assert_eq!(args.quality.spp, Some(9));
        assert!(args.scene.background_color.is_some() && !args.scene.no_background);
        assert_eq!(args.scene.clip_plane.iter().map(|p| p.normal.y).collect::<Vec<_>>(), [1.0]);
        assert!(args.run.verbose && !args.run.quiet);
        assert!(args.run.no_progress && !args.run.progress);
    }

    #[test]
    fn what_is_typed_drives_out_what_it_excludes() {
        let args = with("spp = 4\nnoise-threshold = 0.1", &["--samples-range", "16..32"]).unwrap();
        assert_eq!((args.quality.samples_range, args.quality.spp), (Some((16, 32)), None));
        let args = with("samples-range = \"16..32\"", &["-s", "9"]).unwrap();
        assert_eq!((args.quality.samples_range, args.quality.spp), (None, Some(9)));
    }

    #[test]
    fn a_wrong_entry_is_named() {
        for (text, expected) in [
            ("spp = 0", "spp: invalid value '0'"),
            ("spp = \"many\"", "spp: invalid value 'many'"),
            ("camera_position = [1,2,3]", "(it is 'camera-position')"),
            ("config = \"other.toml\"", "unknown option 'config'"),
            ("model = \"a.obj\"", "unknown option 'model'"),
            ("json = 1", "json: expected true or false"),
            ("spp = true", "spp: expected a text"),
            ("[camera]\nposition = 1", "camera: expected a text"),
            ("spp = ", "TOML parse error"),
        ] {
            let error = with(text, &[]).unwrap_err();
            assert!(error.contains(expected), "{text}: {error}");
        }
    }

    #[test]
    fn repeated_options_of_the_command_line_are_kept_or_overridden() {
        let args = with("", &["-s", "1", "-s", "2", "--clip-plane=1,0,0,0", "--clip-plane=-1,0,0,0"]).unwrap();
        assert_eq!((args.quality.spp, args.scene.clip_plane.len()), (Some(2), 2));
    }
}
