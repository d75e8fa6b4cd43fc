//! Closest and any hit, compiled for themselves alone: they are what most rays ask. The tier and the instructions are
//! chosen outside, once for each call.

use core::marker::PhantomData;
use core::ops::ControlFlow;

use firsthit_geometry::{Precision, Ray};

use super::across::Left;
use super::{Closest, Collect, Collector, whether};
use crate::instance::Instance;
use crate::kernel::{Double, Exact, Fast, Guarded, Kernel, Robust};
use crate::layout::compact8::Compact8;
use crate::layout::wide8::Wide8;
use crate::model::PrimitiveId;
use crate::packet::{self, Courses, Packet, Tier};
use crate::scene::{Inner, is_interval};
use crate::simd::{self, Available, Lanes, Work};
use crate::single::Only;
use crate::stats::Off;
use crate::wide::WideTree;
use crate::{Guards, Hit, HitId, Scene};

/// The guards that the tier `Robust` has in queries.
pub(super) const NEEDED: Guards = Guards::ALL.difference(Guards::OFFSET);

impl Scene {
    /// The nearest hit in the ray's closed interval; `None` also for an invalid ray.
    #[must_use]
    pub fn closest_hit(&self, ray: &Ray<f64>) -> Option<Hit> {
        self.inner().by_shortest(One { asked: AskClosest(self), ray })
    }

    /// [`Scene::closest_hit`] for each ray, into the slot of the same index. The shorter slice decides how many.
    ///
    /// Rays that go the same way, as those of neighbouring pixels in the order of small squares, are traced together where
    /// they follow each other; the answers are the same (of [`Precision::Fast`] but for rays at the very edges of boxes).
    pub fn closest_hits(&self, rays: &[Ray<f64>], hits: &mut [Option<Hit>]) {
        let n = rays.len().min(hits.len());
        self.inner().by_shortest(Batch { asked: AskClosest(self), rays: &rays[..n], answers: &mut hits[..n] });
    }

    /// Whether anything lies in the ray's closed interval: true exactly when [`Scene::closest_hit`] finds something.
    #[must_use]
    pub fn any_hit(&self, ray: &Ray<f64>) -> bool {
        self.inner().by_shortest(One { asked: AskAny(self), ray })
    }

    /// [`Scene::any_hit`] for each ray, into the slot of the same index. The shorter slice decides how many.
    pub fn any_hits(&self, rays: &[Ray<f64>], hits: &mut [bool]) {
        let n = rays.len().min(hits.len());
        self.inner().by_shortest(Batch { asked: AskAny(self), rays: &rays[..n], answers: &mut hits[..n] });
    }
}

/// Rays that leave a triangle.
impl Scene {
    /// [`Scene::closest_hit`] of a ray that starts where [`SurfacePoint::spawn`] says on the triangle `source`, and goes away
    /// from it: the same answer, found sooner. That the ray does not meet the triangle that it comes from would take many
    /// digits to tell; here that triangle is not tested (at [`Precision::Robust`], in
    /// meshes of the wide layout; in others it is).
    ///
    /// [`SurfacePoint::spawn`]: crate::SurfacePoint::spawn
    #[must_use]
    pub fn closest_hit_from(&self, ray: &Ray<f64>, source: HitId) -> Option<Hit> {
        if let Some((level, only, place)) = self.inner().left(source) {
            return simd::run(level, Leaving { only, asked: AskClosest(self), ray, place });
        }
        match self.inner().left_of_several(source) {
            None => self.closest_hit(ray),
            left => self.closest_across::<Robust>(ray, left),
        }
    }

    /// [`Scene::any_hit`] of a ray as for [`Scene::closest_hit_from`].
    #[must_use]
    pub fn any_hit_from(&self, ray: &Ray<f64>, source: HitId) -> bool {
        if let Some((level, only, place)) = self.inner().left(source) {
            return simd::run(level, Leaving { only, asked: AskAny(self), ray, place });
        }
        match self.inner().left_of_several(source) {
            None => self.any_hit(ray),
            left => self.any_across::<Robust>(ray, left),
        }
    }
}

/// Work that depends on the tier: the choice is made once, outside of it.
pub(crate) trait ForKernel {
    type Output;
    fn run<K: Kernel>(self) -> Self::Output;
}

