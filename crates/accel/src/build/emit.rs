//! Copies trees into a [`Topology`]: parents before children, depth bounded.

use firsthit_geometry::Aabb;
use obvhs::bvh2::Bvh2;

use super::{Child, MAX_DEPTH, Topology, balanced, cluster::Clusters};

/// A copy of obvhs's tree, with its groups opened.
pub(super) fn copy(bvh: &Bvh2, clusters: &Clusters, boxes: &[Aabb<f32>]) -> Topology {
    let mut tree = Topology { order: Vec::with_capacity(boxes.len()), ..Topology::default() };
    if bvh.nodes.is_empty() {
        return tree;
    }
    let mut items = Vec::new();
    // Nodes to copy, and where their parent's copy wants to know the place. Depth first: the right child waits.
    let mut todo = vec![(0usize, None::<(usize, usize)>)];
    while let Some((at, parent)) = todo.pop() {
        let node = &bvh.nodes[at];
        let child = if node.is_leaf() {
            items.clear();
            let run = node.first_index as usize..(node.first_index + node.prim_count) as usize;
            for &item in &bvh.primitive_indices[run] {
                match clusters.loose.get(item as usize) {
                    Some(&i) => items.push(i),
                    None => items.extend_from_slice(&clusters.groups[item as usize - clusters.loose.len()]),
                }
            }
            if items.len() <= node.prim_count as usize {
                let first = tree.order.len() as u32;
                tree.order.extend_from_slice(&items);
                Child { first, count: items.len() as u32 }
            } else {
                balanced::append(&mut tree, &mut items, boxes)
            }
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
