//! From boxes to the shape of a tree.
//!
//! obvhs clusters and optimises (PLOC, parallel reinsertion, leaf collapse) by a [`Recipe`]; its answer is copied into a
//! [`Topology`] of bounded depth, and no type of it leaves this module. Boxes that would stall it ([`stall`]) are put into a tree by
//! medians instead ([`balanced`]). Blurring them at random stops the stalling too, but was no better: the tree of a row
//! then costs 277 where medians give 16.

mod balanced;
mod emit;
mod recipe;
mod stall;

use std::borrow::Cow;

use firsthit_geometry::Aabb;
use glam::Vec3;
use rayon::prelude::*;
use recipe::Recipe;

use crate::BuildQuality;

/// No tree is deeper than this, so a traversal stack of this size never overflows.
pub(crate) const MAX_DEPTH: u32 = 64;

/// Primitives in a leaf at most, where one is not all there may be.
const LEAF: u32 = 8;

/// Bytes of a [`Topology`] of so many boxes, and how many making it takes at most, the same included.
pub(crate) fn bytes(count: u64) -> (u64, u64) {
    let node = size_of::<obvhs::bvh2::node::Bvh2Node>() as u64;
    // obvhs: its boxes; nodes of the tree and two levels of leaves; keys of 32 bytes to sort them by; indices. Where leaves
    // are collapsed: parents and two counts, candidates and what becomes of them, and a tree of new nodes.
    let clustering = size_of::<obvhs::aabb::Aabb>() as u64 + 4 * node + 32 + 8;
    let collapsing = size_of::<obvhs::aabb::Aabb>() as u64 + 4 * node + 24 + 46 + 12;
    // As pushed: twice what it needs, and the old ones while they move.
    let topology = size_of::<[Child; 2]>() as u64 * 2 + 4;
    (count * topology, count * clustering.max(collapsing))
}

/// What lies below: an inner node, or a run of primitives.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Child {
    /// Index of the inner node, or position of the first primitive.
    pub(crate) first: u32,
    /// Number of primitives; 0 for an inner node.
    pub(crate) count: u32,
}

impl Child {
    pub(crate) fn inner(index: usize) -> Self {
        Self { first: index as u32, count: 0 }
    }
    #[inline(always)]
    pub(crate) fn is_leaf(self) -> bool {
        self.count > 0
    }
    #[inline(always)]
    pub(crate) fn range(self) -> core::ops::Range<usize> {
        self.first as usize..(self.first + self.count) as usize
    }
}

/// A binary tree without its boxes: what every layout is made from.
#[derive(Clone, Debug, Default)]
pub(crate) struct Topology {
    /// The root; `None` when there is nothing.
    pub(crate) root: Option<Child>,
    /// Children of each inner node. A node's children have higher indices than it.
    pub(crate) nodes: Vec<[Child; 2]>,
    /// Which primitive is at each position of the leaves' runs.
    pub(crate) order: Vec<u32>,
}

impl Topology {
    /// A tree over boxes, at most `u32::MAX / 2` of them, none empty.
    pub(crate) fn new(boxes: &[Aabb<f32>], quality: BuildQuality) -> Self {
        Self::with(boxes, Recipe::new(quality), LEAF)
    }

    /// The same with leaves of one primitive: for layouts that make leaves of their own. (Leaves of the tree by medians
    /// hold a few.)
    pub(crate) fn single(boxes: &[Aabb<f32>], quality: BuildQuality) -> Self {
        Self::with(boxes, Recipe::new(quality), 1)
    }

    fn with(boxes: &[Aabb<f32>], recipe: Recipe, leaf: u32) -> Self {
        let boxes = &*tame(boxes);
        if !stall::stalls(boxes) {
            let items: Vec<obvhs::aabb::Aabb> =
                boxes.par_iter().map(|b| obvhs::aabb::Aabb::new(b.min.into(), b.max.into())).collect();
            return emit::bounded(emit::copy(&recipe.build(&items, leaf)), boxes);
        }
        let mut tree = Self::default();
        let mut all: Vec<u32> = (0..boxes.len() as u32).collect();
        tree.root = Some(balanced::append(&mut tree, &mut all, boxes));
        tree
    }

