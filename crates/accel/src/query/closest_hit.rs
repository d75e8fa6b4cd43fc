//! The nearest hit.

use core::cmp::Ordering;
use core::ops::ControlFlow;

use super::{Candidate, Collector};
use crate::{Hit, HitId};

/// Keeps the nearest accepted hit; of several at the same distance the first in order.
pub(crate) struct Closest<F, O> {
    pub(crate) t_min: f64,
    /// End of the interval, then distance of the best hit.
    pub(crate) t_max: f64,
    pub(crate) source: Option<HitId>,
    pub(crate) accept: F,
    /// Which of two comes first; asked only about two at the same distance.
    pub(crate) order: O,
    pub(crate) best: Option<Hit>,
}

impl<F: FnMut(&Hit) -> bool, O: Fn(&Hit, &Hit) -> Ordering> Collector for Closest<F, O> {
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
        let better = self.best.is_none_or(|best| hit.t < best.t || (self.order)(&hit, &best).is_lt());
        if !(inside && better) || self.source == Some(hit.id) || !(self.accept)(&hit) {
            return ControlFlow::Continue(false);
        }
        self.t_max = hit.t;
        self.best = Some(hit);
        ControlFlow::Continue(true)
    }
}
