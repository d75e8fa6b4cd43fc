//! What an indexed triangle mesh is like: finite, degenerate, closed, manifold, oriented.

use std::collections::HashMap;

use glam::Vec3;

/// A look at an indexed triangle mesh.
///
/// Vertices count as one if their positions are equal (-0 equals 0), whatever their index: files split vertices where
/// normals or texture coordinates differ. Triangles whose indices are out of range, or of which two corners coincide,
/// have no edges of their own and are left out where edges are counted.
///
/// ```
/// use firsthit_geometry::mesh::MeshReport;
/// use glam::Vec3;
///
/// let tetrahedron = [Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::Z];
/// let report = MeshReport::new(&tetrahedron, &[[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]);
/// assert!(report.is_closed() && report.is_manifold() && report.is_oriented());
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct MeshReport {
    /// Triangles in all.
    pub triangles: u64,
    /// Vertices that are NaN or infinite.
    pub not_finite: u64,
    /// Triangles that name a vertex that is not there.
    pub out_of_range: u64,
    /// Triangles without area: corners coincide, or lie on one line.
    pub degenerate: u64,
    /// Edges between different positions.
    pub edges: u64,
    /// Edges with an odd number of triangles: where the surface ends.
    pub boundary_edges: u64,
    /// Edges with more than two triangles.
    pub crowded_edges: u64,
    /// Edges that are not run through equally often in both directions, among those with an even number of triangles:
    /// neighbours there disagree about what is outside.
    pub disoriented_edges: u64,
}

impl MeshReport {
    /// Looks at a mesh, in O(n log n).
    #[must_use]
    pub fn new(positions: &[Vec3], triangles: &[[u32; 3]]) -> Self {
        let mut report = Self {
            triangles: triangles.len() as u64,
            not_finite: positions.iter().filter(|p| !p.is_finite()).count() as u64,
            ..Self::default()
        };
        let first_equal = first_equal(positions);
        // Ends in ascending order, and whether the triangle runs from the lower to the higher.
        let mut edges: Vec<([u32; 2], bool)> = Vec::with_capacity(3 * triangles.len());
        for triangle in triangles {
            let Some([a, b, c]) = corners(triangle, &first_equal) else {
                report.out_of_range += 1;
                continue;
            };
            let [p, q, r] = [a, b, c].map(|i| positions[i as usize].as_dvec3());
            report.degenerate += u64::from((q - p).cross(r - p) == glam::DVec3::ZERO);
            if a != b && b != c && c != a {
                edges.extend([(a, b), (b, c), (c, a)].map(|(u, v)| ([u.min(v), u.max(v)], u < v)));
            }
        }
        edges.sort_unstable();
        for same in edges.chunk_by(|x, y| x.0 == y.0) {
            let upward = same.iter().filter(|(_, up)| *up).count();
            let odd = same.len() % 2 == 1;
            report.edges += 1;
            report.boundary_edges += u64::from(odd);
            report.crowded_edges += u64::from(same.len() > 2);
            report.disoriented_edges += u64::from(!odd && 2 * upward != same.len());
        }
        report
    }

    /// Whether the surface encloses space: it has edges, and each has an even number of triangles. Then the number of
    /// crossings of a ray from a point to infinity tells inside from outside.
    #[must_use]
    pub fn is_closed(&self) -> bool {
        self.edges > 0 && self.boundary_edges == 0
    }

    /// Whether no edge has more than two triangles.
    #[must_use]
    pub fn is_manifold(&self) -> bool {
        self.crowded_edges == 0
    }

    /// Whether neighbours agree about what is outside.
    #[must_use]
    pub fn is_oriented(&self) -> bool {
        self.disoriented_edges == 0
    }
}

/// For each vertex the first one at the same position.
fn first_equal(positions: &[Vec3]) -> Vec<u32> {
    let mut seen = HashMap::with_capacity(positions.len());
    let bits = |p: &Vec3| p.to_array().map(|x| (x + 0.0).to_bits());
    positions.iter().zip(0..).map(|(p, i)| *seen.entry(bits(p)).or_insert(i)).collect()
}

fn corners(triangle: &[u32; 3], first_equal: &[u32]) -> Option<[u32; 3]> {
    let [a, b, c] = triangle.map(|i| first_equal.get(i as usize).copied());
    Some([a?, b?, c?])
}

#[cfg(test)]
mod tests {
    use super::*;

    const CUBE: [[u32; 3]; 12] = [
        [0, 2, 1],
        [1, 2, 3],
        [4, 5, 6],
        [5, 7, 6],
        [0, 1, 4],
        [1, 5, 4],
        [2, 6, 3],
        [3, 6, 7],
        [0, 4, 2],
        [2, 4, 6],
        [1, 3, 5],
        [3, 7, 5],
    ];

    fn corner(i: u32) -> Vec3 {
        Vec3::new((i & 1) as f32, (i >> 1 & 1) as f32, (i >> 2) as f32)
    }

    fn cube() -> Vec<Vec3> {
        (0..8).map(corner).collect()
    }

    #[test]
    fn a_cube_is_closed_also_as_loose_triangles() {
        let report = MeshReport::new(&cube(), &CUBE);
        assert_eq!((report.triangles, report.edges, report.degenerate), (12, 18, 0));
        assert!(report.is_closed() && report.is_manifold() && report.is_oriented());

        let loose: Vec<Vec3> = CUBE.iter().flatten().map(|&i| corner(i)).collect();
        let indices: Vec<[u32; 3]> = (0..12).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
        assert_eq!(MeshReport::new(&loose, &indices), report);

        let negative: Vec<Vec3> = loose.iter().map(|p| p.map(|x| if x == 0.0 { -x } else { x })).collect();
        assert_eq!(MeshReport::new(&negative, &indices), report, "-0 is where 0 is");
    }

    #[test]
    fn a_missing_face_leaves_its_border() {
        let report = MeshReport::new(&cube(), &CUBE[2..]);
        assert_eq!(report.boundary_edges, 4);
        assert!(!report.is_closed() && report.is_manifold() && report.is_oriented());
    }

    #[test]
    fn a_turned_triangle_disagrees_with_its_neighbours() {
        let mut triangles = CUBE;
        triangles[0].swap(0, 1);
        let report = MeshReport::new(&cube(), &triangles);
        assert_eq!(report.disoriented_edges, 3);
        assert!(report.is_closed() && !report.is_oriented());
    }

    #[test]
    fn two_cubes_at_one_edge_are_closed_but_not_manifold() {
        let shifted = cube().into_iter().map(|p| p + Vec3::new(1.0, 1.0, 0.0));
        let positions: Vec<Vec3> = cube().into_iter().chain(shifted).collect();
        let triangles: Vec<[u32; 3]> = CUBE.into_iter().chain(CUBE.map(|t| t.map(|i| i + 8))).collect();
        let report = MeshReport::new(&positions, &triangles);
        assert_eq!(report.crowded_edges, 1);
        assert!(report.is_closed() && report.is_oriented());
    }

    #[test]
    fn bad_input_is_counted_and_does_not_panic() {
        let positions = [Vec3::ZERO, Vec3::X, Vec3::X * 3.0, Vec3::NAN, Vec3::Y];
        let triangles = [[0, 1, 2], [0, 0, 1], [0, 1, 9], [0, 1, 3], [0, 1, 4]];
        let report = MeshReport::new(&positions, &triangles);
        assert_eq!((report.not_finite, report.out_of_range, report.degenerate), (1, 1, 2));
        assert!(!MeshReport::new(&[], &[]).is_closed());
    }
}
