//! The wide tree: eight children a node, eight triangles a block, tested eight at a time.
//!
//! Made from the binary tree by dynamic programming over its nodes, as Wald, Benthin and Boulos, "Getting Rid of
//! Packets" (2008) and Ylitie, Karras and Laine, "Efficient Incoherent Ray Traversal on GPUs Through Compressed Wide
//! BVHs" (HPG 2017) describe: the least expected number of nodes and blocks that a random line meets.

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

/// A node or a run of blocks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Reference(pub(crate) u32);

impl Reference {
    pub(crate) const NOTHING: Self = Self(u32::MAX);
    const LEAF: u32 = 1 << 31;

    fn node(index: usize) -> Self {
        Self(index as u32)
    }
    fn block(index: usize) -> Self {
        Self(index as u32 | Self::LEAF)
    }
    #[inline(always)]
    pub(crate) fn is_leaf(self) -> bool {
        self.0 & Self::LEAF != 0
    }
    /// Of the node or of the block.
    #[inline(always)]
    pub(crate) fn index(self) -> usize {
        (self.0 & !Self::LEAF) as usize
    }
}

/// Eight boxes: four cache lines.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
pub(crate) struct Node {
    /// By axis, lower and upper planes. Of a child that is missing, the lower plane is +infinity and the upper one
    /// -infinity, so that no ray meets it.
    pub(crate) planes: [[[f32; 8]; 2]; 3],
    /// Smaller boxes first.
    pub(crate) children: [u32; 8],
}

/// Up to eight triangles: coordinates by vertex and axis. Lanes that are not used hold NaN.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(32))]
pub(crate) struct Block(pub(crate) [[[f32; 8]; 3]; 3]);

impl Block {
    #[inline(always)]
    pub(crate) fn triangle(&self, lane: usize) -> [Vec3; 3] {
        let lane = lane & 7;
        let [a, b, c] = &self.0;
        [
            Vec3::new(a[0][lane], a[1][lane], a[2][lane]),
            Vec3::new(b[0][lane], b[1][lane], b[2][lane]),
            Vec3::new(c[0][lane], c[1][lane], c[2][lane]),
        ]
    }
}

impl Block {
    /// Lanes that are used.
    pub(crate) fn count(&self) -> u32 {
        self.0[0][0].iter().filter(|x| !x.is_nan()).count() as u32
    }
}

/// Triangles in a leaf at most.
const LEAF: u32 = 8;
/// Cost of testing a block against that of a node.
const BLOCK_COST: f32 = 1.0;

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
        if let Some(root) = topology.root {
            tree.root = tree.emit(&collapse, root, triangles, 1, &mut order);
            let whole = f64::from(collapse.bounds(root).area());
            let plan = collapse.plan(root);
            tree.sah_cost = if whole > 0.0 { f64::from(plan.cost[0]) / whole } else { 1.0 };
        }
        (tree, order)
    }

    /// Expected number of nodes and blocks that a random line through the root's box meets.
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

    /// The triangle at a place, `8 * block + lane`.
    pub(crate) fn triangle(&self, place: usize) -> Option<[Vec3; 3]> {
        self.blocks.get(place / 8).map(|b| b.triangle(place % 8))
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
        self.nodes.push(Node {
            planes: [[[f32::INFINITY; 8], [f32::NEG_INFINITY; 8]]; 3],
            children: [Reference::NOTHING.0; 8],
        });
        for (k, child) in children.into_iter().enumerate() {
            let b = c.bounds(child);
            for axis in 0..3 {
                self.nodes[index].planes[axis][0][k] = b.min[axis];
                self.nodes[index].planes[axis][1][k] = b.max[axis];
            }
            let reference = self.emit(c, child, triangles, depth + 1, order);
            self.nodes[index].children[k] = reference.0;
        }
        Reference::node(index)
    }

    fn emit_leaf(&mut self, run: &[u32], triangles: &[[Vec3; 3]], order: &mut Vec<u32>) -> Reference {
        let index = self.blocks.len();
        let mut block = Block([[[f32::NAN; 8]; 3]; 3]);
        for lane in 0..8 {
            let primitive = run.get(lane).copied().unwrap_or(u32::MAX);
            order.push(primitive);
            if let Some(triangle) = triangles.get(primitive as usize) {
                for (vertex, p) in triangle.iter().enumerate() {
                    for axis in 0..3 {
                        block.0[vertex][axis][lane] = p[axis];
                    }
                }
            }
        }
        self.blocks.push(block);
        Reference::block(index)
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
            Plan { cost: [BLOCK_COST * self.bounds(child).area(); 8], left: [0; 8] }
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
        let leaf = if self.counts[node] <= LEAF { BLOCK_COST * area } else { f32::INFINITY };
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
        for (place, &p) in order.iter().enumerate() {
            let t = tree.triangle(place).unwrap();
            assert_eq!(triangles.get(p as usize).copied(), (!t[0].x.is_nan()).then_some(t));
        }
        // Boxes of children hold what lies below.
        fn below(tree: &Wide8, order: &[u32], r: Reference) -> Aabb<f32> {
            if r.is_leaf() {
                let places = r.index() * 8..r.index() * 8 + 8;
                let used = places.filter(|&k| order[k] != u32::MAX);
                return Aabb::from_points(used.flat_map(|k| tree.triangle(k).unwrap()));
            }
            let node = &tree.nodes[r.index()];
            let mut all = Aabb::empty();
            for k in (0..8).filter(|&k| node.children[k] != u32::MAX) {
                let [x, y, z] = node.planes.map(|p| [p[0][k], p[1][k]]);
                let b = Aabb::new(Vec3::new(x[0], y[0], z[0]), Vec3::new(x[1], y[1], z[1]));
                assert_eq!(b, below(tree, order, Reference(node.children[k])));
                all = all.union(b);
            }
            all
        }
        if tree.root != Reference::NOTHING {
            below(&tree, &order, tree.root);
        }
        if triangles.len() > 100 {
            let filled = triangles.len() as f64 / tree.blocks.len() as f64;
            assert!(filled > 3.0, "blocks hold {filled} triangles");
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
