//! How nodes lie in memory.
//!
//! A layout is made from a [`Topology`](crate::build::Topology) and the boxes of the primitives, and answers one
//! question: which children of a node does a ray meet, nearest first? The traversal is written once, over that.

mod bvh2;

pub(crate) use bvh2::Bvh2;

use firsthit_geometry::{Real, slab::Slabs};

use crate::build::Child;

/// A tree that can be traversed.
pub(crate) trait Tree<R: Real> {
    /// Where to begin; `None` when there is nothing.
    fn root(&self) -> Option<Child>;

    /// The children of node `index` that the ray meets within `[t_min, t_max]`, the nearest first: `(first, second)`
    /// with where the ray enters each.
    fn children(&self, index: u32, ray: &Slabs<R>, t_min: R, t_max: R) -> [Option<(Child, R)>; 2];

    /// All children.
    fn all_children(&self, index: u32) -> [Child; 2];
}
