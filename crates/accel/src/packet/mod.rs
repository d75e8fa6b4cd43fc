//! Packets: rays that go the same way, through the tree together.
//!
//! A packet is some groups of eight rays. Setting up, triangles and finishing are done for eight rays at once, nodes are
//! met by all together. The answers are those of single rays, bit by bit (of `Fast` but for rays at the very edges of
//! boxes, which a packet may find where a single ray does not).

mod alone;
mod frustum;
mod group;
mod tier;
mod trace;
mod vectors;

use firsthit_geometry::{Ray, transform::Transform};
use glam::DVec3;

pub(crate) use alone::Courses;
pub(crate) use tier::Tier;

use crate::layout::wide8::{Reference, Wide8};
use crate::model::Model;
use crate::simd::{Eight, Lanes};
use crate::{Hit, HitId};
use group::{Entry, Group, transformed};
use tier::Way;
use trace::{Among, trace};

/// Groups of a packet.
const GROUPS: usize = 4;

/// Rays of a packet.
pub(crate) const RAYS: usize = 8 * GROUPS;

/// Nodes and leaves that a packet may visit: about as many as its rays would, one by one, in a large scene. Rays of one
/// direction that begin far apart visit far more than that.
const MOST_VISITS: u32 = 8 * RAYS as u32;

/// After a packet that visited too much, so many at most go one by one before it is tried again.
const LONGEST_PAUSE: u32 = 63;

/// Room for a packet, to be used again for the next one.
pub(crate) struct Packet<'a> {
    model: &'a Model,
    tree: &'a Wide8,
    transform: &'a Transform,
    groups: [Group; GROUPS],
    /// How many packets are not tried, and how many will not be after the next that visits too much.
    paused: u32,
    pause: u32,
}

impl<'a> Packet<'a> {
    /// For the only instance of a scene.
    #[inline(always)]
    pub(crate) fn new(model: &'a Model, tree: &'a Wide8, transform: &'a Transform) -> Self {
        Self { model, tree, transform, groups: [Group::default(); GROUPS], paused: 0, pause: 1 }
    }

    /// Whether rays may well go together: seen from a few of them and from the packets before, which is all that rays pay
    /// that do not.
    #[inline(always)]
    pub(crate) fn suits(&mut self, rays: &[Ray<f64>; RAYS]) -> bool {
        if self.tree.root.is_leaf() {
            return false;
        }
        let (first, middle, last) = (&rays[0].direction, &rays[RAYS / 2 + 1].direction, &rays[RAYS - 1].direction);
        let suits = narrow(first, last) && narrow(first, middle);
        if suits && self.paused > 0 {
            self.paused -= 1;
            return false;
        }
        suits
    }

    /// The nearest hit of each ray; or false, and nothing is known: the rays do not go together after all.
    #[inline(always)]
    #[must_use]
    pub(crate) fn closest<L: Lanes, T: Tier>(&mut self, rays: &[Ray<f64>; RAYS], hits: &mut [Option<Hit>]) -> bool {
        if !self.trace::<L, T, false>(rays) {
            return false;
        }
        for (group, hits) in self.groups.iter_mut().zip(hits.as_chunks_mut::<8>().0) {
            group.finish::<L>(self.model, self.transform, hits);
        }
        true
    }

    /// Whether each ray hits anything; or false, as above.
    #[inline(always)]
    #[must_use]
    pub(crate) fn any<L: Lanes, T: Tier>(&mut self, rays: &[Ray<f64>; RAYS], hits: &mut [bool]) -> bool {
        if !self.trace::<L, T, true>(rays) {
            return false;
        }
        for (group, hits) in self.groups.iter().zip(hits.as_chunks_mut::<8>().0) {
            for (lane, hit) in hits.iter_mut().enumerate() {
                *hit = group.hit >> lane & 1 == 1;
            }
        }
        true
    }

    /// The nearest hit of each ray, whatever way they go.
    #[inline(always)]
    pub(crate) fn closest_alone<L: Lanes, T: Tier>(
        &mut self,
        rays: &[Ray<f64>],
        courses: &mut Courses,
        hits: &mut [Option<Hit>],
    ) {
        self.alone::<L, T, false>(rays, courses);
        for (group, hits) in self.groups.iter_mut().zip(hits.as_chunks_mut::<8>().0) {
            group.finish::<L>(self.model, self.transform, hits);
        }
    }

