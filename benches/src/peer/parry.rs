//! parry3d's triangle mesh.

use firsthit_measure::mesh::Mesh;
use parry3d::math::Vector;
use parry3d::query::{Ray, RayCast};
use parry3d::shape::TriMesh;

use super::{Peer, Ray32};

/// A mesh of parry3d.
pub struct Parry(TriMesh);

impl Parry {
    /// Builds the tree; `None` for a mesh that parry3d refuses.
    #[must_use]
    pub fn new(mesh: &Mesh) -> Option<Self> {
        let vertices = mesh.positions.iter().map(|p| Vector::new(p.x, p.y, p.z)).collect();
        TriMesh::new(vertices, mesh.triangles.clone()).ok().map(Self)
    }
}

impl Peer for Parry {
    fn closest(&self, r: &Ray32) -> Option<f32> {
        let (o, d) = (r.origin, r.direction);
        let ray = Ray::new(Vector::new(o.x, o.y, o.z), Vector::new(d.x, d.y, d.z));
        self.0.cast_local_ray(&ray, f32::MAX, false)
    }
}
