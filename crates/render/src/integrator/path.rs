//! Path tracing: all ways that light takes.
//!
//! Kajiya, "The Rendering Equation" (1986). A path goes from the camera from surface to surface; at each that spreads
//! light one light is asked (next-event estimation), and the path goes on in a direction drawn from the surface. A
//! light may be found both ways, which share it by Veach's power heuristic. Chance ends paths that have become dim
//! (Russian roulette), with which the expected value stays the same.
//!
//! What covers in part, and clear sheets without thickness, do not bend a path: it passes them by chance or with their
//! tint, and so does the light that is asked. They are no bounces. Solids of glass bend it, and cast shadows; light
//! comes through them by paths that meet it. Only lights without extent, which no path can meet, are taken as seen
//! straight through smooth solids.

mod fog;

use firsthit_accel::{Hit, HitId};
use firsthit_geometry::Ray;
use glam::{DVec3, Vec3};

use super::scatter::{Scatter, Towards, family, is_delta};
use super::whitted::{Limits, Seen};
use super::{Tracer, aov};
use crate::EffectSet;
use crate::RayKind;
use crate::camera::Cone;
use crate::kernel::Kernel;
use crate::light::choice::{Chosen, Shares};
use crate::light::tree::Receiver;
use crate::light::{LightEnd, LightSample, power_heuristic, studio};
use crate::material::lobes::{Lobe, LobeKind};
use crate::material::{Bsdf, Colors, Material};
use crate::sampler::{Dimension, PixelSampler};
use crate::stage::Backdrop;
use crate::surface::Surface;
use crate::tally;
use fog::Flown;

/// After this bounce chance ends paths that have become dim.
const ROULETTE: u32 = 2;
/// Dim is what has lost more than all but this share of its light: measured, the best for time and noise together.
const DIM: f32 = 1.0 / 3.0;
/// The solid angle that one of many scattered paths stands for, where they are evenly dense: what textures show within
/// it is averaged.
const VIEW: f32 = 1.0 / 256.0;
/// At so many surfaces in a row that let a ray pass, it meets the next.
const MOST_LAYERS: u32 = 500;

/// The end of a path so far.
struct Walk {
    ray: Ray<f64>,
    source: Option<HitId>,
    kind: RayKind,
    throughput: Vec3,
    bounce: u32,
    /// Surfaces passed since the last bounce.
    layers: u32,
    cone: Cone,
    /// Absorption of what the ray is in.
    absorption: Vec3,
    /// It is in a solid.
    inside: bool,
    /// Only straight on so far: it sees the background.
    straight: bool,
    /// Where it last scattered, if the light there might have been asked.
    scattered: Option<Asked>,
    /// By how much radiance was scaled at boundaries of media: it does not make a path dim.
    scale: f32,
    /// Which colours it is about.
    colors: Colors,
    /// How much wider its view of textures becomes for each unit of distance, since it was scattered.
    spread: f32,
    /// Of the next surface mirror images alone are wanted: see [`Limits::mirrors`].
    mirrors: bool,
}

/// A point at which one light was asked.
#[derive(Clone, Copy)]
struct Asked {
    receiver: Receiver,
    shares: Shares,
    /// Density of the direction in which the path went on.
    pdf: f32,
}

/// A surface that a path meets.
struct Vertex<'a, 'b, K: Kernel> {
    surface: &'a Surface<'b>,
    scatter: &'a Scatter<'a, K>,
    receiver: Receiver,
    shares: Shares,
    sampler: PixelSampler,
    bounce: u32,
    absorption: Vec3,
    /// It is seen from within a solid.
    inside: bool,
    /// Light goes into a solid here, out of which it comes bent another time: only paths that follow it tell.
    enters: bool,
}

