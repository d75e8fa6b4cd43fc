//! Rows of answers as bytes, in each format.

use std::io::Write;

use clap::ValueEnum;

/// How rows are written.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Format {
    /// A line of names, then one line a row
    Csv,
    /// One JSON object a line
    Jsonl,
    /// A NumPy array
    Npy,
}

/// A value of a row.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Cell {
    Flag(bool),
    Whole(i64),
    Real(f64),
    Text(String),
}

/// What rows there are, and how they are written.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Table {
    pub(crate) columns: &'static [&'static str],
    pub(crate) format: Format,
}

/// Rows as bytes.
#[derive(Debug, Default)]
pub(crate) struct Rows {
    pub(crate) bytes: Vec<u8>,
    pub(crate) count: u64,
}

impl Table {
    /// What stands before the rows, if that does not depend on how many there are.
    pub(crate) fn head(&self) -> Option<String> {
        (self.format == Format::Csv).then(|| self.columns.join(",") + "\n")
    }

    /// Appends a row of as many cells as there are columns.
    pub(crate) fn push(&self, cells: &[Cell], rows: &mut Rows) {
        debug_assert_eq!(cells.len(), self.columns.len());
        rows.count += 1;
        let out = &mut rows.bytes;
        match self.format {
            Format::Csv => {
                for (i, cell) in cells.iter().enumerate() {
                    out.extend_from_slice(if i > 0 { b"," } else { b"" });
                    csv(cell, out);
                }
                out.push(b'\n');
            }
            Format::Jsonl => {
                for (i, (name, cell)) in self.columns.iter().zip(cells).enumerate() {
                    out.extend_from_slice(if i > 0 { b",\"" } else { b"{\"" });
                    out.extend_from_slice(name.as_bytes());
                    out.extend_from_slice(b"\":");
                    json(cell, out);
                }
                out.extend_from_slice(b"}\n");
            }
            Format::Npy => {
                for cell in cells {
                    out.extend_from_slice(&number(cell).to_le_bytes());
                }
            }
        }
    }
}

// Into memory nothing fails to be written. `{:?}` is the shortest text that reads back exactly, with an exponent where
// the digits would be many.

fn csv(cell: &Cell, out: &mut Vec<u8>) {
    let _ = match cell {
        Cell::Flag(flag) => write!(out, "{}", u8::from(*flag)),
        Cell::Whole(n) => write!(out, "{n}"),
        Cell::Real(x) => write!(out, "{x:?}"),
        Cell::Text(text) if text.contains([',', '"', '\n', '\r']) => write!(out, "\"{}\"", text.replace('"', "\"\"")),
        Cell::Text(text) => write!(out, "{text}"),
    };
}

fn json(cell: &Cell, out: &mut Vec<u8>) {
    let _ = match cell {
        Cell::Flag(flag) => write!(out, "{flag}"),
        Cell::Whole(n) => write!(out, "{n}"),
        Cell::Real(x) if x.is_finite() => write!(out, "{x:?}"),
        // JSON has no name for it.
        Cell::Real(_) => write!(out, "null"),
        Cell::Text(text) => write!(out, "{}", serde_json::Value::from(text.as_str())),
    };
}

fn number(cell: &Cell) -> f64 {
    match cell {
        Cell::Flag(flag) => f64::from(u8::from(*flag)),
        // Ids have 32 bits and rays are fewer than 2^53.
        Cell::Whole(n) => *n as f64,
        Cell::Real(x) => *x,
        // Tables with texts are not written as numbers.
        Cell::Text(_) => f64::NAN,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CELLS: [Cell; 4] = [Cell::Flag(true), Cell::Whole(-1), Cell::Real(f64::INFINITY), Cell::Real(0.1 + 0.2)];

    fn written(format: Format) -> Vec<u8> {
        let mut rows = Rows::default();
        let table = Table { columns: &["hit", "id", "t", "u"], format };
        table.push(&CELLS, &mut rows);
        assert_eq!(rows.count, 1);
        rows.bytes
    }

    #[test]
    fn a_row_is_the_same_in_every_format() {
        assert_eq!(written(Format::Csv), b"1,-1,inf,0.30000000000000004\n");
        assert_eq!(written(Format::Jsonl), b"{\"hit\":true,\"id\":-1,\"t\":null,\"u\":0.30000000000000004}\n");
        let numbers = [1.0, -1.0, f64::INFINITY, 0.1 + 0.2_f64];
        assert_eq!(written(Format::Npy), numbers.map(f64::to_le_bytes).concat());
    }

    #[test]
    fn texts_are_quoted_where_they_must_be() {
        for (text, as_csv, as_json) in
            [("a b", "a b", "\"a b\""), ("a,b", "\"a,b\"", "\"a,b\""), ("6\"\n", "\"6\"\"\n\"", "\"6\\\"\\n\"")]
        {
            let (mut a, mut b) = (Vec::new(), Vec::new());
            csv(&Cell::Text(text.into()), &mut a);
            json(&Cell::Text(text.into()), &mut b);
            assert_eq!([a, b].map(|x| String::from_utf8(x).unwrap()), [as_csv, as_json]);
        }
    }

    #[test]
    fn numbers_read_back_exactly() {
        for x in [1e300, -5e-324, 1e16, 123456789.125, f64::from(0.1_f32), f64::MAX] {
            let mut out = Vec::new();
            csv(&Cell::Real(x), &mut out);
            let text = String::from_utf8(out).unwrap();
            assert_eq!(text.parse(), Ok(x), "{text}");
            assert!(text.len() < 26, "{text}");
        }
    }
}
