//! Closest and any hit, compiled for their collectors alone: they are what most rays ask. The tier and the
//! instructions are chosen outside, once for each call.

use core::marker::PhantomData;
use core::ops::ControlFlow;

use firsthit_geometry::{Precision, Ray, transform::Transform};

use super::{Any, Closest, Collect, Collector, Leaving};
use crate::kernel::{Double, Exact, Fast, Guarded, Kernel, Robust};
use crate::layout::compact8::Compact8;
use crate::layout::wide8::Wide8;
use crate::model::{Model, PrimitiveId};
use crate::packet::{self, Courses, Packet, Tier};
use crate::scene::{Inner, is_interval};
use crate::simd::{self, Available, Lanes, Work};
use crate::stats::Off;
use crate::wide::WideTree;
use crate::{Guards, Hit, HitId, Scene};

/// The guards that the tier `Robust` has in queries.
const NEEDED: Guards = Guards::ALL.difference(Guards::OFFSET);

impl Scene {
    /// The nearest hit in the ray's closed interval; `None` also for an invalid ray.
    #[must_use]
    pub fn closest_hit(&self, ray: &Ray<f64>) -> Option<Hit> {
        self.inner().by_kernel(ClosestHit { scene: self, ray })
    }

    /// [`Scene::closest_hit`] for each ray, into the slot of the same index. The shorter slice decides how many.
    ///
    /// Rays that go the same way, as those of neighbouring pixels in the order of small squares, are traced together where
    /// they follow each other; the answers are the same.
    pub fn closest_hits(&self, rays: &[Ray<f64>], hits: &mut [Option<Hit>]) {
        let n = rays.len().min(hits.len());
        let (rays, hits) = (&rays[..n], &mut hits[..n]);
        let (precision, guards) = (self.options().precision, self.options().guards);
        let asked = AskClosest(self);
        match self.inner().only() {
            Some((level, only)) if precision == Precision::Fast => {
                simd::run(level, InPackets { only, asked, rays, answers: hits, tier: PhantomData::<Fast> });
            }
            Some((level, only)) if precision == Precision::Robust && guards.contains(NEEDED) => {
                simd::run(level, InPackets { only, asked, rays, answers: hits, tier: PhantomData::<Robust> });
            }
            _ => self.inner().by_kernel(ClosestHits { scene: self, rays, hits }),
        }
    }

    /// Whether anything lies in the ray's closed interval: true exactly when [`Scene::closest_hit`] finds something.
    #[must_use]
    pub fn any_hit(&self, ray: &Ray<f64>) -> bool {
        self.inner().by_kernel(AnyHit { scene: self, ray })
    }

    /// [`Scene::any_hit`] for each ray, into the slot of the same index. The shorter slice decides how many.
    pub fn any_hits(&self, rays: &[Ray<f64>], hits: &mut [bool]) {
        let n = rays.len().min(hits.len());
        let (rays, hits) = (&rays[..n], &mut hits[..n]);
        let (precision, guards) = (self.options().precision, self.options().guards);
        let asked = AskAny;
        match self.inner().only() {
            Some((level, only)) if precision == Precision::Fast => {
                simd::run(level, InPackets { only, asked, rays, answers: hits, tier: PhantomData::<Fast> });
            }
            Some((level, only)) if precision == Precision::Robust && guards.contains(NEEDED) => {
                simd::run(level, InPackets { only, asked, rays, answers: hits, tier: PhantomData::<Robust> });
            }
            _ => self.inner().by_kernel(AnyHits { scene: self, rays, hits }),
        }
    }
}

/// Rays that leave a triangle.
impl Scene {
    /// [`Scene::closest_hit`] of a ray that starts where [`SurfacePoint::spawn`] says on the triangle `source`, and goes away
    /// from it: the same answer, found sooner. That the ray does not meet the triangle that it comes from would take many
    /// digits to tell; here that triangle is not tested (where the precision is [`Precision::Robust`], of scenes of one instance).
    ///
    /// [`SurfacePoint::spawn`]: crate::SurfacePoint::spawn
    #[must_use]
    pub fn closest_hit_from(&self, ray: &Ray<f64>, source: HitId) -> Option<Hit> {
        match self.inner().left(source) {
            Some((level, only, place)) => simd::run(level, ClosestHitFrom { only, scene: self, ray, place }),
            None => self.closest_hit(ray),
        }
    }

