//! One ray in a scene of several instances, at the tiers that are asked most: through the tree above and into each mesh by
//! the shortest way.

use core::marker::PhantomData;
use core::ops::ControlFlow;

use firsthit_geometry::{Ray, Real};

use super::direct::{AskAny, AskClosest, Asked, Leaving, Short};
use super::{Closest, Collect, whether};
use crate::above::{WIDEST, Wide};
use crate::instance::Instance;
use crate::layout::wide8::Reference;
use crate::local::{FAR, OFF};
use crate::packet::Tier;
use crate::scene::is_interval;
use crate::simd::{self, Four, Lanes, Stack, Work};
use crate::single::{Only, delta_of, four, reciprocals};
use crate::stats::Off;
use crate::wide::{Boxes, SMALLEST};
use crate::{Hit, Scene};

/// An instance, and the place there of a triangle that the ray leaves: see [`Scene::closest_hit_from`].
pub(super) type Left = Option<(u32, usize)>;

impl Scene {
    /// The nearest hit.
    pub(super) fn closest_across<T: Tier>(&self, ray: &Ray<f64>, left: Left) -> Option<Hit> {
        let mut nearest = Nearest::<T> { scene: self, left, ray: *ray, best: None, tier: PhantomData };
        match self.walked(ray, &mut nearest) {
            Some(_) => nearest.best,
            None => AskClosest(self).anywhere::<T>(ray),
        }
    }

    /// Whether there is a hit.
    pub(super) fn any_across<T: Tier>(&self, ray: &Ray<f64>, left: Left) -> bool {
        let mut first = First::<T> { scene: self, left, ray, tier: PhantomData };
        match self.walked(ray, &mut first) {
            Some(flow) => flow.is_break(),
            None => AskAny(self).anywhere::<T>(ray),
        }
    }

    /// Visits the instances that the ray may meet, the nearest first. `None` where that has to be done another way.
    #[inline(always)]
    fn walked<V: VisitInstance>(&self, ray: &Ray<f64>, visitor: &mut V) -> Option<ControlFlow<()>> {
        let inner = self.inner();
        let (wide, order) = inner.above().wide()?;
        if wide.nodes.is_empty() || inner.has_unbounded() || !is_interval(ray) {
            return None;
        }
        simd::run(wide.level, Walk { scene: self, wide, order, ray, visitor })
    }
}

/// What is asked of the instances that a ray meets.
trait VisitInstance {
    /// Answers with the end of the interval from there on, or breaks.
    fn visit(&mut self, instance: u32) -> ControlFlow<(), f64>;
}

/// Keeps the nearest hit.
struct Nearest<'a, T> {
    scene: &'a Scene,
    left: Left,
    /// What is left of the ray.
    ray: Ray<f64>,
    best: Option<Hit>,
    tier: PhantomData<T>,
}

impl<T: Tier> VisitInstance for Nearest<'_, T> {
    #[inline(always)]
    fn visit(&mut self, i: u32) -> ControlFlow<(), f64> {
        let Self { scene, left, ray, .. } = *self;
        let (Instance { transform, .. }, model) = scene.inner().placed(i);
        let hit = if let Some((tree, level)) = model.wide() {
            let (only, asked) = (Only { model, tree, transform, instance: i }, AskClosest(scene));
            match left {
                Some((from, place)) if from == i => simd::run(level, Leaving { only, asked, ray: &self.ray, place }),
                _ => simd::run(level, Short::<_, _, T>::new(only, asked, &self.ray)),
            }
        } else {
            let order = |a, b| scene.comes_first(&ray, a, b);
            let mut closest = Collect::new(&ray, None, |_| true, Closest { order, best: None });
            let precision = scene.options().precision;
            let _ = model.trace::<false, T, _, _>(&ray, (i, transform), precision, &mut closest, &mut Off);
            closest.take.best.map(|hit| scene.finished(hit))
        };
        if let Some(hit) = hit {
            // It is no farther than the best.
            let ray = &self.ray;
            if self.best.is_none_or(|best| hit.t < best.t || scene.comes_first(ray, hit, best)) {
                (self.ray.t_max, self.best) = (hit.t, Some(hit));
            }
        }
        ControlFlow::Continue(self.ray.t_max)
    }
}

