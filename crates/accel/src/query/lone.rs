//! The nearest hit, or any, in the only instance of a scene: what most rays ask.
//!
//! The usual triangles of a leaf are met four at a time ([`Kernel::four`]); what is unusual goes through the scalar test,
//! with the ray entered once more so that nothing needs to be kept for it. Of the nearest hit only what it takes to
//! compare it is kept, and the rest is worked out at the end.

use core::ops::ControlFlow;

use firsthit_geometry::{Ray, transform::Transform, triangle};
use glam::{DVec3, Vec3};

use crate::kernel::{Found, Kernel, double};
use crate::layout::wide8::{Block, Wide8};
use crate::local::LocalRay;
use crate::model::{Model, within_triangle};
use crate::scene::is_interval;
use crate::simd::{Doubles, Lanes, Numbers};
use crate::stats::Off;
use crate::wide::{self, BoxRay, Met, Visit};
use crate::{Hit, HitId, Scene};

/// The only instance of a scene, of a model with a wide tree: there is nothing above it to be traversed.
#[derive(Clone, Copy)]
pub(super) struct Lone<'a> {
    pub(super) scene: &'a Scene,
    pub(super) model: &'a Model,
    pub(super) tree: &'a Wide8,
    pub(super) transform: &'a Transform,
}

impl Lone<'_> {
    #[inline(always)]
    pub(super) fn closest<L: Lanes, K: Kernel>(&self, ray: &Ray<f64>) -> Option<Hit> {
        let mut nearest = Nearest { found: Place { t: 0.0, u: 0.0, v: 0.0, place: usize::MAX, careful: false } };
        // It never breaks: the nearest hit is known at the end only.
        let _ = self.traverse::<L, K, _, true>(ray, &mut nearest);
        (nearest.found.place != usize::MAX).then(|| self.finished(&nearest.found))?
    }

    #[inline(always)]
    pub(super) fn any<L: Lanes, K: Kernel>(&self, ray: &Ray<f64>) -> bool {
        self.traverse::<L, K, _, false>(ray, &mut Occluded).is_break()
    }

    #[inline(always)]
    fn traverse<L: Lanes, K: Kernel, W: Want, const ORDERED: bool>(&self, world: &Ray<f64>, want: &mut W) -> ControlFlow<()> {
        // What is not finite is found out on entering the mesh.
        if !is_interval(world) {
            return ControlFlow::Continue(());
        }
        let Some(ray) = LocalRay::enter(world, self.transform, self.model.extent()) else {
            return ControlFlow::Continue(());
        };
        let setup = K::setup(&ray, self.model.guards());
        let filter = K::filter::<L>(&setup, &ray);
        let boxes = BoxRay {
            origin: ray.origin32,
            direction: ray.direction32,
            delta: if K::padded(&setup) { ray.delta } else { 0.0 },
            t_min: ray.box_t_min(world.t_min),
            t_max: ray.box_t_max(world.t_max),
        };
        // What is beyond the largest number is in no interval.
        let interval = [world.t_min.max(f64::MIN), world.t_max.min(f64::MAX)];
        let mut visitor = Visitor::<K, W> { lone: self, world, ray: &ray, setup, interval, want };
        wide::traverse::<L, _, _, ORDERED>(self.tree, &boxes, &filter, &mut Off, &mut visitor)
    }

    /// A hit as queries give it.
    #[inline(always)]
    fn finished(&self, found: &Place) -> Option<Hit> {
        let vertices = double(&self.tree.triangle(found.place)?);
        let normal = if found.careful { triangle::area_vector(vertices) } else { plain_normal(vertices) };
        Some(Hit { normal: self.transform.normal(normal), ..self.hit(found)? })
    }

    /// The same without its normal. -0 becomes 0, so that what is sorted by bits agrees with comparisons.
    #[inline(always)]
    fn hit(&self, found: &Place) -> Option<Hit> {
        let id = self.model.id(found.place)?;
        let id = HitId { instance: 0, geometry: id.geometry, primitive: id.primitive };
        Some(Hit { id, t: found.t + 0.0, u: found.u, v: found.v, normal: DVec3::ZERO })
    }

    /// [`Scene::comes_first`] of two at the same distance.
    #[cold]
    #[inline(never)]
    fn comes_first(&self, ray: &Ray<f64>, a: Place, b: Place) -> bool {
        match (self.hit(&a), self.hit(&b)) {
            (Some(a), Some(b)) => self.scene.comes_first(ray, a, b),
            _ => false,
        }
    }

    /// What [`Kernel::test`] says of one triangle.
    #[inline(never)]
    fn test<K: Kernel>(&self, world: &Ray<f64>, setup: &K::Setup, block: &Block, lane: usize, t_max: f64) -> Option<Place> {
        let ray = LocalRay::enter(world, self.transform, self.model.extent())?;
        let triangle: [Vec3; 3] = block.triangle(lane);
        let Found { mut t, u, v, grazing, careful, .. } = K::test(setup, &ray, &triangle, t_max * ray.t_scale)?;
        if grazing && K::clamped(setup) {
            t = within_triangle(ray, t, triangle)?;
        }
        Some(Place { t: t * ray.t_unscale, u, v, place: usize::MAX, careful })
    }
}