impl<K: Kernel> Tracer<'_, K> {
    /// What the camera sees along a ray, which meets `first`, by one path; `screen` is where in the picture that is, 0
    /// to 1 from the upper left.
    pub(crate) fn path(
        &mut self,
        ray: Ray<f64>,
        first: Option<Hit>,
        cone: Cone,
        screen: [f32; 2],
        sampler: PixelSampler,
        limits: Limits,
    ) -> Seen {
        let mut seen = Seen { color: Vec3::ZERO, alpha: 1.0, first: None };
        let mut walk = Walk {
            ray,
            source: None,
            kind: RayKind::Camera,
            throughput: Vec3::ONE,
            bounce: 0,
            layers: 0,
            cone,
            absorption: Vec3::ZERO,
            inside: false,
            straight: true,
            scattered: None,
            scale: 1.0,
            colors: self.colors(sampler),
            spread: 0.0,
            mirrors: limits.mirrors,
        };
        let mut hit = first;
        loop {
            if K::RARE
                && let Some(fog) = self.fog.filter(|_| !walk.inside)
            {
                match self.fly(fog, &mut walk, hit.as_ref(), sampler, limits, &mut seen) {
                    Flown::Through => {}
                    Flown::Scattered => {
                        hit = self.closest(walk.kind, &walk.ray, walk.source);
                        continue;
                    }
                    Flown::Ended => return seen,
                }
            }
            if self.meets_light(&walk, hit.as_ref(), &mut seen) {
                return seen;
            }
            let Some(met) = hit else {
                self.escape_by_path(&walk, screen, limits, &mut seen);
                return seen;
            };
            if K::THROUGH {
                walk.throughput *= walk.left_after(met.t);
            }
            if !self.scatter(&mut walk, &met, sampler, limits, &mut seen) {
                return seen;
            }
            hit = self.closest(walk.kind, &walk.ray, walk.source);
        }
    }

    /// Whether a path ends at a light that is no part of the scene's trees; its glow is added.
    #[inline]
    fn meets_light(&self, walk: &Walk, hit: Option<&Hit>, seen: &mut Seen) -> bool {
        let area = &self.stage.lights.area;
        if !area.has_own() {
            return false;
        }
        let Some((t, i)) = area.own_hit(&walk.ray) else { return false };
        if hit.is_some_and(|h| h.t <= t) {
            return false;
        }
        let light = &area.shapes[i];
        let share = walk.share(|asked| {
            let distance = (walk.ray.at(t) - asked.receiver.point).length();
            let density = light.pdf(asked.receiver.point, walk.ray.direction, distance);
            self.stage.lights.choice.probability(Chosen::Shape(i), &asked.shares, &asked.receiver) * density
        });
        seen.color += walk.throughput * walk.left_after(t) * light.radiance * share;
        true
    }

    /// A path that meets nothing.
    fn escape_by_path(&self, walk: &Walk, screen: [f32; 2], limits: Limits, seen: &mut Seen) {
        let lights = &self.stage.lights;
        let direction = walk.ray.direction.as_vec3();
        if walk.straight {
            let background = match self.stage.background {
                Backdrop::Transparent => {
                    seen.alpha -= walk.throughput.element_sum() / 3.0;
                    return;
                }
                Backdrop::Color(color) => color,
                Backdrop::Studio(brightness) => studio::backdrop(screen[0], screen[1]) * brightness,
                Backdrop::Environment => lights.environment.as_ref().map_or(Vec3::ZERO, |e| e.radiance(direction)),
            };
            seen.color += walk.throughput * background;
        } else if let Some(environment) = &lights.environment {
            // Only what was asked is asked for its density.
            let (radiance, pdf) = match &walk.scattered {
                None => (environment.radiance(direction), 0.0),
                Some(_) if limits.follow.contains(LobeKind::DIFFUSE) => environment.radiance_and_pdf_bright(direction),
                Some(_) => (environment.radiance(direction), environment.pdf(direction)),
            };
            let share = walk.share(|asked| {
                if limits.follow.contains(LobeKind::DIFFUSE) { asked.shares.environment * pdf } else { pdf }
            });
            seen.color += walk.throughput * radiance * share;
        }
    }

    /// A path that meets a surface; false: it ends there.
    #[inline]
    fn scatter(&mut self, walk: &mut Walk, hit: &Hit, sampler: PixelSampler, limits: Limits, seen: &mut Seen) -> bool {
        let stage = self.stage;
        let point = stage.accel.surface_point(&walk.ray, hit);
        let wo = -walk.ray.direction.as_vec3();
        walk.cone.width += walk.cone.spread * hit.t;
        let mut surface = stage.world.surface(hit, point, wo, walk.cone.width as f32);
        surface.colors = walk.colors;
        surface.clock = self.clock;
        let index = stage.world.material(hit.id);
        let material = &stage.materials[index];
        if K::TEXTURES && stage.flags[index].textured {
            surface.dark = stage.is_dark(hit.id, index);
            // What has holes or is clear is asked for by light as well, which sees it sharp; so is what glows.
            let spread = if stage.flags[index].sharp { 0.0 } else { walk.spread * hit.t as f32 };
            surface.look(spread);
        }

        if K::FILTERED && material.has_alpha() && walk.layers < MOST_LAYERS {
            let covered = material.coverage::<K>(&surface);
            let layer = sampler.branch(walk.layers);
            if covered < 1.0 && self.draw1(&layer, Dimension::Alpha(walk.bounce)) >= covered {
                walk.pass(&surface, RayKind::Transparency);
                return true;
            }
        }
        let shading = material.shade::<K>(&surface);
        if self.wants_first && walk.straight && seen.first.is_none() {
            seen.first = Some(aov::First::new(&walk.ray, hit, &surface, &shading, index));
        }
        if shading.emission != Vec3::ZERO {
            let share = walk.share(|asked| self.density_of_glow(asked, hit, &surface, &walk.ray));
            seen.color += walk.throughput * shading.emission * share;
        }
        let lobes = shading.bsdf.lobes();
        // Clear sheets are passed at the last surface too: light that is asked there comes through them.
        let solid = K::THROUGH && material.solid;
        let (ends, sheet) = (walk.bounce >= limits.bounces, K::THROUGH && material.is_clear() && !solid);
        if lobes.is_empty() || (ends && !sheet) {
            return false;
        }
        let mut scatter = Scatter::new(&shading.bsdf, wo, walk.throughput, limits.follow);
        if walk.mirrors {
            scatter.keep_mirrors();
        }
        let sampler = if walk.layers == 0 { sampler } else { sampler.branch(walk.layers) };
        let mut asked = None;
        if scatter.spreads && !ends {
            let receiver = receiver::<K>(&surface, shading.bsdf.normal, lobes);
            let shares = stage.lights.choice.shares(&stage.lights.punctual, &receiver);
            let vertex = Vertex {
                surface: &surface,
                scatter: &scatter,
                receiver,
                shares,
                sampler,
                bounce: walk.bounce,
                absorption: walk.absorption,
                inside: walk.inside,
                enters: solid && surface.front,
            };
            seen.color += walk.throughput * self.ask(&vertex, &shading.bsdf, limits);
            asked = Some((receiver, shares));
        }
        let choice = || self.draw1(&sampler, Dimension::Lobe(walk.bounce));
        let direction = self.draw2(&sampler, Dimension::Direction(walk.bounce));
        let Some(on) = scatter.sample(choice, direction) else { return false };
        let direction = shading.bsdf.world(on.wi).as_dvec3().normalize();
        let through = K::THROUGH && on.wi.z < 0.0;
        // A shading normal may send a reflection below the surface, or a refraction above it.
        let side = direction.dot(surface.geometric.as_dvec3());
        if !(if through { side < 0.0 } else { side > 0.0 }) {
            return false;
        }
        walk.throughput *= on.weight;
        if !(walk.throughput.max_element() > 0.0) {
            return false;
        }
        let lobe = &lobes[on.lobe];
        let unbent = K::THROUGH && matches!(lobe, Lobe::SpecularTransmission(s) if s.eta == 1.0);
        if unbent && !solid && walk.layers < MOST_LAYERS {
            // A clear sheet: the light that was asked before was asked through it, where that is simulated.
            if !material.is_clear() {
                walk.scattered = None;
                walk.mirrors = false;
            }
            walk.pass(&surface, RayKind::Transmission);
            return true;
        }
        if ends {
            return false;
        }
        if through && material.parts_colors {
            walk.colors = walk.colors.parted();
        }
        let entered = through && solid;
        if entered {
            walk.inside = surface.front;
            walk.absorption = if surface.front { material.absorption } else { Vec3::ZERO };
        }
        walk.scale *= lobe.scale();
        walk.kind = match family(lobe) {
            _ if entered => RayKind::Refraction,
            LobeKind::REFLECTION => RayKind::Reflection,
            LobeKind::TRANSMISSION => RayKind::Transmission,
            _ => RayKind::Indirect,
        };
        if let Some(pdf) = on.pdf.filter(|_| K::TEXTURES) {
            walk.spread = walk.spread.max((VIEW / pdf).sqrt());
        }
        walk.straight &= unbent;
        walk.layers = 0;
        walk.mirrors = false;
        walk.source = Some(surface.id);
        walk.ray = Ray::new(surface.point.spawn(direction), direction);
        walk.scattered = match (on.pdf, asked) {
            // Light that enters a solid has not been asked: see `Vertex::enters`. Nor has what comes from below the
            // curved surface that the normals mean.
            (Some(pdf), Some((receiver, shares)))
                if !(entered && surface.front) && (through || direction.as_vec3().dot(surface.smooth) > 0.0) =>
            {
                Some(Asked { receiver, shares, pdf })
            }
            _ => None,
        };
        walk.bounce += 1;
        self.survives(walk, sampler)
    }

    /// Whether chance lets a path go on.
    #[inline]
    fn survives(&self, walk: &mut Walk, sampler: PixelSampler) -> bool {
        if walk.bounce > ROULETTE {
            let chance = walk.throughput.max_element() / (DIM * walk.scale);
            if chance < 1.0 {
                if !(self.draw1(&sampler, Dimension::Roulette(walk.bounce)) < chance) {
                    return false;
                }
                walk.throughput /= chance;
            }
        }
        true
    }

    /// Density over solid angle with which the light at a glowing hit would have been asked.
    fn density_of_glow(&self, asked: &Asked, hit: &Hit, surface: &Surface<'_>, ray: &Ray<f64>) -> f32 {
        let lights = &self.stage.lights;
        let Some(chosen) = lights.area.light_of(hit.id) else { return 0.0 };
        let from = asked.receiver.point;
        let distance = (surface.point.position - from).length();
        let density = lights.area.density(chosen, from, ray.direction, distance);
        lights.choice.probability(chosen, &asked.shares, &asked.receiver) * density
    }

    /// Radiance to the viewer by one reflection of the light of one light, over the probability of asking it.
    fn ask(&mut self, at: &Vertex<'_, '_, K>, bsdf: &Bsdf<K>, limits: Limits) -> Vec3 {
        let stage = self.stage;
        let lights = &stage.lights;
        let choice = &lights.choice;
        let u = if choice.is_single() { 0.0 } else { self.draw1(&at.sampler, Dimension::LightChoice(at.bounce)) };
        let all_followed = limits.follow.contains(LobeKind::DIFFUSE);
        let mut light = Vec3::ZERO;
        if !all_followed && let Some(environment) = &lights.environment {
            // What is not followed must find all of the surroundings this way.
            let sampler = at.sampler.branch(1);
            if let Some(s) = environment.sample(self.draw2(&sampler, Dimension::LightPosition(at.bounce))) {
                light += self.arrives_at(at, bsdf, &from_around(s, 1.0), RayKind::ShadowEnvironment);
            }
        }
        let Some((chosen, probability)) = choice.sample(&lights.punctual, &at.shares, &at.receiver, u) else {
            return light;
        };
        let from = at.surface.point.position;
        let u = self.draw2(&at.sampler, Dimension::LightPosition(at.bounce));
        let (sample, kind) = self.sample_light(chosen, probability, from, at.surface.id, u, all_followed);
        match sample {
            Some(sample) => light + self.arrives_at(at, bsdf, &sample, kind),
            None => light,
        }
    }

    /// A way from a point (on this primitive) to a light that was chosen with a probability. The surroundings are asked by
    /// what stands out of them, where the rest is met by paths.
    #[inline]
    fn sample_light(
        &self,
        chosen: Chosen,
        probability: f32,
        from: DVec3,
        on: HitId,
        u: [f32; 2],
        all_followed: bool,
    ) -> (Option<LightSample>, RayKind) {
        let (stage, lights) = (self.stage, &self.stage.lights);
        match chosen {
            Chosen::Punctual(i) => {
                let sample = lights.punctual[i].sample_followed(from, u);
                (sample.map(|s| s.chosen_with(probability)), RayKind::ShadowPunctual)
            }
            Chosen::Shape(i) => {
                let sample = lights.area.shapes[i].sample(from, u);
                (sample.map(|s| s.chosen_with(probability)), RayKind::ShadowArea)
            }
            Chosen::Triangle(i) => {
                let sample = lights
                    .area
                    .mesh
                    .as_ref()
                    .and_then(|mesh| mesh.sample_triangle(i, 1.0 / f64::from(probability), from, u, on));
                let even = lights.area.mesh.as_ref().and_then(|mesh| mesh.even_radiance(i));
                let sample = sample.map(|(mut sample, hit)| {
                    sample.radiance *= even.unwrap_or_else(|| stage.glow::<K>(&hit, sample.direction));
                    sample
                });
                (sample, RayKind::ShadowArea)
            }
            Chosen::Environment => {
                let sample = lights.environment.as_ref().filter(|_| all_followed).and_then(|e| e.sample_bright(u));
                (sample.map(|s| from_around(s, probability)), RayKind::ShadowEnvironment)
            }
        }
    }

    /// Radiance to the viewer by one reflection of a light sample's light, shared with what following would find.
    fn arrives_at(&mut self, at: &Vertex<'_, '_, K>, bsdf: &Bsdf<K>, sample: &LightSample, kind: RayKind) -> Vec3 {
        let surface = at.surface;
        let wi = bsdf.local(sample.direction);
        let side = sample.direction.dot(surface.geometric);
        let terminator = self.stage.terminator;
        // Light from just below the flat triangle still reaches the curved surface that the normals mean.
        let before = wi.z > 0.0 && sample.direction.dot(surface.smooth) > 0.0;
        let behind = K::THROUGH && wi.z < 0.0 && side < 0.0 && !at.enters;
        if !(before || behind) {
            return Vec3::ZERO;
        }
        let Towards { mut followed, others, pdf } = at.scatter.towards(wi);
        if let Some(own) = sample.pdf {
            // Following never leaves on the other side of the triangle.
            let other = if (side > 0.0) == (wi.z > 0.0) { pdf } else { 0.0 };
            followed *= power_heuristic(own, other);
        }
        let mut light = (followed + others) * sample.radiance;
        if !(light.max_element() > 0.0) {
            return Vec3::ZERO;
        }
        let origin = if before && terminator {
            let mut lifted = surface.point;
            lifted.position += surface.lift();
            // On the viewer's side, even where the light is just below the flat triangle.
            lifted.spawn(surface.geometric.as_dvec3())
        } else {
            surface.point.spawn(sample.direction.as_dvec3())
        };
        // On the way to lights without extent the shadow ray itself looks after solids.
        if at.absorption != Vec3::ZERO
            && !behind
            && sample.pdf.is_some()
            && let LightEnd::At(end) = sample.end
        {
            light *= (at.absorption * -((end - origin).length() as f32)).map(f32::exp);
        }
        if K::RARE && self.fog.is_some() && (behind || !at.inside) {
            light *= self.through_fog(origin, sample);
        }
        // What is just below the flat triangle is lit through it.
        let away = side > 0.0 || !(before && terminator);
        light * self.lit(kind, origin, sample, surface.id, away)
    }
}

