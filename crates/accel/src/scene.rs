//! The scene: built once, then only asked.

use core::ops::ControlFlow;
use std::sync::Arc;

use firsthit_geometry::{Aabb, Ray, Real};
use glam::DVec3;
use rayon::prelude::*;

use crate::above::{Above, Asked};
use crate::groups::Groups;
use crate::instance::{Instance, Placed, tight_boxes};
use crate::kernel::Kernel;
use crate::local::LocalRay;
use crate::memory::{self, AtOnce};
use crate::model::{Model, PrimitiveId, Surface, limit};
use crate::progress::{Progress, Watch as WatchBuild};
use crate::query::{Any, Closest, Collect, Collector, Dyn, ForKernel};
use crate::stats::{Off, Probe, Watch};
use crate::{BuildError, BuildOptions, Crossings, Geometry, Hit, HitId, TraversalCounts};

/// What a scene's trees are like.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SceneStats {
    /// Triangles as stored: each mesh counted once.
    pub stored_triangles: u64,
    /// Triangles as seen: each instance counted.
    pub instanced_triangles: u64,
    /// Instances, without those that are hidden or removed.
    pub instances: u64,
    /// Surface-area cost of the trees of the meshes, weighted by triangles.
    pub sah_cost: f64,
    /// Nodes from the root to the deepest leaf, both levels.
    pub depth: u32,
    /// Memory of trees and primitives.
    pub bytes: u64,
    /// Triangles of no area, which are never hit.
    pub degenerate_triangles: u64,
}

/// Meshes, shapes and instances with their trees. Immutable, `Send + Sync`, cheap to clone.
#[derive(Clone, Debug)]
pub struct Scene {
    inner: Arc<Inner>,
}

#[derive(Debug)]
pub(crate) struct Inner {
    pub(crate) options: BuildOptions,
    /// Shared with the scenes that are made of this one by moving something else.
    pub(crate) models: Vec<Arc<Model>>,
    /// Each instance, as given.
    placed: Vec<Placed>,
    /// Instances of none of these layers are not met.
    mask: u32,
    /// Which instances came in groups.
    groups: Arc<Groups>,
    pub(crate) instances: Vec<Instance>,
    /// Over the instances with something bounded in them.
    above: Above,
    /// Those instances.
    bounded: Vec<u32>,
    /// Instances of models with shapes of no finite box, which are tested outside the tree.
    unbounded: Vec<u32>,
    bounds: Aabb<f64>,
    /// Around the boxes of all instances, which are larger.
    whole: Aabb<f64>,
    /// The largest [`round_trip`](firsthit_geometry::transform::Transform::round_trip) of an instance.
    round_trip: f64,
    stats: SceneStats,
}

impl Scene {
    pub(crate) fn new(
        options: BuildOptions,
        meshes: &[Vec<Geometry>],
        placed: Vec<Placed>,
        groups: Arc<Groups>,
        watch: WatchBuild<'_>,
    ) -> Result<Self, BuildError> {
        limit("meshes", meshes.len() as u64)?;
        limit("instances", placed.len() as u64)?;
        let at_once = memory::check(meshes, placed.len(), options)?;
        let progress = Progress::of(meshes, watch);
        let build = |(i, mesh): (usize, &Vec<Geometry>)| Model::watched(i, mesh, options, &progress).map(Arc::new);
        let models = match at_once {
            AtOnce::All => meshes.par_iter().enumerate().map(build).collect::<Result<_, _>>()?,
            AtOnce::One => meshes.iter().enumerate().map(build).collect::<Result<_, _>>()?,
        };
        Self::place(options, models, placed, u32::MAX, groups)
    }

    /// A scene of models that are built.
    pub(crate) fn place(
        options: BuildOptions,
        models: Vec<Arc<Model>>,
        placed: Vec<Placed>,
        mask: u32,
        groups: Arc<Groups>,
    ) -> Result<Self, BuildError> {
        let instances: Vec<Instance> = placed
            .iter()
            .enumerate()
            .map(|(i, placed)| {
                let (mesh, count) = (placed.mesh, models.len());
                let model = models.get(mesh).ok_or(BuildError::NoSuchMesh { instance: i, mesh, count })?;
                Instance::new(i, placed, model.scale(), mask)
            })
            .collect::<Result<_, _>>()?;
        Ok(Self::arrange(options, models, placed, instances, mask, groups))
    }

