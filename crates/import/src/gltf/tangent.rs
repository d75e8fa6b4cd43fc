//! Tangents by MikkTSpace, for normal textures on meshes that bring none (glTF 2.0 specification, section 3.7.2.1).

use bevy_mikktspace::{Geometry, TangentSpace};
use glam::{Affine2, Vec2, Vec3, Vec4};

use crate::scene::TriangleMesh;
use crate::unit;

/// Gives a mesh tangents for a texture. Vertices at which they differ between triangles are split.
///
/// `uvs` are the coordinates of the normal texture's set and `transform` its texture transform. A mesh without
/// normals gets flat ones, each triangle its own vertices.
pub(super) fn generate(mesh: &mut TriangleMesh, set: usize, transform: Affine2) {
    if mesh.uvs.get(set).is_none_or(Vec::is_empty) {
        return;
    }
    if mesh.normals.is_empty() {
        flatten(mesh);
    }
    let uvs = mesh.uvs[set].iter().map(|&uv| transform.transform_point2(uv)).collect();
    let mut corners = Corners { mesh, uvs, tangents: vec![None; 3 * mesh.triangles.len()] };
    // It can fail only on faces that are no triangles or on more than 2^32 of them.
    if bevy_mikktspace::generate_tangents(&mut corners).is_ok() {
        let tangents = corners.tangents;
        assign(mesh, &tangents);
    }
}

/// What MikkTSpace reads and writes.
struct Corners<'a> {
    mesh: &'a TriangleMesh,
    uvs: Vec<Vec2>,
    tangents: Vec<Option<Vec4>>,
}

impl Corners<'_> {
    fn vertex(&self, face: usize, corner: usize) -> usize {
        self.mesh.triangles[face][corner] as usize
    }
}

impl Geometry for Corners<'_> {
    fn num_faces(&self) -> usize {
        self.mesh.triangles.len()
    }

    fn num_vertices_of_face(&self, _: usize) -> usize {
        3
    }

    fn position(&self, face: usize, corner: usize) -> [f32; 3] {
        self.mesh.positions[self.vertex(face, corner)].into()
    }

    fn normal(&self, face: usize, corner: usize) -> [f32; 3] {
        self.mesh.normals[self.vertex(face, corner)].into()
    }

    fn tex_coord(&self, face: usize, corner: usize) -> [f32; 2] {
        self.uvs[self.vertex(face, corner)].into()
    }

    fn set_tangent(&mut self, space: Option<TangentSpace>, face: usize, corner: usize) {
        // v runs downwards in glTF but the bitangent upwards: hence the other sign.
        self.tangents[3 * face + corner] =
            space.map(|s| Vec4::from(s.tangent_encoded()) * Vec4::new(1.0, 1.0, 1.0, -1.0));
    }
}

/// Hands the corners' tangents to vertices: the first keeps the vertex, one that differs gets a copy of it.
fn assign(mesh: &mut TriangleMesh, tangents: &[Option<Vec4>]) {
    let originals = mesh.positions.len();
    mesh.tangents = vec![Vec4::ZERO; originals];
    // The copies of each vertex, as a list linked through the vertices.
    let mut next: Vec<u32> = vec![u32::MAX; originals];
    for (corner, tangent) in tangents.iter().enumerate() {
        let mut vertex = mesh.triangles[corner / 3][corner % 3] as usize;
        let tangent = tangent
            .filter(|t| t.is_finite() && t.truncate().length_squared() > 0.5)
            // Those of tiny or huge triangles come out longer or shorter.
            .and_then(|t| match t.truncate() {
                unit if unit.is_normalized() => Some(t),
                other => unit::single(other).map(|unit| unit.extend(t.w)),
            })
            .unwrap_or_else(|| mesh.normals[vertex].any_orthonormal_vector().extend(1.0));
        while mesh.tangents[vertex] != Vec4::ZERO && mesh.tangents[vertex] != tangent {
            if next[vertex] == u32::MAX {
                next[vertex] = mesh.positions.len() as u32;
                next.push(u32::MAX);
                copy_vertex(mesh, vertex);
            }
            vertex = next[vertex] as usize;
        }
        mesh.tangents[vertex] = tangent;
        mesh.triangles[corner / 3][corner % 3] = vertex as u32;
    }
}

