//! Where the answers go: a file that appears whole or not at all, or standard output.

use std::io::{self, ErrorKind, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use firsthit_render::output::WholeFile;

use super::npy;
use super::table::{Format, Rows, Table};
use crate::error::{Exit, Failure};
use crate::target::{spare_file, writable};

/// A place for answers, chosen before anything is loaded.
#[derive(Debug)]
pub(super) enum Place {
    Stdout,
    File(PathBuf),
}

impl Place {
    /// From `--output` and `--format`.
    pub(super) fn new(output: &Path, format: Option<Format>) -> Result<(Self, Format), Failure> {
        if output == Path::new("-") {
            return Ok((Self::Stdout, format.unwrap_or(Format::Csv)));
        }
        let extension = output.extension().map(|e| e.to_string_lossy().to_ascii_lowercase());
        let named = match extension.as_deref() {
            Some("csv") => Some(Format::Csv),
            Some("jsonl") => Some(Format::Jsonl),
            Some("npy") => Some(Format::Npy),
            _ => None,
        };
        let Some(format) = format.or(named) else {
            let failure = format_args!("{}: the extension must be .csv, .jsonl or .npy", output.display());
            return Err(Failure::usage(failure).hint("or say how to write: --format csv"));
        };
        writable(output)?;
        Ok((Self::File(output.to_owned()), format))
    }

    /// Refuses if writing would replace one of the files that are read.
    pub(super) fn spare<'a>(&self, read: impl Iterator<Item = &'a Path>) -> Result<(), Failure> {
        match self {
            Self::Stdout => Ok(()),
            Self::File(path) => spare_file(path, read),
        }
    }

    /// As it is named in messages.
    pub(super) fn name(&self) -> String {
        match self {
            Self::Stdout => "standard output".into(),
            Self::File(path) => path.display().to_string(),
        }
    }
}

/// Takes answers.
pub(super) struct Sink<'a> {
    place: &'a Place,
    table: Table,
    out: Out,
    rows: u64,
}

enum Out {
    Stdout(io::Stdout),
    File(WholeFile),
}

impl<'a> Sink<'a> {
    /// Begins the output. `rows`: how many there will be, if that is known.
    pub(super) fn open(place: &'a Place, table: Table, rows: Option<u64>) -> Result<Self, Failure> {
        let out = match place {
            Place::Stdout if table.format == Format::Npy && rows.is_none() => {
                let failure = "a NumPy array on standard output begins with the number of its rows, which is not known";
                return Err(Failure::usage(failure).hint("write to a file: -o FILE.npy"));
            }
            Place::Stdout => Out::Stdout(io::stdout()),
            Place::File(path) => {
                let file = WholeFile::create(path).map_err(|e| failed(place, &e))?;
                let temporary = file.temporary().to_owned();
                // Without a handler Ctrl-C still ends the program.
                let _ = ctrlc::set_handler(move || {
                    let _ = std::fs::remove_file(&temporary);
                    std::process::exit(Exit::Interrupted as i32);
                });
                Out::File(file)
            }
        };
        let mut sink = Self { place, table, out, rows: 0 };
        let head = match table.head() {
            Some(text) => text.into_bytes(),
            None if table.format == Format::Npy => npy::header(rows.unwrap_or(0), table.columns.len()),
            None => Vec::new(),
        };
        // Whether anyone reads is seen with the first rows.
        sink.write(&head)?;
        Ok(sink)
    }

    /// Takes rows; false: the reader has seen enough.
    pub(super) fn push(&mut self, rows: &Rows) -> Result<bool, Failure> {
        self.rows += rows.count;
        self.write(&rows.bytes)
    }

    /// Ends the output; the answer: how many rows there are.
    pub(super) fn finish(mut self) -> Result<u64, Failure> {
        let header = npy::header(self.rows, self.table.columns.len());
        let whole = match self.out {
            Out::Stdout(ref mut out) => match out.flush() {
                Err(e) if e.kind() != ErrorKind::BrokenPipe => Err(e),
                _ => Ok(()),
            },
            Out::File(ref mut file) if self.table.format == Format::Npy => {
                file.seek(SeekFrom::Start(0)).and_then(|_| file.write_all(&header))
            }
            Out::File(_) => Ok(()),
        };
        whole.map_err(|e| failed(self.place, &e))?;
        if let Out::File(file) = self.out {
            file.finish().map_err(|e| failed(self.place, &e))?;
        }
        Ok(self.rows)
    }

    fn write(&mut self, bytes: &[u8]) -> Result<bool, Failure> {
        let written = match &mut self.out {
            Out::Stdout(out) => out.write_all(bytes),
            Out::File(file) => file.write_all(bytes),
        };
        match (written, &self.out) {
            (Ok(()), _) => Ok(true),
            (Err(e), Out::Stdout(_)) if e.kind() == ErrorKind::BrokenPipe => Ok(false),
            (Err(e), _) => Err(failed(self.place, &e)),
        }
    }
}

fn failed(place: &Place, error: &io::Error) -> Failure {
    Failure::failed(format_args!("{}: cannot write: {error}", place.name()))
}
