//! Whether there is a hit.

use core::ops::ControlFlow;

use firsthit_geometry::Ray;

use super::{Collect, Collector, Take};
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
struct Whether;

impl Take for Whether {
    const ORDERED: bool = false;
    const ONLY_WHETHER: bool = true;

    #[inline(always)]
    fn take(&mut self, _: Hit, _: &mut f64) -> ControlFlow<(), bool> {
        ControlFlow::Break(())
    }
}

/// Stops at the first hit in the ray's interval, whatever it is.
#[inline(always)]
pub(crate) fn whether(ray: &Ray<f64>) -> impl Collector + use<> {
    Collect::new(ray, None, |_| true, Whether)
}
