//! How a hit came about: whether it was a close call, and from which side.

use firsthit_geometry::Ray;

use crate::local::LocalRay;
use crate::model::Surface;
use crate::{Hit, Scene};

impl Scene {
    /// Whether the hit of a triangle was decided within rounding of an edge: one of its edge functions is no larger
    /// than what the scene's tier rounds there. Then a neighbour might have answered, or at a border nothing.
    ///
    /// Where it says no, the exact test hits this triangle too (at `Robust` and `Double`; `Fast` rounds otherwise, and
    /// the bound of `Robust` stands in). At `Exact` nothing is rounded, so it never says yes; nor does it for shapes,
    /// which have no edges in this sense. `ray` is the ray that found the hit. Queries do not pay for it: it is worked
    /// out when asked for, in `f64`.
    #[must_use]
    pub fn edge_decided(&self, ray: &Ray<f64>, hit: &Hit) -> bool {
        let Some((instance, Surface::Triangle(vertices))) = self.surface(&hit.id) else { return false };
        let Some(model) = self.models().get(instance.model as usize) else { return false };
        LocalRay::enter(ray, &instance.transform, model.extent())
            .is_some_and(|local| local.near_edge(vertices, self.options().precision))
    }

    /// Whether the ray meets the surface from the side that the normal points to. `ray` is the ray that found the hit.
    ///
    /// Of a triangle that the ray nearly grazes, the sign of `normal.dot(direction)` may contradict the test that found
    /// the hit, which sees rounded vertices. This is the side as that test saw it, so that of the crossings of a closed
    /// mesh ([`Crossings::Surfaces`](crate::Crossings::Surfaces)) as many enter as leave.
    #[must_use]
    pub fn enters(&self, ray: &Ray<f64>, hit: &Hit) -> bool {
        if let Some((instance, Surface::Triangle(vertices))) = self.surface(&hit.id)
            && let Some(model) = self.models().get(instance.model as usize)
            && let Some(local) = LocalRay::enter(ray, &instance.transform, model.extent())
        {
            return local.side(vertices, self.options().precision).is_lt();
        }
        hit.normal_direction.dot(ray.direction) < 0.0
    }
}
