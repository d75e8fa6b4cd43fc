//! Watching a traversal: a type parameter, free when off.

use crate::TraversalCounts;

/// Counts, and changes the order of visits for tests. Answers may depend on neither.
pub(crate) trait Probe {
    /// Visit the farther child first.
    const REVERSED: bool = false;
    /// Skip what the ray misses or what lies beyond the best hit. Off: every primitive is tested.
    const PRUNE: bool = true;
    /// Boxes were tested.
    #[inline(always)]
    fn boxes(&mut self, _count: u32) {}
    /// A primitive was tested.
    #[inline(always)]
    fn primitive(&mut self) {}
    /// A hit needed more than `f64`.
    #[inline(always)]
    fn fallback(&mut self) {}
    /// A block of so many primitives was tested.
    #[inline(always)]
    fn block(&mut self, _count: impl FnOnce() -> u32) {}
}

/// Watches nothing.
pub(crate) struct Off;
impl Probe for Off {}

impl Probe for TraversalCounts {
    #[inline(always)]
    fn boxes(&mut self, count: u32) {
        self.boxes = self.boxes.saturating_add(count);
    }
    #[inline(always)]
    fn primitive(&mut self) {
        self.primitives = self.primitives.saturating_add(1);
    }
    #[inline(always)]
    fn fallback(&mut self) {
        self.fallbacks = self.fallbacks.saturating_add(1);
    }
    #[inline(always)]
    fn block(&mut self, count: impl FnOnce() -> u32) {
        self.primitives = self.primitives.saturating_add(count());
    }
}

/// Far child first.
pub(crate) struct FarFirst;
impl Probe for FarFirst {
    const REVERSED: bool = true;
}

/// No box test at all.
pub(crate) struct Exhaustive;
impl Probe for Exhaustive {
    const PRUNE: bool = false;
}
