//! Other orders of visits, for tests that answers do not depend on them.

use firsthit_geometry::Ray;

use crate::query::{All, Collect};
use crate::stats::Watch;
use crate::{Crossings, Hit, Scene};

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
        let (reversed, exhaustive) = (order == VisitOrder::FarFirst, order == VisitOrder::Exhaustive);
        self.closest_watched(ray, &mut Watch { reversed, exhaustive, ..Watch::default() })
    }

    /// [`Scene::all_hits`] without any box test: the same hits, in no particular order.
    #[doc(hidden)]
    #[must_use]
    pub fn all_hits_exhaustively(&self, ray: &Ray<f64>, crossings: Crossings) -> Vec<Hit> {
        let mut hits = Vec::new();
        let mut all = Collect::new(ray, None, |_| true, All(&mut hits));
        // It never breaks.
        let watch = &mut Watch { exhaustive: true, ..Watch::default() };
        let _ = self.collect_watched(ray, crossings, &mut all, watch);
        for hit in &mut hits {
            *hit = self.finished(*hit);
        }
        hits
    }
}
