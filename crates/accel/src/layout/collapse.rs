//! From the binary tree to the wide one: which of its nodes become nodes, and which leaves.
//!
//! Dynamic programming over the binary nodes, as Wald, Benthin and Boulos, "Getting Rid of Packets" (2008) and Ylitie,
//! Karras and Laine, "Efficient Incoherent Ray Traversal on GPUs Through Compressed Wide BVHs" (HPG 2017) describe: the
//! least expected number of nodes and leaves that a random line meets.

use core::ops::Range;

use firsthit_geometry::Aabb;
use glam::Vec3;
use rayon::prelude::*;

use super::compact8::fits;
use super::wide8::{Block, Node, Reference, Wide8, leaf_cost};
use crate::build::{Child, Topology};
use crate::pages;

/// Triangles in a leaf at most.
const LEAF: u32 = 8;

/// Subtrees of fewer nodes are not worth a task of their own.
const TASK: usize = 1 << 13;

/// What is known of a binary node.
#[derive(Clone, Copy)]
struct Inner {
    bounds: Aabb<f32>,
    /// The primitives below are one run of the order, since it was written depth first: where it begins, and how many.
    first: u32,
    count: u32,
    plan: Plan,
}

/// The least cost of showing what lies below a binary node as at most `i + 1` children, and how.
#[derive(Clone, Copy)]
struct Plan {
    cost: [f32; 8],
    /// How many of the `i + 1` children go to the left; 0 where one fewer child is no worse (for `i = 0`: a leaf).
    left: [u8; 8],
}

impl Plan {
    const NONE: Self = Self { cost: [f32::INFINITY; 8], left: [0; 8] };

    fn leaf(area: f32, count: u32) -> Self {
        Self { cost: [leaf_cost(count) * area; 8], left: [0; 8] }
    }

    /// `leaf`: whether its primitives may be one.
    fn inner(area: f32, count: u32, leaf: bool, l: &Self, r: &Self) -> Self {
        let mut plan = Self::NONE;
        // Shown as j + 1 children: at least one to each side.
        let split = |j: usize| {
            (0..j)
                .map(|k| (l.cost[k] + r.cost[j - 1 - k], k as u8 + 1))
                .fold((f32::INFINITY, 1), |a, b| if b.0 < a.0 { b } else { a })
        };
        let (below, left) = split(7);
        let inner = area + below;
        let leaf = if leaf { leaf_cost(count) * area } else { f32::INFINITY };
        (plan.cost[0], plan.left[0]) = if leaf <= inner { (leaf, 0) } else { (inner, left) };
        for j in 1..8 {
            let (cost, left) = split(j);
            (plan.cost[j], plan.left[j]) = if plan.cost[j - 1] <= cost { (plan.cost[j - 1], 0) } else { (cost, left) };
        }
        plan
    }
}

/// The input.
#[derive(Clone, Copy)]
struct Source<'a> {
    topology: &'a Topology,
    triangles: &'a [[Vec3; 3]],
    boxes: &'a [Aabb<f32>],
    /// Leaves have few different vertices too: for [`Compact8`](super::compact8::Compact8).
    few_vertices: bool,
}

impl Source<'_> {
    fn leaf_bounds(&self, leaf: Child) -> Aabb<f32> {
        let run = &self.topology.order[leaf.range()];
        run.iter().fold(Aabb::empty(), |b, &p| b.union(self.boxes[p as usize]))
    }

    /// Whether so many primitives, from one in the order, may be a leaf.
    fn may_be_leaf(&self, first: u32, count: u32) -> bool {
        if count > LEAF || !self.few_vertices {
            return count <= LEAF;
        }
        let run = &self.topology.order[first as usize..(first + count) as usize];
        fits(run.iter().map(|&p| self.triangles[p as usize]))
    }

    /// Index past the last node of each node's subtree: nodes lie depth first, so it is what lies between.
    fn ends(&self) -> Vec<u32> {
        let mut ends = vec![0; self.topology.nodes.len()];
        for i in (0..ends.len()).rev() {
            let after = |c: Child, otherwise: u32| if c.is_leaf() { otherwise } else { ends[c.first as usize] };
            let [l, r] = self.topology.nodes[i];
            ends[i] = after(r, after(l, i as u32 + 1));
        }
        ends
    }

    /// What is known of the node at the start of `nodes`, where its subtree is written.
    fn plan(&self, ends: &[u32], nodes: Range<usize>, out: &mut [Inner]) -> Inner {
        let children = self.topology.nodes[nodes.start];
        // Recursion is as deep as the tree, which is bounded.
        let below = |c: Child, out: &mut [Inner], start: usize| {
            if c.is_leaf() {
                let bounds = self.leaf_bounds(c);
                Inner { bounds, first: c.first, count: c.count, plan: Plan::leaf(bounds.area(), c.count) }
            } else {
                let (first, end) = (c.first as usize, ends[c.first as usize] as usize);
                self.plan(ends, first..end, &mut out[first - start..end - start])
            }
        };
        let (here, rest) = out.split_at_mut(1);
        let start = nodes.start + 1;
        let [l, r] = if children.iter().any(|c| c.is_leaf()) || rest.len() < TASK {
            [below(children[0], rest, start), below(children[1], rest, start)]
        } else {
            let middle = children[1].first as usize;
            let (left, right) = rest.split_at_mut(middle - start);
            <[Inner; 2]>::from(rayon::join(|| below(children[0], left, start), || below(children[1], right, middle)))
        };
        let bounds = l.bounds.union(r.bounds);
        let count = l.count + r.count;
        let plan = Plan::inner(bounds.area(), count, self.may_be_leaf(l.first, count), &l.plan, &r.plan);
        here[0] = Inner { bounds, first: l.first, count, plan };
        here[0]
    }
}

