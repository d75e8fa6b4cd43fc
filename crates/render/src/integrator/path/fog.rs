//! Paths in fog: how far they get, and the light that is scattered towards the camera on their way.

use firsthit_accel::{Hit, HitId};
use firsthit_geometry::Ray;
use glam::{DVec3, Vec3};

use super::super::whitted::{Limits, Seen};
use super::{Asked, Tracer, Walk, from_around};
use crate::fog::{Flight, Fog};
use crate::kernel::Kernel;
use crate::light::tree::Receiver;
use crate::light::{LightSample, power_heuristic};
use crate::material::lobes::LobeKind;
use crate::sampler::{Dimension, PixelSampler};
use crate::{EffectSet, RayKind, tally};

/// What became of a path on its way through fog.
pub(super) enum Flown {
    /// It got to where it would have got without.
    Through,
    /// It goes on from where it was scattered.
    Scattered,
    /// It ends.
    Ended,
}

/// No primitive: fog is none.
const NOWHERE: HitId = HitId { instance: u32::MAX, geometry: u32::MAX, primitive: u32::MAX };

impl<K: Kernel> Tracer<'_, K> {
    /// Takes a path through fog, up to what it would meet.
    pub(super) fn fly(
        &mut self,
        fog: &Fog,
        walk: &mut Walk,
        hit: Option<&Hit>,
        sampler: PixelSampler,
        limits: Limits,
        seen: &mut Seen,
    ) -> Flown {
        let mut end = hit.map_or(f64::INFINITY, |h| h.t);
        let area = &self.stage.lights.area;
        if area.has_own() {
            end = area.own_hit(&walk.ray).map_or(end, |(t, _)| t.min(end));
        }
        tally::sample(EffectSet::FOG);
        let sampler = if walk.layers == 0 { sampler } else { sampler.branch(walk.layers) };
        match fog.fly(&walk.ray, end, walk.throughput, || self.draw2(&sampler, Dimension::Fog(walk.bounce))) {
            Flight::Through(weight) => {
                walk.throughput *= weight;
                Flown::Through
            }
            Flight::Scattered(t, weight) => {
                walk.throughput *= weight;
                self.scatter_in_fog(fog, walk, t, sampler, limits, seen)
            }
        }
    }

    fn scatter_in_fog(
        &mut self,
        fog: &Fog,
        walk: &mut Walk,
        t: f64,
        sampler: PixelSampler,
        limits: Limits,
        seen: &mut Seen,
    ) -> Flown {
        if walk.bounce >= limits.bounces || !(walk.throughput.max_element() > 0.0) {
            return Flown::Ended;
        }
        let point = walk.ray.at(t);
        // Light counts as much from everywhere.
        let receiver = Receiver { point, normal: Vec3::Z, least_cos: 1.0 };
        let stage = self.stage;
        let shares = stage.lights.choice.shares(&stage.lights.punctual, &receiver);
        let onwards = walk.ray.direction.normalize().as_vec3();
        let followed = limits.follow.contains(LobeKind::DIFFUSE);
        let mut light = Vec3::ZERO;
        if !followed && let Some(environment) = &stage.lights.environment {
            let sampler = sampler.branch(1);
            if let Some(s) = environment.sample(self.draw2(&sampler, Dimension::LightPosition(walk.bounce))) {
                light +=
                    self.arrives_in_fog(fog, point, onwards, false, &from_around(s, 1.0), RayKind::ShadowEnvironment);
            }
        }
        let choice = &stage.lights.choice;
        let u = if choice.is_single() { 0.0 } else { self.draw1(&sampler, Dimension::LightChoice(walk.bounce)) };
        if let Some((chosen, probability)) = choice.sample(&stage.lights.punctual, &shares, &receiver, u) {
            let u = self.draw2(&sampler, Dimension::LightPosition(walk.bounce));
            let (sample, kind) = self.sample_light(chosen, probability, point, NOWHERE, u, followed);
            if let Some(sample) = sample {
                light += self.arrives_in_fog(fog, point, onwards, followed, &sample, kind);
            }
        }
        seen.color += walk.throughput * light;
        walk.bounce += 1;
        if !followed || walk.bounce > limits.bounces {
            return Flown::Ended;
        }
        let direction = fog.turn(onwards, self.draw2(&sampler, Dimension::Direction(walk.bounce - 1)));
        walk.ray = Ray::new(point, direction.as_dvec3().normalize());
        (walk.source, walk.kind, walk.layers, walk.straight) = (None, RayKind::Fog, 0, false);
        walk.scattered = Some(Asked { receiver, shares, pdf: fog.phase(onwards.dot(direction)) });
        if self.survives(walk, sampler) { Flown::Scattered } else { Flown::Ended }
    }

    /// Radiance towards where a path comes from, by the light of one light that fog scatters at a point.
    fn arrives_in_fog(
        &mut self,
        fog: &Fog,
        point: DVec3,
        onwards: Vec3,
        followed: bool,
        sample: &LightSample,
        kind: RayKind,
    ) -> Vec3 {
        let phase = fog.phase(onwards.dot(sample.direction));
        let share = match sample.pdf {
            Some(own) if followed => power_heuristic(own, phase),
            _ => 1.0,
        };
        let light = sample.radiance * (phase * share) * self.through_fog(point, sample);
        if light.max_element() > 0.0 { light * self.lit(kind, point, sample, NOWHERE, false) } else { Vec3::ZERO }
    }
}
