//! What a measurement came to, with all that must be known to read it later.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::{SystemTime, UNIX_EPOCH};
use std::{fs, io};

use serde::Serialize;

use crate::race::Row;
use crate::{peer, summary};

/// A measurement and where it was made.
#[derive(Clone, Debug, Serialize)]
pub struct Record<R> {
    /// The day, as 2026-01-31.
    pub date: String,
    /// Version of firsthit.
    pub version: String,
    /// The commit, with `+` behind it if files were changed since; empty outside a repository.
    pub commit: String,
    /// Name of the processor.
    pub cpu: String,
    /// Logical processors.
    pub cores: usize,
    /// Operating system and architecture.
    pub os: String,
    /// The compiler.
    pub rustc: String,
    /// Instructions that the whole program was compiled for, beyond the target's own.
    pub compiled_for: String,
    /// Engines and their versions.
    pub versions: Vec<String>,
    /// Threads of builds and rays.
    pub threads: usize,
    /// Timed repetitions.
    pub repetitions: usize,
    /// What the user should know.
    pub notes: Vec<String>,
    /// The rows.
    pub rows: Vec<R>,
}

impl<R: Serialize> Record<R> {
    /// Looks at the machine and at the folder of this crate.
    #[must_use]
    pub fn new(threads: usize, repetitions: usize, notes: Vec<String>, rows: Vec<R>) -> Self {
        let cpus = fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
        let cpu = cpus.lines().find_map(|l| Some(l.strip_prefix("model name")?.split_once(':')?.1.trim().to_owned()));
        let days = SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |d| d.as_secs() / 86_400);
        let changed = !git(&["status", "--porcelain", "--untracked-files=no"]).is_empty();
        let commit = git(&["rev-parse", "--short=12", "HEAD"]);
        Self {
            date: date(days),
            version: env!("CARGO_PKG_VERSION").into(),
            commit: if changed { commit + "+" } else { commit },
            cpu: cpu.unwrap_or_else(|| "unknown".into()),
            // All there are, not only those that this process is bound to.
            cores: cpus.lines().filter(|l| l.starts_with("processor")).count(),
            os: format!("{} {}", std::env::consts::OS, std::env::consts::ARCH),
            rustc: output(Command::new("rustc").arg("-V")),
            compiled_for: if cfg!(target_feature = "avx2") { "avx2".into() } else { String::new() },
            versions: versions(),
            threads,
            repetitions,
            notes,
            rows,
        }
    }

    /// Where and how it was made, and the notes, as Markdown.
    #[must_use]
    pub fn circumstances(&self) -> String {
        let compiled = match self.compiled_for.as_str() {
            "" => "stock build".to_owned(),
            more => format!("compiled for {more}"),
        };
        let notes: String = self.notes.iter().map(|n| format!("- {n}\n")).collect();
        format!(
            "firsthit {} at {}; {}, {compiled}; {}, {} cores, {}; threads: {}; {} repetitions.\n\n{notes}",
            self.version, self.commit, self.rustc, self.cpu, self.cores, self.os, self.threads, self.repetitions,
        )
    }

    fn json(&self) -> io::Result<String> {
        Ok(serde_json::to_string_pretty(self)? + "\n")
    }

    /// Writes it as JSON.
    ///
    /// # Errors
    /// When that cannot be done: with the name of the file.
    pub fn write_json(&self, file: &Path) -> Result<(), String> {
        let written = self.json().and_then(|text| fs::write(file, text));
        written.map_err(|e| format!("{}: {e}", file.display()))
    }

    /// Writes PREFIXDATE.json and PREFIXDATE.md into a folder, and says where; a second record of a day has a letter
    /// behind it.
    ///
    /// # Errors
    /// When they cannot be written.
    pub fn write_as(&self, folder: &Path, prefix: &str, markdown: &str) -> io::Result<[PathBuf; 2]> {
        let date = format!("{prefix}{}", self.date);
        let stems = (b'a'..=b'z').map(|c| if c == b'a' { date.clone() } else { format!("{date}{}", c as char) });
        let path = |stem: &str, end: &str| folder.join(format!("{stem}.{end}"));
        let stem = stems.into_iter().find(|s| !path(s, "json").exists()).unwrap_or_else(|| date.clone());
        let files = [path(&stem, "json"), path(&stem, "md")];
        fs::create_dir_all(folder)?;
        fs::write(&files[0], self.json()?)?;
        fs::write(&files[1], markdown)?;
        Ok(files)
    }
}

