//! What a file of polygons says, in flat arrays. A large scan should fit into little more than its mesh, so that what
//! mostly repeats itself is kept in short: triangles on one line after the other have neither a length nor a line.

use std::collections::HashMap;
use std::ops::Range;

use glam::DVec3;

/// No index.
pub(crate) const NONE: u32 = u32::MAX;

/// What an OBJ, PLY or STL file says, with absolute indices from 0, all of them in range.
#[derive(Debug, Default)]
pub(crate) struct Model {
    /// Vertex positions; those that a face uses are finite as f32.
    pub(crate) positions: Vec<[f64; 3]>,
    /// sRGB colours as written: empty, or one for each position.
    pub(crate) colors: Vec<[f32; 3]>,
    /// (0, 0) at the lower left.
    pub(crate) uvs: Vec<[f32; 2]>,
    /// Unit length.
    pub(crate) normals: Vec<[f32; 3]>,
    /// The corners that occur, each once; some of them may be of no face.
    pub(crate) vertices: Vec<Corner>,
    /// Index into `vertices` of the corners of all faces, one face after the other.
    pub(crate) corners: Vec<u32>,
    /// Polygons with at least three corners.
    pub(crate) faces: Faces,
    /// What the faces belong to, in the order of first use.
    pub(crate) parts: Vec<Part>,
    /// The arguments of `mtllib`, with their lines.
    pub(crate) libraries: Vec<(u32, String)>,
    /// The names that `usemtl` gives, in the order of first use, with their lines.
    pub(crate) materials: Vec<(u32, String)>,
    /// Whether there is any `s` statement.
    pub(crate) says_smoothing: bool,
}

/// A corner of a face: indices, or [`NONE`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) struct Corner {
    pub(crate) position: u32,
    pub(crate) uv: u32,
    pub(crate) normal: u32,
}

/// Faces of one object and group with one material.
#[derive(Clone, Debug, Default, PartialEq, Eq, Hash)]
pub(crate) struct Part {
    pub(crate) object: String,
    pub(crate) group: String,
    /// Index into [`Model::materials`].
    pub(crate) material: Option<u32>,
}

impl Model {
    /// The corners of a face.
    #[inline]
    pub(crate) fn corners_of(&self, face: usize) -> &[u32] {
        &self.corners[self.faces.range(face)]
    }

    /// Where a corner or vertex is, by its index into `vertices`.
    #[inline]
    pub(crate) fn place(&self, vertex: u32) -> DVec3 {
        self.positions[self.vertices[vertex as usize].position as usize].into()
    }

    /// The places of a face's corners.
    pub(crate) fn places(&self, face: usize, places: &mut Vec<DVec3>) {
        places.clear();
        for &corner in self.corners_of(face) {
            places.push(self.place(corner));
        }
    }
}

/// A polygon.
#[derive(Clone, Debug)]
pub(crate) struct Face {
    /// Its corners.
    pub(crate) corners: Range<usize>,
    pub(crate) line: u32,
    pub(crate) part: u32,
    /// 0: flat.
    pub(crate) smoothing: u32,
}

/// Polygons, one after the other.
#[derive(Debug, Default)]
pub(crate) struct Faces {
    count: u32,
    /// Where each ends in the corners; empty while all of them are triangles.
    ends: Vec<u32>,
    /// Runs of faces that stand on one line after the other: the first, and its line.
    lines: Vec<(u32, u32)>,
    /// Runs of faces of the same part and smoothing group.
    runs: Vec<Run>,
}

#[derive(Clone, Copy, Debug)]
struct Run {
    first: u32,
    part: u32,
    smoothing: u32,
}

impl Faces {
    pub(crate) fn len(&self) -> usize {
        self.count as usize
    }

