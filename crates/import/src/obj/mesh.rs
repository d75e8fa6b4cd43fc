//! Faces to indexed triangles with one vertex for each (position, uv, normal) that occurs.

use std::collections::HashMap;
use std::path::Path;

use glam::{DVec3, Vec2, Vec3, Vec4};

use super::normals;
use super::parse::{Corner, Model, NONE};
use super::polygon::{Outcome, Triangulator};
use crate::scene::TriangleMesh;
use crate::{Report, srgb};

/// The triangles of all parts of a model.
pub(crate) struct Meshes {
    /// One for each of [`Model::parts`].
    pub(crate) parts: Vec<TriangleMesh>,
    /// Where in the model the origin of the meshes is.
    pub(crate) origin: DVec3,
}

/// Makes the meshes. Triangles keep the order of the faces within each part. `unit` is what [`Face::line`] counts.
///
/// [`Face::line`]: super::Face::line
pub(crate) fn build(model: &mut Model, file: &Path, unit: &str, report: &mut Report) -> Meshes {
    let face_normals = normals::complete(model);
    let colors = linear_colors(model, file, report);
    let mut builder = Builder {
        model,
        face_normals: &face_normals,
        colors: &colors,
        origin: origin(model),
        first: vec![NONE; model.positions.len()],
        triangulator: Triangulator::new(),
        degenerate: (0, 0),
        too_large: (0, 0),
    };
    let mut faces_of = vec![Vec::new(); model.parts.len()];
    for (f, face) in model.faces.iter().enumerate() {
        faces_of[face.part as usize].push(f);
    }
    let parts = faces_of.iter().map(|faces| builder.part(faces)).collect();
    let (degenerate, line) = builder.degenerate;
    if degenerate > 0 {
        report.warn(file, format!("{unit} {line}"), format!("{degenerate} faces without area"));
    }
    let (too_large, line) = builder.too_large;
    if too_large > 0 {
        let message = format!("{too_large} concave polygons with too many corners; cut into fans, which may be wrong");
        report.warn(file, format!("{unit} {line}"), message);
    }
    Meshes { parts, origin: builder.origin }
}

/// Zero, or the middle of a model that is far from its origin: there f32 would lose what f64 kept of the text.
///
/// Half the digits of f32 are enough for the place; 16 sizes away the other half is still finer than a pixel.
fn origin(model: &Model) -> DVec3 {
    let used = model.faces.iter().flat_map(|f| &model.corners[f.range()]);
    let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    for c in used {
        let p = DVec3::from(model.positions[c.position as usize]);
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

struct Builder<'a> {
    model: &'a Model,
    face_normals: &'a [DVec3],
    colors: &'a [Vec4],
    origin: DVec3,
    /// The first vertex that the current part has made of a position.
    first: Vec<u32>,
    triangulator: Triangulator,
    /// How many, and the line of the first.
    degenerate: (u64, u32),
    too_large: (u64, u32),
}

impl Builder<'_> {
    fn part(&mut self, faces: &[usize]) -> TriangleMesh {
        let smooth = faces.iter().any(|&f| self.is_smooth(f));
        let mut vertices: Vec<Corner> = Vec::new();
        // Most positions have one uv and one normal, and are found through `first`; the rest by hashing.
        let mut others: HashMap<Corner, u32> = HashMap::new();
        let mut triangles = Vec::new();
        let (mut points, mut indices, mut cut) = (Vec::new(), Vec::new(), Vec::new());
        for &f in faces {
            let face = self.model.faces[f];
            points.clear();
            indices.clear();
            cut.clear();
            for &corner in &self.model.corners[face.range()] {
                let normal = match corner.normal {
                    _ if !smooth => NONE,
                    // Past the end of the file's normals come those of the faces.
                    NONE => (self.model.normals.len() + f) as u32,
                    n => n,
                };
                let corner = Corner { normal, ..corner };
                points.push(DVec3::from(self.model.positions[corner.position as usize]));
                indices.push(self.vertex(corner, &mut vertices, &mut others));
            }
            match self.triangulator.triangulate(&points, &mut cut) {
                Outcome::Good => {}
                Outcome::Degenerate => tally(&mut self.degenerate, face.line),
                Outcome::TooLarge => tally(&mut self.too_large, face.line),
            }
            triangles.extend(cut.iter().map(|t| t.map(|i| indices[i as usize])));
        }
        for v in &vertices {
            self.first[v.position as usize] = NONE;
        }
        self.mesh(&vertices, triangles, smooth)
    }

    /// Whether a corner of the face has a normal that differs from the face's.
    fn is_smooth(&self, face: usize) -> bool {
        let own = self.face_normals[face].as_vec3();
        self.model.corners[self.model.faces[face].range()]
            .iter()
            .any(|c| c.normal != NONE && !(Vec3::from(self.model.normals[c.normal as usize]).dot(own) > 1.0 - 1e-6))
    }

    fn vertex(&mut self, corner: Corner, vertices: &mut Vec<Corner>, others: &mut HashMap<Corner, u32>) -> u32 {
        let next = vertices.len() as u32;
        let first = &mut self.first[corner.position as usize];
        let index = match *first {
            NONE => {
                *first = next;
                next
            }
            i if vertices[i as usize] == corner => i,
            _ => *others.entry(corner).or_insert(next),
        };
        if index == next {
            vertices.push(corner);
        }
        index
    }

    fn mesh(&self, vertices: &[Corner], triangles: Vec<[u32; 3]>, smooth: bool) -> TriangleMesh {
        let model = self.model;
        let position = |v: &Corner| (DVec3::from(model.positions[v.position as usize]) - self.origin).as_vec3();
        let normal = |v: &Corner| {
            let i = v.normal as usize;
            match model.normals.get(i) {
                Some(&n) => Vec3::from(n),
                None => self.face_normals[i - model.normals.len()].normalize_or(DVec3::Z).as_vec3(),
            }
        };
        // (0, 0) is at the lower left in OBJ, at the upper left in a scene.
        let uv = |v: &Corner| model.uvs.get(v.uv as usize).map_or(Vec2::ZERO, |&[u, v]| Vec2::new(u, 1.0 - v));
        let has_uvs = vertices.iter().any(|v| v.uv != NONE);
        TriangleMesh {
            positions: vertices.iter().map(position).collect(),
            triangles,
            normals: if smooth { vertices.iter().map(normal).collect() } else { Vec::new() },
            tangents: Vec::new(),
            uvs: if has_uvs { vec![vertices.iter().map(uv).collect()] } else { Vec::new() },
            colors: match self.colors {
                [] => Vec::new(),
                colors => vertices.iter().map(|v| colors[v.position as usize]).collect(),
            },
        }
    }
}

fn tally((count, first): &mut (u64, u32), line: u32) {
    if *count == 0 {
        *first = line;
    }
    *count += 1;
}
