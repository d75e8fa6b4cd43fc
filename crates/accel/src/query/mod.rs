//! Queries, one file each, over one way of collecting hits.

mod across;
mod all_hits;
mod any_hit;
mod batch;
mod closest_hit;
mod closest_point;
mod count_hits;
mod crossings;
mod decision;
mod direct;
mod first_hits;
mod furthest_point;
mod nearest_k;
mod tally;

use core::ops::ControlFlow;

use firsthit_geometry::Ray;
use glam::DVec3;

pub(crate) use all_hits::All;
pub use all_hits::HitLists;
pub(crate) use any_hit::{Any, whether};
pub(crate) use closest_hit::Closest;
pub use closest_point::ClosestPoint;
pub use crossings::Crossings;
pub(crate) use direct::ForKernel;
pub(crate) use tally::Crossed;

use crate::{Hit, HitId};

/// A hit that the collector may want, with its normal in the instance's own space.
pub(crate) type Candidate = Hit;

impl Candidate {
    #[inline(always)]
    pub(crate) fn new(id: HitId, t: f64, u: f32, v: f32, normal: DVec3) -> Self {
        // -0 becomes 0, so that lists which are sorted by bits agree with comparisons about what is equally near. What is
        // beyond the largest number is in no interval.
        let t = if t.is_finite() { t + 0.0 } else { f64::NAN };
        Self { id, t, u, v, normal_direction: normal }
    }
}

/// Takes the hits that a traversal finds, in any order.
pub(crate) trait Collector {
    /// Start of the interval.
    fn t_min(&self) -> f64;
    /// End of the interval from here on: hits beyond are not wanted any more.
    fn t_max(&self) -> f64;
    /// Takes a hit or not (then the interval may have become shorter, and of a shape no farther root is wanted); breaks
    /// when nothing more is wanted.
    fn offer(&mut self, hit: Candidate) -> ControlFlow<(), bool>;
    /// Whether finding near hits first helps.
    fn ordered(&self) -> bool;
    /// Whether nothing is asked of a hit but that it lies in the interval: then one may be told of by breaking.
    #[inline(always)]
    fn asks_only_whether(&self) -> bool {
        false
    }
}

/// What a query does with the hits that it wants.
pub(crate) trait Take {
    /// Whether finding near hits first helps.
    const ORDERED: bool = true;
    /// See [`Collector::asks_only_whether`]: for those that take whatever hit there is.
    const ONLY_WHETHER: bool = false;
    /// Whether a hit in the interval is of any use; only then is the filter asked.
    #[inline(always)]
    fn wants(&self, _: &Hit) -> bool {
        true
    }
    /// Takes it; the answer is that of [`Collector::offer`], and `t_max` may become smaller.
    fn take(&mut self, hit: Hit, t_max: &mut f64) -> ControlFlow<(), bool>;
}

/// Passes on the accepted hits of a closed interval, other than on the primitive `source`.
pub(crate) struct Collect<F, T> {
    t_min: f64,
    t_max: f64,
    source: Option<HitId>,
    accept: F,
    pub(crate) take: T,
}

impl<F: FnMut(&Hit) -> bool, T: Take> Collect<F, T> {
    #[inline(always)]
    pub(crate) fn new(ray: &Ray<f64>, source: Option<HitId>, accept: F, take: T) -> Self {
        Self { t_min: ray.t_min, t_max: ray.t_max, source, accept, take }
    }
}

impl<F: FnMut(&Hit) -> bool, T: Take> Collector for Collect<F, T> {
    #[inline(always)]
    fn t_min(&self) -> f64 {
        self.t_min
    }
    #[inline(always)]
    fn t_max(&self) -> f64 {
        self.t_max
    }
    #[inline(always)]
    fn offer(&mut self, hit: Candidate) -> ControlFlow<(), bool> {
        let inside = self.t_min <= hit.t && hit.t <= self.t_max;
        if inside && self.take.wants(&hit) && self.source != Some(hit.id) && (self.accept)(&hit) {
            self.take.take(hit, &mut self.t_max)
        } else {
            ControlFlow::Continue(false)
        }
    }
    #[inline(always)]
    fn ordered(&self) -> bool {
        T::ORDERED
    }
    #[inline(always)]
    fn asks_only_whether(&self) -> bool {
        T::ONLY_WHETHER
    }
}

/// Any collector, called through a pointer.
pub(crate) struct Dyn<'a>(pub(crate) &'a mut (dyn Collector + 'a));

impl Collector for Dyn<'_> {
    #[inline(always)]
    fn t_min(&self) -> f64 {
        self.0.t_min()
    }
    #[inline(always)]
    fn t_max(&self) -> f64 {
        self.0.t_max()
    }
    #[inline(always)]
    fn offer(&mut self, hit: Candidate) -> ControlFlow<(), bool> {
        self.0.offer(hit)
    }
    #[inline(always)]
    fn ordered(&self) -> bool {
        self.0.ordered()
    }
}
