//! What is measured: a model with what a measurement must know of it.

use std::collections::HashMap;

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
        Self { name: name.into(), desc, closed, runs, count }
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
        instances: vec![InstanceDesc { name: String::new(), mesh: 0, transform: DAffine3::IDENTITY }],
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
    fn a_body_of_two_meshes_is_closed_only_as_a_whole() {
        let mesh = icosphere(1);
        let half = |range: std::ops::Range<usize>| Mesh {
            positions: mesh.positions.clone(),
            triangles: mesh.triangles[range].to_vec(),
        };
        let mut desc = desc_of(&half(0..40));
        assert!(!Subject::new("half", desc.clone()).closed);
        desc.meshes.extend(desc_of(&half(40..80)).meshes);
        desc.instances.push(InstanceDesc { name: String::new(), mesh: 1, transform: DAffine3::IDENTITY });
        assert!(Subject::new("whole", desc).closed);
    }
}
