//! Points and lines as thin bodies of triangles: rays meet nothing that has no extent.

use std::f32::consts::TAU;

use glam::Vec3;
use gltf::json::mesh::Mode;

use super::bake::Influence;
use crate::scene::TriangleMesh;

/// How thick points and lines are drawn, in the units of their mesh; by default they are not.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Strokes {
    /// Radius of the ball at each point.
    pub points: Option<f32>,
    /// Radius of the rod along each line.
    pub lines: Option<f32>,
    /// Whether those without a radius are drawn thin: a 400th of the extent of all vertices of their primitive. They are
    /// left out, with a warning, from where the file has more than 10,000 of them.
    pub thin: bool,
}

impl Strokes {
    /// The radius for primitives of a kind.
    pub(super) fn radius(&self, mode: Mode) -> Option<f32> {
        match mode {
            Mode::Points => self.points,
            Mode::Lines | Mode::LineLoop | Mode::LineStrip => self.lines,
            Mode::Triangles | Mode::TriangleStrip | Mode::TriangleFan => None,
        }
    }
}

/// Most points and ends of lines of a file that are drawn though no radius is given: each body takes a hundred times the
/// memory of what it stands for.
pub(super) const MOST_THIN: u64 = 10_000;

/// The radius that is thin beside all of a primitive; `None` if it has no extent.
pub(super) fn thin_radius(positions: &[Vec3]) -> Option<f32> {
    let start = (Vec3::INFINITY, Vec3::NEG_INFINITY);
    let (low, high) = positions.iter().fold(start, |(low, high), &p| (low.min(p), high.max(p)));
    Some((high - low).length() / 400.0).filter(|r| r.is_normal())
}

/// Most vertices or triangles of the body of one point or line.
pub(super) const MOST_ELEMENTS: u64 = 4 * SIDES as u64;

/// Corners of a rod's ends.
const SIDES: u32 = 8;

/// The bodies of a primitive's points or lines. Each vertex has the colour, the texture coordinates and the joints of
/// the vertex of the file that it stands for; lines without length have no body.
pub(super) fn bodies(
    file: &TriangleMesh,
    influences: &[Vec<Influence>],
    mode: Mode,
    indices: &[u32],
    radius: f32,
) -> (TriangleMesh, Vec<Vec<Influence>>) {
    let mut bodies = Bodies { file, mesh: TriangleMesh::default(), origins: Vec::new(), radius };
    match mode {
        Mode::Points => indices.iter().for_each(|&v| bodies.ball(v)),
        Mode::Lines => indices.as_chunks::<2>().0.iter().for_each(|&line| bodies.rod(line)),
        _ => {
            indices.windows(2).for_each(|w| bodies.rod([w[0], w[1]]));
            // Between two vertices the way back is the way there.
            if let (Mode::LineLoop, [first, _, .., last]) = (mode, indices) {
                bodies.rod([*last, *first]);
            }
        }
    }
    let Bodies { mut mesh, origins, .. } = bodies;
    fn gather<T: Copy>(values: &[T], origins: &[u32]) -> Vec<T> {
        if values.is_empty() { Vec::new() } else { origins.iter().map(|&v| values[v as usize]).collect() }
    }
    mesh.colors = gather(&file.colors, &origins);
    mesh.uvs = file.uvs.iter().map(|set| gather(set, &origins)).collect();
    (mesh, influences.iter().map(|set| gather(set, &origins)).collect())
}

struct Bodies<'a> {
    file: &'a TriangleMesh,
    mesh: TriangleMesh,
    /// For each vertex the one of the file that it stands for.
    origins: Vec<u32>,
    radius: f32,
}

