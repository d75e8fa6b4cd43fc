//! What the tests share: the hard cases, and where public data is found.

pub mod oracle;

use std::path::{Path, PathBuf};

/// The folder of hard cases: `FIRSTHIT_HARD_CASES`, or the one that comes with the tests.
#[must_use]
pub fn hard_cases() -> PathBuf {
    std::env::var_os("FIRSTHIT_HARD_CASES")
        .map_or_else(|| [env!("CARGO_MANIFEST_DIR"), "corpus"].iter().collect(), PathBuf::from)
}

/// The folder of public models and references, which a clone does not hold.
///
/// It is named by the environment variable `FIRSTHIT_SHARED`, or else lies beside the workspace as `shared`. Where there
/// is none, says so and returns `None`, and the test that asked is skipped.
///
/// # Panics
/// If there is none though `FIRSTHIT_REQUIRE_SHARED` is 1, so that no test is skipped unseen.
#[must_use]
pub fn shared() -> Option<PathBuf> {
    let beside = || Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared");
    let folder = std::env::var_os("FIRSTHIT_SHARED").map_or_else(beside, PathBuf::from);
    if folder.is_dir() {
        return Some(folder);
    }
    assert!(std::env::var_os("FIRSTHIT_REQUIRE_SHARED").is_none_or(|v| v != "1"), "no folder of public data");
    let test = std::thread::current().name().unwrap_or("a test").to_owned();
    summary(&format!("skipped: {test}: no folder of public data (FIRSTHIT_SHARED names it)"));
    None
}

/// Prints what a run over a corpus came to, and adds it to the file that `FIRSTHIT_SUMMARY` names, if it names one: the
/// output of a test that passes is not shown.
pub fn summary(text: &str) {
    println!("{text}");
    if let Some(path) = std::env::var_os("FIRSTHIT_SUMMARY")
        && let Ok(mut file) = std::fs::OpenOptions::new().create(true).append(true).open(path)
    {
        use std::io::Write;
        // One write, so that tests that end together do not mix their lines.
        let _ = file.write_all(format!("{text}\n").as_bytes());
    }
}

/// The fields of a line of CSV: those with commas are in quotes, their quotes doubled.
#[must_use]
pub fn csv_fields(line: &str) -> Vec<String> {
    let (mut fields, mut field, mut quoted) = (Vec::new(), String::new(), false);
    let mut chars = line.chars().peekable();
    while let Some(c) = chars.next() {
        match c {
            '"' if quoted && chars.peek() == Some(&'"') => field.extend(chars.next()),
            '"' => quoted = !quoted,
            ',' if !quoted => fields.push(std::mem::take(&mut field)),
            c => field.push(c),
        }
    }
    fields.push(field);
    fields
}