    /// [`Scene::any_hit`] of a ray as for [`Scene::closest_hit_from`].
    #[must_use]
    pub fn any_hit_from(&self, ray: &Ray<f64>, source: HitId) -> bool {
        match self.inner().left(source) {
            Some((level, only, place)) => simd::run(level, AnyHitFrom { only, ray, place }),
            None => self.any_hit(ray),
        }
    }
}

/// Work that depends on the tier: the choice is made once, outside of it.
pub(crate) trait ForKernel {
    type Output;
    fn run<K: Kernel>(self) -> Self::Output;
}

/// [`Scene::closest_hit`].
struct ClosestHit<'a> {
    scene: &'a Scene,
    ray: &'a Ray<f64>,
}

impl ForKernel for ClosestHit<'_> {
    type Output = Option<Hit>;

    #[inline(always)]
    fn run<K: Kernel>(self) -> Option<Hit> {
        let Self { scene, ray } = self;
        if let Some((level, only)) = scene.inner().only() {
            return simd::run(level, ClosestHitOf::<_, K> { only, scene, ray, kernel: PhantomData });
        }
        if let Some((level, only)) = scene.inner().only_compact::<K>() {
            return simd::run(level, ClosestHitOf::<_, K> { only, scene, ray, kernel: PhantomData });
        }
        closest::<K>(scene, ray)
    }
}

/// [`Scene::any_hit`].
struct AnyHit<'a> {
    scene: &'a Scene,
    ray: &'a Ray<f64>,
}

impl ForKernel for AnyHit<'_> {
    type Output = bool;

    #[inline(always)]
    fn run<K: Kernel>(self) -> bool {
        let Self { scene, ray } = self;
        if let Some((level, only)) = scene.inner().only() {
            return simd::run(level, AnyHitOf::<_, K> { only, ray, kernel: PhantomData });
        }
        if let Some((level, only)) = scene.inner().only_compact::<K>() {
            return simd::run(level, AnyHitOf::<_, K> { only, ray, kernel: PhantomData });
        }
        any::<K>(scene, ray)
    }
}

/// In any scene.
fn closest<K: Kernel>(scene: &Scene, ray: &Ray<f64>) -> Option<Hit> {
    let order = |a, b| scene.comes_first(ray, a, b);
    let mut closest = Collect::new(ray, None, |_| true, Closest { order, best: None });
    // It never breaks: the nearest hit is known at the end only.
    let _ = scene.inner().trace_by::<false, K, _, _>(ray, &mut closest, &mut Off);
    closest.take.best.map(|hit| scene.finished(hit))
}

/// In any scene.
fn any<K: Kernel>(scene: &Scene, ray: &Ray<f64>) -> bool {
    let mut any = Collect::new(ray, None, |_| true, Any);
    scene.inner().trace_by::<false, K, _, _>(ray, &mut any, &mut Off).is_break()
}

/// [`Scene::closest_hits`]: the choice of instructions is made once for all of them.
struct ClosestHits<'a> {
    scene: &'a Scene,
    rays: &'a [Ray<f64>],
    hits: &'a mut [Option<Hit>],
}

impl ForKernel for ClosestHits<'_> {
    type Output = ();

    #[inline(always)]
    fn run<K: Kernel>(self) {
        let Self { scene, rays, hits } = self;
        if let Some((level, only)) = scene.inner().only() {
            return simd::run(level, ClosestHitsOf::<_, K> { only, scene, rays, hits, kernel: PhantomData });
        }
        if let Some((level, only)) = scene.inner().only_compact::<K>() {
            return simd::run(level, ClosestHitsOf::<_, K> { only, scene, rays, hits, kernel: PhantomData });
        }
        for (ray, hit) in rays.iter().zip(hits) {
            *hit = closest::<K>(scene, ray);
        }
    }
}