    /// Nodes on the longest way from the root to a leaf.
    pub(crate) fn depth(&self) -> u32 {
        let mut depths = vec![1; self.nodes.len()];
        let mut deepest = u32::from(self.root.is_some());
        for (i, children) in self.nodes.iter().enumerate() {
            for c in children {
                deepest = deepest.max(depths[i] + 1);
                if !c.is_leaf() {
                    depths[c.first as usize] = depths[i] + 1;
                }
            }
        }
        deepest
    }
}

/// Boxes whose areas `f32` can hold: where costs overflow, obvhs joins boxes with themselves and indexes out of bounds.
/// Only the tree's shape comes from them.
fn tame(boxes: &[Aabb<f32>]) -> Cow<'_, [Aabb<f32>]> {
    const MOST: f32 = (1u64 << 60) as f32;
    let within = |p: Vec3| p.abs().cmple(Vec3::splat(MOST)).all();
    if boxes.iter().all(|b| within(b.min) && within(b.max)) {
        return Cow::Borrowed(boxes);
    }
    // The largest float becomes 2^60; infinite ones too, and what is not a number becomes some number.
    let scale = MOST / f32::MAX;
    let small = |p: Vec3| (p * scale).max(Vec3::splat(-MOST)).min(Vec3::splat(MOST));
    Cow::Owned(boxes.iter().map(|b| Aabb::new(small(b.min), small(b.max))).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Every primitive is in exactly one leaf, indices grow downwards, and the depth is bounded.
    fn check(boxes: &[Aabb<f32>], quality: BuildQuality) -> Topology {
        let t = Topology::new(boxes, quality);
        let mut seen = t.order.clone();
        seen.sort_unstable();
        assert_eq!(seen, (0..boxes.len() as u32).collect::<Vec<_>>());
        let mut covered = 0;
        for (i, children) in t.nodes.iter().enumerate() {
            for c in children {
                covered += c.count;
                assert!(c.is_leaf() || c.first as usize > i);
            }
        }
        if !t.nodes.is_empty() {
            assert_eq!(covered as usize, boxes.len());
        }
        assert!(t.depth() <= MAX_DEPTH, "depth {}", t.depth());
        t
    }

    fn cube(center: Vec3, half: f32) -> Aabb<f32> {
        Aabb::new(center - half, center + half)
    }

    /// Of such, obvhs made no tree: it stopped at an index out of bounds.
    #[test]
    fn boxes_beyond_the_range_of_areas() {
        let far = [1e25, 1e30, f32::MAX, f32::INFINITY, f32::NAN];
        for n in 1..40 {
            let boxes: Vec<_> =
                (0..n).map(|i| Aabb::new(Vec3::splat(-far[i % 5]), Vec3::splat(far[i * i % 5]))).collect();
            for q in [BuildQuality::Fast, BuildQuality::Balanced, BuildQuality::High] {
                check(&boxes, q);
            }
        }
    }

    #[test]
    fn few() {
        for n in 0..20 {
            let boxes: Vec<_> = (0..n).map(|i| cube(Vec3::X * i as f32, 0.4)).collect();
            for q in [BuildQuality::Fast, BuildQuality::Balanced, BuildQuality::High] {
                check(&boxes, q);
            }
        }
    }

    #[test]
    fn coincident_concentric_and_geometric() {
        let n = 20_000;
        check(&vec![cube(Vec3::ONE, 0.5); n], BuildQuality::Balanced);
        let concentric: Vec<_> = (0..n).map(|i| cube(Vec3::ZERO, 1.0 + i as f32)).collect();
        check(&concentric, BuildQuality::Balanced);
        let series: Vec<_> = (0..120).map(|i| cube(Vec3::X * 2.0f32.powi(-i), 2.0f32.powi(-i - 2))).collect();
        check(&series, BuildQuality::Balanced);
        let nearly: Vec<_> = (0..n).map(|i| cube(Vec3::splat(i as f32 * 1e-9), 1.0 + i as f32 / n as f32)).collect();
        check(&nearly, BuildQuality::Balanced);
    }
}
