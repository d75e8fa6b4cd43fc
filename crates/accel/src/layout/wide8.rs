//! The wide tree: eight children a node, up to eight triangles a leaf, tested eight at a time.
//!
//! Triangles lie in blocks of four. A leaf is a run of up to eight of them that reaches into two blocks at most, so
//! neighbouring leaves may share a block and few lanes are empty.
//!
//! Made from the binary tree by dynamic programming over its nodes, as Wald, Benthin and Boulos, "Getting Rid of
//! Packets" (2008) and Ylitie, Karras and Laine, "Efficient Incoherent Ray Traversal on GPUs Through Compressed Wide
//! BVHs" (HPG 2017) describe: the least expected number of nodes and blocks that a random line meets.

use core::ops::Range;

use firsthit_geometry::Aabb;
use glam::Vec3;

use crate::build::{Child, Topology};

/// A tree of eight children a node.
#[derive(Clone, Debug)]
pub(crate) struct Wide8 {
    /// Where to begin; [`Reference::NOTHING`] for an empty tree.
    pub(crate) root: Reference,
    pub(crate) nodes: Vec<Node>,
    pub(crate) blocks: Vec<Block>,
    depth: u32,
    sah_cost: f64,
}

/// A node, or a leaf: from the highest bit, whether it is one, number of triangles less one (3 bits), lane of the first
/// (2), and its block (26).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Reference(pub(crate) u32);

impl Reference {
    pub(crate) const NOTHING: Self = Self(u32::MAX);
    const LEAF: u32 = 1 << 31;

    fn node(index: usize) -> Self {
        Self(index as u32)
    }
    fn leaf(place: usize, count: usize) -> Self {
        Self(Self::LEAF | (count as u32 - 1) << 28 | (place as u32 & 3) << 26 | (place / 4) as u32)
    }
    #[inline(always)]
    pub(crate) fn is_leaf(self) -> bool {
        self.0 & Self::LEAF != 0
    }
    /// Of a node.
    #[inline(always)]
    pub(crate) fn index(self) -> usize {
        self.0 as usize
    }
    /// Of a leaf: its (first) block.
    #[inline(always)]
    pub(crate) fn block(self) -> usize {
        (self.0 & (MOST_BLOCKS - 1)) as usize
    }
    /// Of a leaf: where its triangles are, `4 * block + lane`.
    fn places(self) -> Range<usize> {
        let first = self.block() * 4 + (self.0 >> 26 & 3) as usize;
        first..first + self.lanes().count_ones() as usize
    }
    /// Of a leaf: its lanes in two blocks.
    #[inline(always)]
    pub(crate) fn lanes(self) -> u32 {
        let (count, first) = ((self.0 >> 28 & 7) + 1, self.0 >> 26 & 3);
        ((1 << count) - 1) << first
    }
}

/// References have room for so many blocks.
const MOST_BLOCKS: u32 = 1 << 26;

/// A mesh of no more triangles surely fits: each leaf wastes three lanes at most, and holds one triangle at least.
pub(crate) const MOST_TRIANGLES: usize = MOST_BLOCKS as usize;

/// Eight boxes: four cache lines.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
pub(crate) struct Node {
    /// By axis, lower and upper planes: see [`Node::row`]. Of a child that is missing, the lower plane is +infinity and
    /// the upper one -infinity, so that no ray meets it.
    pub(crate) planes: [[f32; 8]; 6],
    /// Smaller boxes first.
    pub(crate) children: [u32; 8],
}

impl Node {
    pub(crate) const EMPTY: Self = {
        let (low, high) = ([f32::INFINITY; 8], [f32::NEG_INFINITY; 8]);
        Self { planes: [low, high, low, high, low, high], children: [Reference::NOTHING.0; 8] }
    };

    /// Which planes are the lower (0) or upper (1) ones of an axis.
    #[inline(always)]
    pub(crate) const fn row(axis: usize, side: usize) -> usize {
        axis * 2 + side
    }

    /// Around all children; those that are missing are empty.
    fn bounds(&self) -> Aabb<f32> {
        let p = &self.planes;
        let child = |k: usize| Aabb::new(Vec3::new(p[0][k], p[2][k], p[4][k]), Vec3::new(p[1][k], p[3][k], p[5][k]));
        (0..8).fold(Aabb::empty(), |all, k| all.union(child(k)))
    }

    /// Writes one child's box.
    pub(crate) fn set_box(&mut self, child: usize, b: &Aabb<f32>) {
        for axis in 0..3 {
            self.planes[Self::row(axis, 0)][child] = b.min[axis];
            self.planes[Self::row(axis, 1)][child] = b.max[axis];
        }
    }
}

