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

use std::path::{Path, PathBuf};

use crate::{ErrorKind, ImportError, Imported, Options, files};
use schema::SceneFile;

/// How deep scene files may include scene files: each level costs stack.
const MAX_INCLUDED: usize = 16;

/// Reads a scene file.
///
/// # Errors
/// With the line of what breaks the schema, or the element (`objects[2]`) of what makes no sense.
pub fn read(path: &Path, options: &Options) -> Result<Imported, ImportError> {
    read_included(path, options, &[])
}

/// As [`read`], for a file that `including` led to, outermost first.
pub(crate) fn read_included(path: &Path, options: &Options, including: &[PathBuf]) -> Result<Imported, ImportError> {
    let real = path.canonicalize().map_err(|e| ImportError::io(path, e))?;
    if including.contains(&real) {
        return Err(ImportError::invalid(path, "", "this scene file includes itself"));
    }
    let depth = MAX_INCLUDED.min(options.limits.depth as usize);
    if including.len() >= depth {
        let cause = format!("scene files include scene files more than {depth} deep");
        return Err(ImportError::new(path, "", ErrorKind::Limit(cause)));
    }
    let is_json = files::format_extension(path) == "json";
    let file = parse(path, &files::read(path, &options.limits)?, is_json)?;
    let chain = [including, &[real]].concat();
    build::build(file, path, is_json, options, &chain)
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
