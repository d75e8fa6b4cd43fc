//! The nearest hit.

use core::ops::ControlFlow;

use super::Take;
use crate::Hit;

/// Keeps the nearest hit, whose distance becomes the end of the interval; of several at the same distance the first in
/// order.
pub(crate) struct Closest<O> {
    /// Whether the first comes before the second; asked only about two at the same distance, and by value, so that
    /// neither has to be kept in memory for it.
    pub(crate) order: O,
    pub(crate) best: Option<Hit>,
}

impl<O: Fn(Hit, Hit) -> bool> Take for Closest<O> {
    #[inline(always)]
    fn wants(&self, hit: &Hit) -> bool {
        match &self.best {
            Some(best) => hit.t < best.t || (hit.t == best.t && (self.order)(*hit, *best)),
            None => true,
        }
    }
    #[inline(always)]
    fn take(&mut self, hit: Hit, t_max: &mut f64) -> ControlFlow<(), bool> {
        *t_max = hit.t;
        self.best = Some(hit);
        ControlFlow::Continue(true)
    }
}
