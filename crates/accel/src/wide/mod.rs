//! Traversal of the wide tree, written once for all tiers, queries and processors.

mod boxes;
mod triangles;

use core::ops::ControlFlow;

use glam::Vec3;

pub(crate) use boxes::Boxes;
pub(crate) use triangles::{Either, Filter, Margin, Plain, Sheared};

use crate::layout::wide8::{Reference, Wide8};
use crate::simd::{Lanes, Stack};
use crate::stats::Probe;

/// A ray among boxes: how they are to be met.
#[derive(Clone, Copy, Debug)]
pub(crate) struct BoxRay {
    pub(crate) origin: Vec3,
    pub(crate) direction: Vec3,
    /// Boxes are met as if larger by this in each axis.
    pub(crate) delta: Vec3,
    /// And by the roundings of their test.
    pub(crate) padded: bool,
    pub(crate) t_min: f32,
    pub(crate) t_max: f32,
}

/// Visits what the ray meets: nearer boxes first if `ORDERED`, else larger ones.
///
/// `test` gets the place of each triangle that passes the filter and its vertices, and answers with the new end of the
/// interval if it has become shorter, or breaks. Boxes that begin *beyond* the end are skipped; those that begin at it
/// are visited, so that triangles at equal distance are all seen.
#[inline(always)]
pub(crate) fn traverse<L: Lanes, F: Filter<L>, P: Probe, const ORDERED: bool>(
    tree: &Wide8,
    ray: &BoxRay,
    filter: &F,
    probe: &mut P,
    mut test: impl FnMut(usize, [Vec3; 3], &mut P) -> ControlFlow<(), Option<f32>>,
) -> ControlFlow<()> {
    if tree.root == Reference::NOTHING {
        return ControlFlow::Continue(());
    }
    let boxes = Boxes::<L>::new(ray.origin, ray.direction, ray.delta, ray.padded);
    let t_min = L::splat(ray.t_min);
    let mut t_max = ray.t_max;
    let mut ends = L::splat(t_max);
    let mut stack = Stack::new();
    let mut current = tree.root;
    loop {
        while !current.is_leaf() {
            let node = &tree.nodes[current.index()];
            let (mut hits, enter) = boxes.test(node, t_min, ends);
            probe.boxes(8);
            if !P::PRUNE {
                hits = node.children.iter().enumerate().fold(0, |m, (k, &c)| m | u32::from(c != u32::MAX) << k);
            }
            if hits == 0 {
                current = Reference::NOTHING;
                break;
            }
            if hits & (hits - 1) == 0 {
                current = Reference(node.children[hits.trailing_zeros() as usize & 7]);
                continue;
            }
            if ORDERED {
                // Keys are ordered by the bits of distances, which must not be negative; what begins before 0 is all
                // alike, and never beyond the end.
                let mut keys = enter.max(L::splat(0.0)).pack(&node.children, hits);
                let n = hits.count_ones() as usize;
                sort::<P>(&mut keys, n);
                current = Reference(keys[n - 1 & 7] as u32);
                stack.push(&keys, n - 1);
            } else {
                // The largest is the last.
                let last = 31 - hits.leading_zeros();
                current = Reference(node.children[last as usize & 7]);
                let rest = hits ^ 1 << last;
                stack.push(&enter.pack(&node.children, rest), rest.count_ones() as usize);
            }
        }
        if current != Reference::NOTHING {
            let index = current.index();
            let block = &tree.blocks[index];
            let mut lanes = filter.candidates(block);
            probe.block(|| block.count());
            while lanes != 0 {
                let lane = lanes.trailing_zeros() as usize;
                lanes &= lanes - 1;
                if let Some(end) = test(index * 8 + lane, block.triangle(lane), probe)? {
                    t_max = end;
                    ends = L::splat(end);
                }
            }
        }
        loop {
            let Some(key) = stack.pop() else { return ControlFlow::Continue(()) };
            if !ORDERED || !P::PRUNE || f32::from_bits((key >> 32) as u32) <= t_max.max(0.0) {
                current = Reference(key as u32);
                break;
            }
        }
    }
}

/// The nearest of the first `n` keys last.
#[inline(always)]
fn sort<P: Probe>(keys: &mut [u64; 8], n: usize) {
    let mut order = |i: usize, j: usize| {
        let (a, b) = (keys[i], keys[j]);
        (keys[i], keys[j]) = (a.max(b), a.min(b));
    };
    match n {
        2 => order(0, 1),
        3 => {
            order(0, 1);
            order(1, 2);
            order(0, 1);
        }
        4 => {
            order(0, 1);
            order(2, 3);
            order(0, 2);
            order(1, 3);
            order(1, 2);
        }
        _ => {
            for i in 1..n.min(8) {
                let key = keys[i];
                let mut k = i;
                while k > 0 && keys[k - 1] < key {
                    keys[k] = keys[k - 1];
                    k -= 1;
                }
                keys[k] = key;
            }
        }
    }
    if P::REVERSED {
        keys[..n.min(8)].reverse();
    }
}
