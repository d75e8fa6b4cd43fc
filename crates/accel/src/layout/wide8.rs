//! The wide tree: eight children a node, up to eight triangles a leaf, tested eight at a time.
//!
//! Triangles lie in blocks of four. A leaf is a run of up to eight of them that reaches into two blocks at most, so
//! neighbouring leaves may share a block and few lanes are empty.
//!
//! How it is made from the binary tree is told in [`super::collapse`].

use core::ops::Range;

use firsthit_geometry::Aabb;
use glam::Vec3;

use crate::simd::{Lanes, prefetch};
use crate::wide::{Axis, BoxNode, Leaf, WideTree};

/// A tree of eight children a node.
#[derive(Clone, Debug)]
pub(crate) struct Wide8 {
    /// Where to begin; [`Reference::NOTHING`] for an empty tree.
    pub(crate) root: Reference,
    pub(crate) nodes: Vec<Node>,
    pub(crate) blocks: Vec<Block>,
    pub(super) depth: u32,
    pub(super) sah_cost: f64,
}

impl Default for Wide8 {
    fn default() -> Self {
        Self { root: Reference::NOTHING, nodes: Vec::new(), blocks: Vec::new(), depth: 0, sah_cost: 0.0 }
    }
}

/// A node, or a leaf: from the highest bit, whether it is one, number of triangles less one (3 bits), lane of the first
/// (2), and its block (26).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Reference(pub(crate) u32);

impl Reference {
    pub(crate) const NOTHING: Self = Self(u32::MAX);
    /// The bit of leaves.
    pub(crate) const LEAF: u32 = 1 << 31;

