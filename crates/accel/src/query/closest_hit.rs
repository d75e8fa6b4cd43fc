//! The nearest hit.

use core::cmp::Ordering;
use core::ops::ControlFlow;

use super::Take;
use crate::Hit;

/// Keeps the nearest hit, whose distance becomes the end of the interval; of several at the same distance the first in
/// order.
pub(crate) struct Closest<O> {
    /// Which of two comes first; asked only about two at the same distance.
    pub(crate) order: O,
    pub(crate) best: Option<Hit>,
}

impl<O: Fn(&Hit, &Hit) -> Ordering> Take for Closest<O> {
    #[inline(always)]
    fn wants(&self, hit: &Hit) -> bool {
        self.best.is_none_or(|best| hit.t < best.t || (self.order)(hit, &best).is_lt())
    }
    #[inline(always)]
    fn take(&mut self, hit: Hit, t_max: &mut f64) -> ControlFlow<(), bool> {
        *t_max = hit.t;
        self.best = Some(hit);
        ControlFlow::Continue(true)
    }
}
