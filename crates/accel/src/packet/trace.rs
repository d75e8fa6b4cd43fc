//! The traversal of a packet.

use core::ops::ControlFlow;

use firsthit_geometry::{Ray, transform::Transform};
use glam::{DVec3, Vec3};

use super::frustum::{Frustum, latest};
use super::group::Group;
use super::tier::{Known, Tier, Way};
use crate::kernel;
use crate::layout::wide8::{Reference, Wide8};
use crate::model::Model;
use crate::offer::within_triangle;
use crate::simd::{Eight, Lanes, Stack};
use crate::wide::{Filter, WideTree};

/// The mesh that a packet goes through, and its rays.
#[derive(Clone, Copy)]
pub(super) struct Among<'a> {
    pub(super) model: &'a Model,
    pub(super) tree: &'a Wide8,
    pub(super) transform: &'a Transform,
    /// Those of each group.
    pub(super) rays: &'a [[Ray<f64>; 8]],
}

/// Triangles that passed the filter of some rays of one group: a leaf's, at most eight.
struct Found<L> {
    lanes: [u32; 8],
    places: [u32; 8],
    known: [Known<L>; 8],
    len: usize,
}

impl<L: Lanes> Found<L> {
    #[inline(always)]
    fn push(&mut self, lanes: u32, place: usize, known: Known<L>) {
        let k = self.len & 7;
        (self.lanes[k], self.places[k], self.known[k]) = (lanes, place as u32, known);
        self.len += 1;
    }
}

/// Traces the rays that are awake, all of which go one way: each finds its nearest hit, or `ANY` hit. The tree's root must
/// be a node. It breaks where more nodes and leaves would be visited than are left.
///
/// Nodes are met by the packet as a whole, nearer ones first; leaves by each ray, and its triangles by eight rays at once,
/// or eight at once by a ray where few rays come so far. Whatever more is visited than a single ray would visit, the
/// answers are the same: of a tier with padded boxes they do not depend on the tree.
#[inline(always)]
pub(super) fn trace<L: Lanes, T: Tier, const ANY: bool>(
    among: &Among<'_>,
    groups: &mut [Group],
    way: &Way,
    visits: &mut u32,
) -> ControlFlow<()> {
    let Among { tree, .. } = *among;
    let frustum = Frustum::<L>::new(groups, way.negative);
    let mut end = latest::<L>(groups);
    let mut ends = L::splat(end);
    let mut keys = Stack::<u64>::new();
    let mut found = Found::<L> { lanes: [0; 8], places: [0; 8], known: [[L::splat(0.0); 3]; 8], len: 0 };
    let mut current = tree.root.index();
    loop {
        let node = &tree.nodes[current];
        let (hits, enter) = frustum.test(node, ends);
        // A key is the distance, and which child of which node it is: boxes of leaves are wanted again.
        let mut key = None;
        if hits != 0 {
            let slots = slots(current);
            let mut coming = hits;
            while coming != 0 {
                let child = Reference(node.children[coming.trailing_zeros() as usize & 7]);
                coming &= coming - 1;
                tree.prefetch(child);
            }
            let sorted = enter.max(L::splat(0.0)).pack(&slots, hits);
            key = Some(if hits & (hits - 1) == 0 {
                sorted[0]
            } else {
                keys.top().push_all_but_nearest(sorted, hits.count_ones() as usize, false)
            });
        }
        current = loop {
            let Some(next) = key.or_else(|| keys.top().pop()) else { return ControlFlow::Continue(()) };
            key = None;
            if f32::from_bits((next >> 32) as u32) > end.max(0.0) {
                continue;
            }
            let Some(fewer) = visits.checked_sub(1) else { return ControlFlow::Break(()) };
            *visits = fewer;
            let slot = next as u32;
            let (parent, child) = (&tree.nodes[(slot >> 3) as usize], (slot & 7) as usize);
            let reference = Reference(parent.children[child]);
            if !reference.is_leaf() {
                break reference.index();
            }
            let (block, lanes) = (reference.block(), reference.lanes());
            let leaf = tree.leaf(reference);
            let mut shortened = false;
            for (g, group) in groups.iter_mut().enumerate() {
                let rays = group.meet::<L>(parent, child, way.negative);
                if rays == 0 {
                    continue;
                }
                let singly = rays.count_ones() < lanes.count_ones();
                let mut rounds = if singly { rays } else { 1 };
                while rounds != 0 {
                    let ray = rounds.trailing_zeros() as usize & 7;
                    rounds &= rounds - 1;
                    found.len = 0;
                    if singly {
                        let filter = T::one::<L>(group, way, ray);
                        let interval = filter.interval(group.start[ray], group.end[ray]);
                        let (mut candidates, known) = filter.candidates(&leaf, &interval);
                        if candidates == 0 {
                            continue;
                        }
                        let known = [known[0].store(), known[1].store(), known[2].store()];
                        while candidates != 0 {
                            let lane = candidates.trailing_zeros() as usize & 7;
                            candidates &= candidates - 1;
                            let known = [L::splat(known[0][lane]), L::splat(known[1][lane]), L::splat(known[2][lane])];
                            found.push(1 << ray, block * 4 + lane, known);
                        }
                    } else {
                        let mut triangles = lanes;
                        while triangles != 0 {
                            let lane = triangles.trailing_zeros() as usize & 7;
                            triangles &= triangles - 1;
                            let triangle = tree.blocks[block + lane / 4].triangle(lane);
                            let (candidates, known) = T::candidates::<L>(group, way, &triangle);
                            // Without a branch: what is hit is not to be predicted.
                            found.push(candidates & rays, block * 4 + lane, known);
                            found.len -= usize::from(candidates & rays == 0);
                        }
                    }
                    for k in 0..found.len.min(8) {
                        let (mask, place) = (found.lanes[k], found.places[k] as usize);
                        let triangle = tree.blocks[place / 4].triangle(place);
                        shortened |= group.offer::<L, T, ANY>(among, way, g, mask, place, &triangle, found.known[k]);
                    }
                }
            }
            if shortened {
                end = latest::<L>(groups);
                if ANY && end == f32::NEG_INFINITY {
                    return ControlFlow::Continue(());
                }
                ends = L::splat(end);
            }
        };
    }
}

