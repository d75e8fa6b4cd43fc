//! The compact tree: the wide one in half the memory.
//!
//! Boxes of children lie on a grid of 8 bits in the frame of their node, rounded outward, so that no box is missed that
//! the wide tree meets. The triangles of a leaf share a table of their vertices, in single precision as ever: the tests
//! see the same numbers, and answers are the same bits.

use firsthit_geometry::Aabb;
use glam::{DVec3, Vec3};

use super::wide8::{self, Reference, Wide8};
use crate::simd::{Lanes, Row};
use crate::wide::{Axis, BoxNode, Leaf, WideTree};

/// Different vertices in a leaf at most: what two registers hold.
pub(crate) const MOST_VERTICES: usize = 16;

/// Words that may be read behind the last leaf, and of any leaf at once: eight triangles, three tables and what is read
/// past the last.
const REACH: usize = 80;

/// A tree of eight children a node.
#[derive(Clone, Debug)]
pub(crate) struct Compact8 {
    root: Reference,
    nodes: Vec<Node>,
    /// The leaves, one after the other: numbers of the triangles, the triangles ([`Triangle`]), then x, y and z of the
    /// vertices. The place of a triangle is the index of its word.
    words: Vec<u32>,
    depth: u32,
    sah_cost: f64,
}

/// Eight boxes: two cache lines. (Steps as exponents, of one byte each, make it a line and a half; but then a node takes a dozen
/// instructions more.)
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
pub(crate) struct Node {
    /// The frame's lowest corner.
    origin: [f32; 3],
    /// The frame's steps, powers of two.
    steps: [f32; 3],
    /// Which children are there.
    there: u32,
    /// Smaller boxes first.
    children: [u32; 8],
    /// By axis, lower and upper planes, in steps.
    planes: [[u8; 8]; 6],
}

const _: () = assert!(size_of::<Node>() == 128);

impl Node {
    /// The same boxes or slightly larger ones; the children are copied.
    pub(crate) fn new(wide: &wide8::Node) -> Self {
        let mut node = Self {
            origin: [0.0; 3],
            steps: [f32::MIN_POSITIVE; 3],
            there: 0,
            children: wide.children,
            planes: [[255; 8], [0; 8], [255; 8], [0; 8], [255; 8], [0; 8]],
        };
        let used = (0..8).filter(|&k| wide.children[k] != Reference::NOTHING.0);
        node.there = used.clone().fold(0, |m, k| m | 1 << k);
        for axis in 0..3 {
            let (lower, upper) = (wide8::Node::row(axis, 0), wide8::Node::row(axis, 1));
            // What a refit left empty has no planes; no ray meets it.
            let full = used.clone().filter(|&k| wide.planes[lower][k] <= wide.planes[upper][k]);
            let low = full.clone().map(|k| wide.planes[lower][k]).fold(f32::INFINITY, f32::min);
            let high = full.clone().map(|k| wide.planes[upper][k]).fold(f32::NEG_INFINITY, f32::max);
            if !(low <= high) {
                continue;
            }
            // Differences of f32 in f64: what they round is nothing against the slack of the boxes' test.
            let (origin, extent) = (f64::from(low), f64::from(high) - f64::from(low));
            let mut step = f64::from(f32::MIN_POSITIVE);
            while step * 255.0 < extent {
                step *= 2.0;
            }
            node.origin[axis] = low;
            node.steps[axis] = step as f32;
            for k in full {
                let steps = |x: f32| (f64::from(x) - origin) / step;
                node.planes[lower][k] = steps(wide.planes[lower][k]).floor().clamp(0.0, 255.0) as u8;
                node.planes[upper][k] = steps(wide.planes[upper][k]).ceil().clamp(0.0, 255.0) as u8;
            }
        }
        node
    }

