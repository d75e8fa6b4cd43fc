//! Where the rows of a question come from, block by block.

use std::fs::File;
use std::io::{self, BufRead, BufReader, IsTerminal, Read};
use std::ops::Range;
use std::path::Path;

use rayon::prelude::*;

use super::npy::{Layout, MAGIC, NpyError};
use super::text::{Notation, is_header, shortened};
use crate::error::Failure;

/// The longest line that is read.
const MOST_LINE: u64 = 1 << 16;

/// A block of lines ends after so many bytes: long lines are not to fill the memory.
const BLOCK_BYTES: usize = 1 << 24;

/// What some programs put before a text.
const MARK: &str = "\u{feff}";

/// What the numbers of a row are.
#[derive(Debug)]
pub(crate) struct Columns<const N: usize> {
    /// What a row is.
    pub(super) noun: &'static str,
    pub(super) names: [&'static str; N],
    /// So many must be there. The others are there, or all have their defaults.
    pub(super) least: usize,
    pub(super) defaults: [f64; N],
}

impl<const N: usize> Columns<N> {
    pub(super) fn takes(&self, count: usize) -> bool {
        count == self.least || count == N
    }

    /// An error unless so many numbers are a row.
    pub(super) fn check(&self, count: usize) -> Result<(), String> {
        if self.takes(count) {
            return Ok(());
        }
        let or = if self.least < N { format!(" or {N}") } else { String::new() };
        Err(format!("there are {count} numbers; a {} has {}{or}", self.noun, self.least))
    }

    /// The names, as `ox,oy,oz[,t_min]`.
    pub(super) fn in_words(&self) -> String {
        let (needed, more) = self.names.split_at(self.least);
        let more = if more.is_empty() { String::new() } else { format!("[,{}]", more.join(",")) };
        needed.join(",") + &more
    }
}

/// Rows from a file or from standard input.
pub(crate) struct Source<const N: usize> {
    /// As messages name it.
    name: String,
    columns: &'static Columns<N>,
    input: Box<dyn BufRead + Send>,
    kind: Kind,
    /// Lines or rows that were read.
    place: u64,
    buffer: Vec<u8>,
}

#[derive(Clone, Copy, Debug)]
enum Kind {
    Text(Notation),
    Npy(Layout),
}

impl<const N: usize> Source<N> {
    /// Opens a file, or standard input if it is called `-`. The first bytes tell what it is.
    pub(crate) fn open(path: &Path, columns: &'static Columns<N>) -> Result<Self, Failure> {
        if path == Path::new("-") {
            if io::stdin().is_terminal() {
                let failure = Failure::usage(format_args!("no {}s on standard input", columns.noun));
                return Err(failure.hint(format_args!("name a file: --{}s FILE, or pipe them in", columns.noun)));
            }
            return Self::new(
                "standard input".into(),
                Box::new(BufReader::with_capacity(1 << 16, io::stdin())),
                columns,
            );
        }
        let name = path.display().to_string();
        let failed = |e: io::Error| Failure::failed(format_args!("{name}: {e}"));
        let file = File::open(path).map_err(failed)?;
        if file.metadata().map_err(failed)?.is_dir() {
            return Err(Failure::failed(format_args!("{name}: this is a folder, not a file")));
        }
        Self::new(name, Box::new(BufReader::with_capacity(1 << 16, file)), columns)
    }

    fn new(name: String, mut input: Box<dyn BufRead + Send>, columns: &'static Columns<N>) -> Result<Self, Failure> {
        let failed = |text: &dyn std::fmt::Display| Failure::failed(format_args!("{name}: {text}"));
        let first = input.fill_buf().map_err(|e| failed(&e))?;
        let kind = if first.starts_with(&MAGIC[..1]) {
            let layout = Layout::read(&mut input).map_err(|e| match e {
                NpyError::Io(e) => failed(&e),
                NpyError::Content(text) => failed(&text),
            })?;
            columns.check(layout.width).map_err(|text| failed(&format_args!("in a row {text}")))?;
            Kind::Npy(layout)
        } else {
            let text = first.strip_prefix(MARK.as_bytes()).unwrap_or(first);
            match text.trim_ascii_start().first() {
                Some(b'[' | b'{') => Kind::Text(Notation::Json),
                _ => Kind::Text(Notation::Csv),
            }
        };
        let mut source = Self { name, columns, input, kind, place: 0, buffer: Vec::new() };
        source.skip_header()?;
        Ok(source)
    }

    /// How many rows there are, if that is known beforehand.
    pub(crate) fn rows(&self) -> Option<u64> {
        match self.kind {
            Kind::Npy(layout) => Some(layout.rows),
            Kind::Text(_) => None,
        }
    }

    /// Reads at most so many rows, fewer of long lines; none: that was the end.
    pub(crate) fn read(&mut self, most: usize, rows: &mut Vec<[f64; N]>) -> Result<(), Failure> {
        rows.clear();
        match self.kind {
            Kind::Text(notation) => self.read_text(notation, most, rows),
            Kind::Npy(layout) => self.read_npy(layout, most, rows),
        }
    }

