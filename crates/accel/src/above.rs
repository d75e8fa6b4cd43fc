//! The tree over instances: eight children a node where meshes have such trees too.
//!
//! Its boxes are single precision, in a frame of the scene's own: about its middle, and of size near 1. A ray enters that
//! frame as it enters a mesh ([`LocalRay`]), and boxes are met as if larger by all that is rounded, so no instance with a
//! hit is missed.

use core::ops::{ControlFlow, Range};

use firsthit_geometry::{Aabb, Ray, Real, slab::Slabs, transform::Transform};
use glam::{DAffine3, DVec3};

use crate::build::{Child, Topology};
use crate::layout::wide8::{Node, Reference};
use crate::layout::{Bvh2, Tree};
use crate::local::{Extent, LocalRay};
use crate::nearest::{Boxed, Point, squared_distance, walk, walk_binary};
use crate::simd::{self, Available, Lanes, Stack, Work};
use crate::stats::Probe;
use crate::traverse::traverse;
use crate::wide::Boxes;
use crate::{BuildOptions, Layout};

/// A tree over boxes in the world.
#[derive(Clone, Debug)]
pub(crate) struct Above {
    tree: AboveTree,
    /// Which box is at each position of the leaves' runs.
    order: Vec<u32>,
    depth: u32,
}

#[allow(clippy::large_enum_variant, reason = "one for each scene, and read by every ray")]
#[derive(Clone, Debug)]
enum AboveTree {
    Binary(Bvh2<f64>),
    Wide(Wide),
}

/// Of a query: what the traversal has to know of it, and is told by each leaf.
pub(crate) struct Asked {
    /// How far from the ray, in each axis, the ray may lie that is tested in the end.
    pub(crate) off: DVec3,
    /// Boxes are met as if larger by that.
    pub(crate) padded: bool,
    /// Nearer boxes first.
    pub(crate) ordered: bool,
    /// The interval, of the world's parameter.
    pub(crate) t_min: f64,
    pub(crate) t_max: f64,
}

impl Above {
    /// Over these boxes, none empty.
    pub(crate) fn new(boxes: &[Aabb<f64>], options: BuildOptions) -> Self {
        let frame = Frame::new(boxes);
        let relative: Vec<Aabb<f32>> = boxes.iter().map(|b| frame.boxed(b)).collect();
        match options.layout {
            Layout::Bvh2 => {
                let topology = Topology::new(&relative, options.quality);
                let tree = AboveTree::Binary(Bvh2::new(&topology, boxes));
                Self { tree, depth: topology.depth(), order: topology.order }
            }
            Layout::Wide8 | Layout::Compact8 => {
                let topology = Topology::single(&relative, options.quality);
                let wide = Wide::new(&topology, &relative, frame, Available::up_to(options.simd));
                Self { depth: wide.depth(), tree: AboveTree::Wide(wide), order: topology.order }
            }
        }
    }

    /// Nodes from the root to the deepest leaf.
    pub(crate) fn depth(&self) -> u32 {
        self.depth
    }

    /// Memory of it all.
    pub(crate) fn bytes(&self) -> usize {
        let nodes = match &self.tree {
            AboveTree::Binary(tree) => tree.bytes(),
            AboveTree::Wide(wide) => size_of_val(&wide.nodes[..]) + size_of_val(&wide.runs[..]),
        };
        nodes + size_of_val(&self.order[..])
    }