    /// Adds a face of so many corners.
    pub(crate) fn push(&mut self, corners: u32, line: u32, part: u32, smoothing: u32) {
        let face = self.count;
        if corners != 3 && self.ends.is_empty() {
            self.ends.extend((1..=face).map(|n| 3 * n));
        }
        if corners != 3 || !self.ends.is_empty() {
            self.ends.push(self.ends.last().map_or(0, |&end| end) + corners);
        }
        if self.lines.last().is_none_or(|&(first, at)| u64::from(line) != u64::from(at) + u64::from(face - first)) {
            self.lines.push((face, line));
        }
        if self.runs.last().is_none_or(|run| (run.part, run.smoothing) != (part, smoothing)) {
            self.runs.push(Run { first: face, part, smoothing });
        }
        self.count += 1;
    }

    /// Which corners a face has.
    #[inline]
    pub(crate) fn range(&self, face: usize) -> Range<usize> {
        match self.ends.get(face) {
            None => 3 * face..3 * face + 3,
            Some(&end) => face.checked_sub(1).map_or(0, |before| self.ends[before] as usize)..end as usize,
        }
    }

    /// The face of a corner.
    pub(crate) fn of_corner(&self, corner: usize) -> usize {
        if self.ends.is_empty() { corner / 3 } else { self.ends.partition_point(|&end| end as usize <= corner) }
    }

    /// Where a face stands in the file.
    pub(crate) fn line(&self, face: usize) -> u32 {
        let face = face as u32;
        let run = self.lines.partition_point(|&(first, _)| first <= face) - 1;
        let (first, line) = self.lines[run];
        line + (face - first)
    }

    /// All that there is to say of a face.
    pub(crate) fn get(&self, face: usize) -> Face {
        let run = self.runs.partition_point(|run| run.first as usize <= face) - 1;
        let Run { part, smoothing, .. } = self.runs[run];
        Face { corners: self.range(face), line: self.line(face), part, smoothing }
    }

    /// The part of the last face.
    pub(crate) fn last_part(&self) -> Option<u32> {
        self.runs.last().map(|run| run.part)
    }

    /// Runs of faces with their part and smoothing group, which is 0 for flat ones.
    pub(crate) fn runs(&self) -> impl Iterator<Item = (Range<usize>, u32, u32)> {
        let ends = self.runs.iter().skip(1).map(|run| run.first).chain([self.count]);
        self.runs.iter().zip(ends).map(|(run, end)| (run.first as usize..end as usize, run.part, run.smoothing))
    }
}

/// Finds the vertex of a corner that came up before.
#[derive(Debug, Default)]
pub(crate) struct VertexIndex {
    /// The first vertex at each position.
    first: Vec<u32>,
    /// For each vertex the next one at the same position.
    next: Vec<u32>,
    /// The vertices of positions that have many, or that come later in the file.
    others: HashMap<Corner, u32>,
    /// Whether some came before their positions.
    ahead: bool,
}

/// So many vertices at a position are looked through one by one.
const FEW: u32 = 8;

impl VertexIndex {
    /// The index of a corner in `vertices`, where it is added if it is not there. `positions`: how many there are so
    /// far.
    #[inline]
    pub(crate) fn add(&mut self, corner: Corner, positions: usize, vertices: &mut Vec<Corner>) -> u32 {
        let position = corner.position as usize;
        if position >= self.first.len() {
            if position >= positions {
                self.ahead = true;
                return self.add_other(corner, vertices);
            }
            self.first.resize(positions, NONE);
        }
        let (mut last, mut at, mut seen) = (NONE, self.first[position], 0);
        while at != NONE {
            if vertices[at as usize] == corner {
                return at;
            }
            (last, at, seen) = (at, self.next[at as usize], seen + 1);
        }
        if seen >= FEW || self.ahead {
            return self.add_other(corner, vertices);
        }
        let new = self.push(corner, vertices);
        if last == NONE {
            self.first[position] = new;
        } else {
            self.next[last as usize] = new;
        }
        new
    }

    fn add_other(&mut self, corner: Corner, vertices: &mut Vec<Corner>) -> u32 {
        if let Some(&known) = self.others.get(&corner) {
            return known;
        }
        let new = self.push(corner, vertices);
        self.others.insert(corner, new);
        new
    }

    fn push(&mut self, corner: Corner, vertices: &mut Vec<Corner>) -> u32 {
        vertices.push(corner);
        self.next.push(NONE);
        (vertices.len() - 1) as u32
    }
}
