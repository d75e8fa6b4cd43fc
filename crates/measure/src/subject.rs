//! What is measured: a model with what a measurement must know of it.

use std::collections::{HashMap, HashSet};
use std::sync::OnceLock;

use firsthit_accel::HitId;
use firsthit_geometry::mesh::MeshReport;
use firsthit_import::SceneDesc;
use firsthit_import::scene::{GeometryDesc, InstanceDesc, MeshDesc, SurfaceDesc, TriangleMesh};
use glam::{DAffine3, DVec3, Vec3};

use crate::mesh::{Mesh, bumpy_sphere};

/// A model that is measured.
#[derive(Clone, Debug)]
pub struct Subject {
    /// Its name in reports.
    pub name: String,
    /// Its content.
    pub desc: SceneDesc,
    /// Whether it encloses space: each group of meshes that is placed alike has an even number of triangles at every
    /// edge, so that a ray from inside that hits nothing has leaked.
    pub closed: bool,
    /// Runs of triangles: instance, geometry, and how many triangles come before.
    runs: Vec<(u32, u32, u64)>,
    /// Triangles as instanced.
    count: u64,
    /// Made when it is first asked for.
    borders: OnceLock<Borders>,
}

/// Where surfaces end: edges that one triangle alone has, and their vertices; as hashes of positions in the world.
#[derive(Clone, Debug, Default)]
struct Borders {
    edges: HashSet<u64>,
    vertices: HashSet<u64>,
}

/// A triangle of a model and where it is placed.
#[derive(Clone, Copy, Debug)]
pub struct Placed {
    /// Corners in the mesh's own space.
    pub corners: [Vec3; 3],
    /// From there to the world.
    pub transform: DAffine3,
}

impl Placed {
    /// The corners in the world, rounded to `f64`.
    #[must_use]
    pub fn in_world(&self) -> [DVec3; 3] {
        self.corners.map(|p| self.transform.transform_point3(p.as_dvec3()))
    }
}

impl Subject {
    /// Looks at a model.
    #[must_use]
    pub fn new(name: impl Into<String>, desc: SceneDesc) -> Self {
        let (mut runs, mut count) = (Vec::new(), 0);
        for (i, instance) in desc.instances.iter().enumerate() {
            for (g, geometry) in desc.meshes[instance.mesh].geometries.iter().enumerate() {
                if let SurfaceDesc::Triangles(mesh) = &geometry.surface {
                    runs.push((i as u32, g as u32, count));
                    count += mesh.triangles.len() as u64;
                }
            }
        }
        let closed = encloses_space(&desc);
        Self { name: name.into(), desc, closed, runs, count, borders: OnceLock::new() }
    }

    /// The model that needs no file: a closed bumpy sphere of 81 920 triangles.
    #[must_use]
    pub fn builtin() -> Self {
        Self::new("built-in", desc_of(&bumpy_sphere(6)))
    }

    /// Triangles as instanced.
    #[must_use]
    pub fn triangles(&self) -> u64 {
        self.count
    }

    /// The triangle behind an id; `None` for a shape.
    #[must_use]
    pub fn triangle(&self, id: HitId) -> Option<Placed> {
        let instance = self.desc.instances.get(id.instance as usize)?;
        let geometry = self.desc.meshes.get(instance.mesh)?.geometries.get(id.geometry as usize)?;
        let SurfaceDesc::Triangles(mesh) = &geometry.surface else { return None };
        let corners = mesh.triangles.get(id.primitive as usize)?.map(|i| mesh.positions[i as usize]);
        Some(Placed { corners, transform: instance.transform })
    }

    /// Triangle number `k` of all, in the order of instances; `None` past the last.
    #[must_use]
    pub fn nth(&self, k: u64) -> Option<Placed> {
        let (instance, geometry, before) = *self.runs.get(self.runs.partition_point(|r| r.2 <= k).checked_sub(1)?)?;
        self.triangle(HitId { instance, geometry, primitive: (k - before) as u32 })
    }
}

impl Subject {
    /// Whether a surface ends at a triangle where `near` says which of its edges (by the vertex opposite) are meant: one
    /// of those has no neighbour, or the vertex between two of them lies at the end of such an edge. So it is also at a
    /// vertex in the middle of another triangle's edge, where a mesh is cracked by the rounding of that vertex.
    #[must_use]
    pub fn ends_at(&self, triangle: &Placed, near: [bool; 3]) -> bool {
        let borders = self.borders.get_or_init(|| self.borders());
        let v = triangle.in_world().map(vertex_key);
        (0..3).any(|k| {
            let (next, last) = ((k + 1) % 3, (k + 2) % 3);
            let edge = near[k] && borders.edges.contains(&edge_key(v[next], v[last]));
            // Vertex k is where the edges opposite to the other two meet.
            edge || (near[next] && near[last] && borders.vertices.contains(&v[k]))
        })
    }

    fn borders(&self) -> Borders {
        let corners = || (0..self.count).filter_map(|k| Some(self.nth(k)?.in_world().map(vertex_key)));
        let edges_of = |v: [u64; 3]| [[v[0], v[1]], [v[1], v[2]], [v[2], v[0]]];
        let mut keys: Vec<u64> = corners().flat_map(edges_of).map(|[a, b]| edge_key(a, b)).collect();
        keys.sort_unstable();
        let alone = keys.chunk_by(|a, b| a == b).filter(|same| same.len() == 1).map(|same| same[0]);
        let mut borders = Borders { edges: alone.collect(), vertices: HashSet::new() };
        let ends = corners().flat_map(edges_of).filter(|[a, b]| borders.edges.contains(&edge_key(*a, *b)));
        borders.vertices = ends.flatten().collect();
        borders
    }
}

