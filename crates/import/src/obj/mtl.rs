//! Material libraries: found, made fit for tobj, and parsed by it.
//!
//! tobj wants well-formed text: it stops at the first number it cannot read, takes colours of three numbers only, and
//! wants its keywords in one case. [`clean`] gives it that, and tells with its line what it had to leave out.

use std::collections::HashSet;
use std::path::{Path, PathBuf};

use super::parse::place;
use super::text::{Lines, name, number, split_keyword, to_utf8, words};
use crate::files::{self, Folder};
use crate::{ErrorKind, Limits, Report};

/// A material as its library has it.
pub(super) struct Entry {
    pub(super) material: tobj::Material,
    /// The library, for messages.
    pub(super) file: PathBuf,
    /// Where the names of its textures start.
    pub(super) folder: Folder,
}

/// Stands for the empty name, which tobj does not take.
const UNNAMED: &str = "(unnamed)";

/// The name under which a `usemtl` finds its material.
pub(super) fn key(name: &str) -> &str {
    if name.is_empty() { UNNAMED } else { name }
}

/// Reads the libraries that `mtllib` statements name, in their order; of materials with one name the first counts.
///
/// What cannot be read is a warning.
pub(super) fn load(
    statements: &[(u32, String)],
    obj: &Path,
    folder: &Folder,
    limits: &Limits,
    report: &mut Report,
) -> Vec<Entry> {
    let mut entries = Vec::new();
    let mut libraries = HashSet::new();
    let mut names = HashSet::new();
    for (line, argument) in statements {
        for path in find_libraries(argument, obj, *line, folder, report) {
            if !libraries.insert(path.clone()) {
                continue;
            }
            report.reads(&path);
            let bytes = match files::read(&path, limits) {
                Ok(bytes) => bytes,
                Err(e) => {
                    report.warn(e.file, e.place, format!("{}; its materials are missing", e.kind));
                    continue;
                }
            };
            let here = folder.beside(&path);
            for material in parse(&to_utf8(bytes), &path, report) {
                if names.insert(material.name.clone()) {
                    entries.push(Entry { material, file: path.clone(), folder: here.clone() });
                }
            }
        }
    }
    entries
}

/// The files of one `mtllib`: a single name, perhaps with spaces in it, or several, with spaces escaped by `\`.
fn find_libraries(argument: &str, obj: &Path, line: u32, folder: &Folder, report: &mut Report) -> Vec<PathBuf> {
    let mut missing = |name: &str, e: ErrorKind| {
        report.warn(obj, place(line), format!("material library '{name}': {e}; its materials are missing"));
    };
    let whole = match find_file(argument, &[folder]) {
        Ok(found) => return vec![found.path],
        Err(e) => e,
    };
    let names: Vec<String> =
        argument.replace("\\ ", "\0").split_whitespace().map(|name| name.replace('\0', " ")).collect();
    let found: Vec<_> = names.iter().map(|name| (name, find_file(name, &[folder]))).collect();
    // Several files are meant only if there is one of them.
    if found.iter().all(|(_, f)| f.is_err()) {
        missing(argument, whole);
        return Vec::new();
    }
    let mut paths = Vec::new();
    for (name, found) in found {
        match found {
            Ok(found) => paths.push(found.path),
            Err(e) => missing(name, e),
        }
    }
    paths
}

/// A file that was found.
pub(super) struct Found {
    pub(super) path: PathBuf,
    /// Whether only the last part of its path was used, since the whole leads nowhere or outside.
    pub(super) by_base_name: bool,
}

/// Finds the file of a name in the first of the folders that has it; else, whatever folders the name itself has, the
/// file of its last part: exporters write the absolute paths of their author's machine.
///
/// # Errors
/// Why the whole name was not found in the first folder.
pub(super) fn find_file(name: &str, folders: &[&Folder]) -> Result<Found, ErrorKind> {
    let mut error = None;
    for folder in folders {
        match folder.find_loosely(name) {
            Ok(path) => return Ok(Found { path, by_base_name: false }),
            Err(e) => error = error.or(Some(e)),
        }
    }
    let base = name.rsplit(['/', '\\', ':']).next().unwrap_or_default();
    let elsewhere = folders.iter().filter(|_| !base.is_empty()).find_map(|f| f.find_loosely(base).ok());
    if let Some(path) = elsewhere {
        return Ok(Found { path, by_base_name: true });
    }
    Err(error.unwrap_or_else(|| ErrorKind::Outside(name.to_owned())))
}

/// Parses a library.
fn parse(text: &[u8], file: &Path, report: &mut Report) -> Vec<tobj::Material> {
    let text = clean(text, file, report);
    match tobj::load_mtl_buf(&mut text.as_bytes()) {
        Ok((materials, _)) => materials,
        Err(e) => {
            report.warn(file, "", format!("{e}; its materials are missing"));
            Vec::new()
        }
    }
}

/// What follows a keyword.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Value {
    /// One to three numbers: red alone stands for grey.
    Color,
    Number,
    /// `illum`.
    Model,
    /// Options and a file name.
    Texture,
    /// The name of a new material.
    Name,
}