/// A binary node with its box, on the way to become a child.
#[derive(Clone, Copy)]
struct Shown {
    child: Child,
    bounds: Aabb<f32>,
    area: f32,
}

/// Decides, and writes.
struct Collapse<'a> {
    source: Source<'a>,
    inner: Vec<Inner>,
}

impl Collapse<'_> {
    fn shown(&self, child: Child) -> Shown {
        let bounds =
            if child.is_leaf() { self.source.leaf_bounds(child) } else { self.inner[child.first as usize].bounds };
        Shown { child, bounds, area: bounds.area() }
    }

    /// The primitives below, if it is to be a leaf.
    fn as_leaf(&self, at: Child) -> Option<&[u32]> {
        let order = &self.source.topology.order;
        if at.is_leaf() {
            return Some(&order[at.range()]);
        }
        let inner = &self.inner[at.first as usize];
        let run = inner.first as usize..(inner.first + inner.count) as usize;
        (inner.plan.left[0] == 0).then(|| &order[run])
    }

    /// The children that a node has in the wide tree, smaller boxes first.
    fn children(&self, at: Child) -> Vec<Shown> {
        let mut children = Vec::with_capacity(8);
        let [l, r] = self.source.topology.nodes[at.first as usize];
        let left = self.inner[at.first as usize].plan.left[0];
        self.gather(l, left, &mut children);
        self.gather(r, 8 - left, &mut children);
        children.sort_by(|a, b| a.area.total_cmp(&b.area));
        children
    }

    /// What a subtree is shown as, at most `count` children.
    fn gather(&self, at: Child, count: u8, children: &mut Vec<Shown>) {
        let mut count = count;
        if !at.is_leaf() {
            let plan = &self.inner[at.first as usize].plan;
            while count > 1 && plan.left[count as usize - 1] == 0 {
                count -= 1;
            }
            if count > 1 {
                let left = plan.left[count as usize - 1];
                let [l, r] = self.source.topology.nodes[at.first as usize];
                self.gather(l, left, children);
                self.gather(r, count - left, children);
                return;
            }
        }
        children.push(self.shown(at));
    }
}

/// A part of the tree while it is written. References count from its own start.
#[derive(Default)]
struct Part {
    nodes: Vec<Node>,
    blocks: Vec<Block>,
    /// The primitive in each lane of the blocks; `u32::MAX` stands for none.
    order: Vec<u32>,
    depth: u32,
}

/// A subtree that another task writes: where its parent, at some depth, wants the reference.
struct Later {
    at: Child,
    node: usize,
    slot: usize,
    depth: u32,
}

impl Part {
    /// Writes a subtree and says where it is; what has at most `task` primitives is put off, if there is a list for that.
    /// Recursion is as deep as the tree, which is bounded.
    fn emit(&mut self, c: &Collapse<'_>, at: Child, depth: u32, later: &mut Option<(u32, Vec<Later>)>) -> Reference {
        self.depth = self.depth.max(depth);
        if let Some(run) = c.as_leaf(at) {
            return self.emit_leaf(run, c.source.triangles);
        }
        let index = self.nodes.len();
        self.nodes.push(Node::EMPTY);
        for (slot, shown) in c.children(at).into_iter().enumerate() {
            self.nodes[index].set_box(slot, &shown.bounds);
            let child = shown.child;
            match later {
                Some((task, list)) if c.as_leaf(child).is_none() && c.inner[child.first as usize].count <= *task => {
                    list.push(Later { at: child, node: index, slot, depth: depth + 1 });
                }
                _ => {
                    let reference = self.emit(c, child, depth + 1, later);
                    self.nodes[index].children[slot] = reference.0;
                }
            }
        }
        Reference::node(index)
    }

