//! Faces to indexed triangles with one vertex for each (position, uv, normal) that occurs.

use std::ops::Range;
use std::path::Path;

use glam::{DVec3, Vec2, Vec3, Vec4};

use super::model::{Corner, Model, NONE, VertexIndex};
use super::normals;
use super::polygon::{Outcome, Triangulator, area_vector};
use crate::scene::TriangleMesh;
use crate::{Report, srgb, unit};

/// The triangles of all parts of a model.
pub(crate) struct Meshes {
    /// One for each of [`Model::parts`].
    pub(crate) parts: Vec<TriangleMesh>,
    /// Where in the model the origin of the meshes is.
    pub(crate) origin: DVec3,
}

/// Makes the meshes. Triangles keep the order of the faces within each part. `unit` is what the lines of faces count.
/// The model's corners are gone afterwards.
pub(crate) fn build(model: &mut Model, file: &Path, unit: &str, report: &mut Report) -> Meshes {
    normals::complete(model);
    let colors = linear_colors(model, file, report);
    let mut faces_of: Vec<Vec<Range<usize>>> = vec![Vec::new(); model.parts.len()];
    for (faces, part, _) in model.faces.runs() {
        faces_of[part as usize].push(faces);
    }
    let mut builder = Builder {
        model,
        number_of: vec![NONE; model.vertices.len()],
        flat: None,
        triangulator: Triangulator::new(),
        degenerate: (0, 0),
        too_large: (0, 0),
    };
    let outlines: Vec<Outline> = faces_of.iter().map(|faces| builder.part(faces)).collect();
    let (degenerate, line) = builder.degenerate;
    if degenerate > 0 {
        report.warn(file, format!("{unit} {line}"), format!("{degenerate} faces without area"));
    }
    let (too_large, line) = builder.too_large;
    if too_large > 0 {
        let message = format!(
            "{too_large} concave polygons with too many corners, or the same ones again and again; cut into fans, which may be wrong"
        );
        report.warn(file, format!("{unit} {line}"), message);
    }
    drop(builder);
    let origin = origin(model, &outlines);
    let flat = face_normals(model, &outlines);
    // They make room for what the vertices have.
    model.corners = Vec::new();
    let attributes = Attributes { model, flat: &flat, colors: &colors, origin };
    Meshes { parts: outlines.into_iter().map(|outline| attributes.mesh(outline)).collect(), origin }
}

/// Zero, or the middle of a model that is far from its origin: there f32 would lose what f64 kept of the text.
///
/// Half the digits of f32 are enough for the place; 16 sizes away the other half is still finer than a pixel.
fn origin(model: &Model, outlines: &[Outline]) -> DVec3 {
    let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    for v in outlines.iter().flat_map(|outline| &outline.vertices) {
        let p = model.place(v.index);
        low = low.min(p);
        high = high.max(p);
    }
    let middle = 0.5 * (low + high);
    let far = middle.is_finite() && middle.abs().max_element() > 16.0 * (high - low).max_element();
    if far { middle.round() } else { DVec3::ZERO }
}

/// Colours are painted or photographed: sRGB, as Blender and MeshLab take them.
fn linear_colors(model: &Model, file: &Path, report: &mut Report) -> Vec<Vec4> {
    // A little above 1 is a bright colour, to be clamped.
    let bytes = model.colors.iter().flatten().any(|&c| c > 2.0);
    if bytes {
        report.warn(file, "", "vertex colours above 2 taken as 0 to 255");
    }
    let scale = if bytes { 1.0 / 255.0 } else { 1.0 };
    let linear = |c: f32| srgb::to_linear(f64::from((c * scale).clamp(0.0, 1.0))) as f32;
    model.colors.iter().map(|c| Vec3::from(c.map(linear)).extend(1.0)).collect()
}

/// What a mesh is made of, without what its vertices have.
struct Outline {
    vertices: Vec<Vertex>,
    triangles: Vec<[u32; 3]>,
    /// Whether the vertices have normals.
    smooth: bool,
}

/// A vertex of a mesh.
#[derive(Clone, Copy, PartialEq, Eq)]
struct Vertex {
    /// Index into [`Model::vertices`].
    index: u32,
    /// The face whose normal it has, or [`NONE`].
    face: u32,
}

struct Builder<'a> {
    model: &'a Model,
    /// The number that each of the model's vertices has in the mesh at hand.
    number_of: Vec<u32>,
    /// For each of the model's vertices the one that stands for all that differ from it only in their normal; made when
    /// it is needed.
    flat: Option<Vec<u32>>,
    triangulator: Triangulator,
    /// How many, and the line of the first.
    degenerate: (u64, u32),
    too_large: (u64, u32),
}

