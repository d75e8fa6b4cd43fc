//! The numbers of a PLY file, one after the other.

use super::header::{Element, Encoding, Header, Kind};

/// Reads numbers; all types of PLY fit into f64.
pub(super) struct Values<'a> {
    bytes: &'a [u8],
    at: usize,
    /// Where `bytes` begin in the file.
    start: usize,
    encoding: Encoding,
    line: u32,
}

impl<'a> Values<'a> {
    pub(super) fn new(bytes: &'a [u8], header: &Header) -> Self {
        Self { bytes, at: 0, start: header.body, encoding: header.encoding, line: header.lines + 1 }
    }

    /// Bytes that have not been read.
    pub(super) fn left(&self) -> u64 {
        (self.bytes.len() - self.at) as u64
    }

    /// The least bytes that an element can have.
    pub(super) fn least(&self, element: &Element) -> u64 {
        let of = |kind: Kind| if self.encoding == Encoding::Ascii { 1 } else { kind.bytes() as u64 };
        element.properties.iter().map(|p| of(p.list.unwrap_or(p.kind))).sum()
    }

    /// How errors name where the reader stands.
    pub(super) fn place(&self) -> String {
        match self.encoding {
            Encoding::Ascii => format!("line {}", self.line),
            _ => format!("byte {}", self.start + self.at),
        }
    }

    /// The line of the next number, where there are lines.
    pub(super) fn line(&mut self) -> Option<u32> {
        if self.encoding != Encoding::Ascii {
            return None;
        }
        self.pass_white_space();
        Some(self.line)
    }

    /// The next number.
    ///
    /// # Errors
    /// What was found instead.
    pub(super) fn next(&mut self, kind: Kind) -> Result<f64, String> {
        match self.encoding {
            Encoding::Ascii => self.word(),
            Encoding::LittleEndian => self.binary(kind, |bytes| bytes),
            Encoding::BigEndian => self.binary(kind, |mut bytes| {
                bytes[..kind.bytes()].reverse();
                bytes
            }),
        }
    }

    /// A number of which the low byte comes first after `order`.
    fn binary(&mut self, kind: Kind, order: impl Fn([u8; 8]) -> [u8; 8]) -> Result<f64, String> {
        let Some(found) = self.bytes.get(self.at..self.at + kind.bytes()) else {
            return Err("the end of the file".into());
        };
        self.at += kind.bytes();
        let mut bytes = [0; 8];
        bytes[..found.len()].copy_from_slice(found);
        let bytes = order(bytes);
        let [a, b, c, d, ..] = bytes;
        Ok(match kind {
            Kind::I8 => f64::from(a as i8),
            Kind::U8 => f64::from(a),
            Kind::I16 => f64::from(i16::from_le_bytes([a, b])),
            Kind::U16 => f64::from(u16::from_le_bytes([a, b])),
            Kind::I32 => f64::from(i32::from_le_bytes([a, b, c, d])),
            Kind::U32 => f64::from(u32::from_le_bytes([a, b, c, d])),
            Kind::F32 => f64::from(f32::from_le_bytes([a, b, c, d])),
            Kind::F64 => f64::from_le_bytes(bytes),
        })
    }

    fn pass_white_space(&mut self) {
        while let Some(byte) = self.bytes.get(self.at).filter(|b| b.is_ascii_whitespace()) {
            // Of the two bytes of Windows the second counts.
            let lone = *byte == b'\r' && self.bytes.get(self.at + 1) != Some(&b'\n');
            self.line += u32::from(*byte == b'\n' || lone);
            self.at += 1;
        }
    }

    fn word(&mut self) -> Result<f64, String> {
        self.pass_white_space();
        let rest = &self.bytes[self.at..];
        let word = &rest[..rest.iter().position(u8::is_ascii_whitespace).unwrap_or(rest.len())];
        if word.is_empty() {
            return Err("the end of the file".into());
        }
        let text = std::str::from_utf8(word).ok();
        let Some(value) = text.and_then(|t| t.parse::<f64>().ok()) else {
            let start = &word[..word.len().min(40)];
            return Err(format!("'{}'", String::from_utf8_lossy(start)));
        };
        self.at += word.len();
        Ok(value)
    }
}