    /// Visits the boxes that the ray meets. `visit` gets their numbers, and answers with the end of the interval from
    /// there on, or breaks. Called through a pointer where the tree is wide, so that its traversal is compiled once for
    /// each level of instructions.
    #[inline]
    pub(crate) fn traverse<P: Probe>(
        &self,
        ray: &Ray<f64>,
        asked: &Asked,
        probe: &mut P,
        mut visit: impl FnMut(&[u32], &mut P) -> ControlFlow<(), f64>,
    ) -> ControlFlow<()> {
        match &self.tree {
            AboveTree::Binary(tree) => match tree.root() {
                Some(root) if root.is_leaf() => visit(&self.order[root.range()], probe).map_continue(drop),
                _ if !ray.is_valid() => ControlFlow::Continue(()),
                _ => {
                    let slabs = Slabs::new(ray.origin, ray.direction);
                    let leaf = |range: Range<usize>, probe: &mut P| visit(&self.order[range], probe);
                    if asked.padded {
                        let slabs = slabs.widened(asked.off);
                        traverse::<true, _, _, _>(tree, &slabs, asked.t_min, asked.t_max, probe, leaf)
                    } else {
                        traverse::<false, _, _, _>(tree, &slabs, asked.t_min, asked.t_max, probe, leaf)
                    }
                }
            },
            AboveTree::Wide(wide) => {
                if !wide.nodes.is_empty() && !ray.is_valid() {
                    return ControlFlow::Continue(());
                }
                let local = if wide.nodes.is_empty() { None } else { wide.frame.enter(ray) };
                // In the frame's units, and more than its own rounding.
                let off = asked.off.max_element() / wide.frame.scale * 1.001;
                let delta = local.as_ref().map_or(f32::NAN, |l| (f64::from(l.delta) + off).to_f32().next_up());
                let Some(local) = local.filter(|_| delta < WIDEST) else {
                    // A single run, or a ray that has no room in the frame, though perhaps in a mesh, or comes from so far
                    // that any box may be met.
                    return visit(&self.order, probe).map_continue(drop);
                };
                let (reversed, prunes) = (probe.reversed(), probe.prunes());
                let mut boxes = 0;
                let mut leaf = |run: Range<usize>| visit(&self.order[run], probe);
                let work =
                    Walk { wide, ray: local, delta, asked, reversed, prunes, leaf: &mut leaf, boxes: &mut boxes };
                let flow = simd::run(wide.level, work);
                probe.boxes(boxes);
                flow
            }
        }
    }
}

impl Above {
    /// Visits the boxes that are not farther from a point than the limit (squared), the nearest first. `visit` gets their
    /// numbers, and answers with the limit from there on.
    pub(crate) fn nearest(&self, point: DVec3, limit: f64, visit: &mut dyn FnMut(&[u32]) -> f64) {
        match &self.tree {
            AboveTree::Binary(tree) => {
                // The boxes have room for what is rounded in meshes; here for what is rounded in distances.
                let distance = |b: &Aabb<f64>| squared_distance(b, point) * (1.0 - 1e-12);
                walk_binary(tree, distance, limit, |range| visit(&self.order[range]));
            }
            AboveTree::Wide(wide) => {
                let local = (point - wide.frame.center) / wide.frame.scale;
                if wide.nodes.is_empty() || !(local.abs().max_element() < 2f64.powi(30)) {
                    visit(&self.order);
                    return;
                }
                let rounded = (local - local.as_vec3().as_dvec3()).length() + 2f64.powi(-21);
                simd::run(wide.level, Nearest { wide, order: &self.order, local, rounded, limit, visit });
            }
        }
    }
}

/// For those who walk through the tree themselves.
impl Above {
    /// The wide tree, and the numbers of boxes that its runs are of.
    #[inline(always)]
    pub(crate) fn wide(&self) -> Option<(&Wide, &[u32])> {
        if let AboveTree::Wide(wide) = &self.tree { Some((wide, &self.order)) } else { None }
    }

    /// How many nodes there are.
    pub(crate) fn node_count(&self) -> usize {
        match &self.tree {
            AboveTree::Binary(tree) => tree.node_count(),
            AboveTree::Wide(wide) => wide.nodes.len(),
        }
    }