#[inline(always)]
fn plain_normal([a, b, c]: [DVec3; 3]) -> DVec3 {
    (b - a).cross(c - a)
}

/// A hit, as much as it takes to compare it.
#[derive(Clone, Copy)]
struct Place {
    /// In the world's parameter.
    t: f64,
    u: f32,
    v: f32,
    /// Where the triangle lies in the tree.
    place: usize,
    /// See [`Found::careful`].
    careful: bool,
}

/// What is done with a hit in the interval.
trait Want {
    /// The new end of the interval, or nothing if the hit is not taken.
    fn take(&mut self, lone: &Lone<'_>, ray: &Ray<f64>, found: Place) -> ControlFlow<(), bool>;
}

/// Keeps the nearest; of several at the same distance the first in order.
struct Nearest {
    found: Place,
}

impl Want for Nearest {
    #[inline(always)]
    fn take(&mut self, lone: &Lone<'_>, ray: &Ray<f64>, found: Place) -> ControlFlow<(), bool> {
        // No farther than the end of the interval, which is the last that was taken.
        let first = found.t < self.found.t || self.found.place == usize::MAX;
        if first || lone.comes_first(ray, found, self.found) {
            self.found = found;
            return ControlFlow::Continue(true);
        }
        ControlFlow::Continue(false)
    }
}

/// Stops at the first.
struct Occluded;

impl Want for Occluded {
    #[inline(always)]
    fn take(&mut self, _: &Lone<'_>, _: &Ray<f64>, _: Place) -> ControlFlow<(), bool> {
        ControlFlow::Break(())
    }
}

struct Visitor<'a, K: Kernel, W> {
    lone: &'a Lone<'a>,
    world: &'a Ray<f64>,
    ray: &'a LocalRay,
    setup: K::Setup,
    /// Of the world's parameter, finite.
    interval: [f64; 2],
    want: &'a mut W,
}

impl<K: Kernel, W: Want> Visitor<'_, K, W> {
    #[inline(always)]
    fn offer(&mut self, found: Place) -> ControlFlow<(), bool> {
        // What is not a number is in no interval.
        if !(self.interval[0] <= found.t && found.t <= self.interval[1]) {
            return ControlFlow::Continue(false);
        }
        let taken = self.want.take(self.lone, self.world, found)?;
        if taken {
            self.interval[1] = found.t;
        }
        ControlFlow::Continue(taken)
    }
}

impl<K: Kernel, W: Want> Visit<Off> for Visitor<'_, K, W> {
    #[inline(always)]
    fn visit<L: Lanes>(&mut self, met: &Met<'_, L>, _: &mut Off) -> ControlFlow<(), Option<f32>> {
        // Of the block with the first. Seldom are there some in both.
        let half = usize::from(met.lanes & 0xf == 0);
        let four = K::four::<L>(&self.setup, self.ray, met.blocks[half], &met.known, half);
        let t = four.t.mul(L::Doubles::splat(self.ray.t_unscale));
        let [first, last] = self.interval;
        let inside = L::Doubles::splat(first).le(t) & t.le(L::Doubles::splat(last));
        let sure = four.sure << (4 * half);
        // Those outside of the interval are done with.
        let mut left = met.lanes & !((four.none | (four.sure & !inside)) << (4 * half));
        if left == 0 {
            return ControlFlow::Continue(None);
        }
        let (t, mut shorter) = (t.store(), false);
        while left != 0 {
            let lane = left.trailing_zeros() as usize & 7;
            left &= left - 1;
            let place = met.first + lane;
            let told = if sure >> lane & 1 == 1 { K::weights(&met.known, &four, lane) } else { None };
            let found = if let Some([u, v]) = told {
                Place { t: t[lane & 3], u, v, place, careful: false }
            } else {
                let (block, last) = (met.blocks[lane / 4], self.interval[1]);
                let Some(found) = self.lone.test::<K>(self.world, &self.setup, block, lane, last) else { continue };
                Place { place, ..found }
            };
            shorter |= self.offer(found)?;
        }
        ControlFlow::Continue(if shorter { Some(self.ray.box_t_max(self.interval[1])) } else { None })
    }
}
