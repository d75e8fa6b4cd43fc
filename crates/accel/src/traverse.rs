//! One traversal for all trees, tests and queries.

use core::ops::{ControlFlow, Range};

use firsthit_geometry::{Real, slab::Slabs};

use crate::build::{Child, MAX_DEPTH};
use crate::layout::Tree;
use crate::stats::Probe;

/// Visits the leaves that the ray meets in `[t_min, t_max]`, nearer boxes first.
///
/// `leaf` gets the run of primitives and answers with the end of the interval from there on (it may shrink as hits are
/// found), or breaks. Boxes that begin *beyond* that end are skipped; those that begin at it are visited, so that
/// primitives at equal distance are all seen.
#[inline(always)]
pub(crate) fn traverse<const PADDED: bool, R: Real, T: Tree<R>, P: Probe>(
    tree: &T,
    ray: &Slabs<R>,
    t_min: R,
    mut t_max: R,
    probe: &mut P,
    mut leaf: impl FnMut(Range<usize>, &mut P) -> ControlFlow<(), R>,
) -> ControlFlow<()> {
    let Some(mut current) = tree.root() else { return ControlFlow::Continue(()) };
    let mut stack = Stack::new();
    loop {
        if current.is_leaf() {
            probe.leaf();
            t_max = leaf(current.range(), probe)?;
        } else {
            probe.boxes(2);
            let ([left, right], meets, enter) = tree.children::<PADDED>(current.first, ray, t_min, t_max);
            let meets = if probe.prunes() { meets } else { [true; 2] };
            // Chosen by value: an index into the pair would send it through memory.
            match meets {
                [true, true] => {
                    let right_first = (enter[1] < enter[0]) != probe.reversed();
                    let (near, far) = if right_first { (right, left) } else { (left, right) };
                    stack.push((far, if right_first { enter[0] } else { enter[1] }));
                    current = near;
                    continue;
                }
                [true, false] => {
                    current = left;
                    continue;
                }
                [false, true] => {
                    current = right;
                    continue;
                }
                [false, false] => {}
            }
        }
        loop {
            let Some((child, enter)) = stack.pop() else { return ControlFlow::Continue(()) };
            if enter <= t_max || !probe.prunes() {
                current = child;
                break;
            }
        }
    }
}

/// What is left to visit. It never overflows: no tree is deeper than [`MAX_DEPTH`], and each level leaves at most one
/// child behind.
struct Stack<R> {
    entries: [(Child, R); MAX_DEPTH as usize],
    len: usize,
}

impl<R: Real> Stack<R> {
    #[inline(always)]
    fn new() -> Self {
        Self { entries: [(Child { first: 0, count: 0 }, R::ZERO); MAX_DEPTH as usize], len: 0 }
    }
    #[inline(always)]
    fn push(&mut self, entry: (Child, R)) {
        debug_assert!(self.len < self.entries.len());
        if let Some(slot) = self.entries.get_mut(self.len) {
            *slot = entry;
            self.len += 1;
        }
    }
    #[inline(always)]
    fn pop(&mut self) -> Option<(Child, R)> {
        self.len = self.len.checked_sub(1)?;
        self.entries.get(self.len).copied()
    }
}