    /// The root, where that is a node.
    pub(crate) fn first(&self) -> Option<u32> {
        match &self.tree {
            AboveTree::Binary(tree) => tree.first().filter(|root| !root.is_leaf()).map(|root| root.first),
            AboveTree::Wide(wide) => (!wide.nodes.is_empty()).then_some(0),
        }
    }

    /// The number of the box at a position of the leaves' runs.
    pub(crate) fn numbered(&self, position: u32) -> u32 {
        self.order[position as usize]
    }

    /// What is below a node, nodes or runs of positions, each with a box in the world around it.
    pub(crate) fn below(&self, node: u32, f: &mut dyn FnMut(Result<u32, Range<u32>>, Aabb<f64>)) {
        match &self.tree {
            AboveTree::Binary(tree) => {
                for (child, bounds) in tree.below(node) {
                    let run = child.first..child.first + child.count;
                    f(if child.is_leaf() { Err(run) } else { Ok(child.first) }, bounds);
                }
            }
            AboveTree::Wide(wide) => {
                let Frame { center, scale, .. } = wide.frame;
                // What is rounded here is less than what is rounded outward in single precision, but for the center's part.
                let room = DVec3::splat(2.0 * f64::EPSILON) * (center.abs() + scale);
                wide.nodes[node as usize].each(|child, bounds| {
                    let bounds = bounds.to_f64();
                    let world = Aabb::new(bounds.min * scale + center - room, bounds.max * scale + center + room);
                    let run = || wide.runs[(child.0 & !Reference::LEAF) as usize].clone();
                    f(if child.is_leaf() { Err(run()) } else { Ok(child.0) }, world);
                });
            }
        }
    }
}

/// [`Above::nearest`] by the instructions of a level.
struct Nearest<'a> {
    wide: &'a Wide,
    order: &'a [u32],
    local: DVec3,
    /// How far the point may be from where it is seen.
    rounded: f64,
    limit: f64,
    visit: &'a mut dyn FnMut(&[u32]) -> f64,
}

impl Nearest<'_> {
    fn limit(&self, squared: f64) -> f32 {
        let far = squared.sqrt() / self.wide.frame.scale + self.rounded;
        (far * far * (1.0 + 1e-5)).min(f64::from(f32::MAX)).to_f32().next_up().min(f32::MAX)
    }
}

impl Work for Nearest<'_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(mut self) {
        let limit = self.limit(self.limit);
        let point = self.local.as_vec3();
        walk::<L>(&mut self, point, limit);
    }
}

impl<L: Lanes> Boxed<L> for Nearest<'_> {
    type Node = Node;

    #[inline(always)]
    fn root(&self) -> Reference {
        Reference(0)
    }

    #[inline(always)]
    fn node(&self, at: Reference) -> &Node {
        &self.wide.nodes[at.index()]
    }

    #[inline(always)]
    fn leaf(&mut self, at: Reference, _: Point<L>, _: f32) -> f32 {
        let run = self.wide.runs[(at.0 & !Reference::LEAF) as usize].clone();
        let squared = (self.visit)(&self.order[run.start as usize..run.end as usize]);
        self.limit(squared)
    }
}

/// Boxes are met as if larger by less than this, in a frame of size near 1: reciprocals are below 2^60, and products of the
/// two must stay far from infinity, or children that are missing would be met.
pub(crate) const WIDEST: f32 = 1024.0;

/// Where the scene's boxes are of single precision.
#[derive(Clone, Debug)]
struct Frame {
    center: DVec3,
    /// A power of two.
    scale: f64,
    transform: Option<Transform>,
    extent: Extent,
}

impl Frame {
    fn new(boxes: &[Aabb<f64>]) -> Self {
        let all = boxes.iter().fold(Aabb::empty(), |a, b| a.union(*b));
        if all.is_empty() {
            return Self { center: DVec3::ZERO, scale: 1.0, transform: None, extent: Extent::default() };
        }
        let center = all.center();
        let scale = all.extent().max_element().power_of_two_below();
        let placed = DAffine3::from_scale_rotation_translation(DVec3::splat(scale), Default::default(), center);
        let half = all.extent() * (0.5 / scale);
        Self { center, scale, transform: Transform::new(placed).ok(), extent: Extent::new(&Aabb::new(-half, half)) }
    }