impl Record<Row> {
    /// The race as Markdown.
    #[must_use]
    pub fn markdown(&self) -> String {
        format!(
            "# Peers, {}\n\n{}\n{}.\n\nBest repetitions against best repetitions:\n\n{}{}",
            self.date,
            self.circumstances(),
            self.versions.join(", "),
            summary::figures(&self.rows),
            summary::tables(&self.rows)
        )
    }

    /// Writes DATE.json and DATE.md: see [`Record::write_as`].
    ///
    /// # Errors
    /// When they cannot be written.
    pub fn write(&self, folder: &Path) -> io::Result<[PathBuf; 2]> {
        self.write_as(folder, "", &self.markdown())
    }
}

fn output(command: &mut Command) -> String {
    let output = command.output().ok().filter(|o| o.status.success());
    output.map_or_else(String::new, |o| String::from_utf8_lossy(&o.stdout).trim().to_owned())
}

fn git(arguments: &[&str]) -> String {
    output(Command::new("git").arg("-C").arg(env!("CARGO_MANIFEST_DIR")).args(arguments))
}

/// Versions of the peers: crates as the lock file has them, and the library that is loaded.
fn versions() -> Vec<String> {
    const LOCK: &str = include_str!("../../Cargo.lock");
    let version = |name: &str| {
        let at = LOCK.split_once(&format!("name = \"{name}\"\nversion = \""))?;
        Some(format!("{name} {}", at.1.split('"').next()?))
    };
    let crates = ["obvhs", "parry3d", "bvh", "tinybvh-rs"].iter().filter_map(|n| version(n));
    let embree = peer::embree_library().ok().map(|v| format!("Embree {v}"));
    crates.chain(embree).collect()
}

/// The day so many days after the first of 1970, by the Gregorian calendar.
fn date(days: u64) -> String {
    let leap = |y: u64| y.is_multiple_of(4) && (!y.is_multiple_of(100) || y.is_multiple_of(400));
    let (mut year, mut left) = (1970, days);
    while left >= 365 + u64::from(leap(year)) {
        left -= 365 + u64::from(leap(year));
        year += 1;
    }
    let mut month = 0;
    let lengths = [31, 28 + u64::from(leap(year)), 31, 30, 31, 30, 31, 31, 30, 31, 30, 31];
    while left >= lengths[month] {
        left -= lengths[month];
        month += 1;
    }
    format!("{year}-{:02}-{:02}", month + 1, left + 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn days_have_dates() {
        let known = [(0, "1970-01-01"), (59, "1970-03-01"), (11_016, "2000-02-29"), (20_454, "2026-01-01")];
        assert_eq!(known.map(|(n, _)| date(n)), known.map(|(_, d)| d));
    }

    #[test]
    fn a_record_is_written_and_not_over_another() {
        let folder = std::env::temp_dir().join(format!("firsthit-record-{}", std::process::id()));
        let record = Record::new(1, 5, vec!["a test".into()], Vec::new());
        let [first, text] = record.write(&folder).unwrap();
        let [second, _] = record.write(&folder).unwrap();
        assert_ne!(first, second);
        let json: serde_json::Value = serde_json::from_slice(&fs::read(&first).unwrap()).unwrap();
        assert!(json["rows"].as_array().unwrap().is_empty() && json["versions"].as_array().unwrap().len() >= 3);
        assert!(fs::read_to_string(text).unwrap().contains("- a test"));
        fs::remove_dir_all(folder).unwrap();
    }
}