/// Work that has a shorter way in a scene of one instance, at the tiers that are asked most.
trait Shortest: ForKernel {
    /// In any scene.
    fn across<T: Tier>(self) -> Self::Output;
    fn in_wide<T: Tier>(self, level: Available, only: Only<'_, Wide8>) -> Self::Output;
    fn in_compact<T: Tier>(self, level: Available, only: Only<'_, Compact8>) -> Self::Output;
}

/// What is asked of each ray.
pub(super) trait Asked: Copy {
    type Answer;
    fn scene(&self) -> &Scene;
    /// In any scene.
    fn anywhere<K: Kernel>(self, ray: &Ray<f64>) -> Self::Answer;
    /// The same by the shortest way.
    fn across<T: Tier>(self, ray: &Ray<f64>) -> Self::Answer;
    /// In the only instance.
    fn whole<L: Lanes, K: Kernel>(self, only: &Only<'_, Wide8>, ray: &Ray<f64>) -> Self::Answer;
    /// The same by the shortest way, of a ray that may leave the triangle at a place, which is not tested.
    fn one<L: Lanes, W: WideTree, T: Tier>(
        self,
        only: &Only<'_, W>,
        ray: &Ray<f64>,
        leaves: Option<usize>,
    ) -> Self::Answer;
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
}

/// The nearest hit.
#[derive(Clone, Copy)]
pub(super) struct AskClosest<'a>(pub(super) &'a Scene);

impl Asked for AskClosest<'_> {
    type Answer = Option<Hit>;

    #[inline(always)]
    fn scene(&self) -> &Scene {
        self.0
    }

    #[inline(always)]
    fn anywhere<K: Kernel>(self, ray: &Ray<f64>) -> Option<Hit> {
        let Self(scene) = self;
        let order = |a, b| scene.comes_first(ray, a, b);
        let mut closest = Collect::new(ray, None, |_| true, Closest { order, best: None });
        // It never breaks: the nearest hit is known at the end only.
        let _ = scene.inner().trace_by::<false, K, _, _>(ray, &mut closest, &mut Off);
        closest.take.best.map(|hit| scene.finished(hit))
    }

    #[inline(always)]
    fn across<T: Tier>(self, ray: &Ray<f64>) -> Option<Hit> {
        self.0.closest_across::<T>(ray, None)
    }

    #[inline(always)]
    fn whole<L: Lanes, K: Kernel>(self, only: &Only<'_, Wide8>, ray: &Ray<f64>) -> Option<Hit> {
        let order = |a, b| self.0.comes_first(ray, a, b);
        let mut closest = Collect::new(ray, None, |_| true, Closest { order, best: None });
        let _ = trace::<L, K, _>(only, ray, &mut closest);
        let hit = closest.take.best?;
        Some(Hit { normal_direction: only.transform.normal_direction(hit.normal_direction), ..hit })
    }

    #[inline(always)]
    fn one<L: Lanes, W: WideTree, T: Tier>(
        self,
        only: &Only<'_, W>,
        ray: &Ray<f64>,
        leaves: Option<usize>,
    ) -> Option<Hit> {
        only.closest_hit::<L, T>(self.0, ray, leaves)
    }

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
}

/// Whether there is a hit.
#[derive(Clone, Copy)]
pub(super) struct AskAny<'a>(pub(super) &'a Scene);

impl Asked for AskAny<'_> {
    type Answer = bool;

    #[inline(always)]
    fn scene(&self) -> &Scene {
        self.0
    }

    #[inline(always)]
    fn anywhere<K: Kernel>(self, ray: &Ray<f64>) -> bool {
        let mut any = whether(ray);
        self.0.inner().trace_by::<false, K, _, _>(ray, &mut any, &mut Off).is_break()
    }

    #[inline(always)]
    fn across<T: Tier>(self, ray: &Ray<f64>) -> bool {
        self.0.any_across::<T>(ray, None)
    }

    #[inline(always)]
    fn whole<L: Lanes, K: Kernel>(self, only: &Only<'_, Wide8>, ray: &Ray<f64>) -> bool {
        let mut any = whether(ray);
        trace::<L, K, _>(only, ray, &mut any).is_break()
    }

    #[inline(always)]
    fn one<L: Lanes, W: WideTree, T: Tier>(self, only: &Only<'_, W>, ray: &Ray<f64>, leaves: Option<usize>) -> bool {
        only.any_hit::<L, T>(ray, leaves)
    }

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
}

#[inline(always)]
fn trace<L: Lanes, K: Kernel, C: Collector>(
    only: &Only<'_, Wide8>,
    ray: &Ray<f64>,
    collector: &mut C,
) -> ControlFlow<()> {
    // What is not finite is found out on entering the mesh.
    if !is_interval(ray) {
        return ControlFlow::Continue(());
    }
    let Only { model, tree, transform, .. } = *only;
    model.trace_wide::<L, false, _, K, C, Off>(tree, ray, (0, transform), collector, &mut Off)
}

/// One ray.
struct One<'a, A> {
    asked: A,
    ray: &'a Ray<f64>,
}

