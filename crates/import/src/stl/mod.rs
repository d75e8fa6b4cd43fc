//! STL, the triangles of stereolithography: ASCII or binary, told apart by their content, plain or compressed
//! (`.stl.zst`, `.stl.gz`).
//!
//! Source: 3D Systems, "StereoLithography Interface Specification", 1989.
//!
//! Equal corners become one vertex. The normals in the file are not looked at: many programs write none, or wrong ones;
//! surfaces are smooth across edges of less than 40 degrees, as with OBJ files that say nothing about it. Several
//! solids of an ASCII file are several geometries of one mesh. Colours in the attribute bytes are not read.

use std::collections::HashMap;
use std::path::Path;

use crate::obj::model::{Corner, Model, NONE, Part};
use crate::obj::number;
use crate::{ErrorKind, ImportError, Imported, Limits, Options, Report, files, plain};

/// Bytes before the triangles of a binary file: a comment and their number.
const HEADER: usize = 84;
/// Bytes of a triangle: a normal, three corners, two bytes of attributes.
const TRIANGLE: usize = 50;

/// Reads an STL file.
///
/// ```
/// # let dir = tempfile::tempdir()?;
/// # let path = dir.path().join("triangle.stl");
/// std::fs::write(&path, "solid one\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\n\
///     endloop\nendfacet\nendsolid one\n")?;
/// let imported = firsthit_import::stl::read(&path, &Default::default())?;
/// assert_eq!(imported.report.triangles_all_scenes, 1);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// [`ImportError`] with the line or byte, what was found there and what was expected.
pub fn read(path: impl AsRef<Path>, options: &Options) -> Result<Imported, ImportError> {
    let path = path.as_ref();
    read_bytes(&files::read(path, &options.limits)?, path, options)
}

/// As [`read`], of bytes at hand, not compressed.
///
/// # Errors
/// As for [`read`].
pub fn read_bytes(bytes: &[u8], path: impl AsRef<Path>, options: &Options) -> Result<Imported, ImportError> {
    let path = path.as_ref();
    let mut report = Report::default();
    let mut builder =
        Builder { path, limits: &options.limits, model: Model::default(), triangles: 0, known: HashMap::new() };
    // Binary files may begin with "solid" as well; their length tells.
    let unit = if is_binary(bytes) || !is_ascii(bytes) {
        builder.binary(bytes, &mut report)?;
        "triangle"
    } else {
        builder.ascii(bytes)?;
        "line"
    };
    Ok(plain::scene(builder.model, path, unit, report))
}

/// Whether a file of these first bytes and this length is binary STL for certain.
pub(crate) fn is_binary_of(start: &[u8], length: u64) -> bool {
    let Some(count) = start.get(HEADER - 4..).and_then(|c| c.first_chunk()) else { return false };
    length == HEADER as u64 + TRIANGLE as u64 * u64::from(u32::from_le_bytes(*count))
}

fn is_binary(bytes: &[u8]) -> bool {
    is_binary_of(bytes, bytes.len() as u64)
}

/// Whether a file begins as an ASCII one.
pub(crate) fn is_ascii(bytes: &[u8]) -> bool {
    let rest = bytes.trim_ascii_start().strip_prefix(b"solid");
    rest.is_some_and(|rest| rest.first().is_none_or(u8::is_ascii_whitespace))
}

struct Builder<'a> {
    path: &'a Path,
    limits: &'a Limits,
    model: Model,
    triangles: u64,
    /// The vertex of each place, by the bits of its coordinates.
    known: HashMap<[u32; 3], u32>,
}

