//! The nearest hit.

use core::ops::ControlFlow;

use super::{Candidate, Collector};
use crate::{Hit, HitId};

/// Keeps the nearest accepted hit; of several at the same distance the one with the smallest id.
pub(crate) struct Closest<F> {
    pub(crate) t_min: f64,
    /// End of the interval, then distance of the best hit.
    pub(crate) t_max: f64,
    pub(crate) source: Option<HitId>,
    pub(crate) accept: F,
    pub(crate) best: Option<Hit>,
}

impl<F: FnMut(&Hit) -> bool> Collector for Closest<F> {
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
        let better = self.best.is_none_or(|best| hit.t < best.t || hit.id < best.id);
        if !(inside && better) || self.source == Some(hit.id) || !(self.accept)(&hit) {
            return ControlFlow::Continue(false);
        }
        self.t_max = hit.t;
        self.best = Some(hit);
        ControlFlow::Continue(true)
    }
}