    /// Tells of the children that are there, with their boxes: those of the grid, with room for what was rounded on it.
    pub(crate) fn each(&self, mut f: impl FnMut(Reference, Aabb<f64>)) {
        let vector = |v: [f32; 3]| Vec3::from(v).as_dvec3();
        let (origin, step) = (vector(self.origin), vector(self.steps));
        for k in (0..8).filter(|k| self.there >> k & 1 == 1) {
            let [lx, hx, ly, hy, lz, hz] = self.planes.map(|p| f64::from(p[k]));
            let room = DVec3::splat(2f64.powi(-40));
            let low = origin + (DVec3::new(lx, ly, lz) - room) * step;
            let high = origin + (DVec3::new(hx, hy, hz) + room) * step;
            f(Reference(self.children[k]), Aabb::new(low, high));
        }
    }
}

impl BoxNode for Node {
    #[inline(always)]
    fn children(&self) -> &[u32; 8] {
        &self.children
    }

    #[inline(always)]
    fn slabs<L: Lanes>(&self, axis: usize, ray: &Axis<L>) -> (L, L) {
        // A product with a power of two is exact; so only the frame's corner is rounded once more than in a wide node.
        let step = L::splat(self.steps[axis]).mul(ray.inverse);
        let origin = L::splat(self.origin[axis]);
        let near = origin.mul_sub(ray.inverse, ray.near);
        let far = origin.mul_sub(ray.inverse, ray.far);
        (
            L::load_bytes(&self.planes, ray.entry).mul_add(step, near),
            L::load_bytes(&self.planes, ray.exit).mul_add(step, far),
        )
    }

    #[inline(always)]
    fn corners<L: Lanes>(&self) -> ([L; 3], [L; 3]) {
        let (o, s) = (&self.origin, &self.steps);
        let [ox, oy, oz] = [L::splat(o[0]), L::splat(o[1]), L::splat(o[2])];
        let [sx, sy, sz] = [L::splat(s[0]), L::splat(s[1]), L::splat(s[2])];
        let p = &self.planes;
        const ROW: [Row; 6] = [Row::new(0), Row::new(1), Row::new(2), Row::new(3), Row::new(4), Row::new(5)];
        (
            [
                L::load_bytes(p, ROW[0]).mul_add(sx, ox),
                L::load_bytes(p, ROW[2]).mul_add(sy, oy),
                L::load_bytes(p, ROW[4]).mul_add(sz, oz),
            ],
            [
                L::load_bytes(p, ROW[1]).mul_add(sx, ox),
                L::load_bytes(p, ROW[3]).mul_add(sy, oy),
                L::load_bytes(p, ROW[5]).mul_add(sz, oz),
            ],
        )
    }

    /// A frame may be so small that all of it is within the padding of boxes, what is missing too.
    #[inline(always)]
    fn there(&self, hits: u32) -> u32 {
        hits & self.there
    }
}

/// A triangle in a leaf: from the lowest bit, three indices of vertices (4 bits each), number of vertices of the leaf less
/// one (4), the triangle's lane (3), number of triangles less one (3).
#[derive(Clone, Copy)]
struct Triangle(u32);

impl Triangle {
    #[inline(always)]
    fn vertex(self, k: usize) -> usize {
        (self.0 >> (4 * k) & 15) as usize
    }
    #[inline(always)]
    fn vertices(self) -> usize {
        (self.0 >> 12 & 15) as usize + 1
    }
    #[inline(always)]
    fn lane(self) -> usize {
        (self.0 >> 16 & 7) as usize
    }
    #[inline(always)]
    fn count(self) -> usize {
        (self.0 >> 19 & 7) as usize + 1
    }
}

/// References of leaves have the flag of [`Reference`], number of triangles less one (3 bits), and the first place (28).
const PLACES: u32 = 1 << 28;

/// A mesh of no more triangles surely fits: each has two words, and three vertices at most.
pub(crate) const MOST_TRIANGLES: usize = (PLACES as usize - REACH) / 11;

/// The triangles of a leaf.
pub(crate) struct Words<'a> {
    place: usize,
    lanes: u32,
    words: &'a [u32; REACH],
    /// Where the tables begin, and how long each is.
    tables: usize,
    vertices: usize,
}