    /// This scene for queries that ask about some layers of instances only: those instances that have one of these bits in
    /// their mask (see [`SceneBuilder::set_mask`](crate::SceneBuilder::set_mask)). To all queries the others are not there.
    /// Instances keep their indices.
    ///
    /// It shares all meshes with this scene, and may ask about what this one leaves out: only a tree over the instances is
    /// built, and queries pay for what is in it. (Only that single instances have a shorter way is lost, where others are
    /// hidden.) Where each ray has a mask of its own, a filter can look up the instance's: see [`Scene::closest_hit_filtered`].
    ///
    /// ```
    /// use firsthit_accel::{Geometry, SceneBuilder};
    /// use firsthit_geometry::{Ray, shapes::Sphere};
    /// use glam::{DAffine3, DVec3};
    ///
    /// const OPAQUE: u32 = 1;
    /// const GLASS: u32 = 2;
    /// let mut builder = SceneBuilder::default();
    /// let ball = builder.add_mesh(vec![Geometry::Shape(Sphere::new(DVec3::ZERO, 1.0)?.into())]);
    /// for (z, mask) in [(0.0, OPAQUE), (5.0, GLASS)] {
    ///     let instance = builder.add_instance(ball, DAffine3::from_translation(DVec3::Z * z));
    ///     builder.set_mask(instance, mask);
    /// }
    /// let scene = builder.build()?;
    /// let ray = Ray::new(DVec3::Z * 9.0, DVec3::NEG_Z);
    /// assert_eq!(scene.closest_hit(&ray).unwrap().t, 3.0);
    /// let hit = scene.seen_by(OPAQUE).closest_hit(&ray).unwrap();
    /// assert_eq!((hit.id.instance, hit.t), (0, 8.0));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    #[must_use]
    pub fn seen_by(&self, mask: u32) -> Self {
        let Inner { options, models, placed, instances, groups, .. } = &*self.inner;
        let shown = |(i, p): (&Instance, &Placed)| Instance { shown: p.mask & mask != 0, ..i.clone() };
        let instances = instances.iter().zip(placed).map(shown).collect();
        Self::arrange(*options, models.clone(), placed.clone(), instances, mask, groups.clone())
    }

    /// A scene of instances that are where they are to be.
    fn arrange(
        options: BuildOptions,
        models: Vec<Arc<Model>>,
        placed: Vec<Placed>,
        instances: Vec<Instance>,
        mask: u32,
        groups: Arc<Groups>,
    ) -> Self {
        let tight = tight_boxes(&instances, &models);
        let bounds = tight.iter().fold(Aabb::empty(), |a, b| a.union(*b));
        let bounded: Vec<u32> = (0..instances.len() as u32).filter(|&i| !tight[i as usize].is_empty()).collect();
        let boxes: Vec<Aabb<f64>> = bounded
            .iter()
            .map(|&i| {
                let instance = &instances[i as usize];
                instance.padded_box(&models[instance.model as usize], &tight[i as usize])
            })
            .collect();
        let above = Above::new(&boxes, options);
        let unbounded = (0..instances.len() as u32)
            .filter(|&i| instances[i as usize].shown && models[instances[i as usize].model as usize].has_unbounded())
            .collect();
        let round_trip =
            instances.iter().filter(|i| i.shown).fold(0.0, |most: f64, i| most.max(i.transform.round_trip()));
        let stats = SceneStats::default();
        let mut inner = Inner {
            options,
            models,
            placed,
            mask,
            groups,
            instances,
            above,
            bounded,
            unbounded,
            bounds,
            whole: bounds,
            round_trip,
            stats,
        };
        inner.stats = inner.stats();
        inner.whole = inner.placed_boxes();
        Self { inner: Arc::new(inner) }
    }

