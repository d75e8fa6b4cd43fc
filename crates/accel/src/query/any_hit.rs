//! Whether there is a hit.

use core::ops::ControlFlow;

use super::Take;
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