impl Builder<'_> {
    fn binary(&mut self, bytes: &[u8], report: &mut Report) -> Result<(), ImportError> {
        let Some((header, body)) = bytes.split_at_checked(HEADER) else {
            let cause = format!("{} bytes are neither a binary STL file, nor do they begin with 'solid'", bytes.len());
            return Err(ImportError::invalid(self.path, "", cause));
        };
        let count = header.last_chunk().map_or(0, |c| u32::from_le_bytes(*c)) as usize;
        let (triangles, rest) = body.as_chunks::<TRIANGLE>();
        if triangles.len() < count {
            let cause = format!("{count} triangles are declared, but the file ends in number {}", triangles.len());
            return Err(ImportError::invalid(self.path, format!("byte {}", bytes.len() - rest.len()), cause));
        }
        let after = body.len() - count * TRIANGLE;
        if after > 0 {
            report.warn(self.path, "", format!("{after} bytes after the last triangle passed over"));
        }
        self.check_room(count as u64)?;
        for (i, triangle) in triangles[..count].iter().enumerate() {
            let start = self.model.corners.len();
            for corner in triangle[12..48].as_chunks::<12>().0 {
                let coordinate = |k: usize| f32::from_le_bytes([0, 1, 2, 3].map(|b| corner[4 * k + b]));
                self.corner([0, 1, 2].map(coordinate));
            }
            self.face(start, i as u32)?;
        }
        self.part("");
        Ok(())
    }

    fn ascii(&mut self, bytes: &[u8]) -> Result<(), ImportError> {
        // The first corner of the loop that the line is in.
        let mut open = None;
        let mut name = String::new();
        for (i, line) in bytes.split(|&b| b == b'\n').enumerate() {
            let line_number = i as u32 + 1;
            let invalid = |cause: String| ImportError::invalid(self.path, format!("line {line_number}"), cause);
            let text = String::from_utf8_lossy(line);
            let words: Vec<&str> = text.split_ascii_whitespace().collect();
            // Some programs write the keywords in capitals.
            let keyword = words.first().map(|w| w.to_ascii_lowercase());
            match (keyword.as_deref(), words.get(1..).unwrap_or_default()) {
                (None, _) => {}
                (Some(word @ ("outer" | "facet" | "endfacet" | "solid" | "endsolid")), _) if open.is_some() => {
                    return Err(invalid(format!("expected vertex X Y Z or endloop, found '{word}' in a loop")));
                }
                (Some(word @ ("vertex" | "endloop")), _) if open.is_none() => {
                    return Err(invalid(format!("'{word}' outside of a loop; expected 'outer loop' before it")));
                }
                (Some("outer"), _) => open = Some(self.model.corners.len()),
                (Some("facet" | "endfacet"), _) => {}
                (Some("solid"), rest) => {
                    self.part(&name);
                    name = rest.join(" ");
                }
                (Some("endsolid"), _) => {
                    self.part(&name);
                    name.clear();
                }
                (Some("vertex"), &[x, y, z]) => {
                    let [Some(x), Some(y), Some(z)] = [x, y, z].map(|w| number(w.as_bytes())) else {
                        return Err(invalid(format!("expected three numbers, found '{}'", shortened(&text))));
                    };
                    self.corner([x, y, z].map(|x| x as f32));
                }
                (Some("endloop"), _) => {
                    let start = open.take().unwrap_or(self.model.corners.len());
                    let corners = self.model.corners.len() - start;
                    if corners < 3 {
                        return Err(invalid(format!("a loop of {corners} vertices; expected 3")));
                    }
                    self.face(start, line_number)?;
                }
                _ => {
                    let known = "solid, facet, outer loop, vertex X Y Z, endloop, endfacet or endsolid";
                    return Err(invalid(format!("expected {known}, found '{}'", shortened(&text))));
                }
            }
        }
        if open.is_some() {
            let cause = "the file ends in a loop without 'endloop'";
            return Err(ImportError::invalid(self.path, "", cause));
        }
        self.part(&name);
        Ok(())
    }

    /// Ends the solid of the faces since the last one.
    fn part(&mut self, name: &str) {
        let part = self.model.parts.len() as u32;
        if self.model.faces.last_part() == Some(part) {
            self.model.parts.push(Part { object: name.to_owned(), ..Part::default() });
        }
    }

    fn corner(&mut self, place: [f32; 3]) {
        // -0 and 0 are one place.
        let key = place.map(|x| (x + 0.0).to_bits());
        let next = self.model.positions.len() as u32;
        let position = *self.known.entry(key).or_insert(next);
        if position == next {
            self.model.positions.push(place.map(f64::from));
            self.model.vertices.push(Corner { position, uv: NONE, normal: NONE });
        }
        // A vertex for each position.
        self.model.corners.push(position);
    }

    /// Makes a face of the corners from `start` on, of which there are at least 3.
    fn face(&mut self, start: usize, line: u32) -> Result<(), ImportError> {
        let len = (self.model.corners.len() - start) as u32;
        self.triangles += u64::from(len.saturating_sub(2));
        self.check_room(self.triangles)?;
        let part = self.model.parts.len() as u32;
        self.model.faces.push(len, line, part, 0);
        Ok(())
    }

    fn check_room(&self, triangles: u64) -> Result<(), ImportError> {
        // Corners are numbered by 32 bits.
        let limit = self.limits.elements.min(u64::from(u32::MAX / 3));
        if triangles > limit {
            let cause = format!("{triangles} triangles are more than the limit of {limit}");
            return Err(ImportError::new(self.path, "", ErrorKind::Limit(cause)));
        }
        Ok(())
    }
}

fn shortened(line: &str) -> String {
    line.trim().chars().take(40).collect()
}

#[cfg(test)]
mod tests;
