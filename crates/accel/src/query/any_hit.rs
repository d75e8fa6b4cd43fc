//! Whether there is a hit.

use core::ops::ControlFlow;

use super::{Candidate, Collector};
use crate::{Hit, HitId};

/// Stops at the first accepted hit.
pub(crate) struct Any<F> {
    pub(crate) t_min: f64,
    pub(crate) t_max: f64,
    pub(crate) source: Option<HitId>,
    pub(crate) accept: F,
}

impl<F: FnMut(&Hit) -> bool> Collector for Any<F> {
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
        if inside && self.source != Some(hit.id) && (self.accept)(&hit) {
            ControlFlow::Break(())
        } else {
            ControlFlow::Continue(false)
        }
    }
    #[inline(always)]
    fn ordered(&self) -> bool {
        false
    }
}