    fn read_text(&mut self, notation: Notation, most: usize, rows: &mut Vec<[f64; N]>) -> Result<(), Failure> {
        let lines = self.lines(notation, most)?;
        // The first bad line is told of, not any.
        let (buffer, columns) = (&self.buffer, self.columns);
        let parsed: Vec<Result<[f64; N], String>> = lines
            .par_iter()
            .with_min_len(256)
            .map(|(_, line)| notation.parse(text(buffer, line).unwrap_or_default(), columns))
            .collect();
        for ((number, _), row) in lines.iter().zip(parsed) {
            rows.push(row.map_err(|text| self.bad_line(*number, &text))?);
        }
        Ok(())
    }

    /// The next lines with something on them, by number and place in the buffer. They are text.
    fn lines(&mut self, notation: Notation, most: usize) -> Result<Vec<(u64, Range<usize>)>, Failure> {
        let mut lines = Vec::new();
        self.buffer.clear();
        while lines.len() < most && self.buffer.len() < BLOCK_BYTES {
            let start = self.buffer.len();
            let read = (&mut self.input).take(MOST_LINE).read_until(b'\n', &mut self.buffer);
            match read.map_err(|e| self.failed(&e))? {
                0 => break,
                length => {
                    self.place += 1;
                    if length as u64 == MOST_LINE && !self.buffer.ends_with(b"\n") {
                        return Err(self.bad_line(self.place, "the line is longer than any row"));
                    }
                }
            }
            let line = start..self.buffer.len();
            match text(&self.buffer, &line) {
                Some(text) if notation.is_empty(text) => self.buffer.truncate(start),
                Some(_) => lines.push((self.place, line)),
                None => {
                    let text = String::from_utf8_lossy(&self.buffer[line]);
                    let text = format!("'{}' is not text", shortened(&text));
                    return Err(self.bad_line(self.place, &text));
                }
            }
        }
        Ok(lines)
    }

    /// Reads past the names of the columns, if they are there.
    fn skip_header(&mut self) -> Result<(), Failure> {
        let Kind::Text(Notation::Csv) = self.kind else { return Ok(()) };
        let lines = self.lines(Notation::Csv, 1)?;
        let Some((number, line)) = lines.first() else { return Ok(()) };
        let text = text(&self.buffer, line).unwrap_or_default();
        if !is_header(text, self.columns).map_err(|text| self.bad_line(*number, &text))? {
            // It is the first row.
            let line = io::Cursor::new(text.as_bytes().to_vec());
            let rest = std::mem::replace(&mut self.input, Box::new(io::empty()));
            self.input = Box::new(line.chain(rest));
            self.place = number - 1;
        }
        Ok(())
    }

    fn read_npy(&mut self, layout: Layout, most: usize, rows: &mut Vec<[f64; N]>) -> Result<(), Failure> {
        let count = (layout.rows - self.place).min(most as u64) as usize;
        let bytes = layout.row_bytes();
        self.buffer.clear();
        let read = (&mut self.input).take((count * bytes) as u64).read_to_end(&mut self.buffer);
        let read = read.map_err(|e| self.failed(&e))?;
        if read < count * bytes {
            let whole = self.place + (read / bytes) as u64;
            return Err(self.failed(&format_args!("the file ends after {whole} of its {} rows", layout.rows)));
        }
        self.place += count as u64;
        rows.extend(self.buffer.chunks_exact(bytes).map(|stored| {
            let mut row = self.columns.defaults;
            row.iter_mut().zip(layout.numbers(stored)).for_each(|(slot, number)| *slot = number);
            row
        }));
        Ok(())
    }

    fn bad_line(&self, number: u64, text: &str) -> Failure {
        self.failed(&format_args!("line {number}: {text}"))
    }

    fn failed(&self, text: &dyn std::fmt::Display) -> Failure {
        Failure::failed(format_args!("{}: {text}", self.name))
    }
}

/// A line, if it is text.
fn text<'a>(buffer: &'a [u8], line: &Range<usize>) -> Option<&'a str> {
    let text = str::from_utf8(buffer.get(line.clone())?).ok()?;
    Some(text.strip_prefix(MARK).unwrap_or(text))
}

#[cfg(test)]
mod tests {
    use super::*;

    const PAIRS: Columns<2> = Columns { noun: "pair", names: ["a", "b"], least: 2, defaults: [0.0; 2] };

    #[test]
    fn blocks_of_long_lines_end_by_bytes() {
        // 600 lines of nearly the longest: more than two blocks.
        let line = format!("1,2{}\n", " ".repeat(MOST_LINE as usize - 10));
        let text = line.repeat(600);
        let mut source = Source::new("text".into(), Box::new(io::Cursor::new(text.into_bytes())), &PAIRS).unwrap();
        let (mut rows, mut blocks, mut all) = (Vec::new(), 0, 0);
        loop {
            source.read(1 << 16, &mut rows).unwrap();
            assert!(source.buffer.len() < BLOCK_BYTES + MOST_LINE as usize);
            if rows.is_empty() {
                break;
            }
            assert!(rows.iter().all(|&row| row == [1.0, 2.0]));
            blocks += 1;
            all += rows.len();
        }
        assert_eq!((blocks, all), (3, 600));
    }
}