    pub(super) fn node(index: usize) -> Self {
        Self(index as u32)
    }
    pub(crate) fn leaf(place: usize, count: usize) -> Self {
        Self(Self::LEAF | (count as u32 - 1) << 28 | (place as u32 & 3) << 26 | (place / 4) as u32)
    }
    /// The same after so many nodes or blocks more.
    pub(super) fn moved(self, nodes: u32, blocks: u32) -> Self {
        match self {
            Self::NOTHING => self,
            _ if self.is_leaf() => Self(self.0 + blocks),
            _ => Self(self.0 + nodes),
        }
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
    pub(crate) fn places(self) -> Range<usize> {
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

    fn child_box(&self, k: usize) -> Aabb<f32> {
        let p = &self.planes;
        Aabb::new(Vec3::new(p[0][k], p[2][k], p[4][k]), Vec3::new(p[1][k], p[3][k], p[5][k]))
    }

    /// Around all children; those that are missing are empty.
    fn bounds(&self) -> Aabb<f32> {
        (0..8).fold(Aabb::empty(), |all, k| all.union(self.child_box(k)))
    }

    /// Tells of the children that are there, with their boxes.
    pub(crate) fn each(&self, mut f: impl FnMut(Reference, Aabb<f32>)) {
        for (k, child) in self.children.map(Reference).into_iter().enumerate() {
            if child != Reference::NOTHING {
                f(child, self.child_box(k));
            }
        }
    }

    /// Writes one child's box.
    pub(crate) fn set_box(&mut self, child: usize, b: &Aabb<f32>) {
        for axis in 0..3 {
            self.planes[Self::row(axis, 0)][child] = b.min[axis];
            self.planes[Self::row(axis, 1)][child] = b.max[axis];
        }
    }
}

/// Four triangles: coordinates by vertex and axis. Lanes that are not used hold NaN (after a refit 0).
#[derive(Clone, Copy, Debug)]
#[repr(C, align(16))]
pub(crate) struct Block(pub(crate) [[[f32; 4]; 3]; 3]);

impl Block {
    pub(crate) const EMPTY: Self = Self([[[f32::NAN; 4]; 3]; 3]);

    pub(crate) fn set_triangle(&mut self, lane: usize, triangle: [Vec3; 3]) {
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

/// Cost of testing a leaf against that of a node. Its triangles are tested at once, so it is the memory that counts.
pub(super) fn leaf_cost(count: u32) -> f32 {
    if count <= 4 { 0.9 } else { 1.0 }
}

impl Wide8 {
    /// A tree without boxes and triangles, to be refitted: so many blocks, and children of the nodes.
    pub(crate) fn of_shape(root: Reference, children: &[[u32; 8]], blocks: usize, depth: u32) -> Self {
        let nodes = children.iter().map(|&children| Node { children, ..Node::EMPTY }).collect();
        // What a tree of one leaf costs; others are told by the refit.
        Self { root, nodes, blocks: vec![Block::EMPTY; blocks], depth, sah_cost: 1.0 }
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

    /// Bytes of the tree over so many triangles with their order, where it is a bad one: leaves that fill three lanes of five,
    /// and a node to seven triangles.
    pub(crate) fn bytes_of(triangles: u64) -> u64 {
        let lanes = triangles * 5 / 3 + 8;
        lanes * (size_of::<Block>() as u64 / 4 + 4) + (triangles / 7 + 1) * size_of::<Node>() as u64
    }

    /// The triangle at a place, `4 * block + lane`, if there is such a place.
    #[inline(always)]
    pub(crate) fn triangle(&self, place: usize) -> Option<[Vec3; 3]> {
        self.blocks.get(place / 4).map(|b| b.triangle(place % 4))
    }
}

#[cfg(test)]
impl Wide8 {
    /// A box that no longer holds what is below, for tests.
    pub(crate) fn shrink_a_box(&mut self) {
        self.nodes[0].planes[1][0] = self.nodes[0].planes[0][0];
    }
}

impl WideTree for Wide8 {
    type Node = Node;
    type Leaf<'a> = Blocks<'a>;

    #[inline(always)]
    fn root(&self) -> Reference {
        self.root
    }

    #[inline(always)]
    fn node(&self, at: Reference) -> &Node {
        &self.nodes[at.index()]
    }

    #[inline(always)]
    fn leaf(&self, at: Reference) -> Blocks<'_> {
        let (index, lanes) = (at.block(), at.lanes());
        // Where one block is enough, no other is fetched.
        let high = index + usize::from(lanes > 0xf);
        Blocks { index, low: &self.blocks[index], high: &self.blocks[high], lanes }
    }

    #[inline(always)]
    fn is_large(&self) -> bool {
        self.nodes.len() > 1 << 14
    }

    #[inline(always)]
    fn prefetch(&self, at: Reference) {
        if at.is_leaf() {
            prefetch(&self.blocks[at.block()]);
            prefetch(&self.blocks[at.block() + usize::from(at.lanes() > 0xf)]);
        } else {
            prefetch(&self.nodes[at.index()]);
        }
    }

    #[inline(always)]
    fn triangle(&self, place: usize) -> [Vec3; 3] {
        self.blocks[place / 4].triangle(place)
    }
}

impl BoxNode for Node {
    #[inline(always)]
    fn children(&self) -> &[u32; 8] {
        &self.children
    }

    #[inline(always)]
    fn slabs<L: Lanes>(&self, _: usize, ray: &Axis<L>) -> (L, L) {
        let enter = L::load_row(&self.planes, ray.entry).mul_sub(ray.inverse, ray.near);
        let leave = L::load_row(&self.planes, ray.exit).mul_sub(ray.inverse, ray.far);
        (enter, leave)
    }

    #[inline(always)]
    fn corners<L: Lanes>(&self) -> ([L; 3], [L; 3]) {
        let [lx, hx, ly, hy, lz, hz] = &self.planes;
        ([L::load(lx), L::load(ly), L::load(lz)], [L::load(hx), L::load(hy), L::load(hz)])
    }

    #[inline(always)]
    fn there(&self, hits: u32) -> u32 {
        hits
    }
}

/// The triangles of a leaf: those of two blocks, of which some lanes count.
#[derive(Clone, Copy)]
pub(crate) struct Blocks<'a> {
    index: usize,
    low: &'a Block,
    high: &'a Block,
    lanes: u32,
}

impl Leaf for Blocks<'_> {
    #[inline(always)]
    fn lanes(&self) -> u32 {
        self.lanes
    }

    #[inline(always)]
    fn place(&self, lane: usize) -> usize {
        self.index * 4 + lane
    }

    #[inline(always)]
    fn load<L: Lanes>(&self, vertex: usize, axis: usize) -> L {
        L::load_halves(&self.low.0[vertex][axis], &self.high.0[vertex][axis])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::BuildQuality;
    use crate::build::Topology;

    fn check(triangles: &[[Vec3; 3]]) {
        let boxes: Vec<_> = triangles.iter().map(|t| Aabb::from_points(*t)).collect();
        let topology = Topology::single(&boxes, BuildQuality::Balanced);
        let (tree, order) = Wide8::new(&topology, triangles, &boxes, false);
        let mut seen: Vec<u32> = order.iter().copied().filter(|&p| p != u32::MAX).collect();
        seen.sort_unstable();
        assert_eq!(seen, (0..triangles.len() as u32).collect::<Vec<_>>(), "every triangle in one lane");
        assert!(order.len() == tree.blocks.len() * 4);
        for (place, &p) in order.iter().enumerate() {
            let t = Wide8::triangle(&tree, place).unwrap();
            assert_eq!(triangles.get(p as usize).copied(), (!t[0].x.is_nan()).then_some(t));
        }
        // Boxes of children hold what lies below, in leaves that have no triangle in common.
        fn below(tree: &Wide8, r: Reference, places: &mut Vec<usize>) -> Aabb<f32> {
            if r.is_leaf() {
                let used = (0..8).filter(|k| r.lanes() >> k & 1 == 1).map(|k| r.block() * 4 + k);
                places.extend(used.clone());
                return Aabb::from_points(used.flat_map(|k| tree.triangle(k).unwrap()));
            }
            let node = &tree.nodes[r.index()];
            let mut all = Aabb::empty();
            for k in (0..8).filter(|&k| node.children[k] != u32::MAX) {
                let p = node.planes.map(|p| p[k]);
                let b = Aabb::new(Vec3::new(p[0], p[2], p[4]), Vec3::new(p[1], p[3], p[5]));
                let child = Reference(node.children[k]);
                assert!(child.is_leaf() || child.index() > r.index(), "a refit needs children after their parents");
                assert_eq!(b, below(tree, child, places));
                all = all.union(b);
            }
            all
        }
        let mut places = Vec::new();
        if tree.root != Reference::NOTHING {
            below(&tree, tree.root, &mut places);
        }
        places.sort_unstable();
        let used = (0..order.len()).filter(|&k| order[k] != u32::MAX);
        assert!(used.eq(places), "every triangle in one leaf");
        let again = tree.refit(&order, triangles, &boxes);
        assert!(tree.nodes.iter().zip(&again.nodes).all(|(a, b)| a.planes == b.planes));
        assert!((0..order.len()).all(|k| order[k] == u32::MAX || tree.triangle(k) == again.triangle(k)));
        assert!((again.sah_cost - tree.sah_cost).abs() <= 1e-4 * tree.sah_cost, "{} {}", again.sah_cost, tree.sah_cost);
        if triangles.len() > 100 {
            let filled = triangles.len() as f64 / tree.blocks.len() as f64;
            assert!(filled > 3.0, "blocks hold {filled} triangles of 4");
        }
    }

    fn scattered(n: usize) -> Vec<[Vec3; 3]> {
        let random = |k: usize| ((k as u32).wrapping_mul(0x9e37_79b9) >> 8) as f32 / (1 << 24) as f32;
        let point = |k: usize| Vec3::new(random(k), random(k + 77_777), random(3 * k + 1));
        (0..n).map(|k| [0, 1, 2].map(|i| point(k) + point(7 * k + i) * 0.02)).collect()
    }

    #[test]
    fn all_sizes() {
        // The largest are collapsed by several tasks.
        for n in (0..40).chain([1000, 5000, 40_000]) {
            check(&scattered(n));
            check(&vec![[Vec3::ZERO, Vec3::X, Vec3::Y]; n]);
        }
    }

    /// Ever smaller things, each beside all that are smaller still: as deep as a tree gets.
    #[test]
    fn lists() {
        let at = |k: i32| [Vec3::X, Vec3::Y, Vec3::Z].map(|p| p * 2f32.powi(-k));
        check(&(0..120).map(at).collect::<Vec<_>>());
        check(&(0..20_000).map(|k| at(k % 100)).collect::<Vec<_>>());
    }

    #[test]
    fn any_number_of_threads_makes_the_same_tree() {
        let triangles = scattered(40_000);
        let boxes: Vec<_> = triangles.iter().map(|t| Aabb::from_points(*t)).collect();
        let topology = Topology::single(&boxes, BuildQuality::Balanced);
        let trees = [1, 3].map(|threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let (tree, order) = pool.install(|| Wide8::new(&topology, &triangles, &boxes, false));
            let nodes: Vec<_> =
                tree.nodes.iter().map(|n| (n.planes.map(|p| p.map(f32::to_bits)), n.children)).collect();
            (tree.root, nodes, order)
        });
        assert!(trees[0] == trees[1]);
    }
}