/// The keywords that are read, as tobj or [`super::material`] knows them.
const KEYWORDS: &[(&str, Value)] = &[
    ("newmtl", Value::Name),
    ("Ka", Value::Color),
    ("Kd", Value::Color),
    ("Ks", Value::Color),
    ("Ke", Value::Color),
    ("Tf", Value::Color),
    ("Ns", Value::Number),
    ("Ni", Value::Number),
    ("d", Value::Number),
    ("Tr", Value::Number),
    ("Pr", Value::Number),
    ("Pm", Value::Number),
    ("Ps", Value::Number),
    ("Pc", Value::Number),
    ("Pcr", Value::Number),
    ("aniso", Value::Number),
    ("anisor", Value::Number),
    ("sharpness", Value::Number),
    ("illum", Value::Model),
    ("map_Ka", Value::Texture),
    ("map_Kd", Value::Texture),
    ("map_Ks", Value::Texture),
    ("map_Ke", Value::Texture),
    ("map_Ns", Value::Texture),
    ("map_d", Value::Texture),
    ("map_Pr", Value::Texture),
    ("map_Pm", Value::Texture),
    ("map_Ps", Value::Texture),
    ("map_Pc", Value::Texture),
    ("map_Pcr", Value::Texture),
    ("map_aniso", Value::Texture),
    ("map_anisor", Value::Texture),
    ("map_Tr", Value::Texture),
    ("map_bump", Value::Texture),
    ("bump", Value::Texture),
    ("norm", Value::Texture),
    ("disp", Value::Texture),
    ("decal", Value::Texture),
    ("refl", Value::Texture),
];

/// The library's text with one well-formed statement a line; what is not well-formed is left out with a warning.
fn clean(text: &[u8], file: &Path, report: &mut Report) -> String {
    let mut out = String::new();
    let mut lines = Lines::new(text, 1);
    let mut unknown = HashSet::new();
    while let Some((line, statement)) = lines.next() {
        let (keyword, rest) = split_keyword(statement);
        if keyword.is_empty() || keyword[0] == b'#' {
            continue;
        }
        let word = name(keyword);
        let Some(&(keyword, value)) = KEYWORDS.iter().find(|(k, _)| k.eq_ignore_ascii_case(&word)) else {
            let word: String = word.chars().take(32).collect();
            if unknown.insert(word.clone()) {
                report.warn(file, place(line), format!("unknown statement '{word}' passed over"));
            }
            continue;
        };
        match value_text(value, rest) {
            Some(value) => out.extend([keyword, " ", &value, "\n"]),
            None => {
                let shown: String = name(rest).chars().take(64).collect();
                report.warn(file, place(line), format!("'{keyword} {shown}' cannot be read, passed over"));
            }
        }
    }
    out
}

/// The value in the form that tobj takes.
fn value_text(value: Value, rest: &[u8]) -> Option<String> {
    let finite = |w| number(w).filter(|x| x.abs() <= f64::from(f32::MAX));
    match value {
        Value::Color => {
            let first = finite(words(rest).next()?)?;
            let mut rgb = [first; 3];
            for (channel, word) in rgb.iter_mut().zip(words(rest)) {
                *channel = finite(word)?;
            }
            Some(format!("{} {} {}", rgb[0], rgb[1], rgb[2]))
        }
        // `d -halo 0.5` is thinner in the middle of a surface; the plain value is the nearest there is.
        Value::Number => Some(finite(words(rest).find(|w| *w != b"-halo")?)?.to_string()),
        Value::Model => {
            let model = finite(words(rest).next()?)?;
            (0.0..=10.0).contains(&model).then(|| (model as u8).to_string())
        }
        Value::Texture => Some(name(rest).into_owned()).filter(|name| !name.is_empty()),
        Value::Name => Some(key(&name(rest)).to_owned()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parsed(text: &str) -> (Vec<tobj::Material>, Vec<String>) {
        let mut report = Report::default();
        let materials = parse(text.as_bytes(), Path::new("m.mtl"), &mut report);
        (materials, report.warnings.iter().map(ToString::to_string).collect())
    }

    #[test]
    fn what_tobj_refuses_is_repaired() {
        let (m, warnings) = parsed("newmtl\nkd 0.5\nKs 0.1 0.2\nillum 2.0\nMAP_KD a b.png\nd -halo 0.25\n");
        assert!(warnings.is_empty(), "{warnings:?}");
        assert_eq!(m[0].name, key(""));
        assert_eq!(m[0].diffuse, Some([0.5; 3]), "red alone is grey");
        assert_eq!(m[0].specular, Some([0.1, 0.2, 0.1]));
        assert_eq!((m[0].illumination_model, m[0].dissolve), (Some(2), Some(0.25)));
        assert_eq!(m[0].diffuse_texture.as_deref(), Some("a b.png"));
    }

    #[test]
    fn what_cannot_be_read_is_left_out_with_its_line() {
        let (m, warnings) = parsed("newmtl a\nKd spectral a.rfl\nNs x\nKs nan 0 0\nfoo 1\nfoo 2\nmap_Kd\nNi 1.4\n");
        assert_eq!(m.len(), 1);
        assert_eq!((m[0].diffuse, m[0].optical_density), (None, Some(1.4)));
        assert_eq!(warnings.len(), 5, "{warnings:?}");
        assert!(warnings[0].contains("m.mtl: line 2: 'Kd spectral a.rfl'"), "{warnings:?}");
        assert!(warnings[3].contains("line 5: unknown statement 'foo'"), "{warnings:?}");
    }
}