/// A sample of the surroundings as that of a light which was chosen with a probability.
fn from_around(s: crate::light::environment::EnvironmentSample, probability: f32) -> LightSample {
    let pdf = s.pdf * probability;
    LightSample {
        direction: s.direction,
        radiance: s.radiance / pdf,
        pdf: Some(pdf),
        end: LightEnd::Infinity,
        target: None,
    }
}

/// The surface as lights see it.
#[inline]
fn receiver<K: Kernel>(surface: &Surface<'_>, normal: Vec3, lobes: &[Lobe]) -> Receiver {
    // Where light may come from behind, or the normals disagree, every direction may matter.
    let flat = normal == surface.geometric;
    let opaque = !K::THROUGH || lobes.iter().all(|l| is_delta(l) || !l.goes_through());
    let least_cos = if !opaque {
        0.3
    } else if flat {
        0.0
    } else {
        0.05
    };
    Receiver { point: surface.point.position, normal, least_cos }
}

impl Walk {
    /// The share of a light's glow that is counted on this way, when a light asked at the last bounce counts the rest;
    /// `density` is with which it would have been asked in this direction.
    #[inline]
    fn share(&self, density: impl FnOnce(&Asked) -> f32) -> f32 {
        match &self.scattered {
            Some(asked) => power_heuristic(asked.pdf, density(asked)),
            None => 1.0,
        }
    }

    /// What absorption leaves of light on the way to a point of the ray.
    #[inline]
    fn left_after(&self, t: f64) -> Vec3 {
        if self.absorption == Vec3::ZERO {
            return Vec3::ONE;
        }
        tally::sample(EffectSet::ABSORPTION);
        let way = t * self.ray.direction.length();
        (self.absorption * -(way as f32)).map(f32::exp)
    }

    /// Goes on straight behind a surface.
    fn pass(&mut self, surface: &Surface<'_>, kind: RayKind) {
        let direction = self.ray.direction;
        self.ray = Ray::new(surface.point.spawn(direction), direction);
        self.source = Some(surface.id);
        self.kind = kind;
        self.layers += 1;
    }
}

/// What is asked of a material by rays that pass it without bending.
impl Material {
    /// What light keeps that passes a smooth boundary straight on, where it is there; 0 of rough ones, which scatter.
    pub(super) fn passes_smoothly<K: Kernel>(&self, surface: &Surface<'_>, cos: f32) -> Vec3 {
        if self.is_smooth::<K>(surface) { self.straight_through::<K>(surface, cos) } else { Vec3::ZERO }
    }
}