impl<A: Asked> ForKernel for One<'_, A> {
    type Output = A::Answer;

    #[inline(always)]
    fn run<K: Kernel>(self) -> A::Answer {
        let Self { asked, ray } = self;
        match asked.scene().inner().only() {
            Some((level, only)) => simd::run(level, Whole::<_, K> { only, asked, ray, kernel: PhantomData }),
            None => asked.anywhere::<K>(ray),
        }
    }
}

impl<A: Asked> Shortest for One<'_, A> {
    #[inline(always)]
    fn across<T: Tier>(self) -> A::Answer {
        self.asked.across::<T>(self.ray)
    }

    #[inline(always)]
    fn in_wide<T: Tier>(self, level: Available, only: Only<'_, Wide8>) -> A::Answer {
        simd::run(level, Short::<_, _, T>::new(only, self.asked, self.ray))
    }

    #[inline(always)]
    fn in_compact<T: Tier>(self, level: Available, only: Only<'_, Compact8>) -> A::Answer {
        simd::run(level, Short::<_, _, T>::new(only, self.asked, self.ray))
    }
}

/// Many rays: the choice of instructions is made once for all of them.
struct Batch<'a, A: Asked> {
    asked: A,
    rays: &'a [Ray<f64>],
    answers: &'a mut [A::Answer],
}

impl<A: Asked> ForKernel for Batch<'_, A> {
    type Output = ();

    #[inline(always)]
    fn run<K: Kernel>(self) {
        let Self { asked, rays, answers } = self;
        match asked.scene().inner().only() {
            Some((level, only)) => {
                simd::run(level, WholeBatch::<_, K> { only, asked, rays, answers, kernel: PhantomData })
            }
            None => {
                for (ray, to) in rays.iter().zip(answers) {
                    *to = asked.anywhere::<K>(ray);
                }
            }
        }
    }
}

impl<A: Asked> Shortest for Batch<'_, A> {
    #[inline(always)]
    fn across<T: Tier>(self) {
        let Self { asked, rays, answers } = self;
        for (ray, to) in rays.iter().zip(answers) {
            *to = asked.across::<T>(ray);
        }
    }

    #[inline(always)]
    fn in_wide<T: Tier>(self, level: Available, only: Only<'_, Wide8>) {
        let Self { asked, rays, answers } = self;
        simd::run(level, InPackets::<_, T> { only, asked, rays, answers, tier: PhantomData });
    }

    #[inline(always)]
    fn in_compact<T: Tier>(self, level: Available, only: Only<'_, Compact8>) {
        let Self { asked, rays, answers } = self;
        simd::run(level, ShortBatch::<_, T> { only, asked, rays, answers, tier: PhantomData });
    }
}

/// [`One`] in the only instance.
struct Whole<'a, A, K> {
    only: Only<'a, Wide8>,
    asked: A,
    ray: &'a Ray<f64>,
    kernel: PhantomData<K>,
}

impl<A: Asked, K: Kernel> Work for Whole<'_, A, K> {
    type Output = A::Answer;

    #[inline(always)]
    fn run<L: Lanes>(self) -> A::Answer {
        self.asked.whole::<L, K>(&self.only, self.ray)
    }
}

/// The same by the shortest way.
pub(super) struct Short<'a, A, W, T> {
    only: Only<'a, W>,
    asked: A,
    ray: &'a Ray<f64>,
    tier: PhantomData<T>,
}

impl<'a, A, W, T> Short<'a, A, W, T> {
    #[inline(always)]
    pub(super) fn new(only: Only<'a, W>, asked: A, ray: &'a Ray<f64>) -> Self {
        Self { only, asked, ray, tier: PhantomData }
    }
}

impl<A: Asked, W: WideTree, T: Tier> Work for Short<'_, A, W, T> {
    type Output = A::Answer;

    #[inline(always)]
    fn run<L: Lanes>(self) -> A::Answer {
        self.asked.one::<L, W, T>(&self.only, self.ray, None)
    }
}

/// The same of a ray that leaves a triangle.
pub(super) struct Leaving<'a, A> {
    pub(super) only: Only<'a, Wide8>,
    pub(super) asked: A,
    pub(super) ray: &'a Ray<f64>,
    pub(super) place: usize,
}

impl<A: Asked> Work for Leaving<'_, A> {
    type Output = A::Answer;

    #[inline(always)]
    fn run<L: Lanes>(self) -> A::Answer {
        self.asked.one::<L, _, Robust>(&self.only, self.ray, Some(self.place))
    }
}