    fn boxed(&self, b: &Aabb<f64>) -> Aabb<f32> {
        let k = 1.0 / self.scale;
        Aabb::new((b.min - self.center) * k, (b.max - self.center) * k).to_f32_outward()
    }

    fn enter(&self, ray: &Ray<f64>) -> Option<LocalRay> {
        LocalRay::enter(ray, self.transform.as_ref()?, &self.extent)
    }
}

/// Nodes of eight children over runs of boxes.
#[derive(Clone, Debug)]
pub(crate) struct Wide {
    /// The root first; none where all boxes are in one run.
    pub(crate) nodes: Vec<Node>,
    /// What a leaf's reference counts.
    pub(crate) runs: Vec<Range<u32>>,
    frame: Frame,
    pub(crate) level: Available,
}

impl Wide {
    /// Middle and scale of the frame, and what is around all boxes there.
    #[inline(always)]
    pub(crate) fn frame(&self) -> (DVec3, f64, &Extent) {
        (self.frame.center, self.frame.scale, &self.frame.extent)
    }
}

impl Wide {
    /// Each node takes in the largest of its children until it has eight.
    fn new(topology: &Topology, boxes: &[Aabb<f32>], frame: Frame, level: Available) -> Self {
        let mut wide = Self { nodes: Vec::new(), runs: Vec::new(), frame, level };
        let Some(root) = topology.root.filter(|r| !r.is_leaf()) else { return wide };
        let bounds = bounds(topology, boxes);
        let of = |c: Child| {
            if c.is_leaf() { run_bounds(topology, boxes, c) } else { bounds[c.first as usize] }
        };
        wide.nodes.push(Node::EMPTY);
        let mut open = vec![(root, 0usize)];
        while let Some((node, place)) = open.pop() {
            let mut children = topology.nodes[node.first as usize].to_vec();
            while children.len() < 8 {
                let inner = (0..children.len()).filter(|&k| !children[k].is_leaf());
                let area = |k: &usize| of(children[*k]).area();
                let Some(largest) = inner.max_by(|a, b| area(a).total_cmp(&area(b))) else { break };
                let child = children.swap_remove(largest);
                children.extend(topology.nodes[child.first as usize]);
            }
            // Smaller boxes first, as in every wide tree.
            children.sort_by(|&a, &b| of(a).area().total_cmp(&of(b).area()));
            for (k, &child) in children.iter().enumerate() {
                let reference = if child.is_leaf() {
                    wide.runs.push(child.first..child.first + child.count);
                    Reference::LEAF | (wide.runs.len() - 1) as u32
                } else {
                    wide.nodes.push(Node::EMPTY);
                    open.push((child, wide.nodes.len() - 1));
                    (wide.nodes.len() - 1) as u32
                };
                wide.nodes[place].set_box(k, &of(child));
                wide.nodes[place].children[k] = reference;
            }
        }
        wide
    }

    fn depth(&self) -> u32 {
        let mut depths = vec![1; self.nodes.len()];
        let mut deepest = u32::from(!self.runs.is_empty() || self.nodes.is_empty());
        for (i, node) in self.nodes.iter().enumerate() {
            for child in node.children.map(Reference) {
                if child == Reference::NOTHING {
                    continue;
                }
                deepest = deepest.max(depths[i] + 1);
                if !child.is_leaf() {
                    depths[child.index()] = depths[i] + 1;
                }
            }
        }
        deepest
    }
}

