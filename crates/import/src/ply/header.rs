//! The header of a PLY file: what elements there are, and of what they are made.

/// How numbers are written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Encoding {
    Ascii,
    LittleEndian,
    BigEndian,
}

/// A type of numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    F32,
    F64,
}

impl Kind {
    fn of(name: &str) -> Option<Self> {
        Some(match name {
            "char" | "int8" => Self::I8,
            "uchar" | "uint8" => Self::U8,
            "short" | "int16" => Self::I16,
            "ushort" | "uint16" => Self::U16,
            "int" | "int32" => Self::I32,
            "uint" | "uint32" => Self::U32,
            "float" | "float32" => Self::F32,
            "double" | "float64" => Self::F64,
            _ => return None,
        })
    }

    pub(super) fn name(self) -> &'static str {
        match self {
            Self::I8 => "a char",
            Self::U8 => "a uchar",
            Self::I16 => "a short",
            Self::U16 => "a ushort",
            Self::I32 => "an int",
            Self::U32 => "a uint",
            Self::F32 => "a float",
            Self::F64 => "a double",
        }
    }

    pub(super) fn bytes(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::F64 => 8,
        }
    }

    fn is_integer(self) -> bool {
        !matches!(self, Self::F32 | Self::F64)
    }

    /// The number that a full colour is written as.
    pub(super) fn white(self) -> f64 {
        match self {
            Self::U16 => 65535.0,
            Self::F32 | Self::F64 => 1.0,
            _ => 255.0,
        }
    }
}

#[derive(Debug)]
pub(super) struct Property {
    pub(super) name: String,
    /// For a list the type of its length.
    pub(super) list: Option<Kind>,
    pub(super) kind: Kind,
}

#[derive(Debug)]
pub(super) struct Element {
    pub(super) name: String,
    pub(super) count: u64,
    pub(super) properties: Vec<Property>,
}

#[derive(Debug)]
pub(super) struct Header {
    pub(super) encoding: Encoding,
    pub(super) elements: Vec<Element>,
    /// Where the numbers begin.
    pub(super) body: usize,
    /// How many lines the header has.
    pub(super) lines: u32,
}

impl Header {
    /// Reads the header.
    ///
    /// # Errors
    /// What is wrong, with the line, or 0 for the file as a whole.
    pub(super) fn parse(bytes: &[u8]) -> Result<Self, (u32, String)> {
        if !super::is_ply(bytes) {
            return Err((0, "no PLY file: its first line is not 'ply'".into()));
        }
        // The first line shows how lines end: a byte of the body after it may look like part of an end.
        let end: &[u8] = match &bytes[3..] {
            [b'\r', b'\n', ..] => b"\r\n",
            [b'\r', ..] => b"\r",
            _ => b"\n",
        };
        let (mut encoding, mut elements, mut at, mut number) = (None, Vec::<Element>::new(), 3 + end.len(), 1);
        loop {
            number += 1;
            let fault = |cause: String| Err((number, cause));
            let Some(length) = bytes[at..].windows(end.len()).position(|w| w == end) else {
                return fault("the header has no 'end_header'".into());
            };
            let line = String::from_utf8_lossy(&bytes[at..at + length]);
            at += length + end.len();
            let words: Vec<&str> = line.split_ascii_whitespace().collect();
            match words[..] {
                ["end_header"] => break,
                [] | ["comment" | "obj_info", ..] => {}
                ["format", name, version] => {
                    if version != "1.0" {
                        return fault(format!("version {version} of PLY is not read, only 1.0"));
                    }
                    encoding = Some(match name {
                        "ascii" => Encoding::Ascii,
                        "binary_little_endian" => Encoding::LittleEndian,
                        "binary_big_endian" => Encoding::BigEndian,
                        _ => {
                            let known = "ascii, binary_little_endian and binary_big_endian";
                            return fault(format!("the format '{name}' is none of {known}"));
                        }
                    });
                }
                ["element", name, count] => {
                    let Ok(count) = count.parse() else {
                        return fault(format!("expected how many '{name}' there are, found '{count}'"));
                    };
                    elements.push(Element { name: name.into(), count, properties: Vec::new() });
                }
                ["property", ref rest @ ..] => {
                    let kind = |name: &str| Kind::of(name).ok_or((number, format!("'{name}' is no type of PLY")));
                    let property = match *rest {
                        ["list", length, each, name] => {
                            let (length, each) = (kind(length)?, kind(each)?);
                            if !length.is_integer() {
                                return fault(format!("the length of the list '{name}' is {}", length.name()));
                            }
                            Property { name: name.into(), list: Some(length), kind: each }
                        }
                        [each, name] => Property { name: name.into(), list: None, kind: kind(each)? },
                        _ => return fault(format!("expected 'property TYPE NAME', found '{}'", shortened(&line))),
                    };
                    let Some(element) = elements.last_mut() else {
                        return fault("a property before any element".into());
                    };
                    element.properties.push(property);
                }
                _ => {
                    let known = "format, element, property, comment or end_header";
                    return fault(format!("expected {known}, found '{}'", shortened(&line)));
                }
            }
        }
        let Some(encoding) = encoding else { return Err((number, "the header says no format".into())) };
        Ok(Self { encoding, elements, body: at, lines: number })
    }
}

fn shortened(line: &str) -> String {
    line.chars().take(40).collect()
}