impl Builder<'_> {
    fn part(&mut self, runs: &[Range<usize>]) -> Outline {
        let model = self.model;
        let mut points = Vec::new();
        let smooth = runs.iter().cloned().flatten().any(|f| is_smooth(model, f, &mut points));
        if !smooth && !model.normals.is_empty() && self.flat.is_none() {
            self.flat = Some(without_normals(model));
        }
        let mut outline = Outline { vertices: Vec::new(), triangles: Vec::new(), smooth };
        outline.triangles.reserve_exact(runs.iter().map(ExactSizeIterator::len).sum());
        let (mut numbers, mut cut) = (Vec::new(), Vec::new());
        for f in runs.iter().cloned().flatten() {
            if let &[a, b, c] = model.corners_of(f) {
                let triangle = [a, b, c].map(|corner| self.number(corner, f, &mut outline));
                outline.triangles.push(triangle);
                let [a, b, c] = [a, b, c].map(|corner| model.place(corner));
                if area_vector(&[a, b, c]) == DVec3::ZERO {
                    tally(&mut self.degenerate, model.faces.line(f));
                }
                continue;
            }
            numbers.clear();
            cut.clear();
            for &corner in model.corners_of(f) {
                numbers.push(self.number(corner, f, &mut outline));
            }
            model.places(f, &mut points);
            match self.triangulator.triangulate(&points, &mut cut) {
                Outcome::Good => {}
                Outcome::Degenerate => tally(&mut self.degenerate, model.faces.line(f)),
                Outcome::TooLarge => tally(&mut self.too_large, model.faces.line(f)),
            }
            for t in &cut {
                outline.triangles.push(t.map(|i| numbers[i as usize]));
            }
        }
        for v in &outline.vertices {
            self.number_of[v.index as usize] = NONE;
        }
        outline
    }

    /// The number of a corner in the mesh.
    #[inline]
    fn number(&mut self, corner: u32, face: usize, outline: &mut Outline) -> u32 {
        let mut vertex = Vertex { index: corner, face: NONE };
        if !outline.smooth {
            if let Some(flat) = &self.flat {
                vertex.index = flat[corner as usize];
            }
        } else if self.model.vertices[corner as usize].normal == NONE {
            vertex.face = face as u32;
        }
        let number = &mut self.number_of[vertex.index as usize];
        // Of another face it has another normal.
        if *number == NONE || outline.vertices[*number as usize] != vertex {
            *number = outline.vertices.len() as u32;
            outline.vertices.push(vertex);
        }
        *number
    }
}

/// Whether a corner of the face has a normal that differs from the face's.
fn is_smooth(model: &Model, face: usize, places: &mut Vec<DVec3>) -> bool {
    let own = normals::of_face(model, face, places).as_vec3();
    model.corners_of(face).iter().any(|&corner| {
        let normal = model.vertices[corner as usize].normal;
        normal != NONE && !(Vec3::from(model.normals[normal as usize]).dot(own) > 1.0 - 1e-6)
    })
}

fn without_normals(model: &Model) -> Vec<u32> {
    let (mut index, mut flat) = (VertexIndex::default(), Vec::new());
    // The first vertex of each kind.
    let mut first = Vec::new();
    let mut stands_for = Vec::with_capacity(model.vertices.len());
    for (i, &vertex) in model.vertices.iter().enumerate() {
        let kind = index.add(Corner { normal: NONE, ..vertex }, model.positions.len(), &mut flat);
        if kind as usize == first.len() {
            first.push(i as u32);
        }
        stands_for.push(first[kind as usize]);
    }
    stands_for
}

/// The normals of the faces whose vertices have them, by the numbers of the faces.
fn face_normals(model: &Model, outlines: &[Outline]) -> Vec<(u32, Vec3)> {
    let mut faces: Vec<u32> =
        outlines.iter().flat_map(|outline| &outline.vertices).map(|v| v.face).filter(|&f| f != NONE).collect();
    faces.sort_unstable();
    faces.dedup();
    let mut places = Vec::new();
    faces
        .into_iter()
        .map(|f| (f, unit::double(normals::of_face(model, f as usize, &mut places)).unwrap_or(DVec3::Z).as_vec3()))
        .collect()
}

/// What gives the vertices of outlines all that they have.
struct Attributes<'a> {
    model: &'a Model,
    /// Normals of faces.
    flat: &'a [(u32, Vec3)],
    colors: &'a [Vec4],
    origin: DVec3,
}

impl Attributes<'_> {
    fn mesh(&self, outline: Outline) -> TriangleMesh {
        let Outline { vertices, triangles, smooth } = outline;
        let (model, flat) = (self.model, self.flat);
        let position = |v: &Vertex| (model.place(v.index) - self.origin).as_vec3();
        let corner = |v: &Vertex| model.vertices[v.index as usize];
        let normal = |v: &Vertex| match model.normals.get(corner(v).normal as usize) {
            Some(&n) => Vec3::from(n),
            None => flat.binary_search_by_key(&v.face, |(face, _)| *face).map_or(Vec3::Z, |at| flat[at].1),
        };
        // (0, 0) is at the lower left in OBJ, at the upper left in a scene.
        let uv = |v: &Vertex| model.uvs.get(corner(v).uv as usize).map_or(Vec2::ZERO, |&[u, v]| Vec2::new(u, 1.0 - v));
        let has_uvs = !model.uvs.is_empty() && vertices.iter().any(|v| corner(v).uv != NONE);
        TriangleMesh {
            positions: vertices.iter().map(position).collect(),
            triangles,
            normals: if smooth { vertices.iter().map(normal).collect() } else { Vec::new() },
            tangents: Vec::new(),
            uvs: if has_uvs { vec![vertices.iter().map(uv).collect()] } else { Vec::new() },
            colors: match self.colors {
                [] => Vec::new(),
                colors => vertices.iter().map(|v| colors[corner(v).position as usize]).collect(),
            },
            moves_to: None,
        }
    }
}

fn tally((count, first): &mut (u64, u32), line: u32) {
    if *count == 0 {
        *first = line;
    }
    *count += 1;
}