/// Around what is below each node.
fn bounds(topology: &Topology, boxes: &[Aabb<f32>]) -> Vec<Aabb<f32>> {
    let mut bounds = vec![Aabb::empty(); topology.nodes.len()];
    // Children come after their parents.
    for i in (0..bounds.len()).rev() {
        let of = |c: Child| if c.is_leaf() { run_bounds(topology, boxes, c) } else { bounds[c.first as usize] };
        let [l, r] = topology.nodes[i];
        bounds[i] = of(l).union(of(r));
    }
    bounds
}

fn run_bounds(topology: &Topology, boxes: &[Aabb<f32>], leaf: Child) -> Aabb<f32> {
    topology.order[leaf.range()].iter().fold(Aabb::empty(), |b, &i| b.union(boxes[i as usize]))
}

/// The traversal of the wide tree.
struct Walk<'a> {
    wide: &'a Wide,
    ray: LocalRay,
    /// By how much boxes are met as if larger.
    delta: f32,
    asked: &'a Asked,
    reversed: bool,
    prunes: bool,
    leaf: &'a mut dyn FnMut(Range<usize>) -> ControlFlow<(), f64>,
    boxes: &'a mut u32,
}

impl Work for Walk<'_> {
    type Output = ControlFlow<()>;

    #[inline(always)]
    fn run<L: Lanes>(self) -> ControlFlow<()> {
        let Self { wide, ray, delta, asked, reversed, prunes, leaf, boxes } = self;
        let test = Boxes::<L>::of(ray.origin32, ray.direction32, delta);
        let t_min = L::splat(ray.box_t_min(asked.t_min));
        let mut t_max = ray.box_t_max(asked.t_max);
        let mut stack = Stack::<u64>::new();
        let mut current = 0u32;
        loop {
            if Reference(current).is_leaf() {
                let run = wide.runs[(current & !Reference::LEAF) as usize].clone();
                t_max = ray.box_t_max(leaf(run.start as usize..run.end as usize)?);
            } else {
                let node = &wide.nodes[current as usize];
                let (mut hits, enter) = test.test(node, t_min, L::splat(t_max));
                *boxes = boxes.saturating_add(8);
                if !prunes {
                    hits = node.children.iter().enumerate().fold(0, |m, (k, &c)| m | u32::from(c != u32::MAX) << k);
                }
                // As in the meshes' traversal: what begins before 0 is all alike. Without distances larger boxes come
                // first, which are the last: their keys count down.
                let order = if asked.ordered { enter.max(L::splat(0.0)) } else { L::load(&LAST_FIRST) };
                let keys = order.pack(&node.children, hits);
                match hits.count_ones() as usize {
                    0 => {}
                    1 => {
                        current = keys[0] as u32;
                        continue;
                    }
                    n => {
                        current = stack.top().push_all_but_nearest(keys, n, reversed) as u32;
                        continue;
                    }
                }
            }
            loop {
                let Some(key) = stack.top().pop() else { return ControlFlow::Continue(()) };
                // Any end of an interval is beyond what does not tell distances.
                let enter = if asked.ordered { f32::from_bits((key >> 32) as u32) } else { f32::NEG_INFINITY };
                if !prunes || enter <= t_max.max(0.0) {
                    current = key as u32;
                    break;
                }
            }
        }
    }
}

