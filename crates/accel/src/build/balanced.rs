//! A balanced tree by medians: not the best one, but one that no input can spoil.

use std::cmp::Ordering;

use firsthit_geometry::Aabb;
use glam::Vec3;

use super::{Child, Topology};

/// Primitives in a leaf.
const LEAF: usize = 4;

/// Levels of inner nodes that [`append`] makes for `count` primitives.
pub(super) fn height(count: u32) -> u32 {
    u32::BITS - (count.div_ceil(LEAF as u32)).saturating_sub(1).leading_zeros()
}

/// Appends a balanced tree over `items` (not empty) to `tree` and returns its root.
pub(super) fn append(tree: &mut Topology, items: &mut [u32], boxes: &[Aabb<f32>]) -> Child {
    // Recursion is no deeper than the logarithm of the number of items.
    if items.len() <= LEAF {
        let first = tree.order.len() as u32;
        tree.order.extend_from_slice(items);
        return Child { first, count: items.len() as u32 };
    }
    // Halves are whole leaves, so the height is what `height` says.
    let leaves = items.len().div_ceil(LEAF);
    let middle = leaves.div_ceil(2) * LEAF;
    let compare = order(items, boxes);
    items.select_nth_unstable_by(middle, compare);
    let node = tree.nodes.len();
    tree.nodes.push([Child::default(); 2]);
    let (low, high) = items.split_at_mut(middle);
    let children = [append(tree, low, boxes), append(tree, high, boxes)];
    tree.nodes[node] = children;
    Child::inner(node)
}

/// By centre along the axis in which the centres differ most; where they don't, by size; then by index.
fn order<'b>(items: &[u32], boxes: &'b [Aabb<f32>]) -> impl Fn(&u32, &u32) -> Ordering + use<'b> {
    let center = |i: u32| boxes[i as usize].min + boxes[i as usize].max;
    let (low, high) = items
        .iter()
        .fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(low, high), &i| (low.min(center(i)), high.max(center(i))));
    let extent = high - low;
    let axis = extent.max_position();
    move |&a, &b| {
        let place = |i: u32| if extent[axis] > 0.0 { center(i)[axis] } else { boxes[i as usize].area() };
        place(a).total_cmp(&place(b)).then(a.cmp(&b))
    }
}