fn copy_vertex(mesh: &mut TriangleMesh, vertex: usize) {
    fn again<T: Copy>(values: &mut Vec<T>, index: usize) {
        if let Some(&value) = values.get(index) {
            values.push(value);
        }
    }
    again(&mut mesh.positions, vertex);
    again(&mut mesh.normals, vertex);
    again(&mut mesh.colors, vertex);
    mesh.uvs.iter_mut().for_each(|set| again(set, vertex));
    mesh.tangents.push(Vec4::ZERO);
}

/// Gives each triangle vertices of its own, with its face's normal.
fn flatten(mesh: &mut TriangleMesh) {
    fn spread<T: Copy>(values: &mut Vec<T>, triangles: &[[u32; 3]]) {
        if !values.is_empty() {
            *values = triangles.as_flattened().iter().map(|&v| values[v as usize]).collect();
        }
    }
    let triangles = std::mem::take(&mut mesh.triangles);
    spread(&mut mesh.positions, &triangles);
    spread(&mut mesh.colors, &triangles);
    mesh.uvs.iter_mut().for_each(|set| spread(set, &triangles));
    let face = |p: &[Vec3]| unit::single((p[1] - p[0]).cross(p[2] - p[0])).unwrap_or(Vec3::Z);
    mesh.normals = mesh.positions.chunks_exact(3).flat_map(|p| [face(p); 3]).collect();
    mesh.triangles = (0..triangles.len() as u32).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A square in the plane z = 0 facing +Z, its texture upright, or mirrored from left to right.
    fn square(mirrored: bool) -> TriangleMesh {
        let corners = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)];
        let uv = |(x, y): (f32, f32)| Vec2::new(if mirrored { 1.0 - x } else { x }, 1.0 - y);
        TriangleMesh {
            positions: corners.map(|(x, y)| Vec3::new(x, y, 0.0)).to_vec(),
            triangles: vec![[0, 1, 2], [0, 2, 3]],
            normals: vec![Vec3::Z; 4],
            uvs: vec![corners.map(uv).to_vec()],
            ..TriangleMesh::default()
        }
    }

    #[test]
    fn tangents_follow_u_and_bitangents_run_up_the_image() {
        for (mirrored, tangent) in [(false, Vec3::X), (true, Vec3::NEG_X)] {
            let mut mesh = square(mirrored);
            generate(&mut mesh, 0, Affine2::IDENTITY);
            assert_eq!(mesh.tangents.len(), 4, "nothing to split");
            for (t, n) in mesh.tangents.iter().zip(&mesh.normals) {
                assert!((t.truncate() - tangent).length() < 1e-6);
                assert!((n.cross(t.truncate()) * t.w - Vec3::Y).length() < 1e-6);
            }
        }
    }

    #[test]
    fn vertices_between_mirrored_halves_are_split() {
        // Two squares that share an edge and mirror their texture at it.
        let mut mesh = square(false);
        mesh.positions.extend([Vec3::new(2.0, 0.0, 0.0), Vec3::new(2.0, 1.0, 0.0)]);
        mesh.uvs[0].extend([Vec2::new(0.0, 1.0), Vec2::new(0.0, 0.0)]);
        mesh.normals.extend([Vec3::Z; 2]);
        mesh.triangles.extend([[1, 4, 5], [1, 5, 2]]);
        let before = mesh.clone();
        generate(&mut mesh, 0, Affine2::IDENTITY);
        assert_eq!(mesh.positions.len(), 8);
        for (t, corners) in mesh.triangles.iter().enumerate() {
            let x = if t < 2 { Vec3::X } else { Vec3::NEG_X };
            for (k, &v) in corners.iter().enumerate() {
                let v = v as usize;
                assert_eq!(mesh.positions[v], before.positions[before.triangles[t][k] as usize]);
                assert!((mesh.tangents[v].truncate() - x).length() < 1e-6);
            }
        }
    }

    #[test]
    fn without_normals_triangles_get_flat_ones() {
        let mut mesh = square(false);
        mesh.normals.clear();
        generate(&mut mesh, 0, Affine2::IDENTITY);
        assert_eq!((mesh.positions.len(), mesh.normals), (6, vec![Vec3::Z; 6]));
        assert_eq!(mesh.uvs[0].len(), 6);
    }

    #[test]
    fn degenerate_triangles_get_some_tangent() {
        let mut mesh = square(false);
        mesh.uvs[0] = vec![Vec2::ZERO; 4];
        generate(&mut mesh, 0, Affine2::IDENTITY);
        for (t, n) in mesh.tangents.iter().zip(&mesh.normals) {
            assert!(t.is_finite() && (t.truncate().length() - 1.0).abs() < 1e-5 && t.truncate().dot(*n).abs() < 1e-5);
        }
    }
}