/// [`Scene::any_hits`], likewise.
struct AnyHits<'a> {
    scene: &'a Scene,
    rays: &'a [Ray<f64>],
    hits: &'a mut [bool],
}

impl ForKernel for AnyHits<'_> {
    type Output = ();

    #[inline(always)]
    fn run<K: Kernel>(self) {
        let Self { scene, rays, hits } = self;
        if let Some((level, only)) = scene.inner().only() {
            return simd::run(level, AnyHitsOf::<_, K> { only, rays, hits, kernel: PhantomData });
        }
        if let Some((level, only)) = scene.inner().only_compact::<K>() {
            return simd::run(level, AnyHitsOf::<_, K> { only, rays, hits, kernel: PhantomData });
        }
        for (ray, hit) in rays.iter().zip(hits) {
            *hit = any::<K>(scene, ray);
        }
    }
}

/// The only instance of a scene, of a model with a wide tree (or a compact one): there is nothing above it to be
/// traversed.
#[derive(Clone, Copy)]
struct Only<'a, T> {
    model: &'a Model,
    tree: &'a T,
    transform: &'a Transform,
}

impl<T: WideTree> Only<'_, T> {
    #[inline(always)]
    fn trace<L: Lanes, K: Kernel, C: Collector>(&self, ray: &Ray<f64>, collector: &mut C) -> ControlFlow<()> {
        // What is not finite is found out on entering the mesh.
        if !is_interval(ray) {
            return ControlFlow::Continue(());
        }
        self.model.trace_wide::<L, false, T, K, C, Off>(self.tree, ray, (0, self.transform), collector, &mut Off)
    }

    #[inline(always)]
    fn closest<L: Lanes, K: Kernel>(&self, scene: &Scene, ray: &Ray<f64>) -> Option<Hit> {
        let order = |a, b| scene.comes_first(ray, a, b);
        let mut closest = Collect::new(ray, None, |_| true, Closest { order, best: None });
        let _ = self.trace::<L, K, _>(ray, &mut closest);
        let hit = closest.take.best?;
        Some(Hit { normal: self.transform.normal(hit.normal), ..hit })
    }

    #[inline(always)]
    fn any<L: Lanes, K: Kernel>(&self, ray: &Ray<f64>) -> bool {
        let mut any = Collect::new(ray, None, |_| true, Any);
        self.trace::<L, K, _>(ray, &mut any).is_break()
    }
}

/// [`ClosestHit`] in the only instance.
struct ClosestHitOf<'a, T, K> {
    only: Only<'a, T>,
    scene: &'a Scene,
    ray: &'a Ray<f64>,
    kernel: PhantomData<K>,
}

impl<T: WideTree, K: Kernel> Work for ClosestHitOf<'_, T, K> {
    type Output = Option<Hit>;

    #[inline(always)]
    fn run<L: Lanes>(self) -> Option<Hit> {
        self.only.closest::<L, K>(self.scene, self.ray)
    }
}

/// [`AnyHit`] in the only instance.
struct AnyHitOf<'a, T, K> {
    only: Only<'a, T>,
    ray: &'a Ray<f64>,
    kernel: PhantomData<K>,
}

impl<T: WideTree, K: Kernel> Work for AnyHitOf<'_, T, K> {
    type Output = bool;

    #[inline(always)]
    fn run<L: Lanes>(self) -> bool {
        self.only.any::<L, K>(self.ray)
    }
}

/// [`Scene::closest_hit_from`] in the only instance.
struct ClosestHitFrom<'a> {
    only: Only<'a, Wide8>,
    scene: &'a Scene,
    ray: &'a Ray<f64>,
    place: usize,
}

impl Work for ClosestHitFrom<'_> {
    type Output = Option<Hit>;

    #[inline(always)]
    fn run<L: Lanes>(self) -> Option<Hit> {
        let Self { only, scene, ray, place } = self;
        let order = |a, b| scene.comes_first(ray, a, b);
        let collector = Collect::new(ray, None, |_| true, Closest { order, best: None });
        let mut closest = Leaving { collector, place };
        let _ = only.trace::<L, Robust, _>(ray, &mut closest);
        let hit = closest.collector.take.best?;
        Some(Hit { normal: only.transform.normal(hit.normal), ..hit })
    }
}

