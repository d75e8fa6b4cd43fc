//! Copies trees into a [`Topology`]: parents before children, depth bounded.

use firsthit_geometry::Aabb;
use obvhs::bvh2::Bvh2;

use super::{Child, MAX_DEPTH, Topology, balanced};

/// A copy of obvhs's tree.
pub(super) fn copy(bvh: &Bvh2) -> Topology {
    let mut tree = Topology { order: Vec::with_capacity(bvh.primitive_indices.len()), ..Topology::default() };
    if bvh.nodes.is_empty() {
        return tree;
    }
    // Nodes to copy, and where their parent's copy wants to know the place. Depth first: the right child waits.
    let mut todo = vec![(0usize, None::<(usize, usize)>)];
    while let Some((at, parent)) = todo.pop() {
        let node = &bvh.nodes[at];
        let child = if node.is_leaf() {
            let run = node.first_index as usize..(node.first_index + node.prim_count) as usize;
            let first = tree.order.len() as u32;
            tree.order.extend_from_slice(&bvh.primitive_indices[run]);
            Child { first, count: node.prim_count }
        } else {
            let index = tree.nodes.len();
            tree.nodes.push([Child::default(); 2]);
            let left = node.first_index as usize;
            todo.push((left + 1, Some((index, 1))));
            todo.push((left, Some((index, 0))));
            Child::inner(index)
        };
        match parent {
            Some((index, side)) => tree.nodes[index][side] = child,
            None => tree.root = Some(child),
        }
    }
    tree
}

/// The same tree if it is shallow; else one in which each subtree that would grow too deep is balanced.
pub(super) fn bounded(tree: Topology, boxes: &[Aabb<f32>]) -> Topology {
    let Some(root) = tree.root else { return tree };
    if tree.depth() <= MAX_DEPTH {
        return tree;
    }
    // The primitives below a node are one run of `order`, since both were written depth first.
    let mut runs = vec![(0u32, 0u32); tree.nodes.len()];
    let run = |c: Child, runs: &[(u32, u32)]| if c.is_leaf() { (c.first, c.count) } else { runs[c.first as usize] };
    for i in (0..tree.nodes.len()).rev() {
        let [l, r] = tree.nodes[i].map(|c| run(c, &runs));
        runs[i] = (l.0, l.1 + r.1);
    }
    let mut out = Topology { order: Vec::with_capacity(tree.order.len()), ..Topology::default() };
    let mut todo = vec![(root, 1, None::<(usize, usize)>)];
    while let Some((child, depth, parent)) = todo.pop() {
        let (first, count) = run(child, &runs);
        let primitives = &tree.order[first as usize..(first + count) as usize];
        let copied = if child.is_leaf() {
            let first = out.order.len() as u32;
            out.order.extend_from_slice(primitives);
            Child { first, count }
        } else if depth + balanced::height(count) >= MAX_DEPTH {
            balanced::append(&mut out, &mut primitives.to_vec(), boxes)
        } else {
            let index = out.nodes.len();
            out.nodes.push([Child::default(); 2]);
            let [left, right] = tree.nodes[child.first as usize];
            todo.push((right, depth + 1, Some((index, 1))));
            todo.push((left, depth + 1, Some((index, 0))));
            Child::inner(index)
        };
        match parent {
            Some((index, side)) => out.nodes[index][side] = copied,
            None => out.root = Some(copied),
        }
    }
    out
}
