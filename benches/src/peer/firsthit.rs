//! firsthit itself, at one tier.

use firsthit_accel::{BuildOptions, Geometry, Scene, SceneBuilder};
use firsthit_geometry::{Precision, Ray};
use firsthit_measure::mesh::Mesh;
use glam::DAffine3;

use super::{Peer, Ray32};

/// A scene of one mesh.
pub struct Firsthit(Scene);

impl Firsthit {
    /// Builds the tree.
    ///
    /// # Panics
    /// If the mesh cannot be built: vertices that are not finite, or indices out of range.
    #[must_use]
    pub fn new(mesh: &Mesh, precision: Precision) -> Self {
        let mut builder = SceneBuilder::new(BuildOptions { precision, ..BuildOptions::default() });
        let geometry = Geometry::Triangles { positions: mesh.positions.clone(), triangles: mesh.triangles.clone() };
        let mesh = builder.add_mesh(vec![geometry]);
        builder.add_instance(mesh, DAffine3::IDENTITY);
        Self(builder.build().expect("a mesh that can be built"))
    }
}

impl Peer for Firsthit {
    fn closest(&self, ray: &Ray32) -> Option<f32> {
        let ray = Ray::<f64>::new(ray.origin.as_dvec3(), ray.direction.as_dvec3());
        self.0.closest_hit(&ray).map(|hit| hit.t as f32)
    }
}
