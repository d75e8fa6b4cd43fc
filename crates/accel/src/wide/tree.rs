//! What the traversal asks of a tree of eight children a node, however it lies in memory.

use glam::Vec3;

use super::boxes::Axis;
use crate::layout::wide8::Reference;
use crate::simd::Lanes;

/// A tree of eight children a node and up to eight triangles a leaf.
pub(crate) trait WideTree {
    type Node: BoxNode;
    type Leaf<'a>: Leaf
    where
        Self: 'a;

    /// Where to begin; [`Reference::NOTHING`] for an empty tree.
    fn root(&self) -> Reference;
    /// The node that a reference which is no leaf stands for.
    fn node(&self, at: Reference) -> &Self::Node;
    /// The triangles of a leaf.
    fn leaf(&self, at: Reference) -> Self::Leaf<'_>;
    /// Whether the tree is so large that it pays to ask for nodes and leaves before they are looked at.
    #[inline(always)]
    fn is_large(&self) -> bool {
        false
    }
    /// Asks for a node or leaf that will be looked at soon.
    #[inline(always)]
    fn prefetch(&self, _: Reference) {}
    /// The triangle at a place of a leaf.
    fn triangle(&self, place: usize) -> [Vec3; 3];
}

/// Eight boxes.
pub(crate) trait BoxNode {
    /// References to the children, smaller boxes first; [`Reference::NOTHING`] behind the last.
    fn children(&self) -> &[u32; 8];
    /// Where the ray enters and leaves the slabs of one axis.
    fn slabs<L: Lanes>(&self, axis: usize, ray: &Axis<L>) -> (L, L);
    /// Lower and upper corners of the boxes: those of a compact node off by rounding.
    fn corners<L: Lanes>(&self) -> ([L; 3], [L; 3]);
    /// Those of the hits whose child is there.
    fn there(&self, hits: u32) -> u32;
}

/// Up to eight triangles.
pub(crate) trait Leaf {
    /// One bit for each triangle.
    fn lanes(&self) -> u32;
    /// The place of the triangle in a lane.
    fn place(&self, lane: usize) -> usize;
    /// A coordinate of one vertex of each triangle.
    fn load<L: Lanes>(&self, vertex: usize, axis: usize) -> L;
}
