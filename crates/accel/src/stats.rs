//! Watching a traversal: a type parameter, free when off.

use crate::TraversalCounts;

/// Counts, and changes the order of visits for tests. Answers may depend on neither.
pub(crate) trait Probe {
    /// Visit the farther child first.
    #[inline(always)]
    fn reversed(&self) -> bool {
        false
    }
    /// Skip what the ray misses or what lies beyond the best hit. Off: every primitive is tested.
    #[inline(always)]
    fn prunes(&self) -> bool {
        true
    }
    /// Boxes were tested.
    #[inline(always)]
    fn boxes(&mut self, _count: u32) {}
    /// A leaf was visited.
    #[inline(always)]
    fn leaf(&mut self) {}
    /// Primitives were tested.
    #[inline(always)]
    fn primitives(&mut self, _count: u32) {}
    /// A hit needed more than `f64`.
    #[inline(always)]
    fn fallback(&mut self) {}
}

/// Watches nothing.
pub(crate) struct Off;
impl Probe for Off {}

/// Any probe through a pointer, so that a traversal need not be compiled for each.
pub(crate) struct DynProbe<'a>(pub(crate) &'a mut dyn Probe);

impl Probe for DynProbe<'_> {
    #[inline(always)]
    fn reversed(&self) -> bool {
        self.0.reversed()
    }
    #[inline(always)]
    fn prunes(&self) -> bool {
        self.0.prunes()
    }
    #[inline(always)]
    fn boxes(&mut self, count: u32) {
        self.0.boxes(count);
    }
    #[inline(always)]
    fn leaf(&mut self) {
        self.0.leaf();
    }
    #[inline(always)]
    fn primitives(&mut self, count: u32) {
        self.0.primitives(count);
    }
    #[inline(always)]
    fn fallback(&mut self) {
        self.0.fallback();
    }
}

/// All that a probe can do, in one type: a traversal is compiled for each.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Watch {
    pub(crate) reversed: bool,
    pub(crate) exhaustive: bool,
    pub(crate) counts: TraversalCounts,
}

impl Probe for Watch {
    #[inline(always)]
    fn reversed(&self) -> bool {
        self.reversed
    }
    #[inline(always)]
    fn prunes(&self) -> bool {
        !self.exhaustive
    }
    #[inline(always)]
    fn boxes(&mut self, count: u32) {
        self.counts.boxes = self.counts.boxes.saturating_add(count);
    }
    #[inline(always)]
    fn leaf(&mut self) {
        self.counts.leaves = self.counts.leaves.saturating_add(1);
    }
    #[inline(always)]
    fn primitives(&mut self, count: u32) {
        self.counts.primitives = self.counts.primitives.saturating_add(count);
    }
    #[inline(always)]
    fn fallback(&mut self) {
        self.counts.fallbacks = self.counts.fallbacks.saturating_add(1);
    }
}
