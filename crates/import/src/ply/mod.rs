//! PLY, the polygon files of Stanford: ASCII, binary with the low or the high byte first, plain or compressed
//! (`.ply.zst`, `.ply.gz`).
//!
//! Source: Greg Turk, "The PLY Polygon File Format", 1994.
//!
//! | in the file | here |
//! |---|---|
//! | `vertex`: `x y z` | positions, in f64 until the mesh is placed (as with OBJ) |
//! | `nx ny nz` | normals; without them smooth across edges of less than 40 degrees |
//! | `red green blue` | vertex colours, sRGB: 0 to 255, 0 to 65535, or as floats 0 to 1 |
//! | `u v`, `s t`, `texture_u texture_v` | texture coordinates, v counted from below |
//! | `face`: a list `vertex_indices` or `vertex_index` | polygons of any number of corners, concave ones too |
//! | `tristrips`: the same, strips apart by -1 | triangles |
//! | other elements and properties | passed over |
//! | no faces | nothing to see: points are not drawn |

mod header;
mod values;

use std::path::Path;

use self::header::{Element, Encoding, Header};
use self::values::Values;
use crate::obj::model::{Corner, Model, NONE, Part};
use crate::{ErrorKind, ImportError, Imported, Limits, Options, Report, files, plain, unit};

/// Reads a PLY file.
///
/// ```
/// # let dir = tempfile::tempdir()?;
/// # let path = dir.path().join("triangle.ply");
/// std::fs::write(&path, "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n\
///     property float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n\
///     0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n")?;
/// let imported = firsthit_import::ply::read(&path, &Default::default())?;
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
    let header = Header::parse(bytes).map_err(|(line, cause)| {
        let place = if line == 0 { String::new() } else { format!("line {line}") };
        ImportError::invalid(path, place, cause)
    })?;
    let mut report = Report::default();
    let unit = if header.encoding == Encoding::Ascii { "line" } else { "face" };
    let values = Values::new(&bytes[header.body..], &header);
    let mut reader = Reader { path, limits: &options.limits, values, model: Model::default(), few: 0, vertices: false };
    for element in &header.elements {
        match element.name.as_str() {
            "vertex" => reader.vertices(element)?,
            "face" => reader.faces(element, false)?,
            "tristrips" => reader.faces(element, true)?,
            _ => reader.skip(element)?,
        }
    }
    let Reader { mut model, few, .. } = reader;
    if few > 0 {
        report.warn(path, "", format!("{few} faces with less than 3 corners left out"));
    }
    check_indices(&mut model, path, unit)?;
    if model.faces.len() > 0 {
        model.parts.push(Part::default());
    }
    Ok(plain::scene(model, path, unit, report))
}

/// Whether a file is PLY, by its first bytes.
pub(crate) fn is_ply(bytes: &[u8]) -> bool {
    bytes.starts_with(b"ply\n") || bytes.starts_with(b"ply\r")
}

/// What a property of a vertex is for.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Role {
    Position(usize),
    Normal(usize),
    Color(usize),
    Uv(usize),
}

impl Role {
    fn of(name: &str) -> Option<Self> {
        Some(match name {
            "x" => Self::Position(0),
            "y" => Self::Position(1),
            "z" => Self::Position(2),
            "nx" => Self::Normal(0),
            "ny" => Self::Normal(1),
            "nz" => Self::Normal(2),
            "red" | "r" | "diffuse_red" => Self::Color(0),
            "green" | "g" | "diffuse_green" => Self::Color(1),
            "blue" | "b" | "diffuse_blue" => Self::Color(2),
            "u" | "s" | "texture_u" => Self::Uv(0),
            "v" | "t" | "texture_v" => Self::Uv(1),
            _ => return None,
        })
    }
}

struct Reader<'a> {
    path: &'a Path,
    limits: &'a Limits,
    values: Values<'a>,
    model: Model,
    /// Faces with too few corners.
    few: u64,
    /// Whether the vertices have been read.
    vertices: bool,
}