/// Four triangles: coordinates by vertex and axis. Lanes that are not used hold NaN.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(16))]
pub(crate) struct Block(pub(crate) [[[f32; 4]; 3]; 3]);

impl Block {
    const EMPTY: Self = Self([[[f32::NAN; 4]; 3]; 3]);

    fn set_triangle(&mut self, lane: usize, triangle: [Vec3; 3]) {
        for (vertex, p) in triangle.iter().enumerate() {
            for axis in 0..3 {
                self.0[vertex][axis][lane] = p[axis];
            }
        }
    }

    #[inline(always)]
    pub(crate) fn triangle(&self, lane: usize) -> [Vec3; 3] {
        let lane = lane & 3;
        let [a, b, c] = &self.0;
        [
            Vec3::new(a[0][lane], a[1][lane], a[2][lane]),
            Vec3::new(b[0][lane], b[1][lane], b[2][lane]),
            Vec3::new(c[0][lane], c[1][lane], c[2][lane]),
        ]
    }
}

/// Triangles in a leaf at most.
const LEAF: u32 = 8;

/// Cost of testing a leaf against that of a node. Its triangles are tested at once, so it is the memory that counts.
fn leaf_cost(count: u32) -> f32 {
    if count <= 4 { 0.9 } else { 1.0 }
}

/// What the dynamic programme knows of a binary node: the least cost of showing what lies below as at most `i + 1`
/// children, and how.
#[derive(Clone, Copy)]
struct Plan {
    cost: [f32; 8],
    /// How many of the `i + 1` children go to the left; 0 where one fewer child is no worse (for `i = 0`: a leaf).
    left: [u8; 8],
}

struct Collapse<'a> {
    topology: &'a Topology,
    boxes: Vec<Aabb<f32>>,
    counts: Vec<u32>,
    plans: Vec<Plan>,
    primitives: &'a [Aabb<f32>],
}

impl Wide8 {
    /// Collapses a binary tree whose leaves hold one primitive each (or few).
    ///
    /// Tells also which triangle is in each lane of each block; `u32::MAX` stands for none.
    pub(crate) fn new(topology: &Topology, triangles: &[[Vec3; 3]], boxes: &[Aabb<f32>]) -> (Self, Vec<u32>) {
        let collapse = Collapse::new(topology, boxes);
        let mut tree =
            Self { root: Reference::NOTHING, nodes: Vec::new(), blocks: Vec::new(), depth: 0, sah_cost: 0.0 };
        let mut order = Vec::new();
        // A leaf of one triangle may waste three lanes, but not all do.
        tree.blocks.reserve(triangles.len() / 3);
        tree.nodes.reserve(triangles.len() / 16);
        if let Some(root) = topology.root {
            tree.root = tree.emit(&collapse, root, triangles, 1, &mut order);
            // Two blocks are read for any leaf.
            tree.blocks.push(Block::EMPTY);
            order.resize(tree.blocks.len() * 4, u32::MAX);
            let whole = f64::from(collapse.bounds(root).area());
            let plan = collapse.plan(root);
            tree.sah_cost = if whole > 0.0 { f64::from(plan.cost[0]) / whole } else { 1.0 };
        }
        (tree, order)
    }

    /// A tree of the same shape over triangles in this order of the lanes; `u32::MAX` stands for a lane with nothing.
    pub(crate) fn refit(&self, order: &[u32], triangles: &[[Vec3; 3]], boxes: &[Aabb<f32>]) -> Self {
        let mut tree = self.clone();
        for (place, &primitive) in order.iter().enumerate() {
            let triangle = triangles.get(primitive as usize).copied();
            tree.blocks[place / 4].set_triangle(place % 4, triangle.unwrap_or_default());
        }
        let mut below = 0.0;
        // Children come after their parents.
        for i in (0..tree.nodes.len()).rev() {
            for k in 0..8 {
                let child = Reference(tree.nodes[i].children[k]);
                if child == Reference::NOTHING {
                    continue;
                }
                let (bounds, cost) = if child.is_leaf() {
                    let run = &order[child.places()];
                    let used = run.iter().filter_map(|&p| boxes.get(p as usize));
                    (used.fold(Aabb::empty(), |a, b| a.union(*b)), leaf_cost(run.len() as u32))
                } else {
                    (tree.nodes[child.index()].bounds(), 1.0)
                };
                tree.nodes[i].set_box(k, &bounds);
                below += f64::from(cost * bounds.area());
            }
        }
        // That of a single leaf stays.
        if let Some(root) = tree.nodes.first() {
            let whole = f64::from(root.bounds().area());
            tree.sah_cost = if whole > 0.0 { 1.0 + below / whole } else { 1.0 };
        }
        tree
    }

