//! Traversal of the wide tree, written once for all tiers, queries and processors.

mod boxes;
mod tree;
mod triangles;

use core::ops::ControlFlow;

pub(crate) use boxes::{Axis, Boxes, FARTHEST, SMALLEST, in_lanes, kept_near};
pub(crate) use tree::{BoxNode, Leaf, WideTree};
pub(crate) use triangles::{Either, Filter, Margin, Plain, Sheared};

use crate::layout::wide8::Reference;
use crate::simd::{Lanes, Stack};
use crate::stats::Probe;

/// Tests triangles. A trait and not a closure, which could not be told to be inlined: into what is compiled for the
/// level, or every call would save and load all registers.
pub(crate) trait Visit<P> {
    /// Gets a triangle's place, and what the filter knows of it. Answers with the new end of the interval if it has become
    /// shorter, or breaks. Must be `#[inline(always)]`.
    fn visit(&mut self, place: usize, known: [f32; 3], probe: &mut P) -> ControlFlow<(), Option<f32>>;
}

/// The last of all keys of children that begin no farther than the end of an interval.
#[inline(always)]
fn last_key(t_max: f32) -> u64 {
    // Adding 0 makes 0 of -0.
    u64::from((t_max.max(0.0) + 0.0).to_bits()) << 32 | u64::from(u32::MAX)
}

/// Visits what the ray meets: nearer boxes first if `ORDERED`, else larger ones.
///
/// The visitor gets each triangle that passes the filter. Boxes that begin *beyond* the end are skipped; those that begin
/// at it are visited, so that triangles at equal distance are all seen.
#[inline(always)]
pub(crate) fn traverse<L: Lanes, T: WideTree, F: Filter<L>, P: Probe, const ORDERED: bool>(
    tree: &T,
    boxes: &Boxes<L>,
    [t_min, t_max]: [f32; 2],
    filter: &F,
    probe: &mut P,
    visitor: &mut impl Visit<P>,
) -> ControlFlow<()> {
    if tree.root() == Reference::NOTHING {
        return ControlFlow::Continue(());
    }
    // What is next on the stack is asked for where memory is far.
    let large = tree.is_large();
    let start = L::splat(t_min);
    let mut ends = L::splat(t_max);
    let mut interval = filter.interval(t_min, t_max);
    let mut last = last_key(t_max);
    // Nearest first, or without distances.
    let (mut keys, mut children) = (Stack::<u64>::new(), Stack::<u32>::new());
    let mut current = tree.root();
    loop {
        while !current.is_leaf() {
            let node = tree.node(current);
            let below = node.children();
            let (mut hits, enter) = boxes.test(node, start, ends);
            probe.boxes(8);
            if !probe.prunes() {
                hits = below.iter().enumerate().fold(0, |m, (k, &c)| m | u32::from(c != u32::MAX) << k);
            }
            if hits == 0 {
                current = Reference::NOTHING;
                break;
            }
            if hits & (hits - 1) == 0 {
                current = Reference(below[hits.trailing_zeros() as usize & 7]);
                continue;
            }
            if ORDERED && hits.count_ones() == 2 && !probe.reversed() {
                // Most of all: two numbers come back from memory sooner than eight are packed.
                let enter = enter.max(L::splat(0.0)).store();
                let (i, j) = (hits.trailing_zeros() as usize & 7, (31 - hits.leading_zeros()) as usize & 7);
                let a = u64::from(enter[i].to_bits()) << 32 | u64::from(below[i]);
                let b = u64::from(enter[j].to_bits()) << 32 | u64::from(below[j]);
                current = Reference(a.min(b) as u32);
                keys.top().put([a.max(b)]);
                if large {
                    tree.prefetch(Reference(a.max(b) as u32));
                }
                continue;
            }
            if ORDERED {
                // Keys are ordered by the bits of distances, which must not be negative; what begins before 0 is all
                // alike, and never beyond the end.
                let hit = enter.max(L::splat(0.0)).pack(below, hits);
                current = Reference(
                    keys.top().push_all_but_nearest(hit, hits.count_ones() as usize, probe.reversed()) as u32
                );
                if large && let Some(key) = keys.top().peek() {
                    tree.prefetch(Reference(key as u32));
                }
            } else {
                // The largest is the last.
                let last = 31 - hits.leading_zeros();
                current = Reference(below[last as usize & 7]);
                let rest = hits ^ 1 << last;
                children.top().push(&L::pack_words(below, rest), rest.count_ones() as usize);
                if large && let Some(child) = children.top().peek() {
                    tree.prefetch(Reference(child));
                }
            }
        }
        if current != Reference::NOTHING {
            let leaf = tree.leaf(current);
            probe.leaf();
            probe.primitives(leaf.lanes().count_ones());
            let (mut candidates, known) = filter.candidates(&leaf, &interval);
            if candidates != 0 {
                let known = [known[0].store(), known[1].store(), known[2].store()];
                while candidates != 0 {
                    let lane = candidates.trailing_zeros() as usize & 7;
                    candidates &= candidates - 1;
                    let place = leaf.place(lane);
                    let known = [known[0][lane], known[1][lane], known[2][lane]];
                    if let Some(end) = visitor.visit(place, known, probe)? {
                        last = last_key(end);
                        ends = L::splat(end);
                        interval = filter.interval(t_min, end);
                    }
                }
            }
        }
        if !ORDERED {
            let Some(child) = children.top().pop() else { return ControlFlow::Continue(()) };
            current = Reference(child);
            continue;
        }
        loop {
            let Some(key) = keys.top().pop() else { return ControlFlow::Continue(()) };
            if !probe.prunes() || key <= last {
                current = Reference(key as u32);
                break;
            }
        }
    }
}