/// Numbers of the children of a node.
#[inline(always)]
fn slots(node: usize) -> [u32; 8] {
    let first = (node as u32) << 3;
    [first, first | 1, first | 2, first | 3, first | 4, first | 5, first | 6, first | 7]
}

impl Group {
    /// Tests a triangle for the rays whose filter it has passed; whether it hits one, or one sooner than anything before.
    #[inline(always)]
    fn offer<L: Lanes, T: Tier, const ANY: bool>(
        &mut self,
        among: &Among<'_>,
        way: &Way,
        index: usize,
        mask: u32,
        place: usize,
        triangle: &[Vec3; 3],
        known: Known<L>,
    ) -> bool {
        let met = T::meet(self, way, triangle, mask, known);
        // -0 becomes 0, as in a `Candidate`.
        let t = met.t.add(L::Eight::splat(0.0));
        let t_max = L::Eight::load(&self.t_max);
        let within = L::Eight::load(&self.t_min).le(t) & t.abs().le(L::Eight::splat(f64::MAX));
        let (nearer, level) = (t.lt(t_max), t.le(t_max));
        let fits = mask & met.plain & within;
        let mut take = fits & if ANY { level } else { nearer | (level & !self.hit) };
        if !ANY {
            // Of several at the same distance the first in order.
            let mut ties = fits & level & !nearer & self.hit;
            while ties != 0 {
                let lane = ties.trailing_zeros();
                ties &= ties - 1;
                take |= u32::from(comes_first(among.model, place, self.place(lane as usize & 7))) << lane;
            }
        }
        let mut shortened = false;
        if take != 0 && among.model.has(place) {
            shortened = true;
            self.hit |= take;
            if ANY {
                L::splat(f32::NEG_INFINITY).choose(take, L::load(&self.end)).put(&mut self.end);
                self.awake &= !take;
            } else {
                t.select(take, t_max).store(&mut self.t_max);
                met.u.choose(take, L::load(&self.u)).put(&mut self.u);
                met.v.choose(take, L::load(&self.v)).put(&mut self.v);
                for axis in 0..3 {
                    met.normal[axis].select(take, L::Eight::load(&self.normal[axis])).store(&mut self.normal[axis]);
                }
                L::splat(f32::from_bits(place as u32)).choose(take, L::load(&self.place)).put(&mut self.place);
                self.box_t::<L>(t, 1.0).choose(take, L::load(&self.end)).put(&mut self.end);
            }
        }
        let mut unclear = mask & met.unclear;
        if unclear != 0 {
            let known = [known[0].store(), known[1].store(), known[2].store()];
            while unclear != 0 {
                let lane = unclear.trailing_zeros() as usize & 7;
                unclear &= unclear - 1;
                let known = [known[0][lane], known[1][lane], known[2][lane]];
                shortened |= self.offer_one::<T, ANY>(among, index, lane, place, triangle, known);
            }
        }
        shortened
    }

