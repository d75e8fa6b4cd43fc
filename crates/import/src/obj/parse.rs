//! The statements of an OBJ file, read into flat arrays, and checked.

use std::collections::HashMap;
use std::path::Path;

use super::model::{Corner, Model, NONE, Part, VertexIndex};
use super::text::{Blocks, Lines, name, number, plain_number, split_keyword, words};
use crate::files::Input;
use crate::timing::{Stage, timed};
use crate::{ErrorKind, ImportError, Limits, Options, Report, unit};

/// How often something came up, and where first.
#[derive(Default)]
struct Tally {
    count: u64,
    line: u32,
}

impl Tally {
    fn add(&mut self, line: u32) {
        if self.count == 0 {
            self.line = line;
        }
        self.count += 1;
    }

    fn report(&self, report: &mut Report, file: &Path, message: impl FnOnce(u64) -> String) {
        if self.count > 0 {
            report.warn(file, place(self.line), message(self.count));
        }
    }
}

/// How errors and warnings name a line.
pub(super) fn place(line: u32) -> String {
    format!("line {line}")
}

/// Reads the statements of an OBJ file. `file` is for messages.
pub(super) fn parse(
    input: Input<'_>,
    file: &Path,
    options: &Options,
    report: &mut Report,
) -> Result<Model, ImportError> {
    let stages = options.stages.as_ref();
    let mut parser = Parser::new(file, &options.limits);
    let mut blocks = timed(stages, Stage::Read, || Blocks::new(input))?;
    let mut first = 1;
    while let Some(text) = timed(stages, Stage::Read, || blocks.next())? {
        first = timed(stages, Stage::Parse, || parser.lines(text, first))?;
    }
    parser.finish(report)
}

struct Parser<'a> {
    file: &'a Path,
    limits: &'a Limits,
    line: u32,
    model: Model,
    vertices: VertexIndex,
    /// The part of the next face; its index is looked up when the face comes.
    part: Part,
    part_index: Option<u32>,
    part_indices: HashMap<Part, u32>,
    material_indices: HashMap<String, u32>,
    smoothing: u32,
    known: u64,
    unknown: Tally,
    unknown_word: String,
    free_form: Tally,
    lines_and_points: Tally,
    too_few: Tally,
    bad_attribute: Tally,
}

impl<'a> Parser<'a> {
    fn new(file: &'a Path, limits: &'a Limits) -> Self {
        Self {
            file,
            limits,
            line: 0,
            model: Model::default(),
            vertices: VertexIndex::default(),
            part: Part::default(),
            part_index: None,
            part_indices: HashMap::new(),
            material_indices: HashMap::new(),
            smoothing: 0,
            known: 0,
            unknown: Tally::default(),
            unknown_word: String::new(),
            free_form: Tally::default(),
            lines_and_points: Tally::default(),
            too_few: Tally::default(),
            bad_attribute: Tally::default(),
        }
    }

    fn invalid(&self, cause: impl Into<String>) -> ImportError {
        ImportError::invalid(self.file, place(self.line), cause)
    }

    /// Reads lines from number `first` on, and returns the number after the last one.
    fn lines(&mut self, text: &[u8], first: u32) -> Result<u32, ImportError> {
        let mut lines = Lines::new(text, first);
        while let Some((number, line)) = lines.next() {
            self.line = number;
            self.statement(line)?;
        }
        Ok(lines.number())
    }

    fn statement(&mut self, line: &[u8]) -> Result<(), ImportError> {
        let (keyword, rest) = split_keyword(line);
        self.known += 1;
        match keyword {
            b"" => self.known -= 1,
            [b'#', ..] => self.known -= 1,
            b"v" => self.vertex(rest)?,
            b"vt" => self.texture_coordinate(rest)?,
            b"vn" => self.normal(rest)?,
            // `fo` is the older word for it.
            b"f" | b"fo" => self.face(rest)?,
            b"l" | b"p" => self.lines_and_points.add(self.line),
            b"o" => {
                self.part = Part { object: name(rest).into_owned(), group: String::new(), ..self.part };
                self.part_index = None;
            }
            b"g" => {
                self.part.group = name(rest).into_owned();
                self.part_index = None;
            }
            b"s" => {
                self.model.says_smoothing = true;
                self.smoothing = match words(rest).next() {
                    None | Some(b"off" | b"0") => 0,
                    Some(n) => name(n).parse().unwrap_or(1),
                };
            }
            b"usemtl" => self.use_material(&name(rest)),
            b"mtllib" => self.model.libraries.push((self.line, name(rest).into_owned())),
            b"vp" | b"cstype" | b"deg" | b"bmat" | b"step" | b"curv" | b"curv2" | b"surf" | b"parm" | b"trim"
            | b"hole" | b"scrv" | b"sp" | b"end" | b"con" | b"ctech" | b"stech" | b"bsp" | b"bzp" | b"cdc" | b"cdp"
            | b"res" => self.free_form.add(self.line),
            // How a modeller shows things; nothing that a picture depends on.
            b"mg" | b"bevel" | b"c_interp" | b"d_interp" | b"lod" | b"shadow_obj" | b"trace_obj" | b"maplib"
            | b"usemap" => {}
            _ => {
                self.known -= 1;
                if self.unknown.count == 0 {
                    self.unknown_word = name(&keyword[..keyword.len().min(32)]).into_owned();
                }
                self.unknown.add(self.line);
            }
        }
        Ok(())
    }

