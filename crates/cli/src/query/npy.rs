//! NumPy's file format, as far as tables of floats go: little and big endian, 32 and 64 bits, rows one after the other.

use std::io::{self, Read};

/// What a file begins with.
pub(super) const MAGIC: &[u8] = b"\x93NUMPY";

/// The longest header that is read; that of a table has about 100 bytes.
const MOST_HEADER: usize = 1 << 16;

/// Bytes before the rows of a file that is written: room for any number of rows.
const HEADER: usize = 128;

/// How a number is stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Item {
    bytes: usize,
    big_endian: bool,
}

/// The rest of a file that a header describes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Layout {
    item: Item,
    /// Rows.
    pub(super) rows: u64,
    /// Numbers in a row.
    pub(super) width: usize,
}

/// Why something is no table that can be read.
#[derive(Debug)]
pub(super) enum NpyError {
    Io(io::Error),
    Content(String),
}

impl From<io::Error> for NpyError {
    fn from(error: io::Error) -> Self {
        if error.kind() == io::ErrorKind::UnexpectedEof {
            return Self::Content("the file ends within the header".into());
        }
        Self::Io(error)
    }
}

fn content<T>(text: impl Into<String>) -> Result<T, NpyError> {
    Err(NpyError::Content(text.into()))
}

impl Layout {
    /// Reads a header, from the first byte of the file.
    pub(super) fn read(input: &mut impl Read) -> Result<Self, NpyError> {
        let mut start = [0; 8];
        input.read_exact(&mut start)?;
        if !start.starts_with(MAGIC) {
            return content("this is no .npy file");
        }
        let length = match start[6] {
            1 => {
                let mut length = [0; 2];
                input.read_exact(&mut length)?;
                u16::from_le_bytes(length).into()
            }
            2 | 3 => {
                let mut length = [0; 4];
                input.read_exact(&mut length)?;
                u32::from_le_bytes(length) as usize
            }
            version => return content(format!("version {version} of the .npy format is not known")),
        };
        if length > MOST_HEADER {
            return content(format!("its header has {length} bytes, more than the {MOST_HEADER} that are read"));
        }
        let mut header = vec![0; length];
        input.read_exact(&mut header)?;
        Self::parse(&String::from_utf8_lossy(&header))
    }

    /// From the text of a header, a dictionary in Python's notation.
    fn parse(header: &str) -> Result<Self, NpyError> {
        let value = |key: &str| {
            let quoted = [format!("'{key}'"), format!("\"{key}\"")];
            let rest = quoted.iter().find_map(|q| header.split_once(q.as_str()))?.1;
            Some(rest.trim_start().strip_prefix(':')?.trim_start())
        };
        let (Some(descr), Some(order), Some(shape)) = (value("descr"), value("fortran_order"), value("shape")) else {
            return content("its header does not say descr, fortran_order and shape");
        };
        let descr = match descr.strip_prefix(['\'', '"']) {
            Some(rest) => rest.split(['\'', '"']).next().unwrap_or_default(),
            None => return content("its elements are records; a table of numbers is needed"),
        };
        let item = match descr {
            "<f8" => Item { bytes: 8, big_endian: false },
            ">f8" => Item { bytes: 8, big_endian: true },
            "<f4" => Item { bytes: 4, big_endian: false },
            ">f4" => Item { bytes: 4, big_endian: true },
            other => return content(format!("its numbers are of type '{other}'; f4 or f8 is needed")),
        };
        if !order.starts_with("False") {
            return content("it is stored by columns; numpy.ascontiguousarray stores it by rows");
        }
        let Some((shape, _)) = shape.strip_prefix('(').and_then(|s| s.split_once(')')) else {
            return content("its header has no shape");
        };
        let sizes: Result<Vec<u64>, _> =
            shape.split(',').map(str::trim).filter(|s| !s.is_empty()).map(str::parse).collect();
        match sizes.as_deref() {
            Ok(&[rows, width @ 1..=64]) => Ok(Self { item, rows, width: width as usize }),
            _ => content(format!("its shape is ({shape}); rows of numbers are needed")),
        }
    }

    /// Bytes of a row.
    pub(super) fn row_bytes(self) -> usize {
        self.width * self.item.bytes
    }

    /// The numbers of a row.
    pub(super) fn numbers(self, row: &[u8]) -> impl Iterator<Item = f64> + '_ {
        let Item { bytes, big_endian } = self.item;
        row.chunks_exact(bytes).map(move |stored| {
            let mut number = [0; 8];
            number[..bytes].copy_from_slice(stored);
            if big_endian {
                number[..bytes].reverse();
            }
            let [a, b, c, d, ..] = number;
            if bytes == 4 { f32::from_le_bytes([a, b, c, d]).into() } else { f64::from_le_bytes(number) }
        })
    }
}