/// [`Scene::any_hit_from`] in the only instance.
struct AnyHitFrom<'a> {
    only: Only<'a, Wide8>,
    ray: &'a Ray<f64>,
    place: usize,
}

impl Work for AnyHitFrom<'_> {
    type Output = bool;

    #[inline(always)]
    fn run<L: Lanes>(self) -> bool {
        let Self { only, ray, place } = self;
        let mut any = Leaving { collector: Collect::new(ray, None, |_| true, Any), place };
        only.trace::<L, Robust, _>(ray, &mut any).is_break()
    }
}

/// [`ClosestHits`] in the only instance.
struct ClosestHitsOf<'a, T, K> {
    only: Only<'a, T>,
    scene: &'a Scene,
    rays: &'a [Ray<f64>],
    hits: &'a mut [Option<Hit>],
    kernel: PhantomData<K>,
}

impl<T: WideTree, K: Kernel> Work for ClosestHitsOf<'_, T, K> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(self) {
        let Self { only, scene, rays, hits, .. } = self;
        for (ray, hit) in rays.iter().zip(hits) {
            *hit = only.closest::<L, K>(scene, ray);
        }
    }
}

/// What is asked of each ray of a batch that goes in packets.
trait Asked: Copy {
    type Answer;
    /// Of rays that go the same way; false if they do not after all, and nothing is known.
    fn together<L: Lanes, T: Tier>(
        self,
        packet: &mut Packet<'_>,
        rays: &[Ray<f64>; packet::RAYS],
        to: &mut [Self::Answer],
    ) -> bool;
    /// Of eights of rays that need not have anything in common.
    fn alone<L: Lanes, T: Tier>(
        self,
        packet: &mut Packet<'_>,
        courses: &mut Courses,
        rays: &[Ray<f64>],
        to: &mut [Self::Answer],
    );
    fn one<L: Lanes, T: Tier>(self, only: &Only<'_, Wide8>, ray: &Ray<f64>) -> Self::Answer;
}

/// [`Scene::closest_hits`].
#[derive(Clone, Copy)]
struct AskClosest<'a>(&'a Scene);

impl Asked for AskClosest<'_> {
    type Answer = Option<Hit>;

    #[inline(always)]
    fn together<L: Lanes, T: Tier>(
        self,
        packet: &mut Packet<'_>,
        rays: &[Ray<f64>; packet::RAYS],
        to: &mut [Option<Hit>],
    ) -> bool {
        packet.closest::<L, T>(rays, to)
    }

    #[inline(always)]
    fn alone<L: Lanes, T: Tier>(
        self,
        packet: &mut Packet<'_>,
        courses: &mut Courses,
        rays: &[Ray<f64>],
        to: &mut [Option<Hit>],
    ) {
        packet.closest_alone::<L, T>(rays, courses, to);
    }

    #[inline(always)]
    fn one<L: Lanes, T: Tier>(self, only: &Only<'_, Wide8>, ray: &Ray<f64>) -> Option<Hit> {
        only.closest::<L, T>(self.0, ray)
    }
}

/// [`Scene::any_hits`].
#[derive(Clone, Copy)]
struct AskAny;

impl Asked for AskAny {
    type Answer = bool;

    #[inline(always)]
    fn together<L: Lanes, T: Tier>(
        self,
        packet: &mut Packet<'_>,
        rays: &[Ray<f64>; packet::RAYS],
        to: &mut [bool],
    ) -> bool {
        packet.any::<L, T>(rays, to)
    }

    #[inline(always)]
    fn alone<L: Lanes, T: Tier>(
        self,
        packet: &mut Packet<'_>,
        courses: &mut Courses,
        rays: &[Ray<f64>],
        to: &mut [bool],
    ) {
        packet.any_alone::<L, T>(rays, courses, to);
    }