    /// Appends up to eight triangles. `order` has as many entries as there are lanes in use.
    fn emit_leaf(&mut self, run: &[u32], triangles: &[[Vec3; 3]]) -> Reference {
        debug_assert!(run.len() <= LEAF as usize);
        let room = if run.len() <= 4 { 4 } else { 8 };
        if self.order.len() % 4 + run.len() > room {
            self.fill_block();
        }
        let first = self.order.len();
        for &primitive in run {
            let (block, lane) = (self.order.len() / 4, self.order.len() % 4);
            if lane == 0 {
                self.blocks.push(Block::EMPTY);
            }
            self.blocks[block].set_triangle(lane, triangles[primitive as usize]);
            self.order.push(primitive);
        }
        Reference::leaf(first, run.len())
    }

    fn fill_block(&mut self) {
        self.order.resize(self.order.len().next_multiple_of(4), u32::MAX);
    }

    /// Gives back the room that was taken in vain: all parts are there before the first is appended.
    fn shrink_to_fit(&mut self) {
        self.nodes.shrink_to_fit();
        self.blocks.shrink_to_fit();
        self.order.shrink_to_fit();
    }

    /// Appends another part, and says what its references become.
    fn append(&mut self, mut part: Self) -> impl Fn(Reference) -> Reference + use<> {
        self.fill_block();
        let (nodes, blocks) = (self.nodes.len() as u32, self.blocks.len() as u32);
        let moved = move |r: Reference| r.moved(nodes, blocks);
        for node in &mut part.nodes {
            for child in &mut node.children {
                *child = moved(Reference(*child)).0;
            }
        }
        self.nodes.append(&mut part.nodes);
        self.blocks.append(&mut part.blocks);
        self.order.append(&mut part.order);
        self.depth = self.depth.max(part.depth);
        moved
    }
}

impl Wide8 {
    /// Bytes that making the tree over so many triangles takes at most, the tree included: the plan, and parts that grow.
    pub(crate) fn making_bytes(triangles: u64) -> u64 {
        triangles * (size_of::<Inner>() as u64 + 4) + 3 * Self::bytes_of(triangles)
    }

    /// Collapses a binary tree whose leaves hold one primitive each (or few), by dynamic programming over its nodes, on
    /// the threads of the rayon pool it is called from; the same tree for any number.
    ///
    /// Tells also which triangle is in each lane of each block; `u32::MAX` stands for none.
    ///
    /// `few_vertices`: no leaf has more different vertices than one of [`Compact8`](super::compact8::Compact8) may have.
    pub(crate) fn new(
        topology: &Topology,
        triangles: &[[Vec3; 3]],
        boxes: &[Aabb<f32>],
        few_vertices: bool,
    ) -> (Self, Vec<u32>) {
        let source = Source { topology, triangles, boxes, few_vertices };
        let Some(root) = topology.root else { return (Self::default(), Vec::new()) };
        let nothing = Inner { bounds: Aabb::empty(), first: 0, count: 0, plan: Plan::NONE };
        let mut inner = vec![nothing; topology.nodes.len()];
        let mut sah_cost = 1.0;
        if !root.is_leaf() {
            let ends = source.ends();
            let top = source.plan(&ends, 0..topology.nodes.len(), &mut inner);
            let whole = f64::from(top.bounds.area());
            sah_cost = if whole > 0.0 { f64::from(top.plan.cost[0]) / whole } else { 1.0 };
        }
        let collapse = Collapse { source, inner };

        let task = (triangles.len() / 64).max(TASK) as u32;
        let mut later = Some((task, Vec::new()));
        let mut top = Part::default();
        let root = top.emit(&collapse, root, 1, &mut later);
        let tasks = later.map_or(Vec::new(), |(_, list)| list);
        let parts: Vec<(Later, Part, Reference)> = tasks
            .into_par_iter()
            .map(|task| {
                let mut part = Part::default();
                let reference = part.emit(&collapse, task.at, task.depth, &mut None);
                part.shrink_to_fit();
                (task, part, reference)
            })
            .collect();
        let sum = |of: fn(&Part) -> usize| parts.iter().map(|(_, part, _)| of(part)).sum::<usize>();
        top.nodes.reserve_exact(sum(|p| p.nodes.len()));
        top.blocks.reserve_exact(sum(|p| p.blocks.len()) + 1);
        top.order.reserve_exact(sum(|p| p.blocks.len() * 4) + 8);
        pages::advise(&mut top.nodes);
        pages::advise(&mut top.blocks);
        pages::advise(&mut top.order);
        for (Later { node, slot, .. }, part, reference) in parts {
            let moved = top.append(part);
            top.nodes[node].children[slot] = moved(reference).0;
        }
        // Two blocks are read for any leaf.
        top.blocks.push(Block::EMPTY);
        top.order.resize(top.blocks.len() * 4, u32::MAX);
        let Part { nodes, blocks, order, depth } = top;
        (Self { root, nodes, blocks, depth, sah_cost }, order)
    }
}