impl Leaf for Words<'_> {
    #[inline(always)]
    fn lanes(&self) -> u32 {
        self.lanes
    }
    #[inline(always)]
    fn place(&self, lane: usize) -> usize {
        self.place + lane
    }
    #[inline(always)]
    fn load<L: Lanes>(&self, vertex: usize, axis: usize) -> L {
        let [triangles, ..] = self.words.as_chunks::<8>().0 else { return L::splat(0.0) };
        let start = self.tables + self.vertices * (axis & 3);
        match self.words.get(start..).and_then(|w| w.first_chunk::<16>()) {
            Some(table) => L::look_up(triangles, vertex, table),
            None => L::splat(0.0),
        }
    }
}

impl WideTree for Compact8 {
    type Node = Node;
    type Leaf<'a> = Words<'a>;

    #[inline(always)]
    fn root(&self) -> Reference {
        self.root
    }

    #[inline(always)]
    fn node(&self, at: Reference) -> &Node {
        &self.nodes[at.index()]
    }

    #[inline(always)]
    fn leaf(&self, at: Reference) -> Words<'_> {
        let place = (at.0 & (PLACES - 1)) as usize;
        let count = (at.0 >> 28 & 7) as usize + 1;
        const NOTHING: &[u32; REACH] = &[0; REACH];
        let words = self.words[place..].first_chunk().unwrap_or(NOTHING);
        Words { place, lanes: (1 << count) - 1, words, tables: count, vertices: Triangle(words[0]).vertices() }
    }

    #[inline(always)]
    fn triangle(&self, place: usize) -> [Vec3; 3] {
        let triangle = Triangle(self.words[place]);
        let n = triangle.vertices();
        let tables = &self.words[place - triangle.lane() + triangle.count()..][..3 * n];
        let at = |k: usize, axis: usize| f32::from_bits(tables[axis * n + triangle.vertex(k)]);
        let corner = |k: usize| Vec3::new(at(k, 0), at(k, 1), at(k, 2));
        [corner(0), corner(1), corner(2)]
    }
}

impl Compact8 {
    /// The wide tree with its triangles by places, made smaller. No leaf may have more than [`MOST_VERTICES`] different
    /// vertices.
    pub(crate) fn new(wide: &Wide8, numbers: &[u32]) -> Self {
        let mut words = Vec::new();
        let mut leaf = |at: Reference| leaf_words(wide, at, numbers, &mut words);
        let mut nodes = Vec::with_capacity(wide.nodes.len());
        for wide in &wide.nodes {
            let mut node = Node::new(wide);
            for child in &mut node.children {
                let at = Reference(*child);
                if at != Reference::NOTHING && at.is_leaf() {
                    *child = leaf(at).0;
                }
            }
            nodes.push(node);
        }
        let root = if wide.root != Reference::NOTHING && wide.root.is_leaf() { leaf(wide.root) } else { wide.root };
        words.resize(words.len() + REACH, 0);
        words.shrink_to_fit();
        Self { root, nodes, words, depth: wide.depth(), sah_cost: wide.sah_cost() }
    }

    /// Bytes of the tree over so many triangles, where it is a bad one: no two triangles share a vertex. Making it takes no
    /// more than making the wide one.
    pub(crate) fn bytes_of(triangles: u64) -> u64 {
        triangles * 44 + (triangles / 7 + 1) * size_of::<Node>() as u64 + 4 * REACH as u64
    }

    /// See [`Wide8::sah_cost`].
    pub(crate) fn sah_cost(&self) -> f64 {
        self.sah_cost
    }

    /// Nodes from the root to the deepest leaf.
    pub(crate) fn depth(&self) -> u32 {
        self.depth
    }

    /// Memory of nodes and leaves.
    pub(crate) fn bytes(&self) -> usize {
        size_of_val(self.nodes.as_slice()) + size_of_val(self.words.as_slice())
    }

    /// Whether there may be a triangle at a place: `u32::MAX` stands for none.
    pub(crate) fn has(&self, place: usize) -> bool {
        place < self.words.len() - REACH
    }

