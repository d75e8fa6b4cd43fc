//! Casting rays into a stage.

use std::marker::PhantomData;
use std::time::{Duration, Instant};

use firsthit_accel::{Hit, HitId};
use firsthit_geometry::clip::ClipRegion;
use firsthit_geometry::{Precision, Ray};
use glam::{DVec3, Vec3};

use super::clock::{Clock, Parts, Spent};
use crate::fog::Fog;
use crate::kernel::Kernel;
use crate::light::{LightEnd, LightSample};
use crate::material::Colors;
use crate::sampler::{Dimension, PixelSampler, Points};
use crate::{EffectSet, RayCounts, RayKind, Stage, tally};

/// Time spent in rays of each kind, on pixels that are timed.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Timing {
    seconds: [f64; RayKind::ALL.len()],
    rays: [u64; RayKind::ALL.len()],
    /// How often the clock was looked at for them.
    looks: u64,
    pub(crate) parts: Parts,
}

impl Timing {
    pub(crate) fn add(&mut self, other: &Self) {
        for k in 0..RayKind::ALL.len() {
            self.seconds[k] += other.seconds[k];
            self.rays[k] += other.rays[k];
        }
        self.looks += other.looks;
        self.parts.add(&other.parts);
    }

    pub(crate) fn seconds_per_ray(&self, kind: RayKind) -> Option<f64> {
        let k = kind as usize;
        (self.rays[k] > 0).then(|| self.seconds[k] / self.rays[k] as f64)
    }

    /// Rays of all kinds.
    pub(crate) fn traversal(&self) -> Spent {
        Spent { seconds: self.seconds.iter().sum(), spans: self.looks }
    }

    fn note(&mut self, kind: RayKind, time: Duration) {
        self.note_some(kind, time, 1);
    }

    /// Some rays that took about this time each.
    fn note_some(&mut self, kind: RayKind, each: Duration, rays: u64) {
        self.seconds[kind as usize] += each.as_secs_f64() * rays as f64;
        self.rays[kind as usize] += rays;
        self.looks += u64::from(rays > 0);
    }
}

/// A shadow ray.
fn towards(from: DVec3, sample: &LightSample) -> Ray<f64> {
    /// The light itself is not in the way.
    const BEFORE_LIGHT: f64 = 1.0 - 1e-6;
    match sample.end {
        LightEnd::At(point) => Ray::segment(from, point).with_interval(0.0, BEFORE_LIGHT),
        LightEnd::Infinity => Ray::new(from, sample.direction.as_dvec3()),
    }
}

/// Which clear surfaces a shadow ray passes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Clear {
    /// Rough or smooth, sheets and solids.
    All,
    /// Those that do not scatter.
    Smooth,
    /// Those that neither scatter nor bend.
    SmoothSheets,
}

/// Casts rays for one thread by one kernel, and counts them.
pub(crate) struct Tracer<'a, K: Kernel> {
    pub(crate) stage: &'a Stage,
    clip: Option<&'a ClipRegion<f64>>,
    shadows: bool,
    disperses: bool,
    /// How near things must be to take even light away, where that is simulated.
    pub(super) occlusion_reach: Option<f64>,
    pub(crate) counts: RayCounts,
    pub(crate) timing: Timing,
    /// Whether the rays of the current pixel are timed.
    pub(crate) timed: bool,
    /// Times what is not rays on such pixels, if that is asked for.
    pub(crate) clock: Option<&'a Clock>,
    /// Fog, for those who simulate it.
    pub(crate) fog: Option<&'a Fog>,
    points: Points,
    /// What the first surface looks like is to be told.
    pub(crate) wants_first: bool,
    kernel: PhantomData<K>,
}

impl<'a, K: Kernel> Tracer<'a, K> {
    pub(crate) fn new(stage: &'a Stage, clip: &'a ClipRegion<f64>) -> Self {
        Self {
            stage,
            clip: (!clip.is_all()).then_some(clip),
            shadows: stage.plan().simulated().contains(EffectSet::SHADOWS),
            disperses: stage.plan().simulated().contains(EffectSet::DISPERSION),
            occlusion_reach: stage
                .plan()
                .simulated()
                .contains(EffectSet::AMBIENT_OCCLUSION)
                .then_some(stage.lights.ambient_reach),
            counts: RayCounts::default(),
            timing: Timing::default(),
            timed: false,
            clock: None,
            fog: None,
            points: Points::default(),
            wants_first: false,
            kernel: PhantomData,
        }
    }

    /// The share of a light sample's light that gets through fog to a point.
    pub(super) fn through_fog(&self, from: DVec3, sample: &LightSample) -> Vec3 {
        let Some(fog) = self.fog else { return Vec3::ONE };
        match sample.end {
            LightEnd::At(point) => fog.passed(&Ray::segment(from, point), 1.0),
            LightEnd::Infinity => fog.passed(&Ray::new(from, sample.direction.as_dvec3()), f64::INFINITY),
        }
    }