/// [`Batch`] in the only instance.
struct WholeBatch<'a, A: Asked, K> {
    only: Only<'a, Wide8>,
    asked: A,
    rays: &'a [Ray<f64>],
    answers: &'a mut [A::Answer],
    kernel: PhantomData<K>,
}

impl<A: Asked, K: Kernel> Work for WholeBatch<'_, A, K> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(self) {
        let Self { only, asked, rays, answers, .. } = self;
        for (ray, to) in rays.iter().zip(answers) {
            *to = asked.whole::<L, K>(&only, ray);
        }
    }
}

/// The same by the shortest way, in a compact tree.
struct ShortBatch<'a, A: Asked, T> {
    only: Only<'a, Compact8>,
    asked: A,
    rays: &'a [Ray<f64>],
    answers: &'a mut [A::Answer],
    tier: PhantomData<T>,
}

impl<A: Asked, T: Tier> Work for ShortBatch<'_, A, T> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(self) {
        let Self { only, asked, rays, answers, .. } = self;
        for (ray, to) in rays.iter().zip(answers) {
            *to = asked.one::<L, _, T>(&only, ray, None);
        }
    }
}

/// A batch in the only instance: in packets where rays suit each other, else with some under way at a time.
struct InPackets<'a, A: Asked, T> {
    only: Only<'a, Wide8>,
    asked: A,
    rays: &'a [Ray<f64>],
    answers: &'a mut [A::Answer],
    tier: PhantomData<T>,
}

impl<A: Asked, T: Tier> Work for InPackets<'_, A, T> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(self) {
        let Self { only, asked, mut rays, mut answers, .. } = self;
        // Less than a group: it would not pay to make room.
        if rays.len() < 8 {
            for (ray, to) in rays.iter().zip(answers) {
                *to = asked.one::<L, _, T>(&only, ray, None);
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
                *to = asked.one::<L, _, T>(&only, ray, None);
            }
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
    fn by_shortest<W: Shortest>(&self, work: W) -> W::Output {
        match self.options.precision {
            Precision::Fast => self.by_shortest_of::<Fast, W>(work),
            Precision::Robust if self.options.guards.contains(NEEDED) => self.by_shortest_of::<Robust, W>(work),
            // Not `by_kernel`: the long way is compiled only for those that go it.
            Precision::Robust => work.run::<Guarded>(),
            Precision::Double => work.run::<Double>(),
            Precision::Exact => work.run::<Exact>(),
        }
    }

    #[inline(always)]
    fn by_shortest_of<T: Tier, W: Shortest>(&self, work: W) -> W::Output {
        if let Some((level, only)) = self.only() {
            return work.in_wide::<T>(level, only);
        }
        if let Some((level, only)) = self.only_compact() {
            return work.in_compact::<T>(level, only);
        }
        work.across::<T>()
    }

    /// The only instance of a scene.
    #[inline(always)]
    fn single(&self) -> Option<&Instance> {
        let [instance] = &self.instances[..] else { return None };
        instance.shown.then_some(instance)
    }

    #[inline(always)]
    pub(super) fn only(&self) -> Option<(Available, Only<'_, Wide8>)> {
        let instance = self.single()?;
        let model = &self.models[instance.model as usize];
        let (tree, level) = model.wide()?;
        Some((level, Only { model, tree, transform: &instance.transform, instance: 0 }))
    }

    /// Whether rays that leave a triangle need not meet it.
    #[inline(always)]
    fn leaves(&self) -> bool {
        self.options.precision == Precision::Robust && self.options.guards.contains(NEEDED | Guards::OFFSET)
    }

    /// An instance and the place there of a triangle that rays leave.
    fn left_of_several(&self, source: HitId) -> Left {
        let instance = self.instances.get(source.instance as usize).filter(|_| self.leaves())?;
        let id = PrimitiveId { geometry: source.geometry, primitive: source.primitive };
        Some((source.instance, self.models[instance.model as usize].place(id)?))
    }

    /// The only instance of a scene and the place there of a triangle that rays leave.
    #[inline(always)]
    fn left(&self, source: HitId) -> Option<(Available, Only<'_, Wide8>, usize)> {
        if !self.leaves() {
            return None;
        }
        let (level, only) = self.only()?;
        let id = PrimitiveId { geometry: source.geometry, primitive: source.primitive };
        let place = only.model.place(id)?;
        Some((level, only, place))
    }

    /// The same of a compact tree.
    #[inline(always)]
    fn only_compact(&self) -> Option<(Available, Only<'_, Compact8>)> {
        let instance = self.single()?;
        let model = &self.models[instance.model as usize];
        let (tree, level) = model.compact()?;
        Some((level, Only { model, tree, transform: &instance.transform, instance: 0 }))
    }
}
