//! Engines that answer the same single-precision rays: firsthit by tier, and others. One file each.

mod embree;
mod firsthit;
pub(crate) mod flat_bvh;
mod obvhs;
mod parry;
#[cfg(feature = "tinybvh")]
mod tiny;

pub use embree::{Embree, library as embree_library};
pub use firsthit::Firsthit;
pub use flat_bvh::FlatBvh;
pub use obvhs::{CwBvh, ObvhsBvh2, triangles as obvhs_triangles};
pub use parry::Parry;
#[cfg(feature = "tinybvh")]
pub use tiny::Tiny;

use firsthit_geometry::Precision;
use firsthit_measure::mesh::Mesh;
use glam::Vec3;

use crate::rays::Kind;

/// A ray as every engine takes it.
#[repr(C, align(16))]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ray32 {
    /// Origin.
    pub origin: Vec3,
    /// Where the interval begins, in lengths of the direction; engines that have no such end take 0.
    pub t_min: f32,
    /// Direction, of any length.
    pub direction: Vec3,
    /// Where the interval ends.
    pub t_max: f32,
}

impl Ray32 {
    /// A ray over `[0, infinity]`.
    #[must_use]
    pub const fn new(origin: Vec3, direction: Vec3) -> Self {
        Self { origin, t_min: 0.0, direction, t_max: f32::INFINITY }
    }
}

/// The closest hit of a ray, or none.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Answer {
    /// Ray parameter.
    pub t: f64,
    /// The triangle's place in the mesh; `u32::MAX`: no hit.
    pub triangle: u32,
    /// Weight of the triangle's second vertex.
    pub u: f32,
    /// Weight of the triangle's third vertex.
    pub v: f32,
}

impl Answer {
    /// No hit.
    pub const MISS: Self = Self { t: f64::INFINITY, triangle: u32::MAX, u: 0.0, v: 0.0 };

    /// Whether there is a hit.
    #[must_use]
    pub const fn is_hit(&self) -> bool {
        self.triangle != u32::MAX
    }
}

/// An engine with its tree over one mesh.
pub trait Peer: Send + Sync {
    /// The nearest hit.
    fn closest(&self, ray: &Ray32) -> Option<Answer>;

    /// Whether there is any hit.
    fn any(&self, ray: &Ray32) -> bool;

    /// The nearest hit of each ray, one by one: one call for many, so that the engine's own loop is inlined.
    fn closest_each(&self, rays: &[Ray32], answers: &mut [Answer]) {
        for (ray, answer) in rays.iter().zip(answers) {
            *answer = self.closest(ray).unwrap_or(Answer::MISS);
        }
    }

    /// Whether there is any hit, for each ray one by one.
    fn any_each(&self, rays: &[Ray32], answers: &mut [bool]) {
        for (ray, answer) in rays.iter().zip(answers) {
            *answer = self.any(ray);
        }
    }

    /// The same rays to be asked all at once, if the engine can do better so with rays of this kind.
    fn batch<'a>(&'a self, _rays: &[Ray32], _kind: Kind) -> Option<Box<dyn Batch + 'a>> {
        None
    }

    /// Bytes of tree and primitives by the engine's own account, if it gives one.
    fn own_bytes(&self) -> Option<u64> {
        None
    }

    /// Hits of many rays, counted.
    fn count_hits(&self, rays: &[Ray32]) -> usize {
        rays.iter().filter(|r| self.closest(r).is_some()).count()
    }
}

/// Many rays of one kind in the form in which an engine takes them, with room for its answers. What the engine must do to
/// each ray to ask many at once belongs into [`Batch::ask`].
pub trait Batch: Send {
    /// Asks them all, on the threads of the rayon pool it is called from if `parallel`.
    fn ask(&mut self, parallel: bool);

    /// The answers by single rays' terms; of an any-hit query only whether there is a hit counts.
    fn answers(&self) -> Vec<Answer>;
}

/// Every engine over a mesh that yields closest hits, with its name.
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
