//! How nodes lie in memory.
//!
//! A layout is made from a [`Topology`](crate::build::Topology) and the boxes of the primitives, and answers one
//! question: which children of a node does a ray meet, and where? The traversal is written once, over that.

mod bvh2;
mod collapse;
pub(crate) mod compact8;
pub(crate) mod wide8;

pub(crate) use bvh2::Bvh2;

use firsthit_geometry::{Real, slab::Slabs};

use crate::build::Child;

/// A tree that can be traversed.
pub(crate) trait Tree<R: Real> {
    /// Where to begin; `None` when there is nothing.
    fn root(&self) -> Option<Child>;

    /// The children of node `index`, whether the ray meets each within `[t_min, t_max]`, and where it enters them.
    /// `PADDED`: the far end is moved outward by the error of its roundings, so that no box is missed.
    fn children<const PADDED: bool>(
        &self,
        index: u32,
        ray: &Slabs<R>,
        t_min: R,
        t_max: R,
    ) -> ([Child; 2], [bool; 2], [R; 2]);
}