    /// The nearest hit that `accept` accepts, other than on the flat primitive `source` that the ray starts from.
    ///
    /// `accept` is asked about candidates in any order, and not about all of them; they are as the query would give them. So
    /// alpha tests, masks of single rays and the culling of one side are written in a line:
    ///
    /// ```
    /// use firsthit_accel::{Geometry, SceneBuilder};
    /// use firsthit_geometry::{Ray, shapes::Sphere};
    /// use glam::{DAffine3, DVec3};
    ///
    /// let mut builder = SceneBuilder::default();
    /// let ball = builder.add_mesh(vec![Geometry::Shape(Sphere::new(DVec3::ZERO, 1.0)?.into())]);
    /// builder.add_instance(ball, DAffine3::from_scale(DVec3::new(1.0, 1.0, -2.0)));
    /// let scene = builder.build()?;
    /// let ray = Ray::new(DVec3::Z * 9.0, DVec3::NEG_Z);
    /// let front = scene.closest_hit_filtered(&ray, None, |hit| hit.normal_direction.dot(ray.direction) < 0.0);
    /// let back = scene.closest_hit_filtered(&ray, None, |hit| hit.normal_direction.dot(ray.direction) > 0.0);
    /// assert_eq!((front.unwrap().t, back.unwrap().t), (7.0, 11.0));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// A curved shape is never skipped, since a ray may well meet it again: [`crate::SurfacePoint::spawn`] sees to it
    /// that the ray does not start behind its own surface.
    #[must_use]
    pub fn closest_hit_filtered(
        &self,
        ray: &Ray<f64>,
        source: Option<HitId>,
        mut accept: impl FnMut(&Hit) -> bool,
    ) -> Option<Hit> {
        let order = |a, b| self.comes_first(ray, a, b);
        let accept = |hit: &Hit| accept(&self.finished(*hit));
        let mut closest = Collect::new(ray, self.flat(source), accept, Closest { order, best: None });
        // It never breaks: the nearest hit is known at the end only.
        let _ = self.collect(ray, Crossings::Triangles, &mut closest);
        closest.take.best.map(|hit| self.finished(hit))
    }

    /// As [`Scene::any_hit`] with a filter: see [`Scene::closest_hit_filtered`]. A filter that always says no is asked
    /// about every hit exactly once.
    #[must_use]
    pub fn any_hit_filtered(
        &self,
        ray: &Ray<f64>,
        source: Option<HitId>,
        mut accept: impl FnMut(&Hit) -> bool,
    ) -> bool {
        let mut any = Collect::new(ray, self.flat(source), |hit| accept(&self.finished(*hit)), Any);
        self.collect(ray, Crossings::Triangles, &mut any).is_break()
    }

    /// As [`Scene::closest_hit`], with what it cost.
    #[must_use]
    pub fn closest_hit_counted(&self, ray: &Ray<f64>) -> (Option<Hit>, TraversalCounts) {
        let mut watch = Watch::default();
        let hit = self.closest_watched(ray, &mut watch);
        (hit, watch.counts)
    }

    /// A box around everything that is bounded (infinite planes do not count); empty for an empty scene.
    #[must_use]
    pub fn bounds(&self) -> Aabb<f64> {
        self.inner.bounds
    }

    /// What the trees are like.
    #[must_use]
    pub fn stats(&self) -> SceneStats {
        self.inner.stats
    }

    /// How many indices of instances there are: of hidden and removed ones too.
    #[must_use]
    pub fn instance_count(&self) -> usize {
        self.inner.instances.len()
    }

    /// How the scene was built.
    #[must_use]
    pub fn options(&self) -> BuildOptions {
        self.inner.options
    }

    pub(crate) fn inner(&self) -> &Inner {
        &self.inner
    }

    pub(crate) fn models(&self) -> &[Arc<Model>] {
        &self.inner.models
    }

    pub(crate) fn placed(&self) -> &[Placed] {
        &self.inner.placed
    }

    pub(crate) fn groups(&self) -> &Arc<Groups> {
        &self.inner.groups
    }

    pub(crate) fn mask(&self) -> u32 {
        self.inner.mask
    }

    /// The instances that queries meet, with their indices.
    pub(crate) fn shown(&self) -> impl Iterator<Item = (u32, &Instance)> {
        (0..).zip(&self.inner.instances).filter(|(_, instance)| instance.shown)
    }

