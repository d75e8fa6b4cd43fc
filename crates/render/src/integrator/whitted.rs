//! Whitted's ray tracing, distribution style.
//!
//! Turner Whitted, "An Improved Illumination Model for Shaded Display" (1980); Cook, Porter and Carpenter,
//! "Distributed Ray Tracing" (1984). At every hit: what glows, the light of all lights, and rays that follow mirror
//! reflection, refraction and transparency; diffuse light between surfaces is not followed. On the first bounces a
//! path splits into all of its continuations, later it takes one of them by chance; both ways the expected value is
//! the same. The walk is a list of pending rays, never a recursion.
//!
//! Lights that a glossy continuation may meet are also sampled directly: the two share by Veach's power heuristic.

use firsthit_accel::{Hit, HitId};
use firsthit_geometry::Ray;
use glam::{DVec3, Vec3};

use super::direct::{Lit, is_followed};
use super::{Tracer, aov};
use crate::EffectSet;
use crate::RayKind;
use crate::camera::Cone;
use crate::kernel::{Kernel, MAX_LOBES};
use crate::light::power_heuristic;
use crate::light::studio;
use crate::material::lobes::{Lobe, LobeKind, LobeSample};
use crate::material::{Colors, Material, Shading};
use crate::sampler::{Dimension, PixelSampler};
use crate::stage::Backdrop;
use crate::surface::Surface;
use crate::tally;

/// Bounces at which a path splits instead of choosing.
const SPLITS: u32 = 2;
/// From this bounce on, chance ends paths that have become dim.
const ROULETTE: u32 = 4;
/// So many partly covering surfaces in a row are added up in full; those behind are met or passed by chance.
const FULL_LAYERS: u32 = 6;
/// At so many surfaces in a row that let a ray pass, it ends.
const MOST_LAYERS: u32 = 500;

/// What a camera ray finds.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Seen {
    /// Radiance.
    pub(crate) color: Vec3,
    /// Share of the pixel that is not transparent background.
    pub(crate) alpha: f32,
    /// The first surface.
    pub(crate) first: Option<aov::First>,
}

/// A ray that is still to be traced.
#[derive(Clone, Debug)]
struct Pending {
    ray: Ray<f64>,
    source: Option<HitId>,
    kind: RayKind,
    throughput: Vec3,
    bounce: u32,
    /// Surfaces passed since the last bounce.
    layers: u32,
    sampler: PixelSampler,
    cone: Cone,
    /// Absorption of what the ray is in.
    absorption: Vec3,
    /// Only straight on so far: it sees the background.
    straight: bool,
    /// How it came to its direction, if direct light could have chosen it as well.
    chosen: Option<Chosen>,
    /// Throughput that chance compares with.
    bright: f32,
    /// Which colours it is about.
    colors: Colors,
}

#[derive(Clone, Copy, Debug)]
struct Chosen {
    pdf: f32,
    from: DVec3,
    normal: Vec3,
}

/// How far and along what paths are followed.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Limits {
    /// Most bounces.
    pub(crate) bounces: u32,
    /// Lobes that are followed.
    pub(crate) follow: LobeKind,
    /// What the first surface spreads is left out: paths from the lights bring it. Mirror images are there.
    pub(crate) mirrors: bool,
}