    /// Expected number of nodes and leaves that a random line through the root's box meets.
    pub(crate) fn sah_cost(&self) -> f64 {
        self.sah_cost
    }

    /// Nodes from the root to the deepest leaf.
    pub(crate) fn depth(&self) -> u32 {
        self.depth
    }

    /// Memory of nodes and blocks.
    pub(crate) fn bytes(&self) -> usize {
        size_of_val(self.nodes.as_slice()) + size_of_val(self.blocks.as_slice())
    }

    /// The triangle at a place, `4 * block + lane`.
    #[inline(always)]
    pub(crate) fn triangle(&self, place: usize) -> Option<[Vec3; 3]> {
        self.blocks.get(place / 4).map(|b| b.triangle(place % 4))
    }

    /// Writes the subtree and says where it is. Recursion is as deep as the tree, which is bounded.
    fn emit(
        &mut self,
        c: &Collapse<'_>,
        at: Child,
        triangles: &[[Vec3; 3]],
        depth: u32,
        order: &mut Vec<u32>,
    ) -> Reference {
        self.depth = self.depth.max(depth);
        if at.is_leaf() || c.plan(at).left[0] == 0 {
            let (first, count) = c.run(at);
            return self.emit_leaf(&c.topology.order[first as usize..(first + count) as usize], triangles, order);
        }
        let mut children = Vec::with_capacity(8);
        let [l, r] = c.topology.nodes[at.first as usize];
        let split = c.plan(at).left[0];
        c.gather(l, split, &mut children);
        c.gather(r, 8 - split, &mut children);
        children.sort_by(|a, b| c.bounds(*a).area().total_cmp(&c.bounds(*b).area()));

        let index = self.nodes.len();
        self.nodes.push(Node::EMPTY);
        for (k, child) in children.into_iter().enumerate() {
            self.nodes[index].set_box(k, &c.bounds(child));
            let reference = self.emit(c, child, triangles, depth + 1, order);
            self.nodes[index].children[k] = reference.0;
        }
        Reference::node(index)
    }

    /// Appends up to eight triangles. `order` has as many entries as there are lanes in use.
    fn emit_leaf(&mut self, run: &[u32], triangles: &[[Vec3; 3]], order: &mut Vec<u32>) -> Reference {
        let room = if run.len() <= 4 { 4 } else { 8 };
        if order.len() % 4 + run.len() > room {
            order.resize(order.len().next_multiple_of(4), u32::MAX);
        }
        let first = order.len();
        for &primitive in run {
            let (block, lane) = (order.len() / 4, order.len() % 4);
            if lane == 0 {
                self.blocks.push(Block::EMPTY);
            }
            self.blocks[block].set_triangle(lane, triangles[primitive as usize]);
            order.push(primitive);
        }
        Reference::leaf(first, run.len())
    }
}

impl<'a> Collapse<'a> {
    fn new(topology: &'a Topology, primitives: &'a [Aabb<f32>]) -> Self {
        let n = topology.nodes.len();
        let plan = Plan { cost: [f32::INFINITY; 8], left: [0; 8] };
        let (boxes, counts) = (vec![Aabb::empty(); n], vec![0; n]);
        let mut c = Self { topology, boxes, counts, plans: vec![plan; n], primitives };
        for i in (0..n).rev() {
            let [l, r] = topology.nodes[i];
            c.boxes[i] = c.bounds(l).union(c.bounds(r));
            c.counts[i] = c.run(l).1 + c.run(r).1;
            c.plans[i] = c.choose(i, &c.plan(l), &c.plan(r));
        }
        c
    }

    fn bounds(&self, child: Child) -> Aabb<f32> {
        if child.is_leaf() {
            let run = &self.topology.order[child.range()];
            run.iter().fold(Aabb::empty(), |b, &p| b.union(self.primitives[p as usize]))
        } else {
            self.boxes[child.first as usize]
        }
    }

    /// The primitives below: where they begin, and how many. A subtree's are one run, written depth first.
    fn run(&self, child: Child) -> (u32, u32) {
        let mut first = child;
        while !first.is_leaf() {
            first = self.topology.nodes[first.first as usize][0];
        }
        let count = if child.is_leaf() { child.count } else { self.counts[child.first as usize] };
        (first.first, count)
    }

    fn plan(&self, child: Child) -> Plan {
        if child.is_leaf() {
            Plan { cost: [leaf_cost(child.count) * self.bounds(child).area(); 8], left: [0; 8] }
        } else {
            self.plans[child.first as usize]
        }
    }

