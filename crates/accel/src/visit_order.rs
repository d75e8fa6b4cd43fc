//! Other orders of visits, for tests that answers do not depend on them.

use firsthit_geometry::Ray;

use crate::stats::{Exhaustive, FarFirst, Off};
use crate::{Hit, Scene};

/// How a traversal goes about it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum VisitOrder {
    /// Nearer children first: what queries do.
    NearFirst,
    /// Farther children first.
    FarFirst,
    /// Every primitive, no box tested.
    Exhaustive,
}

impl Scene {
    /// [`Scene::closest_hit`] with another order of visits: the same answer, bit for bit, and slower.
    #[doc(hidden)]
    #[must_use]
    pub fn closest_hit_in_order(&self, ray: &Ray<f64>, order: VisitOrder) -> Option<Hit> {
        match order {
            VisitOrder::NearFirst => self.closest(ray, &mut Off),
            VisitOrder::FarFirst => self.closest(ray, &mut FarFirst),
            VisitOrder::Exhaustive => self.closest(ray, &mut Exhaustive),
        }
    }
}