impl<K: Kernel> Tracer<'_, K> {
    /// What the camera sees along a ray; `screen` is where in the picture that is, 0 to 1 from the upper left.
    pub(crate) fn radiance(
        &mut self,
        ray: Ray<f64>,
        cone: Cone,
        screen: [f32; 2],
        sampler: PixelSampler,
        limits: Limits,
    ) -> Seen {
        let mut seen = Seen { color: Vec3::ZERO, alpha: 1.0, first: None };
        let mut pending = vec![Pending {
            ray,
            source: None,
            kind: RayKind::Camera,
            throughput: Vec3::ONE,
            bounce: 0,
            layers: 0,
            sampler,
            cone,
            absorption: Vec3::ZERO,
            straight: true,
            chosen: None,
            bright: 1.0,
            colors: self.colors(sampler),
        }];
        while let Some(mut path) = pending.pop() {
            let hit = self.closest(path.kind, &path.ray, path.source);
            if let Some((t, light)) = self.stage.lights.area.hit(&path.ray)
                && hit.is_none_or(|h| t < h.t)
            {
                path.absorb(t);
                seen.color += path.throughput
                    * light.radiance
                    * path.share_with_light(|c, d| light.pdf(c.from, d, (path.ray.at(t) - c.from).length()));
                continue;
            }
            let Some(hit) = hit else {
                self.escape(&path, screen, &mut seen);
                continue;
            };
            path.absorb(hit.t);
            self.meet(path, &hit, limits, &mut pending, &mut seen);
        }
        seen
    }

    /// A path that meets nothing.
    fn escape(&self, path: &Pending, screen: [f32; 2], seen: &mut Seen) {
        let direction = path.ray.direction.as_vec3();
        if path.straight {
            let background = match self.stage.background {
                Backdrop::Transparent => {
                    seen.alpha -= path.throughput.element_sum() / 3.0;
                    return;
                }
                Backdrop::Color(color) => color,
                Backdrop::Studio(brightness) => studio::backdrop(screen[0], screen[1]) * brightness,
                Backdrop::Environment => {
                    self.stage.lights.environment.as_ref().map_or(Vec3::ZERO, |e| e.radiance(direction))
                }
            };
            seen.color += path.throughput * background;
        } else if let Some(environment) = &self.stage.lights.environment {
            let share = path.share_with_light(|c, _| self.stage.environment_pdf(direction, c.normal));
            seen.color += path.throughput * environment.radiance(direction) * share;
        }
    }

    /// A path that meets a surface.
    fn meet(&mut self, mut path: Pending, hit: &Hit, limits: Limits, pending: &mut Vec<Pending>, seen: &mut Seen) {
        let stage = self.stage;
        let point = stage.accel.surface_point(&path.ray, hit);
        let wo = -path.ray.direction.as_vec3();
        let width = (path.cone.width + path.cone.spread * hit.t) as f32;
        let mut surface = stage.world.surface(hit, point, wo, width);
        surface.colors = path.colors;
        let material = &stage.materials[stage.world.material(hit.id)];

        if K::FILTERED && material.has_alpha() {
            let covered = material.coverage::<K>(&surface);
            if covered < 1.0 && !self.pass(&mut path, &surface, covered, pending) {
                return;
            }
        }
        let shading = material.shade::<K>(&surface);
        if seen.first.is_none() && path.kind == RayKind::Camera {
            seen.first = Some(aov::First::new(&path.ray, hit, &surface, &shading, stage.world.material(hit.id)));
        }
        if shading.emission != Vec3::ZERO {
            let share = path.share_with_light(|c, d| {
                let distance = (point.position - c.from).length();
                stage.lights.area.pdf_of_primitive(hit.id, c.from, d, distance)
            });
            seen.color += path.throughput * shading.emission * share;
        }
        if path.bounce >= limits.bounces || shading.bsdf.lobes().is_empty() {
            return;
        }
        let mut followed = [false; MAX_LOBES];
        for (f, lobe) in followed.iter_mut().zip(shading.bsdf.lobes()) {
            *f = is_followed(lobe, limits.follow, stage.reference);
        }
        let lit = Lit {
            surface: &surface,
            bsdf: &shading.bsdf,
            followed,
            sampler: path.sampler,
            bounce: path.bounce,
            enters: material.solid && surface.front,
        };
        seen.color += path.throughput * self.direct(&lit);
        if stage.lights.ambient != Vec3::ZERO {
            let even = shading.base_color * stage.lights.ambient;
            seen.color += path.throughput * even * self.openness(&surface, path.sampler, path.bounce);
        }
        self.follow(&path, &surface, material, &shading, followed, hit.t, pending);
    }

    /// Lets a path pass a surface that covers only in part: by weight, or by chance. False: it passed and is not met.
    fn pass(&mut self, path: &mut Pending, surface: &Surface<'_>, covered: f32, pending: &mut Vec<Pending>) -> bool {
        let on = |path: &Pending, share: f32| {
            let mut next = path.clone();
            let at = surface.point.position;
            next.ray = Ray::new(surface.point.spawn(path.ray.direction), path.ray.direction);
            next.cone.width += next.cone.spread * (at - path.ray.origin).length();
            next.source = Some(surface.id);
            next.kind = RayKind::Transparency;
            next.throughput *= share;
            next.layers += 1;
            next.sampler = path.sampler.branch(next.layers);
            next
        };
        if path.layers >= MOST_LAYERS {
            return true;
        }
        if path.bounce == 0 && path.layers < FULL_LAYERS {
            pending.push(on(path, 1.0 - covered));
            path.throughput *= covered;
            return true;
        }
        if path.sampler.get1(Dimension::Alpha(path.bounce)) < covered {
            return true;
        }
        pending.push(on(path, 1.0));
        false
    }

    /// Follows the continuations of a path: all of them at first, one by chance later.
    #[allow(clippy::too_many_arguments, reason = "the parts of one hit")]
    fn follow(
        &self,
        path: &Pending,
        surface: &Surface<'_>,
        material: &Material,
        shading: &Shading<K>,
        followed: [bool; MAX_LOBES],
        t: f64,
        pending: &mut Vec<Pending>,
    ) {
        let bsdf = &shading.bsdf;
        let wo = bsdf.local(surface.wo);
        let strength = |lobe: &Lobe| (path.throughput * lobe.albedo::<K>(wo)).max_element();
        let lobes = || bsdf.lobes().iter().enumerate().filter(|(i, _)| followed[*i]);
        if path.bounce < SPLITS {
            // The last one pushed is traced first: reflections before refractions, as they are listed.
            for (i, lobe) in lobes() {
                let sampler = path.sampler.branch(i as u32 + 1);
                // Weak reflections in reflections, as of plastics, are followed now and then.
                let all = path.bounce == 0 || self.stage.reference;
                let chance = if all { 1.0 } else { (4.0 * strength(lobe)).min(1.0) };
                if chance < 1.0 && !(sampler.get1(Dimension::Roulette(path.bounce)) < chance) {
                    continue;
                }
                let u = sampler.get2(Dimension::Direction(path.bounce));
                if let Some(sample) = lobe.sample::<K>(wo, u) {
                    let share = 1.0 / chance;
                    self.go_on(path, surface, material, shading, lobe, sample, share, sampler, t, pending);
                }
            }
            return;
        }
        let total: f32 = lobes().map(|(_, lobe)| strength(lobe)).sum();
        if !(total > 0.0) {
            return;
        }
        let mut share = 1.0;
        if path.bounce >= ROULETTE {
            // A little more, so that rounding never ends a path that has lost nothing.
            let chance = (1.01 * total / path.bright).min(1.0);
            if !(path.sampler.get1(Dimension::Roulette(path.bounce)) < chance) {
                return;
            }
            share /= chance;
        }
        let mut left = path.sampler.get1(Dimension::Lobe(path.bounce)) * total;
        let Some((_, lobe)) = lobes()
            .find(|(_, lobe)| {
                left -= strength(lobe);
                left < 0.0
            })
            .or_else(|| lobes().next_back())
        else {
            return;
        };
        share *= total / strength(lobe);
        if let Some(sample) = lobe.sample::<K>(wo, path.sampler.get2(Dimension::Direction(path.bounce))) {
            self.go_on(path, surface, material, shading, lobe, sample, share, path.sampler, t, pending);
        }
    }

    #[allow(clippy::too_many_arguments, reason = "the parts of one hit")]
    fn go_on(
        &self,
        path: &Pending,
        surface: &Surface<'_>,
        material: &Material,
        shading: &Shading<K>,
        lobe: &Lobe,
        sample: LobeSample,
        share: f32,
        sampler: PixelSampler,
        t: f64,
        pending: &mut Vec<Pending>,
    ) {
        let direction = shading.bsdf.world(sample.wi).as_dvec3().normalize();
        let through = lobe.goes_through();
        // A shading normal may send a reflection below the surface, or a refraction above it.
        let side = direction.dot(surface.geometric.as_dvec3());
        if !(if through { side < 0.0 } else { side > 0.0 }) {
            return;
        }
        let throughput = path.throughput * sample.weight * share;
        if !(throughput.max_element() > 0.0) {
            return;
        }
        let (mut kind, mut absorption) = (RayKind::Reflection, path.absorption);
        if through && material.solid {
            kind = RayKind::Refraction;
            absorption = if surface.front { material.absorption } else { Vec3::ZERO };
        } else if through {
            kind = RayKind::Transmission;
        }
        // Light that enters a solid has not been sampled: see `Lit::enters`.
        let shared = sample.pdf.filter(|_| !(kind == RayKind::Refraction && surface.front));
        let unbent = matches!(lobe, Lobe::SpecularTransmission(s) if s.eta == 1.0);
        let bounce = path.bounce + 1;
        pending.push(Pending {
            ray: Ray::new(surface.point.spawn(direction), direction),
            source: Some(surface.id),
            kind,
            throughput,
            bounce,
            layers: 0,
            sampler,
            cone: Cone { width: path.cone.width + path.cone.spread * t, spread: path.cone.spread },
            absorption,
            colors: if through && material.parts_colors { path.colors.parted() } else { path.colors },
            straight: path.straight && unbent,
            chosen: shared.map(|pdf| Chosen { pdf, from: surface.point.position, normal: shading.bsdf.normal }),
            bright: if bounce <= ROULETTE { throughput.max_element() } else { path.bright * lobe.scale() },
        });
    }
}

impl Pending {
    /// The share of light that is counted on this way, when direct light at the last bounce counts the rest; `density`
    /// is with which direct light would have come here.
    fn share_with_light(&self, density: impl FnOnce(&Chosen, DVec3) -> f32) -> f32 {
        match &self.chosen {
            Some(chosen) => power_heuristic(chosen.pdf, density(chosen, self.ray.direction)),
            None => 1.0,
        }
    }

    /// Takes away what a way of length `t` absorbs.
    fn absorb(&mut self, t: f64) {
        if self.absorption != Vec3::ZERO {
            tally::sample(EffectSet::ABSORPTION);
            self.throughput *= (self.absorption * -(t as f32)).map(f32::exp);
        }
    }
}