    /// Whether each ray hits anything, whatever way they go.
    #[inline(always)]
    pub(crate) fn any_alone<L: Lanes, T: Tier>(&mut self, rays: &[Ray<f64>], courses: &mut Courses, hits: &mut [bool]) {
        self.alone::<L, T, true>(rays, courses);
        for (group, hits) in self.groups.iter().zip(hits.as_chunks_mut::<8>().0) {
            for (lane, hit) in hits.iter_mut().enumerate() {
                *hit = group.hit >> lane & 1 == 1;
            }
        }
    }

    /// Eights of rays, as many as a packet holds.
    #[inline(always)]
    fn alone<L: Lanes, T: Tier, const ANY: bool>(&mut self, rays: &[Ray<f64>], courses: &mut Courses) {
        let Self { model, tree, transform, groups, .. } = self;
        let rays = rays.as_chunks::<8>().0;
        let entry = Entry { transform, extent: model.extent(), padded: T::PADDED };
        for (rays, groups) in rays.chunks(alone::GROUPS).zip(groups.as_chunks_mut::<{ alone::GROUPS }>().0) {
            for (k, group) in groups.iter_mut().enumerate() {
                match rays.get(k) {
                    Some(rays) => group.enter::<L>(rays, &entry),
                    None => group.valid = 0,
                }
            }
            if tree.root != Reference::NOTHING {
                alone::trace::<L, T, ANY>(&Among { model, tree, transform, rays }, groups, courses);
            }
        }
    }

    /// Whether it was worth it.
    #[inline(always)]
    fn trace<L: Lanes, T: Tier, const ANY: bool>(&mut self, rays: &[Ray<f64>; RAYS]) -> bool {
        let Self { model, tree, transform, groups, .. } = self;
        let mut visits = MOST_VISITS;
        let rays = rays.as_chunks::<8>().0;
        let entry = Entry { transform, extent: model.extent(), padded: T::PADDED };
        let mut left = [0; GROUPS];
        for (k, group) in groups.iter_mut().enumerate() {
            group.enter::<L>(&rays[k], &entry);
            left[k] = group.valid;
        }
        let among = Among { model, tree, transform, rays };
        // Once for each way that some of them go; nearly always there is one.
        while let Some(k) = left.iter().position(|&m| m != 0) {
            let lane = left[k].trailing_zeros();
            let leader = &groups[k];
            let axis = leader.axis(lane);
            let negative = [
                leader.negative[0] >> lane & 1 == 1,
                leader.negative[1] >> lane & 1 == 1,
                leader.negative[2] >> lane & 1 == 1,
            ];
            let way = Way { negative, axes: [[1, 2, 0], [2, 0, 1], [0, 1, 2]][axis] };
            for k in 0..GROUPS {
                let lanes = left[k] & groups[k].alike(negative, axis);
                left[k] &= !lanes;
                groups[k].wake::<L>(lanes, way.axes);
            }
            if trace::<L, T, ANY>(&among, groups, &way, &mut visits).is_break() {
                self.paused = self.pause;
                self.pause = (2 * self.pause + 1).min(LONGEST_PAUSE);
                return false;
            }
        }
        self.pause = (self.pause / 2).max(1);
        true
    }
}

/// Whether two directions are within about 8 degrees of each other.
#[inline(always)]
fn narrow(a: &DVec3, b: &DVec3) -> bool {
    let along = a.dot(*b);
    along > 0.0 && along * along > 0.98 * (a.length_squared() * b.length_squared())
}

impl Group {
    /// Gives out the hits as users get them: with their ids and with the normal of the world.
    #[inline(always)]
    fn finish<L: Lanes>(&mut self, model: &Model, transform: &Transform, hits: &mut [Option<Hit>; 8]) {
        let of = L::Eight::splat;
        let [x, y, z] = &self.normal;
        let normal = [L::Eight::load(x), L::Eight::load(y), L::Eight::load(z)];
        let linear = transform.normal_linear();
        let normal = if transform.is_uniform() {
            vectors::scaled(normal, of(linear.x_axis.x))
        } else {
            transformed(&linear, normal)
        };
        for (from, to) in normal.into_iter().zip(&mut self.normal) {
            from.store(to);
        }
        for (lane, hit) in hits.iter_mut().enumerate() {
            *hit = None;
            if self.hit >> lane & 1 == 1
                && let Some(id) = model.id(self.place(lane))
            {
                let normal_direction = DVec3::new(self.normal[0][lane], self.normal[1][lane], self.normal[2][lane]);
                let id = HitId { instance: 0, geometry: id.geometry, primitive: id.primitive };
                *hit = Some(Hit { id, t: self.t_max[lane], u: self.u[lane], v: self.v[lane], normal_direction });
            }
        }
    }
}
