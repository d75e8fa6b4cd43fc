//! Every model file of a folder, loaded by the `firsthit` program: what came of it, beside what is known of the file.
//!
//! Each file gets a process of its own, so that panics, hangs and the most memory it took are seen from outside.

pub mod child;
pub mod inventory;
pub mod page;
pub mod run;
pub mod sheet;
pub mod verdict;

use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Duration;
use std::{fs, io};

use serde::Serialize;
use serde_json::Value;

use child::Ended;
use inventory::Known;

/// After this time a process counts as hanging.
pub const LIMIT: Duration = Duration::from_secs(60);

/// What came of a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum End {
    /// It was read.
    Loaded,
    /// It was refused with an error.
    Refused,
    /// The program ended in another way than by an answer: a panic, a signal, an exit code that it has no meaning for.
    Panicked,
    /// It did not end within [`LIMIT`].
    Hung,
    /// An inventory lists it, but it is not there.
    Absent,
}

impl End {
    fn of(ended: &Ended) -> Self {
        match ended.exit {
            _ if ended.hung => Self::Hung,
            Some(0) => Self::Loaded,
            Some(1) if !ended.stderr.contains("panicked at") => Self::Refused,
            _ => Self::Panicked,
        }
    }

    /// The word for it.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Loaded => "loaded",
            Self::Refused => "refused",
            Self::Panicked => "panicked",
            Self::Hung => "hung",
            Self::Absent => "absent",
        }
    }
}

/// A file, what is known of it, and what came of it.
#[derive(Clone, Debug, Serialize)]
pub struct Row {
    /// Path below the folder.
    pub file: String,
    /// What the inventories say.
    pub known: Known,
    /// What came of it.
    pub end: End,
    /// The first line of the error, without the folder and without the file's own name.
    pub error: String,
    /// Things that could not be honoured.
    pub warnings: u64,
    /// Triangles of all scenes, each instance counted.
    pub triangles: Option<u64>,
    /// Bytes of the files that were read: the model and all that it names; of the model alone where it is refused.
    pub bytes: u64,
    /// From start to end of the process.
    pub seconds: f64,
    /// Of the processor.
    pub processor_seconds: f64,
    /// The most memory that the process had.
    pub peak_bytes: u64,
    /// Its picture, where one was asked for.
    pub picture: Option<Picture>,
}

/// How the render of a file ended.
#[derive(Clone, Debug, Serialize)]
pub struct Picture {
    /// Where it is.
    #[serde(skip)]
    pub path: PathBuf,
    /// What came of it.
    pub end: End,
    /// The first line of the error.
    pub error: String,
    /// From start to end of the process.
    pub seconds: f64,
    /// The most memory that the process had.
    pub peak_bytes: u64,
}

impl Row {
    /// The most memory that a file of so many bytes may take: 64 times its size and 256 MiB.
    #[must_use]
    pub const fn allowed_bytes(&self) -> u64 {
        64 * self.bytes + (256 << 20)
    }

    /// Whether the count of triangles is neither the inventory's nor one that differs for a known reason.
    #[must_use]
    pub fn is_count_wrong(&self) -> bool {
        match (self.triangles, self.known.triangles) {
            (Some(found), Some(wanted)) => found != wanted && verdict::known_difference(self).is_none(),
            _ => false,
        }
    }
}

/// Loads a file of a folder by `firsthit inspect`.
///
/// # Errors
/// If the program cannot be started.
pub fn load(program: &Path, folder: &Path, file: &str, known: Known) -> io::Result<Row> {
    let path = folder.join(file);
    let mut row = Row {
        file: file.into(),
        known,
        end: End::Absent,
        error: String::new(),
        warnings: 0,
        triangles: None,
        bytes: 0,
        seconds: 0.0,
        processor_seconds: 0.0,
        peak_bytes: 0,
        picture: None,
    };
    let Ok(metadata) = fs::metadata(&path) else { return Ok(row) };
    let mut command = Command::new(program);
    // As many threads as the page says.
    command.env("RAYON_NUM_THREADS", "1");
    let ended = child::run(command.arg("inspect").arg(&path).arg("--json"), LIMIT)?;
    row.end = End::of(&ended);
    row.error = first_line(&ended.stderr, folder, file);
    row.bytes = metadata.len();
    row.seconds = ended.seconds;
    row.processor_seconds = ended.processor_seconds;
    row.peak_bytes = ended.peak_bytes;
    if row.end == End::Loaded {
        let said: Value = serde_json::from_str(&ended.stdout).map_err(io::Error::other)?;
        row.triangles = said["triangles_all_scenes"].as_u64();
        let listed = said["warnings"].as_array().map_or(0, Vec::len) as u64;
        row.warnings = listed + said["more_warnings"].as_u64().unwrap_or(0);
        let read = said["files"].as_array().into_iter().flatten().filter_map(Value::as_str);
        row.bytes = read.filter_map(|f| Some(fs::metadata(f).ok()?.len())).sum::<u64>().max(row.bytes);
    }
    Ok(row)
}

/// Renders a file of a folder, small and quickly, on one thread.
///
/// # Errors
/// If the program cannot be started.
pub fn render(program: &Path, folder: &Path, file: &str, into: &Path) -> io::Result<Picture> {
    let path = into.join(file.replace('/', "__") + ".png");
    let mut command = Command::new(program);
    command.arg("render").arg(folder.join(file)).arg("-o").arg(&path);
    command.args(["--resolution", "256x256", "--spp", "16", "--time-limit", "20s", "--threads", "1"]);
    let ended = child::run(command.args(["--no-config", "--no-progress"]), LIMIT)?;
    Ok(Picture {
        path,
        end: End::of(&ended),
        error: first_line(&ended.stderr, folder, file),
        seconds: ended.seconds,
        peak_bytes: ended.peak_bytes,
    })
}

/// The first line that names an error, without what differs between machines.
fn first_line(stderr: &str, folder: &Path, file: &str) -> String {
    let line = stderr.lines().find(|l| l.starts_with("error: ") || l.contains("panicked at"));
    let line = line.unwrap_or_default().trim_start_matches("error: ");
    let folder = format!("{}/", folder.display());
    line.replace(&folder, "").trim_start_matches(file).trim_start_matches(": ").to_owned()
}