    fn choose(&self, node: usize, l: &Plan, r: &Plan) -> Plan {
        let mut plan = Plan { cost: [f32::INFINITY; 8], left: [0; 8] };
        // Shown as j + 1 children: at least one to each side.
        let split = |j: usize| {
            (0..j)
                .map(|k| (l.cost[k] + r.cost[j - 1 - k], k as u8 + 1))
                .fold((f32::INFINITY, 1), |a, b| if b.0 < a.0 { b } else { a })
        };
        let area = self.boxes[node].area();
        let (below, left) = split(7);
        let inner = area + below;
        let count = self.counts[node];
        let leaf = if count <= LEAF { leaf_cost(count) * area } else { f32::INFINITY };
        (plan.cost[0], plan.left[0]) = if leaf <= inner { (leaf, 0) } else { (inner, left) };
        for j in 1..8 {
            let (cost, left) = split(j);
            (plan.cost[j], plan.left[j]) = if plan.cost[j - 1] <= cost { (plan.cost[j - 1], 0) } else { (cost, left) };
        }
        plan
    }

    /// The children that a subtree is shown as, at most `count`.
    fn gather(&self, at: Child, count: u8, children: &mut Vec<Child>) {
        let mut count = count;
        if !at.is_leaf() {
            let plan = &self.plans[at.first as usize];
            while count > 1 && plan.left[count as usize - 1] == 0 {
                count -= 1;
            }
            if count > 1 {
                let left = plan.left[count as usize - 1];
                let [l, r] = self.topology.nodes[at.first as usize];
                self.gather(l, left, children);
                self.gather(r, count - left, children);
                return;
            }
        }
        children.push(at);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::BuildQuality;

    fn check(triangles: &[[Vec3; 3]]) {
        let boxes: Vec<_> = triangles.iter().map(|t| Aabb::from_points(*t)).collect();
        let topology = Topology::single(&boxes, BuildQuality::Balanced);
        let (tree, order) = Wide8::new(&topology, triangles, &boxes);
        let mut seen: Vec<u32> = order.iter().copied().filter(|&p| p != u32::MAX).collect();
        seen.sort_unstable();
        assert_eq!(seen, (0..triangles.len() as u32).collect::<Vec<_>>(), "every triangle in one lane");
        assert!(order.len() == tree.blocks.len() * 4);
        for (place, &p) in order.iter().enumerate() {
            let t = tree.triangle(place).unwrap();
            assert_eq!(triangles.get(p as usize).copied(), (!t[0].x.is_nan()).then_some(t));
        }
        // Boxes of children hold what lies below.
        fn below(tree: &Wide8, r: Reference) -> Aabb<f32> {
            if r.is_leaf() {
                let used = (0..8).filter(|k| r.lanes() >> k & 1 == 1).map(|k| r.block() * 4 + k);
                return Aabb::from_points(used.flat_map(|k| tree.triangle(k).unwrap()));
            }
            let node = &tree.nodes[r.index()];
            let mut all = Aabb::empty();
            for k in (0..8).filter(|&k| node.children[k] != u32::MAX) {
                let p = node.planes.map(|p| p[k]);
                let b = Aabb::new(Vec3::new(p[0], p[2], p[4]), Vec3::new(p[1], p[3], p[5]));
                assert_eq!(b, below(tree, Reference(node.children[k])));
                all = all.union(b);
            }
            all
        }
        if tree.root != Reference::NOTHING {
            below(&tree, tree.root);
        }
        let again = tree.refit(&order, triangles, &boxes);
        assert!(tree.nodes.iter().zip(&again.nodes).all(|(a, b)| a.planes == b.planes));
        assert!((0..order.len()).all(|k| order[k] == u32::MAX || tree.triangle(k) == again.triangle(k)));
        assert!((again.sah_cost - tree.sah_cost).abs() <= 1e-4 * tree.sah_cost, "{} {}", again.sah_cost, tree.sah_cost);
        if triangles.len() > 100 {
            let filled = triangles.len() as f64 / tree.blocks.len() as f64;
            assert!(filled > 3.0, "blocks hold {filled} triangles of 4");
        }
    }

    #[test]
    fn all_sizes() {
        let random = |k: usize| ((k as u32).wrapping_mul(0x9e37_79b9) >> 8) as f32 / (1 << 24) as f32;
        for n in (0..40).chain([1000, 5000]) {
            let point = |k: usize| Vec3::new(random(k), random(k + 77_777), random(3 * k + 1));
            let triangles: Vec<_> = (0..n).map(|k| [0, 1, 2].map(|i| point(k) + point(7 * k + i) * 0.02)).collect();
            check(&triangles);
            check(&vec![[Vec3::ZERO, Vec3::X, Vec3::Y]; n]);
        }
    }
}
