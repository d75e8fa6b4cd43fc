//! Engines that answer the same single-precision rays: firsthit by tier, and other crates. One file each.

mod firsthit;
mod flat_bvh;
mod obvhs;
mod parry;

pub use firsthit::Firsthit;
pub use flat_bvh::FlatBvh;
pub use obvhs::{CwBvh, ObvhsBvh2};
pub use parry::Parry;

use firsthit_geometry::Precision;
use firsthit_measure::mesh::Mesh;
use glam::Vec3;

/// A ray as every engine takes it, over `[0, infinity]`.
#[derive(Clone, Copy, Debug)]
pub struct Ray32 {
    /// Origin.
    pub origin: Vec3,
    /// Direction, of any length.
    pub direction: Vec3,
}

/// An engine with its tree over one mesh.
pub trait Peer: Sync {
    /// The ray parameter of the nearest hit.
    fn closest(&self, ray: &Ray32) -> Option<f32>;
    /// Hits of many rays, counted: one call for many, so that the engine's own loop is inlined.
    fn count_hits(&self, rays: &[Ray32]) -> usize {
        rays.iter().filter(|r| self.closest(r).is_some()).count()
    }
}

/// Every engine over a mesh, with its name.
#[must_use]
pub fn all(mesh: &Mesh) -> Vec<(String, Box<dyn Peer>)> {
    let mut engines: Vec<(String, Box<dyn Peer>)> = Vec::new();
    for precision in Precision::ALL {
        engines.push((format!("firsthit-{precision}"), Box::new(Firsthit::new(mesh, precision))));
    }
    engines.push(("obvhs-bvh2".into(), Box::new(ObvhsBvh2::new(mesh))));
    engines.push(("obvhs-cwbvh".into(), Box::new(CwBvh::new(mesh))));
    engines.push(("bvh".into(), Box::new(FlatBvh::new(mesh))));
    engines.extend(Parry::new(mesh).map(|p| ("parry3d".to_owned(), Box::new(p) as Box<dyn Peer>)));
    engines
}