    /// Which colour a camera ray's path follows once colours are parted; nothing is drawn where they never are.
    pub(super) fn colors(&self, sampler: PixelSampler) -> Colors {
        if !self.disperses {
            return Colors::All(1);
        }
        tally::sample(EffectSet::DISPERSION);
        Colors::chosen_by(sampler.get1(Dimension::Color))
    }

    /// Sample points for one use.
    #[inline]
    pub(crate) fn draw2(&self, sampler: &PixelSampler, dimension: Dimension) -> [f32; 2] {
        match self.clock {
            None => self.points.get2(sampler, dimension),
            Some(clock) => clock.sampling(|| self.points.get2(sampler, dimension)),
        }
    }

    /// A number for one use.
    #[inline]
    pub(crate) fn draw1(&self, sampler: &PixelSampler, dimension: Dimension) -> f32 {
        match self.clock {
            None => self.points.get1(sampler, dimension),
            Some(clock) => clock.sampling(|| self.points.get1(sampler, dimension)),
        }
    }

    /// The ray inside what is shown.
    pub(super) fn clipped(&self, ray: &Ray<f64>) -> Option<Ray<f64>> {
        match self.clip {
            None => Some(*ray),
            Some(region) => {
                tally::sample(EffectSet::CLIPPING);
                region.clip(ray)
            }
        }
    }

    pub(super) fn timed<R>(&mut self, kind: RayKind, cast: impl FnOnce(&mut Self) -> R) -> R {
        self.counts[kind] += 1;
        if !self.timed {
            return cast(self);
        }
        let start = Instant::now();
        let answer = cast(self);
        self.timing.note(kind, start.elapsed());
        answer
    }

    /// The nearest surface that a ray sees.
    pub(crate) fn closest(&mut self, kind: RayKind, ray: &Ray<f64>, source: Option<HitId>) -> Option<Hit> {
        self.timed(kind, |this| {
            let ray = this.clipped(ray)?;
            // A spawned ray starts off its surface for certain: to leave that out is only faster.
            let hit = match source {
                Some(source) => this.stage.accel.closest_hit_from(&ray, source),
                None => this.stage.accel.closest_hit(&ray),
            };
            if K::FILTERED { this.seen(&ray, source, hit) } else { hit }
        })
    }

    /// The nearest surfaces that camera rays see, each in the slot of its ray; `timed` of them are.
    pub(crate) fn camera_hits(&mut self, rays: &[Ray<f64>], hits: &mut [Option<Hit>], timed: u64) -> Duration {
        let start = Instant::now();
        let inside: Vec<_>;
        let rays = match self.clip {
            None => rays,
            Some(region) => {
                // What is outside has an interval without a number in it.
                let clip = |ray: &Ray<f64>| {
                    tally::sample(EffectSet::CLIPPING);
                    region.clip(ray).unwrap_or(ray.with_interval(1.0, 0.0))
                };
                inside = rays.iter().map(clip).collect();
                &inside
            }
        };
        // `Fast` alone may find other hits in a packet than one by one, and what goes in one packet depends on where a
        // render pauses.
        if self.stage.accel.options().precision == Precision::Fast {
            for (ray, hit) in rays.iter().zip(&mut *hits) {
                *hit = self.stage.accel.closest_hit(ray);
            }
        } else {
            self.stage.accel.closest_hits(rays, hits);
        }
        if K::FILTERED {
            for (ray, hit) in rays.iter().zip(hits) {
                *hit = self.seen(ray, None, *hit);
            }
        }
        let each = start.elapsed().div_f64(rays.len().max(1) as f64);
        self.counts[RayKind::Camera] += rays.len() as u64;
        self.timing.note_some(RayKind::Camera, each, timed);
        each
    }

    /// The nearest hit that is seen, when this one is the nearest of all. Most often that is the same, and is found
    /// without asking about any other.
    #[inline]
    fn seen(&self, ray: &Ray<f64>, source: Option<HitId>, nearest: Option<Hit>) -> Option<Hit> {
        let nearest = nearest?;
        if source != Some(nearest.id) && self.is_seen(ray, &nearest) {
            return Some(nearest);
        }
        self.stage.accel.closest_hit_filtered(ray, source, |hit| self.is_seen(ray, hit))
    }

    /// Whether a surface is there for a ray that sees: glTF hides back faces of single-sided materials, and holes.
    fn is_seen(&self, ray: &Ray<f64>, hit: &Hit) -> bool {
        let world = &self.stage.world;
        let material = world.material(hit.id);
        if self.is_culled(hit, material, ray.direction) {
            return false;
        }
        !self.stage.flags[material].alpha
            || self.stage.materials[material].coverage::<K>(&world.attributes(hit, true)) > 0.0
    }

    /// Whether a surface is not there for what meets its back: sight, or the light on its way. A shadow ray runs
    /// against the light.
    pub(super) fn is_culled(&self, hit: &Hit, material: usize, towards: DVec3) -> bool {
        self.stage.flags[material].culls && !self.stage.world.faces(hit.id, towards)
    }