impl Bodies<'_> {
    /// An octahedron with each side cut into four.
    fn ball(&mut self, v: u32) {
        let first = self.mesh.positions.len() as u32;
        let corners = [Vec3::X, Vec3::Y, Vec3::Z, Vec3::NEG_X, Vec3::NEG_Y, Vec3::NEG_Z];
        corners.iter().for_each(|&c| self.vertex(v, c, c));
        // The middles of edges, by their ends; opposite corners share none.
        let mut middle = [[0; 6]; 6];
        let mut next = first + 6;
        for a in 0..6 {
            for b in a + 1..6 {
                if b != a + 3 {
                    let m = (corners[a] + corners[b]).normalize();
                    self.vertex(v, m, m);
                    (middle[a][b], middle[b][a]) = (next, next);
                    next += 1;
                }
            }
        }
        for x in [0, 3] {
            for y in [1, 4] {
                for z in [2, 5] {
                    // Counter-clockwise seen from outside: mirrored once for each negative corner.
                    let turned = (x + y + z) % 2 == 0;
                    let [a, b, c] = if turned { [x, z, y] } else { [x, y, z] };
                    let [ab, bc, ca] = [middle[a][b], middle[b][c], middle[c][a]];
                    let [a, b, c] = [a, b, c].map(|k| first + k as u32);
                    self.mesh.triangles.extend([[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]);
                }
            }
        }
    }

    /// A prism, smooth around, with flat ends.
    fn rod(&mut self, ends: [u32; 2]) {
        let [a, b] = ends.map(|v| self.file.positions[v as usize]);
        let Some(along) = (b - a).try_normalize() else { return };
        let (u, v) = along.any_orthonormal_pair();
        let first = self.mesh.positions.len() as u32;
        for (end, cap) in [(ends[0], -along), (ends[1], along)] {
            for k in 0..SIDES {
                let (sin, cos) = (TAU * k as f32 / SIDES as f32).sin_cos();
                let around = u * cos + v * sin;
                self.vertex(end, around, around);
                self.vertex(end, around, cap);
            }
        }
        // Smooth vertices are even, those of the ends odd.
        let at = |end: u32, k: u32| first + 2 * (end * SIDES + k % SIDES);
        for k in 0..SIDES {
            let [a, b, c, d] = [at(0, k), at(0, k + 1), at(1, k + 1), at(1, k)];
            self.mesh.triangles.extend([[a, b, c], [a, c, d]]);
        }
        for k in 1..SIDES - 1 {
            self.mesh.triangles.push([at(0, 0) + 1, at(0, k + 1) + 1, at(0, k) + 1]);
            self.mesh.triangles.push([at(1, 0) + 1, at(1, k) + 1, at(1, k + 1) + 1]);
        }
    }

    fn vertex(&mut self, v: u32, away: Vec3, normal: Vec3) {
        self.mesh.positions.push(self.file.positions[v as usize] + self.radius * away);
        self.mesh.normals.push(normal);
        self.origins.push(v);
    }
}

#[cfg(test)]
mod tests {
    use firsthit_geometry::mesh::MeshReport;
    use glam::Vec4;

    use super::*;

    fn made(mode: Mode, indices: &[u32]) -> TriangleMesh {
        let file = TriangleMesh {
            positions: vec![Vec3::ZERO, 5.0 * Vec3::X, 5.0 * Vec3::Y, 5.0 * Vec3::X],
            colors: (0..4).map(|k| Vec4::splat(k as f32)).collect(),
            ..TriangleMesh::default()
        };
        bodies(&file, &[], mode, indices, 0.1).0
    }

    /// Six times the volume, positive if triangles are counter-clockwise seen from outside.
    fn volume(mesh: &TriangleMesh) -> f32 {
        let corners = |t: &[u32; 3]| t.map(|v| mesh.positions[v as usize]);
        mesh.triangles.iter().map(corners).map(|[a, b, c]| a.dot(b.cross(c))).sum()
    }

    #[test]
    fn bodies_are_closed_and_face_outwards() {
        for (mode, indices, bodies) in [
            (Mode::Points, &[0, 2][..], 2),
            (Mode::Lines, &[0, 1, 0, 2][..], 2),
            (Mode::LineStrip, &[0, 1, 2][..], 2),
            (Mode::LineLoop, &[0, 1, 2][..], 3),
            (Mode::LineLoop, &[0, 1][..], 1),
        ] {
            let mesh = made(mode, indices);
            let (each, six) = if mode == Mode::Points { (32, 0.01) } else { (28, 0.5) };
            assert_eq!(mesh.triangles.len(), bodies * each);
            assert!(mesh.triangles.len().max(mesh.positions.len()) as u64 <= bodies as u64 * MOST_ELEMENTS);
            assert!(volume(&mesh) > six * 0.1 * bodies as f32, "{mode:?}: {}", volume(&mesh));
            assert_eq!(mesh.colors.len(), mesh.positions.len());
        }
        assert!(MeshReport::new(&made(Mode::Points, &[0]).positions, &made(Mode::Points, &[0]).triangles).is_closed());
        assert!(made(Mode::Lines, &[1, 3]).triangles.is_empty(), "no length");
    }
}