    /// Up to N numbers; how many there were.
    fn numbers<const N: usize>(&self, mut rest: &[u8]) -> Result<([f64; N], usize), ImportError> {
        let mut out = [0.0; N];
        let mut count = 0;
        while count < N {
            rest = rest.trim_ascii_start();
            if matches!(rest, [] | [b'#', ..]) {
                break;
            }
            (out[count], rest) = match plain_number(rest) {
                Some(found) => found,
                None => self.word_of_number(rest)?,
            };
            count += 1;
        }
        Ok((out, count))
    }

    /// A number however it is written, and what follows it.
    #[cold]
    fn word_of_number<'t>(&self, text: &'t [u8]) -> Result<(f64, &'t [u8]), ImportError> {
        let (word, rest) = split_keyword(text);
        let shown = || name(&word[..word.len().min(32)]).into_owned();
        let value = number(word).ok_or_else(|| self.invalid(format!("'{}' is not a number", shown())))?;
        Ok((value, rest))
    }

    fn vertex(&mut self, rest: &[u8]) -> Result<(), ImportError> {
        let ([x, y, z, r, g, b], count) = self.numbers::<6>(rest)?;
        if count < 3 {
            return Err(self.invalid(format!("a vertex needs 3 coordinates, here are {count}")));
        }
        let at = self.model.positions.len();
        self.check_count(at as u64 + 1, "vertices")?;
        self.model.positions.push([x, y, z]);
        // A fourth number is the weight of rational curves and surfaces; it has no meaning for polygons.
        if count == 6 {
            // White for the vertices before the first with a colour.
            self.model.colors.resize(at, [1.0; 3]);
            self.model.colors.push([r, g, b].map(|c| if c.is_finite() { c as f32 } else { 1.0 }));
        } else if !self.model.colors.is_empty() {
            self.model.colors.push([1.0; 3]);
        }
        Ok(())
    }

    fn texture_coordinate(&mut self, rest: &[u8]) -> Result<(), ImportError> {
        let ([u, v], count) = self.numbers::<2>(rest)?;
        if count == 0 {
            return Err(self.invalid("a texture coordinate needs at least 1 number"));
        }
        self.check_count(self.model.uvs.len() as u64 + 1, "texture coordinates")?;
        let uv = [u as f32, v as f32];
        if !uv.iter().all(|x| x.is_finite()) {
            self.bad_attribute.add(self.line);
        }
        self.model.uvs.push(uv);
        Ok(())
    }

    fn normal(&mut self, rest: &[u8]) -> Result<(), ImportError> {
        let (n, count) = self.numbers::<3>(rest)?;
        if count < 3 {
            return Err(self.invalid(format!("a normal needs 3 numbers, here are {count}")));
        }
        self.check_count(self.model.normals.len() as u64 + 1, "normals")?;
        let unit = unit::double(glam::DVec3::from_array(n));
        if unit.is_none() {
            self.bad_attribute.add(self.line);
        }
        self.model.normals.push(unit.map_or([f32::NAN; 3], |n| n.as_vec3().to_array()));
        Ok(())
    }

    fn check_count(&self, count: u64, what: &str) -> Result<(), ImportError> {
        if count <= self.limits.elements && count < u64::from(NONE) {
            return Ok(());
        }
        let kind = ErrorKind::Limit(format!("more than {} {what}", self.limits.elements));
        Err(ImportError::new(self.file, place(self.line), kind))
    }

    fn face(&mut self, mut rest: &[u8]) -> Result<(), ImportError> {
        let start = self.model.corners.len();
        loop {
            rest = rest.trim_ascii_start();
            if matches!(rest, [] | [b'#', ..]) {
                break;
            }
            let (indices, after) = match plain_corner(rest) {
                Some(found) => found,
                None => {
                    let (word, after) = split_keyword(rest);
                    (self.written_corner(word)?, after)
                }
            };
            let corner = self.corner(indices)?;
            let vertex = self.vertices.add(corner, self.model.positions.len(), &mut self.model.vertices);
            self.model.corners.push(vertex);
            rest = after;
        }
        let len = self.model.corners.len() - start;
        if len < 3 {
            self.model.corners.truncate(start);
            self.too_few.add(self.line);
            return Ok(());
        }
        // A polygon of n corners makes at most n - 2 triangles.
        self.check_count(self.model.corners.len() as u64, "corners of faces")?;
        let part = match self.part_index {
            Some(i) => i,
            None => {
                let next = self.model.parts.len() as u32;
                let i = *self.part_indices.entry(self.part.clone()).or_insert(next);
                if i == next {
                    self.model.parts.push(self.part.clone());
                }
                *self.part_index.insert(i)
            }
        };
        self.model.faces.push(len as u32, self.line, part, self.smoothing);
        Ok(())
    }

    /// `v`, `v/vt`, `v//vn` or `v/vt/vn`.
    fn written_corner(&self, word: &[u8]) -> Result<Indices, ImportError> {
        let mut fields = word.split(|&b| b == b'/').map(|field| {
            let Some((&first, digits)) = field.split_first() else { return Some(None) };
            let (negative, digits) = match first {
                b'-' => (true, digits),
                b'+' => (false, digits),
                _ => (false, field),
            };
            let mut value = 0_i64;
            for d in digits {
                if !d.is_ascii_digit() {
                    return None;
                }
                value = value.saturating_mul(10).saturating_add(i64::from(d - b'0'));
            }
            (!digits.is_empty()).then_some(Some(if negative { -value } else { value }))
        });
        let v = fields.next().flatten();
        let (uv, normal) = (fields.next().unwrap_or(Some(None)), fields.next().unwrap_or(Some(None)));
        match (v, uv, normal, fields.next()) {
            (Some(Some(v)), Some(uv), Some(normal), None) => Ok([Some(v), uv, normal]),
            _ => {
                let shown = name(&word[..word.len().min(32)]).into_owned();
                Err(self.invalid(format!("'{shown}' is not a corner of a face (v, v/vt, v//vn or v/vt/vn)")))
            }
        }
    }

    /// The corner of such indices.
    #[inline]
    fn corner(&mut self, [v, uv, normal]: Indices) -> Result<Corner, ImportError> {
        // Negative indices count back from the statement; positive ones may also point forward.
        let absolute = |i: i64, count: usize| {
            let i = if i < 0 { i.saturating_add(count as i64) } else { i - 1 };
            u32::try_from(i).ok().filter(|&i| i != NONE)
        };
        let v = v.unwrap_or(0);
        let position = absolute(v, self.model.positions.len()).ok_or_else(|| self.no_vertex(v))?;
        let mut optional = |i: Option<i64>, count: usize| match i.map(|i| absolute(i, count)) {
            None => NONE,
            Some(Some(i)) => i,
            Some(None) => {
                self.bad_attribute.add(self.line);
                NONE
            }
        };
        let uv = optional(uv, self.model.uvs.len());
        let normal = optional(normal, self.model.normals.len());
        Ok(Corner { position, uv, normal })
    }

    fn no_vertex(&self, index: i64) -> ImportError {
        let so_far = if index < 0 { " so far" } else { "" };
        self.invalid(format!("vertex {index} does not exist; the file has {}{so_far}", self.model.positions.len()))
    }

    fn use_material(&mut self, name: &str) {
        let index = match self.material_indices.get(name) {
            Some(&i) => i,
            None => {
                let i = self.model.materials.len() as u32;
                self.model.materials.push((self.line, name.to_owned()));
                self.material_indices.insert(name.to_owned(), i);
                i
            }
        };
        self.part.material = Some(index);
        self.part_index = None;
    }

    /// Checks what could not be checked before all was read, and reports.
    fn finish(mut self, report: &mut Report) -> Result<Model, ImportError> {
        if self.known == 0 {
            let cause = "no OBJ statement in it: the file is empty, or of another format";
            return Err(ImportError::invalid(self.file, "", cause));
        }
        if !self.model.colors.is_empty() {
            self.model.colors.resize(self.model.positions.len(), [1.0; 3]);
        }
        let mut not_finite = Tally::default();
        if !self.model.vertices.iter().all(|&v| self.is_good(v)) {
            self.mend(&mut not_finite)?;
        }
        self.vertices = VertexIndex::default();

        let file = self.file;
        let word = &self.unknown_word;
        self.unknown.report(report, file, |n| format!("unknown statement '{word}' passed over; {n} lines are unknown"));
        self.free_form.report(report, file, |n| format!("curves and free-form surfaces are not read ({n} lines)"));
        self.lines_and_points.report(report, file, |n| format!("lines and points are not rendered ({n} of them)"));
        self.too_few.report(report, file, |n| format!("{n} faces with less than 3 corners left out"));
        not_finite.report(report, file, |n| {
            format!("{n} faces left out, because a vertex of theirs is infinite or not a number")
        });
        self.bad_attribute.report(report, file, |n| {
            format!("{n} texture coordinates or normals do not exist or are not finite; done without them")
        });
        Ok(self.model)
    }

    fn has_finite_position(&self, corner: Corner) -> Option<bool> {
        let place = self.model.positions.get(corner.position as usize)?;
        Some(place.iter().all(|x| x.abs() <= f64::from(f32::MAX)))
    }

    fn has_good_uv(&self, corner: Corner) -> bool {
        let uv = self.model.uvs.get(corner.uv as usize);
        corner.uv == NONE || uv.is_some_and(|uv| uv.iter().all(|x| x.is_finite()))
    }

    fn has_good_normal(&self, corner: Corner) -> bool {
        let normal = self.model.normals.get(corner.normal as usize);
        corner.normal == NONE || normal.is_some_and(|n| n.iter().all(|x| x.is_finite()))
    }

    fn is_good(&self, corner: Corner) -> bool {
        self.has_finite_position(corner) == Some(true) && self.has_good_uv(corner) && self.has_good_normal(corner)
    }

    /// Reads the faces once more: those with a vertex that is not finite are left out, and so are texture coordinates
    /// and normals that do not exist.
    fn mend(&mut self, not_finite: &mut Tally) -> Result<(), ImportError> {
        let faces = std::mem::take(&mut self.model.faces);
        let corners = std::mem::take(&mut self.model.corners);
        let vertices = std::mem::take(&mut self.model.vertices);
        let mut index = VertexIndex::default();
        let mut kept = Vec::new();
        for face in (0..faces.len()).map(|f| faces.get(f)) {
            self.line = face.line;
            kept.clear();
            for &vertex in &corners[face.corners.clone()] {
                let mut corner = vertices[vertex as usize];
                match self.has_finite_position(corner) {
                    None => return Err(self.no_vertex(i64::from(corner.position) + 1)),
                    Some(true) => {}
                    Some(false) => {
                        not_finite.add(face.line);
                        kept.clear();
                        break;
                    }
                }
                if !self.has_good_uv(corner) {
                    self.bad_attribute.add(face.line);
                    corner.uv = NONE;
                }
                if !self.has_good_normal(corner) {
                    self.bad_attribute.add(face.line);
                    corner.normal = NONE;
                }
                kept.push(corner);
            }
            if kept.is_empty() {
                continue;
            }
            for &corner in &kept {
                let vertex = index.add(corner, self.model.positions.len(), &mut self.model.vertices);
                self.model.corners.push(vertex);
            }
            self.model.faces.push(kept.len() as u32, face.line, face.part, face.smoothing);
        }
        Ok(())
    }
}

