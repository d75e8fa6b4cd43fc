//! Whether there is a hit.

use core::ops::ControlFlow;

use firsthit_geometry::Ray;

use super::{Candidate, Collector, Take};
use crate::Hit;

/// Stops at the first hit.
pub(crate) struct Any;

impl Take for Any {
    const ORDERED: bool = false;

    #[inline(always)]
    fn take(&mut self, _: Hit, _: &mut f64) -> ControlFlow<(), bool> {
        ControlFlow::Break(())
    }
}

/// The same of any hit in the interval, with nothing asked of it.
pub(crate) struct Whether {
    t_min: f64,
    t_max: f64,
}

impl Whether {
    #[inline(always)]
    pub(crate) fn new(ray: &Ray<f64>) -> Self {
        Self { t_min: ray.t_min, t_max: ray.t_max }
    }
}

impl Collector for Whether {
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
        if self.t_min <= hit.t && hit.t <= self.t_max { ControlFlow::Break(()) } else { ControlFlow::Continue(false) }
    }
    #[inline(always)]
    fn ordered(&self) -> bool {
        false
    }
    #[inline(always)]
    fn asks_only_whether(&self) -> bool {
        true
    }
}
