//! Reading a folder of cases.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use serde_json::Value;

use super::Case;

/// Why a folder of cases cannot be read.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CorpusError {
    /// A folder or file cannot be read.
    #[error("{}: {error}", path.display())]
    Io {
        /// The folder or file.
        path: PathBuf,
        /// Why.
        error: io::Error,
    },
    /// The folder has no file of cases.
    #[error("{}: no .jsonl file in this folder", .0.display())]
    NoFile(PathBuf),
    /// The files of the folder have no line.
    #[error("{}: no case in the .jsonl files of this folder", .0.display())]
    NoCase(PathBuf),
    /// A line is not a case.
    #[error("{}, line {line}{}: {message}", path.display(), case.as_ref().map_or(String::new(), |c| format!(" (case {c})")))]
    Line {
        /// The file.
        path: PathBuf,
        /// Its line, from 1.
        line: usize,
        /// The `id` of the case, where the line has one.
        case: Option<String>,
        /// What was found, where in the case, and what was expected.
        message: String,
    },
}

/// All cases of a folder, in the order of the file names. Empty lines are skipped.
///
/// # Errors
/// When the folder cannot be read or holds no case, or a line is not a case: see [`CorpusError`].
pub fn read(folder: &Path) -> Result<Vec<Case>, CorpusError> {
    let at = |path: &Path| {
        let path = path.to_owned();
        move |error| CorpusError::Io { path, error }
    };
    let entries = fs::read_dir(folder).map_err(at(folder))?;
    let mut files: Vec<PathBuf> = entries.map(|e| Ok(e?.path())).collect::<io::Result<_>>().map_err(at(folder))?;
    files.retain(|f| f.extension().is_some_and(|e| e == "jsonl"));
    files.sort();
    if files.is_empty() {
        return Err(CorpusError::NoFile(folder.to_owned()));
    }
    let mut cases = Vec::new();
    for path in files {
        let text = fs::read_to_string(&path).map_err(at(&path))?;
        for (number, line) in text.lines().enumerate().filter(|(_, line)| !line.trim().is_empty()) {
            let case = parse(line).map_err(|message| {
                let id = serde_json::from_str::<Value>(line).ok().and_then(|v| Some(v.get("id")?.as_str()?.to_owned()));
                CorpusError::Line { path: path.clone(), line: number + 1, case: id, message }
            })?;
            cases.push(case);
        }
    }
    if cases.is_empty() { Err(CorpusError::NoCase(folder.to_owned())) } else { Ok(cases) }
}

fn parse(line: &str) -> Result<Case, String> {
    let mut json = serde_json::Deserializer::from_str(line);
    let case = serde_path_to_error::deserialize(&mut json).map_err(|e| e.to_string())?;
    json.end().map_err(|e| e.to_string())?;
    Ok(case)
}

#[cfg(test)]
mod tests {
    use super::*;

    const CASE: &str = r#"{"id":"s/1","group":"sphere","category":"near","prim":{"kind":"sphere","c":["00000000","00000000","00000000"],"r":"3f800000"},"ray":{"o":["00000000","00000000","40000000"],"d":["00000000","00000000","bf800000"],"tmin":"00000000","tmax":"7f800000"},"expect":{"result":"hit","t":"1","t_f32":"3f800000","kappa":2.0,"level":"f32"}}"#;

    fn folder(files: &[(&str, &str)]) -> tempfile::TempDir {
        let folder = tempfile::tempdir().unwrap();
        for (name, text) in files {
            fs::write(folder.path().join(name), text).unwrap();
        }
        folder
    }

    fn error(files: &[(&str, &str)]) -> String {
        read(folder(files).path()).unwrap_err().to_string()
    }

    #[test]
    fn cases_are_read_in_the_order_of_file_names() {
        let second = CASE.replace("s/1", "s/2");
        let folder = folder(&[("b.jsonl", CASE), ("a.jsonl", &format!("{second}\n\n")), ("README.md", "words")]);
        let ids: Vec<String> = read(folder.path()).unwrap().into_iter().map(|c| c.id).collect();
        assert_eq!(ids, ["s/2", "s/1"]);
    }

    #[test]
    fn a_wrong_line_is_named_with_file_case_and_place() {
        let bits =
            error(&[("a.jsonl", &format!("{CASE}\n{}", CASE.replace("3f800000\"},\"ray", "+f800000\"},\"ray")))]);
        assert!(bits.contains("a.jsonl, line 2 (case s/1)") && bits.contains("'+f800000'"), "{bits}");
        let level = error(&[("a.jsonl", &CASE.replace("\"f32\"", "\"f16\""))]);
        assert!(level.contains("expect.level") && level.contains("f16"), "{level}");
        let cut = error(&[("a.jsonl", &CASE[..CASE.len() - 3])]);
        assert!(cut.contains("line 1:") && cut.contains("EOF"), "{cut}");
        let twice = error(&[("a.jsonl", &format!("{CASE}{CASE}"))]);
        assert!(twice.contains("trailing"), "{twice}");
    }

    #[test]
    fn a_folder_without_cases_is_an_error() {
        assert!(error(&[("a.txt", CASE)]).contains("no .jsonl file"));
        assert!(error(&[("a.jsonl", "\n")]).contains("no case"));
        assert!(matches!(read(Path::new("no such folder")), Err(CorpusError::Io { .. })));
    }
}