fn mixed(x: u64, y: u64) -> u64 {
    let x = (x ^ y.rotate_left(32)).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    (x ^ (x >> 29)).wrapping_mul(0xbf58_476d_1ce4_e5b9) ^ (x >> 32)
}

fn vertex_key(p: DVec3) -> u64 {
    // -0 is where 0 is.
    (p + 0.0).to_array().into_iter().fold(0, |key, x| mixed(key, x.to_bits()))
}

fn edge_key(a: u64, b: u64) -> u64 {
    mixed(a.min(b), a.max(b))
}

/// A scene of one mesh, where it stands.
#[must_use]
pub fn desc_of(mesh: &Mesh) -> SceneDesc {
    let surface = SurfaceDesc::Triangles(TriangleMesh {
        positions: mesh.positions.clone(),
        triangles: mesh.triangles.clone(),
        ..TriangleMesh::default()
    });
    let geometry = GeometryDesc { name: String::new(), surface, material: None };
    SceneDesc {
        meshes: vec![MeshDesc { name: String::new(), geometries: vec![geometry] }],
        instances: vec![InstanceDesc { name: String::new(), mesh: 0, transform: DAffine3::IDENTITY, moves_to: None }],
        ..SceneDesc::default()
    }
}

fn encloses_space(desc: &SceneDesc) -> bool {
    // Parts of one body may be meshes of their own: what is placed alike is looked at together.
    let mut groups: HashMap<[u64; 12], Vec<usize>> = HashMap::new();
    for instance in &desc.instances {
        let placed = instance.transform.to_cols_array().map(f64::to_bits);
        groups.entry(placed).or_default().push(instance.mesh);
    }
    let mut any = false;
    for meshes in groups.values() {
        let (mut positions, mut triangles) = (Vec::new(), Vec::new());
        for geometry in meshes.iter().flat_map(|&m| &desc.meshes[m].geometries) {
            let SurfaceDesc::Triangles(mesh) = &geometry.surface else { return false };
            let first = positions.len() as u32;
            positions.extend_from_slice(&mesh.positions);
            triangles.extend(mesh.triangles.iter().map(|t| t.map(|v| v + first)));
        }
        if !triangles.is_empty() && !MeshReport::new(&positions, &triangles).is_closed() {
            return false;
        }
        any |= !triangles.is_empty();
    }
    any
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::icosphere;

    #[test]
    fn triangles_are_found_by_number_and_by_id() {
        let mut desc = desc_of(&icosphere(0));
        desc.instances.push(InstanceDesc {
            name: String::new(),
            mesh: 0,
            transform: DAffine3::from_translation(DVec3::X),
            moves_to: None,
        });
        let subject = Subject::new("two", desc);
        assert_eq!(subject.triangles(), 40);
        let (first, second) = (subject.nth(3).unwrap(), subject.nth(23).unwrap());
        assert_eq!(first.corners, second.corners);
        assert_eq!(second.in_world()[0], first.in_world()[0] + DVec3::X);
        assert!(subject.nth(40).is_none());
        assert!(subject.closed);
    }

    #[test]
    fn surfaces_end_at_edges_without_neighbour_and_at_cracks() {
        // Two triangles above the edge from (0, 0) to (2, 0) meet at (1, 0); below there is one.
        let at = |x: f32, y: f32| Vec3::new(x, y, 0.0);
        let mesh = Mesh {
            positions: vec![at(0.0, 0.0), at(1.0, 0.0), at(2.0, 0.0), at(1.0, 1.0), at(1.0, -1.0)],
            triangles: vec![[0, 1, 3], [1, 2, 3], [0, 4, 2]],
        };
        let subject = Subject::new("cracked", desc_of(&mesh));
        let first = subject.nth(0).unwrap();
        // Edge 1-3 is shared with the second triangle, 0-1 with none.
        assert!(!subject.ends_at(&first, [true, false, false]));
        assert!(subject.ends_at(&first, [false, false, true]));
        assert!(!subject.ends_at(&first, [false; 3]));
        assert!(subject.ends_at(&first, [true, false, true]), "the vertex in the middle of the lower edge");
        let closed = Subject::new("closed", desc_of(&icosphere(1)));
        assert!((0..80).all(|k| !closed.ends_at(&closed.nth(k).unwrap(), [true; 3])));
    }

    #[test]
    fn a_body_of_two_meshes_is_closed_only_as_a_whole() {
        let mesh = icosphere(1);
        let half = |range: std::ops::Range<usize>| Mesh {
            positions: mesh.positions.clone(),
            triangles: mesh.triangles[range].to_vec(),
        };
        let mut desc = desc_of(&half(0..40));
        assert!(!Subject::new("half", desc.clone()).closed);
        desc.meshes.extend(desc_of(&half(40..80)).meshes);
        desc.instances.push(InstanceDesc {
            name: String::new(),
            mesh: 1,
            transform: DAffine3::IDENTITY,
            moves_to: None,
        });
        assert!(Subject::new("whole", desc).closed);
    }
}