/// Stops at the first hit.
struct First<'a, T> {
    scene: &'a Scene,
    left: Left,
    ray: &'a Ray<f64>,
    tier: PhantomData<T>,
}

impl<T: Tier> VisitInstance for First<'_, T> {
    #[inline(always)]
    fn visit(&mut self, i: u32) -> ControlFlow<(), f64> {
        let Self { scene, left, ray, .. } = *self;
        let (Instance { transform, .. }, model) = scene.inner().placed(i);
        let found = if let Some((tree, level)) = model.wide() {
            let (only, asked) = (Only { model, tree, transform, instance: i }, AskAny(scene));
            match left {
                Some((from, place)) if from == i => simd::run(level, Leaving { only, asked, ray, place }),
                _ => simd::run(level, Short::<_, _, T>::new(only, asked, ray)),
            }
        } else {
            let mut any = whether(ray);
            let precision = scene.options().precision;
            model.trace::<false, T, _, _>(ray, (i, transform), precision, &mut any, &mut Off).is_break()
        };
        if found { ControlFlow::Break(()) } else { ControlFlow::Continue(ray.t_max) }
    }
}

/// The way through the tree above.
struct Walk<'a, V> {
    scene: &'a Scene,
    wide: &'a Wide,
    /// Of the runs' boxes.
    order: &'a [u32],
    ray: &'a Ray<f64>,
    visitor: &'a mut V,
}

/// Directions in the frame whose largest component lies between this and its reciprocal need not be scaled.
const LEAST: f64 = 1.0 / (1u64 << 40) as f64;

/// An end of the interval in single precision, not before it.
#[inline(always)]
fn end(t: f64) -> f32 {
    let t = t as f32;
    t + t.abs() * OFF
}

impl<V: VisitInstance> Work for Walk<'_, V> {
    type Output = Option<ControlFlow<()>>;

    #[inline(always)]
    fn run<L: Lanes>(self) -> Option<ControlFlow<()>> {
        let Self { scene, wide, order, ray, visitor } = self;
        let inner = scene.inner();
        // The ray in the frame, where its parameter stays the world's.
        let (center, scale, extent) = wide.frame();
        let unscale = L::Four::splat(1.0 / scale);
        let origin = four::<L::Four>(ray.origin).sub(four(center)).mul(unscale);
        let direction = four::<L::Four>(ray.direction).mul(unscale);
        let (_, _, half) = extent.parts();
        let delta = delta_of(origin.abs(), direction.abs(), LEAST, extent)?;
        // What `Inner::entering` says, for the farthest of these rays.
        let delta = delta + ((FAR + 3.0) * half * inner.round_trip()).to_f32().next_up();
        if !(delta < WIDEST) {
            return None;
        }
        let (origin, direction) = (L::narrow_four(origin), L::narrow_four(direction));
        let inverse = reciprocals(direction, SMALLEST * LEAST as f32);
        let boxes = Boxes::<L>::inverted(origin, direction, inverse, L::splat(delta));

        let start = L::splat(-end(-ray.t_min));
        let mut t_max = end(ray.t_max);
        let mut stack = Stack::<u64>::new();
        let mut current = 0u32;
        loop {
            if Reference(current).is_leaf() {
                let run = &wide.runs[(current & !Reference::LEAF) as usize];
                for &k in &order[run.start as usize..run.end as usize] {
                    match visitor.visit(inner.bounded(k)) {
                        ControlFlow::Continue(t) => t_max = end(t),
                        stop => return Some(stop.map_continue(drop)),
                    }
                }
            } else {
                let node = &wide.nodes[current as usize];
                let (hits, enter) = boxes.test(node, start, L::splat(t_max));
                if hits != 0 {
                    // What begins before 0 is all alike.
                    let keys = enter.max(L::splat(0.0)).pack(&node.children, hits);
                    current = stack.top().push_all_but_nearest(keys, hits.count_ones() as usize, false) as u32;
                    continue;
                }
            }
            loop {
                let Some(key) = stack.top().pop() else { return Some(ControlFlow::Continue(())) };
                if f32::from_bits((key >> 32) as u32) <= t_max.max(0.0) {
                    current = key as u32;
                    break;
                }
            }
        }
    }
}