    pub(crate) fn instances(&self) -> &[Instance] {
        &self.inner.instances
    }

    /// [`Scene::closest_hit`] with a probe.
    pub(crate) fn closest_watched(&self, ray: &Ray<f64>, watch: &mut Watch) -> Option<Hit> {
        let order = |a, b| self.comes_first(ray, a, b);
        let mut closest = Collect::new(ray, None, |_| true, Closest { order, best: None });
        let _ = self.collect_watched(ray, Crossings::Triangles, &mut closest, watch);
        closest.take.best.map(|hit| self.finished(hit))
    }

    /// Offers all hits to any collector: called through a pointer, so that the traversals of all tiers are not compiled
    /// anew for every filter of every caller. Only candidates pay for it.
    pub(crate) fn collect(
        &self,
        ray: &Ray<f64>,
        crossings: Crossings,
        collector: &mut (dyn Collector + '_),
    ) -> ControlFlow<()> {
        self.collect_watched(ray, crossings, collector, &mut Off)
    }

    /// The same with a probe.
    pub(crate) fn collect_watched<P: Probe>(
        &self,
        ray: &Ray<f64>,
        crossings: Crossings,
        collector: &mut (dyn Collector + '_),
        probe: &mut P,
    ) -> ControlFlow<()> {
        let mut collector = Dyn(collector);
        match crossings {
            Crossings::Surfaces => self.inner.trace::<true, _, _>(ray, &mut collector, probe),
            Crossings::Triangles => self.inner.trace::<false, _, _>(ray, &mut collector, probe),
        }
    }

    /// The primitive to skip: only what a straight ray cannot meet twice.
    #[inline(always)]
    pub(crate) fn flat(&self, source: Option<HitId>) -> Option<HitId> {
        source.filter(|id| match self.surface(id) {
            Some((_, Surface::Triangle(_))) => true,
            Some((_, Surface::Shape(s))) => s.is_flat(),
            None => false,
        })
    }

    pub(crate) fn surface(&self, id: &HitId) -> Option<(&Instance, Surface<'_>)> {
        let instance = self.inner.instances.get(id.instance as usize)?;
        let model = self.inner.models.get(instance.model as usize)?;
        let surface = model.surface(PrimitiveId { geometry: id.geometry, primitive: id.primitive })?;
        Some((instance, surface))
    }

    /// A hit as users get it: its normal is that of the world.
    #[inline(always)]
    pub(crate) fn finished(&self, hit: Hit) -> Hit {
        let instance = self.inner.instances.get(hit.id.instance as usize);
        let normal = instance.map_or(DVec3::ZERO, |i| i.transform.normal_direction(hit.normal_direction));
        Hit { normal_direction: normal, ..hit }
    }
}

impl Inner {
    pub(crate) fn above(&self) -> &Above {
        &self.above
    }

    /// Where queries about regions begin.
    pub(crate) fn whole(&self) -> Aabb<f64> {
        self.whole
    }

    /// The instance that has a box's number in the tree above.
    pub(crate) fn bounded(&self, k: u32) -> u32 {
        self.bounded[k as usize]
    }

    /// How many instances the tree above has.
    pub(crate) fn bounded_count(&self) -> u32 {
        self.bounded.len() as u32
    }

    /// Offers hits to the collector, by the tests of the scene's tier.
    fn trace<const SURFACES: bool, C: Collector, P: Probe>(
        &self,
        ray: &Ray<f64>,
        collector: &mut C,
        probe: &mut P,
    ) -> ControlFlow<()> {
        self.by_kernel(Trace::<SURFACES, C, P> { inner: self, ray, collector, probe })
    }

    pub(crate) fn trace_by<const SURFACES: bool, K: Kernel, C: Collector, P: Probe>(
        &self,
        ray: &Ray<f64>,
        collector: &mut C,
        probe: &mut P,
    ) -> ControlFlow<()> {
        // Whether it is finite is seen on entering a mesh.
        if !is_interval(ray) {
            return ControlFlow::Continue(());
        }
        let precision = self.options.precision;
        for &i in &self.unbounded {
            let (instance, model) = self.placed(i);
            if let Some(local) = LocalRay::enter(ray, &instance.transform, model.extent()) {
                model.trace_unbounded::<SURFACES, C, P>(&local, i, precision, collector, probe)?;
            }
        }
        // A distance in the world has gone through an instance and back: a few roundings more than a box's entry.
        let beyond = |t: f64| t + t.abs() * (64.0 * f64::UNIT_ROUNDOFF);
        let before = ray.t_min - ray.t_min.abs() * (64.0 * f64::UNIT_ROUNDOFF);
        let asked = Asked {
            off: self.entering(ray),
            padded: K::PADDED_ABOVE,
            ordered: collector.ordered(),
            t_min: before,
            t_max: beyond(collector.t_max()),
        };
        self.above.traverse(ray, &asked, probe, |run, probe| {
            for &k in run {
                let i = self.bounded[k as usize];
                let (instance, model) = self.placed(i);
                model.trace::<SURFACES, K, C, P>(ray, (i, &instance.transform), precision, collector, probe)?;
            }
            ControlFlow::Continue(beyond(collector.t_max()))
        })
    }

    /// Whether there are instances with something in them that has no end.
    pub(crate) fn has_unbounded(&self) -> bool {
        !self.unbounded.is_empty()
    }

    /// Those instances.
    pub(crate) fn unbounded(&self) -> &[u32] {
        &self.unbounded
    }

    /// An instance, and what is placed by it.
    #[inline(always)]
    pub(crate) fn placed(&self, i: u32) -> (&Instance, &Model) {
        let instance = &self.instances[i as usize];
        (instance, &self.models[instance.model as usize])
    }

    /// By how much of its distance from the farthest corner of the scene a ray is rounded: see [`Inner::entering`].
    pub(crate) fn round_trip(&self) -> f64 {
        self.round_trip
    }

    /// How far from the ray, in each axis, the ray may lie that an instance's tests see: it is rounded on its way there,
    /// which matters from far away. For what is rounded near the object its box is padded.
    fn entering(&self, ray: &Ray<f64>) -> DVec3 {
        // Some eight roundings on entering and 32 in the shift and the tests, see `LocalRay`: less than 64.
        let farthest = (ray.origin - self.bounds.min).abs().max((ray.origin - self.bounds.max).abs()).max_element();
        DVec3::splat(farthest * self.round_trip)
    }

    fn stats(&self) -> SceneStats {
        let stored = |m: &Model| m.triangle_count();
        let weight: u64 = self.models.iter().map(|m| stored(m)).sum();
        let cost: f64 = self.models.iter().map(|m| m.sah_cost() * m.triangle_count() as f64).sum();
        let models: usize = self.models.iter().map(|m| m.bytes()).sum();
        SceneStats {
            stored_triangles: weight,
            instanced_triangles: self
                .instances
                .iter()
                .filter(|i| i.shown)
                .map(|i| stored(&self.models[i.model as usize]))
                .sum(),
            instances: self.instances.iter().filter(|i| i.shown).count() as u64,
            sah_cost: if weight > 0 { cost / weight as f64 } else { 0.0 },
            depth: self.above.depth() + self.models.iter().map(|m| m.depth()).max().unwrap_or(0),
            bytes: (models + self.above.bytes() + size_of_val(self.instances.as_slice())) as u64,
            degenerate_triangles: self.models.iter().map(|m| m.degenerate()).sum(),
        }
    }
}

/// [`Inner::trace`].
struct Trace<'a, const SURFACES: bool, C, P> {
    inner: &'a Inner,
    ray: &'a Ray<f64>,
    collector: &'a mut C,
    probe: &'a mut P,
}

impl<const SURFACES: bool, C: Collector, P: Probe> ForKernel for Trace<'_, SURFACES, C, P> {
    type Output = ControlFlow<()>;

    #[inline(always)]
    fn run<K: Kernel>(self) -> ControlFlow<()> {
        self.inner.trace_by::<SURFACES, K, C, P>(self.ray, self.collector, self.probe)
    }
}

/// Whether the ray's interval has anything in it; false for NaN.
#[inline(always)]
pub(crate) fn is_interval(ray: &Ray<f64>) -> bool {
    ray.t_min <= ray.t_max
}