    #[inline(always)]
    fn one<L: Lanes, T: Tier>(self, only: &Only<'_, Wide8>, ray: &Ray<f64>) -> bool {
        only.any::<L, T>(ray)
    }
}

/// A batch in the only instance: in packets where rays suit each other, else with some under way at a time.
struct InPackets<'a, T, A: Asked> {
    only: Only<'a, Wide8>,
    asked: A,
    rays: &'a [Ray<f64>],
    answers: &'a mut [A::Answer],
    tier: PhantomData<T>,
}

impl<T: Tier, A: Asked> Work for InPackets<'_, T, A> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(self) {
        let Self { only, asked, mut rays, mut answers, .. } = self;
        // Less than a group: it would not pay to make room.
        if rays.len() < 8 {
            for (ray, to) in rays.iter().zip(answers) {
                *to = asked.one::<L, T>(&only, ray);
            }
            return;
        }
        let mut packet = Packet::new(only.model, only.tree, only.transform);
        let mut courses = Courses::new(only.tree);
        while !rays.is_empty() {
            let (now, later) = rays.split_at(rays.len().min(packet::RAYS));
            let (to, to_later) = answers.split_at_mut(now.len());
            (rays, answers) = (later, to_later);
            if let Some(together) = now.first_chunk()
                && packet.suits(together)
                && asked.together::<L, T>(&mut packet, together, to)
            {
                continue;
            }
            let eights = now.len() / 8 * 8;
            asked.alone::<L, T>(&mut packet, &mut courses, &now[..eights], &mut to[..eights]);
            for (ray, to) in now[eights..].iter().zip(&mut to[eights..]) {
                *to = asked.one::<L, T>(&only, ray);
            }
        }
    }
}

/// [`AnyHits`] in the only instance.
struct AnyHitsOf<'a, T, K> {
    only: Only<'a, T>,
    rays: &'a [Ray<f64>],
    hits: &'a mut [bool],
    kernel: PhantomData<K>,
}

impl<T: WideTree, K: Kernel> Work for AnyHitsOf<'_, T, K> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(self) {
        let Self { only, rays, hits, .. } = self;
        for (ray, hit) in rays.iter().zip(hits) {
            *hit = only.any::<L, K>(ray);
        }
    }
}

impl Inner {
    #[inline(always)]
    pub(crate) fn by_kernel<W: ForKernel>(&self, work: W) -> W::Output {
        match self.options.precision {
            Precision::Fast => work.run::<Fast>(),
            Precision::Robust if self.options.guards.contains(NEEDED) => work.run::<Robust>(),
            Precision::Robust => work.run::<Guarded>(),
            Precision::Double => work.run::<Double>(),
            Precision::Exact => work.run::<Exact>(),
        }
    }

    #[inline(always)]
    fn only(&self) -> Option<(Available, Only<'_, Wide8>)> {
        let [instance] = &self.instances[..] else { return None };
        let model = &self.models[instance.model as usize];
        let (tree, level) = model.wide()?;
        Some((level, Only { model, tree, transform: &instance.transform }))
    }

    /// The only instance of a scene and the place there of a triangle that rays leave.
    #[inline(always)]
    fn left(&self, source: HitId) -> Option<(Available, Only<'_, Wide8>, usize)> {
        if self.options.precision != Precision::Robust || !self.options.guards.contains(NEEDED | Guards::OFFSET) {
            return None;
        }
        let (level, only) = self.only()?;
        let id = PrimitiveId { geometry: source.geometry, primitive: source.primitive };
        let place = only.model.place(id)?;
        Some((level, only, place))
    }

    /// The same of a compact tree; for the tiers that are asked most alone, so that not everything is compiled twice.
    #[inline(always)]
    fn only_compact<K: Kernel>(&self) -> Option<(Available, Only<'_, Compact8>)> {
        if !K::DIRECT {
            return None;
        }
        let [instance] = &self.instances[..] else { return None };
        let model = &self.models[instance.model as usize];
        let (tree, level) = model.compact()?;
        Some((level, Only { model, tree, transform: &instance.transform }))
    }
}
