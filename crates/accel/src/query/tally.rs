//! How many hits rays have in a scene of one instance, and which way they go through, at the tier that is asked most: compiled
//! for itself alone, for all rays of a call.

use core::ops::ControlFlow;

use firsthit_geometry::transform::Transform;
use firsthit_geometry::{Precision, Ray};
use glam::DVec3;

use super::direct::NEEDED;
use super::{Collect, Crossings, Take};
use crate::Hit;
use crate::kernel::{MOST, Robust, Short, short_plane};
use crate::layout::wide8::Wide8;
use crate::local::{Line, LocalRay};
use crate::model::Model;
use crate::offer::OfferTriangle;
use crate::scene::Inner;
use crate::simd::{self, Available, Lanes, Work};
use crate::single::{self, Entered, Lean, careful, tell};
use crate::stats::Off;
use crate::wide::{self, Boxes, Visit, WideTree};

impl Inner {
    /// Counts the hits of each ray; `false` where this is no such scene, and nothing is done.
    pub(super) fn tally(&self, rays: &[Ray<f64>], crossings: Crossings, counts: &mut [u32]) -> bool {
        if self.options.precision != Precision::Robust || !self.options.guards.contains(NEEDED) {
            return false;
        }
        let Some((level, single::Only { model, tree, transform, .. })) = self.only() else { return false };
        let only = Only { model, tree, transform, surfaces: crossings == Crossings::Surfaces };
        run(level, Tally { only, rays, counts });
        true
    }

    /// The crossings of surfaces by a ray, and how many of them lead out of what these enclose: along the normal. `None`
    /// as above.
    pub(crate) fn crossings(&self, ray: &Ray<f64>) -> Option<Crossed> {
        if self.options.precision != Precision::Robust || !self.options.guards.contains(NEEDED) {
            return None;
        }
        let (level, single::Only { model, tree, transform, .. }) = self.only()?;
        let only = Only { model, tree, transform, surfaces: true };
        Some(cross(level, Cross { only, ray }))
    }
}

/// How often a ray goes through surfaces.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Crossed {
    pub(crate) count: u32,
    /// Those along the normal.
    pub(crate) out: u32,
}

impl Crossed {
    pub(crate) fn of(normal: DVec3, direction: DVec3) -> Self {
        Self { count: 1, out: u32::from(normal.dot(direction) > 0.0) }
    }

    /// Those out less those in.
    pub(crate) fn signed(self) -> i64 {
        2 * i64::from(self.out) - i64::from(self.count)
    }

    #[inline(always)]
    pub(crate) fn add(&mut self, other: Self) {
        self.count += other.count;
        self.out += other.out;
    }
}

#[inline(never)]
fn cross(level: Available, cross: Cross<'_>) -> Crossed {
    simd::run(level, cross)
}

/// One ray, with the way that it goes.
struct Cross<'a> {
    only: Only<'a>,
    ray: &'a Ray<f64>,
}

impl Work for Cross<'_> {
    type Output = Crossed;

    #[inline(always)]
    fn run<L: Lanes>(self) -> Crossed {
        self.only.cross::<L>(self.ray)
    }
}

/// Once for all callers.
#[inline(never)]
fn run(level: Available, tally: Tally<'_>) {
    simd::run(level, tally);
}

/// What is asked.
#[derive(Clone, Copy)]
struct Only<'a> {
    model: &'a Model,
    tree: &'a Wide8,
    transform: &'a Transform,
    /// Each crossing once.
    surfaces: bool,
}

/// The counts of some rays. The shorter slice decides how many.
struct Tally<'a> {
    only: Only<'a>,
    rays: &'a [Ray<f64>],
    counts: &'a mut [u32],
}

impl Work for Tally<'_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(self) {
        let Self { only, rays, counts } = self;
        for (ray, count) in rays.iter().zip(counts) {
            *count = only.cross::<L>(ray).count;
        }
    }
}