    /// [`Group::offer`] for one ray.
    #[inline(always)]
    pub(super) fn offer_alone<T: Tier, const ANY: bool>(
        &mut self,
        among: &Among<'_>,
        index: usize,
        lane: usize,
        place: usize,
        triangle: &[Vec3; 3],
        known: [f32; 3],
    ) -> bool {
        let ray = self.local(lane, among.model.extent().parts().1);
        let Some(found) = T::meet_one(&ray, triangle, known) else {
            return self.offer_one::<T, ANY>(among, index, lane, place, triangle, known);
        };
        let Some(kernel::Found { t, u, v, normal, grazing, .. }) = found else { return false };
        let t = if grazing && T::PADDED { within_triangle(ray.line(), t, *triangle) } else { Some(t) };
        // -0 becomes 0, as in a `Candidate`.
        let Some(t) = t.map(|t| t * ray.t_unscale + 0.0) else { return false };
        if !(self.t_min[lane] <= t && t <= self.t_max[lane] && t.is_finite()) || !among.model.has(place) {
            return false;
        }
        self.take_one::<ANY>(among.model, lane, place, (t, u, v), normal)
    }

    /// [`Group::offer`] of what only the kernel can decide.
    #[inline(never)]
    fn offer_one<T: Tier, const ANY: bool>(
        &mut self,
        among: &Among<'_>,
        index: usize,
        lane: usize,
        place: usize,
        triangle: &[Vec3; 3],
        known: [f32; 3],
    ) -> bool {
        let ray = &among.rays[index][lane];
        let ray = ray.with_interval(ray.t_min, self.t_max[lane]);
        let Some(hit) = among.model.hit_of_one::<T>(&ray, (0, among.transform), place, triangle, known) else {
            return false;
        };
        self.take_one::<ANY>(among.model, lane, place, (hit.t, hit.u, hit.v), hit.normal_direction)
    }

    /// Takes a hit of one ray within its interval, but for one that another at the same distance comes before; whether
    /// it did.
    #[inline(always)]
    fn take_one<const ANY: bool>(
        &mut self,
        model: &Model,
        lane: usize,
        place: usize,
        (t, u, v): (f64, f32, f32),
        normal: DVec3,
    ) -> bool {
        let bit = 1 << lane;
        if ANY {
            self.end[lane] = f32::NEG_INFINITY;
            self.awake &= !bit;
        } else {
            let tie = t == self.t_max[lane] && self.hit & bit != 0;
            if tie && !comes_first(model, place, self.place(lane)) {
                return false;
            }
            (self.t_max[lane], self.u[lane], self.v[lane]) = (t, u, v);
            self.place[lane] = f32::from_bits(place as u32);
            (self.normal[0][lane], self.normal[1][lane], self.normal[2][lane]) = (normal.x, normal.y, normal.z);
            self.end[lane] = self.box_t_of(lane);
        }
        self.hit |= bit;
        true
    }
}

/// Whether a triangle comes before another that is hit at the same distance.
#[cold]
#[inline(never)]
fn comes_first(model: &Model, place: usize, other: usize) -> bool {
    model.number(place) < model.number(other)
}
