//! Scene files (`.toml`, `.json`): what OBJ and glTF can't say.
//!
//! Analytic shapes, references to models with transforms, materials, lights, an environment, cameras. One schema is
//! read from both notations; `docs/scene-files.md` describes it. A `.json` file is a *reference scene* unless it says
//! otherwise: see [`Settings::reference_conventions`](crate::scene::Settings::reference_conventions).
//!
//! Unknown keys are errors, so that a misspelt one is not silently without effect. Files may be named only inside the
//! scene file's folder.

mod build;
mod lights;
mod materials;
mod place;
mod schema;
mod shapes;
#[cfg(test)]
mod tests;
mod values;

use std::cell::Cell;
use std::path::{Path, PathBuf};
use std::rc::Rc;

use crate::open::finish;
use crate::{ErrorKind, ImportError, Imported, Options, files};
use schema::SceneFile;

/// How deep scene files may include scene files: each level costs stack.
const DEEPEST: usize = 16;

/// How many scene files may be read for one: those that are included from several files are read for each of them.
const MOST_INCLUDED: usize = 4096;

/// How a scene file is reached.
#[derive(Clone, Debug, Default)]
pub(crate) struct Inclusion {
    /// The real paths of the scene files that led here, outermost first.
    chain: Vec<PathBuf>,
    /// How many were read in all.
    read: Rc<Cell<usize>>,
}

impl Inclusion {
    /// One file further.
    fn add(&self, real: &Path, options: &Options) -> Result<Self, ErrorKind> {
        if self.chain.iter().any(|p| p == real) {
            return Err(ErrorKind::Invalid("this scene file includes itself".to_owned()));
        }
        let depth = DEEPEST.min(options.limits.depth as usize);
        if self.chain.len() >= depth {
            return Err(ErrorKind::Limit(format!("scene files include scene files more than {depth} deep")));
        }
        self.read.set(self.read.get() + 1);
        if self.read.get() > MOST_INCLUDED {
            return Err(ErrorKind::Limit(format!("scene files include each other more than {MOST_INCLUDED} times")));
        }
        Ok(Self { chain: [&self.chain[..], &[real.to_owned()]].concat(), read: Rc::clone(&self.read) })
    }
}

/// Reads a scene file.
///
/// # Errors
/// With the line of what breaks the schema (in TOML, of the table it is in), or the element (`objects[2]`) of what makes no sense.
pub fn read(path: &Path, options: &Options) -> Result<Imported, ImportError> {
    let bytes = files::read(path, &options.limits)?;
    let mut imported = read_bytes(&bytes, path, options, &Inclusion::default())?;
    imported.scene.keep_only(&options.only, path)?;
    finish(&mut imported.scene, &mut imported.report, path, options)?;
    Ok(imported)
}

/// As [`read`], of the bytes of a file that others may have led to; unfinished.
pub(crate) fn read_bytes(
    bytes: &[u8],
    path: &Path,
    options: &Options,
    including: &Inclusion,
) -> Result<Imported, ImportError> {
    let real = path.canonicalize().map_err(|e| ImportError::io(path, e))?;
    let inclusion = including.add(&real, options).map_err(|kind| ImportError::new(path, "", kind))?;
    let is_json = files::format_extension(path) == "json";
    let file = parse(path, bytes, is_json)?;
    build::build(file, path, is_json, options, &inclusion)
}

fn parse(path: &Path, bytes: &[u8], is_json: bool) -> Result<SceneFile, ImportError> {
    let line_at = |offset: usize| {
        let newlines = bytes.iter().take(offset).filter(|&&b| b == b'\n').count();
        format!("line {}", newlines + 1)
    };
    let text = str::from_utf8(bytes)
        .map_err(|e| ImportError::invalid(path, line_at(e.valid_up_to()), "is not UTF-8 text"))?
        .trim_start_matches('\u{feff}');
    if is_json {
        // serde would also take a list, as the fields in their order.
        if !text.trim_start().starts_with('{') {
            return Err(ImportError::invalid(path, "", "is no JSON object"));
        }
        serde_json::from_str(text).map_err(|e| {
            let (place, message) = (format!("line {}", e.line()), e.to_string());
            let cause = message.rsplit_once(" at line ").map_or(message.as_str(), |(cause, _)| cause);
            ImportError::invalid(path, place, cause)
        })
    } else {
        ::toml::from_str(text).map_err(|e| {
            let place = e.span().map(|span| line_at(span.start + bytes.len() - text.len())).unwrap_or_default();
            ImportError::invalid(path, place, e.message())
        })
    }
}