/// What stands before so many rows: little-endian 64-bit floats. It is equally long for any number of rows. One column
/// is a plain list.
pub(super) fn header(rows: u64, columns: usize) -> Vec<u8> {
    let shape = if columns == 1 { format!("({rows},)") } else { format!("({rows}, {columns})") };
    let text = format!("{{'descr': '<f8', 'fortran_order': False, 'shape': {shape}, }}");
    let length = HEADER - MAGIC.len() - 4;
    let mut out = [MAGIC, &[1, 0], &(length as u16).to_le_bytes()].concat();
    out.extend_from_slice(text.as_bytes());
    out.resize(HEADER - 1, b' ');
    out.push(b'\n');
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    fn file(version: u8, header: &str) -> Vec<u8> {
        let length = header.len() as u32;
        let length = if version == 1 { (length as u16).to_le_bytes().to_vec() } else { length.to_le_bytes().to_vec() };
        [MAGIC, &[version, 0], &length, header.as_bytes()].concat()
    }

    fn refused(bytes: &[u8]) -> String {
        match Layout::read(&mut &bytes[..]) {
            Err(NpyError::Content(text)) => text,
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn headers_of_every_version_are_read() {
        let header = "{'descr': '<f4', 'fortran_order': False, 'shape': (12, 6), }   \n";
        for version in 1..=3 {
            let layout = Layout::read(&mut &file(version, header)[..]).unwrap();
            assert_eq!((layout.rows, layout.width, layout.row_bytes()), (12, 6, 24));
        }
        let turned = "{\"shape\": (0,8), \"fortran_order\": False, \"descr\": \">f8\"}";
        let layout = Layout::read(&mut &file(1, turned)[..]).unwrap();
        assert_eq!((layout.rows, layout.width, layout.item.big_endian), (0, 8, true));
    }

    #[test]
    fn what_is_written_is_read() {
        for (rows, columns) in [(0, 10), (7, 11), (u64::MAX, 64)] {
            let bytes = header(rows, columns);
            assert_eq!(bytes.len(), HEADER);
            let layout = Layout::read(&mut &bytes[..]).unwrap();
            assert_eq!((layout.rows, layout.width), (rows, columns));
        }
        assert!(String::from_utf8_lossy(&header(5, 1)).contains("(5,)"));
    }

    #[test]
    fn numbers_of_every_type() {
        let numbers = [1.5, -0.0, f64::INFINITY];
        for (descr, bytes) in [
            ("<f8", numbers.map(f64::to_le_bytes).concat()),
            (">f8", numbers.map(f64::to_be_bytes).concat()),
            ("<f4", numbers.map(|x| (x as f32).to_le_bytes()).concat()),
            (">f4", numbers.map(|x| (x as f32).to_be_bytes()).concat()),
        ] {
            let header = format!("{{'descr': '{descr}', 'fortran_order': False, 'shape': (1, 3)}}");
            let layout = Layout::parse(&header).unwrap();
            assert_eq!(layout.row_bytes(), bytes.len());
            assert_eq!(layout.numbers(&bytes).collect::<Vec<_>>(), numbers, "{descr}");
        }
    }

    #[test]
    fn what_is_no_table_is_refused_by_name() {
        assert!(refused(b"\x93NUMP").contains("ends"));
        assert!(refused(b"PK\x03\x04zip!").contains("no .npy"));
        assert!(refused(&file(9, "")).contains("version 9"));
        assert!(refused(&[MAGIC, &[2, 0], &[255; 4]].concat()).contains("more than"));
        assert!(refused(&[MAGIC, &[1, 0], &[255, 0, b'{']].concat()).contains("ends"));
        for (header, word) in [
            ("", "does not say"),
            ("{'descr': '<i8', 'fortran_order': False, 'shape': (1, 6)}", "'<i8'"),
            ("{'descr': '|O', 'fortran_order': False, 'shape': (1, 6)}", "'|O'"),
            ("{'descr': [('a', '<f8')], 'fortran_order': False, 'shape': (1,)}", "records"),
            ("{'descr': '<f8', 'fortran_order': True, 'shape': (1, 6)}", "columns"),
            ("{'descr': '<f8', 'fortran_order': False, 'shape': (6,)}", "(6,)"),
            ("{'descr': '<f8', 'fortran_order': False, 'shape': (1, 2, 3)}", "(1, 2, 3)"),
            ("{'descr': '<f8', 'fortran_order': False, 'shape': (1, 65)}", "(1, 65)"),
            ("{'descr': '<f8', 'fortran_order': False, 'shape': (99999999999999999999, 6)}", "shape"),
            ("{'descr': '<f8', 'fortran_order': False, 'shape': (-1, 6)}", "(-1, 6)"),
            ("{'descr': '<f8', 'fortran_order': False, 'shape': 6}", "no shape"),
        ] {
            let text = refused(&file(1, header));
            assert!(text.contains(word), "{header}: {text}");
        }
    }
}