    /// Whether anything lies between a point and infinity or `distance`, alpha included (clear surfaces count as
    /// there).
    pub(crate) fn occluded(&mut self, kind: RayKind, ray: &Ray<f64>, source: HitId, covers: f32) -> bool {
        self.timed(kind, |this| {
            let Some(ray) = this.clipped(ray) else { return false };
            this.stage.accel.any_hit_filtered(&ray, Some(source), |hit| {
                if !K::FILTERED {
                    return true;
                }
                let material = this.stage.world.material(hit.id);
                !this.is_culled(hit, material, -ray.direction)
                    && (!this.stage.flags[material].alpha
                        || this.stage.materials[material].coverage::<K>(&this.stage.world.attributes(hit, true))
                            > covers)
            })
        })
    }

    /// The share of a light sample's light that arrives: shadow rays see what other rays see, pass holes and
    /// partly covering surfaces, and go straight through clear ones.
    pub(crate) fn transmittance(&mut self, kind: RayKind, from: DVec3, sample: &LightSample, source: HitId) -> Vec3 {
        if !self.shadows {
            return Vec3::ONE;
        }
        let ray = towards(from, sample);
        self.timed(kind, |this| {
            let Some(ray) = this.clipped(&ray) else { return Vec3::ONE };
            if K::FILTERED {
                return this.filtered_transmittance(&ray, sample.target, source, Clear::All);
            }
            let target = sample.target;
            let blocked =
                this.stage.accel.any_hit_filtered(&ray, Some(source), |hit| target.is_none_or(|t| t != hit.id));
            if blocked { Vec3::ZERO } else { Vec3::ONE }
        })
    }

    /// The share of a light sample's light that arrives on a way which paths do not take in part: shadow rays pass
    /// holes, partly covering surfaces and smooth sheets, and are stopped by solids, by what is rough, and by lights
    /// that stand in the way. Only the light of what no path can meet passes smooth solids. `away`: the ray goes away from its
    /// source for certain.
    pub(crate) fn lit(&mut self, kind: RayKind, from: DVec3, sample: &LightSample, source: HitId, away: bool) -> Vec3 {
        if !self.shadows {
            return Vec3::ONE;
        }
        let ray = towards(from, sample);
        self.timed(kind, |this| {
            let area = &this.stage.lights.area;
            if area.has_own() && area.own_hit(&ray).is_some() {
                return Vec3::ZERO;
            }
            let Some(ray) = this.clipped(&ray) else { return Vec3::ONE };
            if K::FILTERED {
                let clear = if sample.pdf.is_none() { Clear::Smooth } else { Clear::SmoothSheets };
                return this.filtered_transmittance(&ray, sample.target, source, clear);
            }
            let accel = &this.stage.accel;
            let blocked = if away { accel.any_hit_from(&ray, source) } else { accel.any_hit(&ray) };
            if blocked { Vec3::ZERO } else { Vec3::ONE }
        })
    }

    pub(super) fn filtered_transmittance(
        &self,
        ray: &Ray<f64>,
        target: Option<HitId>,
        source: HitId,
        clear: Clear,
    ) -> Vec3 {
        /// Less light than this is none.
        const NEGLIGIBLE: f32 = 1e-4;
        let (stage, world) = (self.stage, &self.stage.world);
        let direction = ray.direction.normalize();
        let length = ray.direction.length();
        let mut arrives = Vec3::ONE;
        // Sum of (absorption x way) with entries negative and exits positive: the order of hits does not matter.
        let mut absorbed = Vec3::ZERO;
        let blocked = stage.accel.any_hit_filtered(ray, Some(source), |hit| {
            if target == Some(hit.id) {
                return false;
            }
            let index = world.material(hit.id);
            if self.is_culled(hit, index, -ray.direction) {
                return false;
            }
            if !stage.flags[index].lets_through {
                return true;
            }
            let material = &stage.materials[index];
            let surface = world.attributes(hit, true);
            let covered = material.coverage::<K>(&surface);
            if covered <= 0.0 {
                return false;
            }
            let mut through = Vec3::ZERO;
            if K::THROUGH && material.is_clear() && (clear != Clear::SmoothSheets || !material.solid) {
                let crossing = world.crossing(hit, ray);
                let cos = crossing.normal.dot(direction).abs() as f32;
                through = match clear {
                    Clear::All => material.straight_through::<K>(&surface, cos),
                    _ => material.passes_smoothly::<K>(&surface, cos),
                };
                if material.solid {
                    let way = |t: f64| (t * length) as f32;
                    let entering = crossing.normal.dot(direction) < 0.0;
                    absorbed += material.absorption * if entering { -way(hit.t) } else { way(hit.t) };
                    // A ball or the like is asked about once: this is its other side.
                    if let Some(exit) = crossing.exit {
                        through *= through;
                        absorbed += material.absorption * way(exit);
                    }
                }
            }
            arrives *= Vec3::splat(1.0 - covered) + through * covered;
            arrives.max_element() < NEGLIGIBLE
        });
        if blocked {
            return Vec3::ZERO;
        }
        // A way that ends inside (a light in a solid) leaves more entries than exits: nothing is gained by that.
        arrives * absorbed.max(Vec3::ZERO).map(|a| (-a).exp())
    }
}
