//! What `accuracy` and `bench` share: the models that are measured, and the files that are written.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use firsthit_import::{Imported, UpAxis};
use firsthit_measure::{Subject, result::Machine};
use firsthit_render::output;

use crate::console::{Console, visible};
use crate::error::Failure;

/// Reads models; one without triangles is refused.
pub(crate) fn subjects(models: &[PathBuf], up: Option<UpAxis>, console: Console) -> Result<Vec<Subject>, Failure> {
    let read = |path: &PathBuf| {
        let options = firsthit_import::Options { up, ..Default::default() };
        let Imported { scene, report } = firsthit_import::open(path, &options)?;
        console.warnings(&report, false)?;
        let subject = Subject::new(name(path, models), scene);
        if subject.triangles() == 0 {
            let failure = Failure::failed(format_args!("{}: there is no triangle to aim at", path.display()));
            return Err(failure.hint("analytic shapes are measured beside any model: firsthit accuracy --builtin"));
        }
        Ok(subject)
    };
    models.iter().map(read).collect()
}

/// The file's name; the whole path where two models have the same.
pub(crate) fn name(path: &Path, all: &[PathBuf]) -> String {
    let same = all.iter().filter(|other| other.file_name() == path.file_name()).count();
    match path.file_name() {
        Some(name) if same < 2 => name.to_string_lossy().into_owned(),
        _ => path.display().to_string(),
    }
}

/// Refuses in time what cannot be written, and what would replace a model.
pub(crate) fn check_target(file: &Path, models: &[PathBuf]) -> Result<(), Failure> {
    let folder = file.parent().filter(|p| !p.as_os_str().is_empty());
    if let Some(folder) = folder.filter(|f| !f.is_dir()) {
        let failure = Failure::failed(format_args!("{}: there is no folder {}", file.display(), folder.display()));
        return Err(failure.hint(format_args!("mkdir -p {}", folder.display())));
    }
    if file.is_dir() {
        return Err(Failure::failed(format_args!("{}: this is a folder, not a file", file.display())));
    }
    if let Ok(full) = file.canonicalize()
        && models.iter().any(|m| m.canonicalize().is_ok_and(|m| m == full))
    {
        return Err(Failure::failed(format_args!("{}: this is one of the models", file.display())));
    }
    output::try_path(file).map_err(Failure::failed)
}

/// Writes a report, whole or not at all.
pub(crate) fn write(path: &Path, text: &str, console: Console) -> Result<(), Failure> {
    output::write_text(path, text).map_err(Failure::failed)?;
    console.say(format_args!("wrote {}", path.display()));
    Ok(())
}

/// Ends a table: the machine, what else is worth knowing of the run, and notes.
pub(crate) fn end(out: &mut String, m: &Machine, more: &str, seed: u64, seconds: f64, notes: &[String]) {
    let (cpu, noise) = (visible(&m.cpu), m.noise * 100.0);
    let (cores, os) = (m.cores, &m.os);
    let _ = writeln!(
        out,
        "{cpu}, {cores} cores, {os};{more} timings spread by {noise:.1} %; seed {seed}; {seconds:.1} s in all"
    );
    for note in notes {
        let _ = writeln!(out, "note: {}", visible(note));
    }
}