    /// The number of the triangle at a place.
    #[inline(always)]
    pub(crate) fn number(&self, place: usize) -> Option<u32> {
        let triangle = Triangle(*self.words.get(place)?);
        self.words.get(place.checked_sub(triangle.count())?).copied()
    }

    /// How many nodes there are.
    pub(crate) fn node_count(&self) -> usize {
        self.nodes.len()
    }

    /// The places of a leaf, if that is there and whole.
    pub(crate) fn leaf_places(&self, at: Reference) -> Option<core::ops::Range<usize>> {
        let (first, count) = ((at.0 & (PLACES - 1)) as usize, (at.0 >> 28 & 7) as usize + 1);
        let triangles = self.words.get(first..first + count)?;
        let vertices = Triangle(triangles[0]).vertices();
        let whole = |(lane, word): (usize, &u32)| {
            let t = Triangle(*word);
            let shape = (t.lane(), t.count(), t.vertices()) == (lane, count, vertices);
            shape && (0..3).all(|k| t.vertex(k) < vertices)
        };
        let end = first + count + 3 * vertices;
        let there = first >= count && end + REACH <= self.words.len();
        (there && triangles.iter().enumerate().all(whole)).then_some(first..first + count)
    }

    /// All places of triangles.
    pub(crate) fn places(&self) -> impl Iterator<Item = usize> + '_ {
        let children = self.nodes.iter().flat_map(|n| n.children);
        let leaves = children.chain([self.root.0]).map(Reference).filter(|r| *r != Reference::NOTHING && r.is_leaf());
        leaves.flat_map(|at| {
            let first = (at.0 & (PLACES - 1)) as usize;
            first..first + (at.0 >> 28 & 7) as usize + 1
        })
    }
}

#[cfg(test)]
impl Compact8 {
    /// A box that no longer holds what is below, for tests.
    pub(crate) fn shrink_a_box(&mut self) {
        self.nodes[0].planes[1][0] = self.nodes[0].planes[0][0];
    }
}

/// Writes a leaf, and says where it is.
fn leaf_words(wide: &Wide8, at: Reference, numbers: &[u32], words: &mut Vec<u32>) -> Reference {
    let places = at.places();
    let count = places.len();
    let mut vertices: Vec<[u32; 3]> = Vec::with_capacity(MOST_VERTICES);
    let mut triangles = Vec::with_capacity(count);
    for place in places.clone() {
        let corners = wide.triangle(place).unwrap_or_default();
        let mut packed = 0;
        for (k, corner) in corners.iter().enumerate() {
            // By bits: -0 is not 0.
            let bits = corner.to_array().map(f32::to_bits);
            let index = vertices.iter().position(|v| *v == bits).unwrap_or_else(|| {
                vertices.push(bits);
                vertices.len() - 1
            });
            debug_assert!(index < MOST_VERTICES);
            packed |= (index as u32) << (4 * k);
        }
        triangles.push(packed);
    }
    words.extend(places.map(|place| numbers.get(place).copied().unwrap_or(u32::MAX)));
    let first = words.len() as u32;
    let shape = (vertices.len() as u32 - 1) << 12 | (count as u32 - 1) << 19;
    words.extend(triangles.iter().enumerate().map(|(lane, packed)| packed | shape | (lane as u32) << 16));
    (0..3).for_each(|axis| words.extend(vertices.iter().map(|v| v[axis])));
    Reference(Reference::LEAF | (count as u32 - 1) << 28 | first)
}

/// Whether triangles have no more different vertices than a leaf may have.
pub(crate) fn fits(triangles: impl Iterator<Item = [Vec3; 3]>) -> bool {
    let mut seen = [[0u32; 3]; MOST_VERTICES];
    let mut count = 0;
    for corner in triangles.flatten() {
        let bits = corner.to_array().map(f32::to_bits);
        if !seen[..count].contains(&bits) {
            let Some(slot) = seen.get_mut(count) else { return false };
            *slot = bits;
            count += 1;
        }
    }
    true
}