/// The indices of a corner as they are written, from 1 or counted back: of position, texture coordinates and normal.
type Indices = [Option<i64>; 3];

/// The corner that a text begins with, if it is written plainly, and what follows it.
#[inline]
fn plain_corner(text: &[u8]) -> Option<(Indices, &[u8])> {
    let mut indices = [None; 3];
    let mut at = 0;
    for (field, index) in indices.iter_mut().enumerate() {
        let negative = text.get(at) == Some(&b'-');
        at += usize::from(negative);
        let (start, mut value) = (at, 0_i64);
        while let Some(digit) = text.get(at).map(|b| b.wrapping_sub(b'0')).filter(|d| *d < 10) {
            value = 10 * value + i64::from(digit);
            at += 1;
            // Ten digits are more than there can be vertices.
            if at - start > 10 {
                return None;
            }
        }
        match (at - start, negative) {
            (0, true) => return None,
            (0, false) if field == 0 => return None,
            (0, false) => {}
            (_, true) => *index = Some(-value),
            (_, false) => *index = Some(value),
        }
        match text.get(at) {
            None => return Some((indices, &[])),
            Some(b'/') => at += 1,
            Some(b) if b.is_ascii_whitespace() => return Some((indices, &text[at..])),
            Some(_) => return None,
        }
    }
    None
}