impl Only<'_> {
    #[inline(always)]
    fn cross<L: Lanes>(self, ray: &Ray<f64>) -> Crossed {
        let Some(entered) = Entered::<L>::new(ray, self.transform, self.model.extent()) else {
            return Crossed::default();
        };
        let Entered { line, t_unscale: unscale, interval, .. } = entered;
        let from = ray.t_min * entered.t_scale;
        let boxes = Boxes::<L>::inverted(entered.origin, entered.direction, entered.inverse, L::splat(entered.delta));
        let filter = Robust::picks(&entered);
        let mut visitor = Counter { only: self, ray, line, from, unscale, crossed: Crossed::default() };
        // It never breaks.
        let _ = wide::traverse::<L, _, _, Off, false>(self.tree, &boxes, interval, &filter, &mut Off, &mut visitor);
        visitor.crossed
    }

    // What is rare. By value: what is passed by reference has to be kept in memory by the caller, always.

    /// The hits of one triangle by the tier's kernel: at most one.
    #[cold]
    #[inline(never)]
    fn unclear(self, ray: Ray<f64>, place: usize, known: [f32; 3]) -> Crossed {
        let triangle = WideTree::triangle(self.tree, place);
        let Some(local) = LocalRay::enter(&ray, self.transform, self.model.extent()) else { return Crossed::default() };
        if !self.surfaces {
            let hit = self.model.hit_of_one::<Robust>(&ray, (0, self.transform), place, &triangle, known);
            return hit.map_or(Crossed::default(), |hit| Crossed::of(hit.normal_direction, local.line().direction));
        }
        let mut met = Collect::new(&ray, None, |_| true, Met { line: local.line(), crossed: Crossed::default() });
        let mut offer = OfferTriangle::<true, Robust>::new(self.model, &local, 0, &met);
        let _ = offer.offer(place, &triangle, Some(known), &mut met, &mut Off);
        met.take.crossed
    }
}

/// The hits of one triangle, in the object's space: as in the world, normals and directions are on the same side.
struct Met {
    line: Line,
    crossed: Crossed,
}

impl Take for Met {
    fn take(&mut self, hit: Hit, _: &mut f64) -> ControlFlow<(), bool> {
        self.crossed.add(Crossed::of(hit.normal_direction, self.line.direction));
        ControlFlow::Continue(false)
    }
}

/// Counts the triangles in the interval.
struct Counter<'a> {
    only: Only<'a>,
    ray: &'a Ray<f64>,
    line: Line,
    /// Start of the interval, local.
    from: f64,
    /// From local parameters to the world's.
    unscale: f64,
    crossed: Crossed,
}

impl Visit<Off> for Counter<'_> {
    #[inline(always)]
    fn visit(&mut self, place: usize, known: [f32; 3], _: &mut Off) -> ControlFlow<(), Option<f32>> {
        // Where an edge function is 0 a rule tells whose the crossing is.
        if !tell(known) {
            self.crossed.add(self.only.unclear(*self.ray, place, known));
            return ControlFlow::Continue(None);
        }
        let triangle = WideTree::triangle(self.only.tree, place);
        let plane = match short_plane(&triangle, &self.line, MOST, self.from) {
            Short::Met(plane) => Some(plane),
            Short::Before => return ControlFlow::Continue(None),
            Short::Grazed => careful::<true>(triangle, self.line),
            Short::Lost => careful::<false>(triangle, self.line),
        };
        match plane {
            Some(plane) => {
                let t = plane.t * self.unscale;
                let met = u32::from(self.ray.t_min <= t && t <= self.ray.t_max && t.abs() <= f64::MAX);
                let out = u32::from(plane.normal.dot(self.line.direction) > 0.0);
                self.crossed.add(Crossed { count: met, out: met & out });
            }
            // No crossing may be lost where the plane does not tell.
            None => self.crossed.add(self.only.unclear(*self.ray, place, known)),
        }
        ControlFlow::Continue(None)
    }
}