impl Reader<'_> {
    fn invalid<T>(&self, cause: impl Into<String>) -> Result<T, ImportError> {
        Err(ImportError::invalid(self.path, self.values.place(), cause))
    }

    /// Checks a declared count against the limits and what is left of the file.
    fn check_count(&self, element: &Element) -> Result<(), ImportError> {
        let (count, name) = (element.count, &element.name);
        if count > self.limits.elements {
            let cause = format!("{count} elements '{name}' are more than the limit of {}", self.limits.elements);
            return Err(ImportError::new(self.path, "", ErrorKind::Limit(cause)));
        }
        let least = self.values.least(element);
        let left = self.values.left();
        if count.saturating_mul(least) > left {
            return self.invalid(format!(
                "{count} elements '{name}' of at least {least} bytes are declared, but {left} bytes follow"
            ));
        }
        Ok(())
    }

    fn vertices(&mut self, element: &Element) -> Result<(), ImportError> {
        if std::mem::replace(&mut self.vertices, true) {
            return self.invalid("a second element 'vertex'");
        }
        self.check_count(element)?;
        let roles: Vec<Option<Role>> =
            element.properties.iter().map(|p| Role::of(&p.name).filter(|_| p.list.is_none())).collect();
        let has = |role: Role| roles.contains(&Some(role));
        for (k, name) in ["x", "y", "z"].iter().enumerate() {
            if !has(Role::Position(k)) {
                return self.invalid(format!("the element 'vertex' has no property '{name}'"));
            }
        }
        let has_normals = (0..3).all(|k| has(Role::Normal(k)));
        let has_colors = (0..3).all(|k| has(Role::Color(k)));
        let has_uvs = (0..2).all(|k| has(Role::Uv(k)));
        let count = element.count as usize;
        self.model.positions.reserve_exact(count);
        for vertex in 0..count {
            let (mut position, mut normal, mut color, mut uv) = ([0.0; 3], [0.0; 3], [0.0; 3], [0.0; 2]);
            for (property, role) in element.properties.iter().zip(&roles) {
                if property.list.is_some() {
                    self.list(element, vertex, property)?;
                    continue;
                }
                let value = self.value(element, vertex, property, property.kind)?;
                match *role {
                    Some(Role::Position(k)) => position[k] = value,
                    Some(Role::Normal(k)) => normal[k] = value,
                    Some(Role::Color(k)) => color[k] = value / property.kind.white(),
                    Some(Role::Uv(k)) => uv[k] = value,
                    None => {}
                }
            }
            self.model.positions.push(position);
            if has_normals {
                let unit = unit::double(glam::DVec3::from(normal)).unwrap_or(glam::DVec3::ZERO);
                self.model.normals.push(unit.as_vec3().to_array());
            }
            if has_colors {
                self.model.colors.push(color.map(|c| if c.is_finite() { c as f32 } else { 1.0 }));
            }
            if has_uvs {
                self.model.uvs.push(uv.map(|x| x as f32));
            }
        }
        Ok(())
    }

    fn faces(&mut self, element: &Element, strips: bool) -> Result<(), ImportError> {
        self.check_count(element)?;
        let is_list = |name: &str| matches!(name, "vertex_indices" | "vertex_index");
        let Some(list) = element.properties.iter().position(|p| p.list.is_some() && is_list(&p.name)) else {
            return self.invalid(format!("the element '{}' has no list 'vertex_indices'", element.name));
        };
        for face in 0..element.count as usize {
            for (k, property) in element.properties.iter().enumerate() {
                if property.list.is_none() {
                    self.value(element, face, property, property.kind)?;
                } else if k != list {
                    self.list(element, face, property)?;
                } else {
                    let line = self.values.line().unwrap_or(face as u32);
                    let count = self.list_length(element, face, property)?;
                    let start = self.model.corners.len();
                    // Few bytes can say many numbers: before they are read.
                    self.check_corners((start as u64).saturating_add(count))?;
                    for _ in 0..count {
                        let index = self.value(element, face, property, property.kind)?;
                        let position = self.index(element, face, index, strips)?;
                        self.model.corners.push(position);
                    }
                    if strips { self.strip(start, line)? } else { self.polygon(start, line)? }
                }
            }
        }
        Ok(())
    }

    /// An index of a vertex, not yet checked to be in range; [`NONE`] where a strip ends.
    fn index(&self, element: &Element, number: usize, index: f64, strips: bool) -> Result<u32, ImportError> {
        if strips && index == -1.0 {
            return Ok(NONE);
        }
        if index < 0.0 || index >= f64::from(NONE) || index.fract() != 0.0 {
            return self.invalid(format!("{} {number}: {index} is no index of a vertex", element.name));
        }
        Ok(index as u32)
    }

    /// Makes a face of the corners from `start` on.
    fn polygon(&mut self, start: usize, line: u32) -> Result<(), ImportError> {
        let len = self.model.corners.len() - start;
        if len < 3 {
            self.few += 1;
            self.model.corners.truncate(start);
            return Ok(());
        }
        self.check_corners(self.model.corners.len() as u64)?;
        self.model.faces.push(len as u32, line, 0, 0);
        Ok(())
    }

    /// A polygon of n corners makes n - 2 triangles; so whoever counts the corners counts both.
    fn check_corners(&self, count: u64) -> Result<(), ImportError> {
        // They are numbered by 32 bits.
        let limit = self.limits.elements.min(u64::from(NONE));
        if count > limit {
            let cause = format!("more than {limit} corners of faces");
            return Err(ImportError::new(self.path, self.values.place(), ErrorKind::Limit(cause)));
        }
        Ok(())
    }

    /// Makes triangles of the strips from corner `start` on.
    fn strip(&mut self, start: usize, line: u32) -> Result<(), ImportError> {
        let corners = self.model.corners.split_off(start);
        for strip in corners.split(|&c| c == NONE) {
            for (i, w) in strip.windows(3).enumerate() {
                let start = self.model.corners.len();
                let turned = if i % 2 == 0 { [w[0], w[1], w[2]] } else { [w[0], w[2], w[1]] };
                self.model.corners.extend(turned);
                self.polygon(start, line)?;
            }
        }
        Ok(())
    }

    fn skip(&mut self, element: &Element) -> Result<(), ImportError> {
        self.check_count(element)?;
        if element.properties.is_empty() {
            return Ok(());
        }
        for number in 0..element.count as usize {
            for property in &element.properties {
                if property.list.is_some() {
                    self.list(element, number, property)?;
                } else {
                    self.value(element, number, property, property.kind)?;
                }
            }
        }
        Ok(())
    }

    /// Passes over a list.
    fn list(&mut self, element: &Element, number: usize, property: &header::Property) -> Result<(), ImportError> {
        for _ in 0..self.list_length(element, number, property)? {
            self.value(element, number, property, property.kind)?;
        }
        Ok(())
    }

    fn list_length(
        &mut self,
        element: &Element,
        number: usize,
        property: &header::Property,
    ) -> Result<u64, ImportError> {
        let kind = property.list.unwrap_or(property.kind);
        let length = self.value(element, number, property, kind)?;
        let (most, name) = (self.values.left(), &property.name);
        if length < 0.0 || length.fract() != 0.0 || length > most as f64 {
            let element = &element.name;
            return self.invalid(format!("{element} {number}: a list '{name}' of {length}; {most} bytes follow"));
        }
        Ok(length as u64)
    }

    fn value(
        &mut self,
        element: &Element,
        number: usize,
        property: &header::Property,
        kind: header::Kind,
    ) -> Result<f64, ImportError> {
        self.values.next(kind).or_else(|found| {
            let (element, name) = (&element.name, &property.name);
            self.invalid(format!("{element} {number}: expected {} for '{name}', found {found}", kind.name()))
        })
    }
}

/// Checks that all corners are vertices, and makes a vertex of each position, with what the file gives it.
fn check_indices(model: &mut Model, path: &Path, unit: &str) -> Result<(), ImportError> {
    let count = model.positions.len();
    if let Some(at) = model.corners.iter().position(|&index| index as usize >= count) {
        let cause = format!("vertex {} does not exist: there are {count}", model.corners[at]);
        let line = model.faces.line(model.faces.of_corner(at));
        return Err(ImportError::invalid(path, format!("{unit} {line}"), cause));
    }
    model.vertices.reserve_exact(count);
    for position in 0..count as u32 {
        let normal = model.normals.get(position as usize).is_some_and(|n| *n != [0.0; 3]);
        let uv = model.uvs.get(position as usize).is_some_and(|uv| uv.iter().all(|x| x.is_finite()));
        let index = |there: bool| if there { position } else { NONE };
        model.vertices.push(Corner { position, uv: index(uv), normal: index(normal) });
    }
    Ok(())
}

#[cfg(test)]
mod tests;