const LAST_FIRST: [f32; 8] = [8.0, 7.0, 6.0, 5.0, 4.0, 3.0, 2.0, 1.0];

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stats::{Off, Watch};
    use proptest::prelude::*;

    fn options(layout: Layout) -> BuildOptions {
        BuildOptions { layout, ..BuildOptions::default() }
    }

    /// The boxes that a traversal visits, in order of their numbers.
    fn visited(above: &Above, ray: &Ray<f64>, ordered: bool, probe: &mut impl Probe) -> Vec<u32> {
        let asked = Asked { off: DVec3::ZERO, padded: true, ordered, t_min: ray.t_min, t_max: ray.t_max };
        let mut all = Vec::new();
        let flow = above.traverse(ray, &asked, probe, |run, _| {
            all.extend_from_slice(run);
            ControlFlow::Continue(ray.t_max)
        });
        assert!(flow.is_continue());
        all.sort_unstable();
        all
    }

    proptest! {
        /// Whatever a ray meets is visited, once, and little else; also far away, and at any scale.
        #[test]
        fn boxes_that_are_met_are_visited(
            corners in prop::collection::vec((prop::array::uniform3(-8i32..8), prop::array::uniform3(0i32..3)), 0..60),
            (from, to) in (prop::array::uniform3(-20i32..20), prop::array::uniform3(-20i32..20)),
            (offset, scale) in (prop_oneof![Just(0.0), Just(1e6)], -20i32..20), ordered: bool, within: bool,
        ) {
            let v = |a: [i32; 3]| DVec3::new(a[0].into(), a[1].into(), a[2].into());
            let (scale, at) = (2f64.powi(scale), DVec3::new(offset, -offset, offset));
            let placed = |p: DVec3| (p + at) * scale;
            let boxes: Vec<_> = corners.iter().map(|&(c, s)| Aabb::new(placed(v(c)), placed(v(c) + v(s)))).collect();
            prop_assume!(from != to);
            let t_max = if within { 1.0 } else { f64::INFINITY };
            let ray = Ray { origin: placed(v(from)), direction: (v(to) - v(from)) * scale, t_min: 0.0, t_max };
            let met = |grown: f64| -> Vec<u32> {
                let slabs = Slabs::new(ray.origin, ray.direction).widened(DVec3::splat(grown * scale));
                let meets = |b: &Aabb<f64>| {
                    let (enter, leave) = slabs.padded(b, ray.t_min, ray.t_max);
                    enter <= leave
                };
                (0..boxes.len() as u32).filter(|&i| meets(&boxes[i as usize])).collect()
            };
            for layout in Layout::ALL {
                let above = Above::new(&boxes, options(layout));
                let got = visited(&above, &ray, ordered, &mut Off);
                prop_assert!(met(0.0).iter().all(|i| got.contains(i)), "{:?}: {:?} of {:?}", layout, got, met(0.0));
                prop_assert!(got.windows(2).all(|w| w[0] < w[1]));
                // Leaves of the binary tree hold several.
                let alone = layout == Layout::Wide8 && boxes.len() > 1;
                prop_assert!(!alone || got.iter().all(|i| met(0.01).contains(i)), "more: {:?}", got);
                let mut all = Watch { exhaustive: true, reversed: true, ..Watch::default() };
                prop_assert_eq!(visited(&above, &ray, ordered, &mut all).len(), boxes.len());
            }
        }
    }

    #[test]
    fn rays_without_room_in_the_frame_visit_everything() {
        let boxes: Vec<_> =
            (0..20).map(|i| Aabb::new(DVec3::X * f64::from(i), DVec3::X * f64::from(i) + DVec3::ONE)).collect();
        let above = Above::new(&boxes, options(Layout::Wide8));
        let ray = Ray { origin: DVec3::ZERO, direction: DVec3::X * 1e-170, t_min: 0.0, t_max: f64::INFINITY };
        assert_eq!(visited(&above, &ray, true, &mut Off).len(), 20);
        // From so far that its place is not known to within the scene.
        let ray = Ray { origin: DVec3::new(1e300, 3e299, 0.5), direction: DVec3::NEG_X, ..ray };
        assert_eq!(visited(&above, &ray, true, &mut Off).len(), 20);
        let asked = Asked { off: DVec3::INFINITY, padded: true, ordered: true, t_min: 0.0, t_max: 1.0 };
        let mut count = 0;
        let flow = above.traverse(&Ray::new(DVec3::ZERO, DVec3::X), &asked, &mut Off, |run, _| {
            count += run.len();
            ControlFlow::Continue(1.0)
        });
        assert!(flow.is_continue() && count == 20);
    }
}
