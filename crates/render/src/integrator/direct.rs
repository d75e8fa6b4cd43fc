//! The light that reaches one point from all lights.

use std::f32::consts::FRAC_1_PI;

use glam::{DVec3, Vec3};

use super::Tracer;
use crate::RayKind;
use crate::kernel::{Kernel, MAX_LOBES};
use crate::light::environment::luminance;
use crate::light::{LightEnd, LightSample, power_heuristic};
use crate::material::Bsdf;
use crate::material::lobes::{Lobe, LobeKind};
use crate::sampler::{Dimension, PixelSampler};
use crate::surface::Surface;
use crate::warp;

/// Branches of a sampler by kind of light: each light sees numbers of its own.
const PUNCTUAL: u32 = 0x100_0000;
const SHAPE: u32 = 0x200_0000;
const MESH: u32 = 0x300_0000;
const ENVIRONMENT: u32 = 0x400_0000;

/// A point that is lit.
#[derive(Clone, Copy)]
pub(super) struct Lit<'a, K: Kernel> {
    pub(super) surface: &'a Surface<'a>,
    pub(super) bsdf: &'a Bsdf<K>,
    /// Which lobes are also followed by rays, which may find the same lights: they share by weights.
    pub(super) followed: [bool; MAX_LOBES],
    pub(super) sampler: PixelSampler,
    pub(super) bounce: u32,
    /// Light goes into a solid here, out of which it comes bent another time: only rays that follow it tell.
    pub(super) enters: bool,
}

impl<K: Kernel> Lit<'_, K> {
    /// f |cos| towards a light, each lobe weighted against what following it would find.
    fn scattered(&self, sample: &LightSample) -> Vec3 {
        let (wo, wi) = (self.bsdf.local(self.surface.wo), self.bsdf.local(sample.direction));
        let before = sample.direction.dot(self.surface.smooth) > 0.0;
        let behind = sample.direction.dot(self.surface.geometric) < 0.0;
        let mut total = Vec3::ZERO;
        for (lobe, followed) in self.bsdf.lobes().iter().zip(self.followed) {
            let through = lobe.goes_through();
            if !(if through { behind && !self.enters } else { before }) {
                continue;
            }
            let weight = match sample.pdf {
                Some(pdf) if followed => power_heuristic(pdf, lobe.pdf::<K>(wo, wi)),
                _ => 1.0,
            };
            total += lobe.eval::<K>(wo, wi) * weight;
        }
        total
    }

    /// Whether light from behind is scattered, and no ray is followed there.
    fn gathers_behind(&self) -> bool {
        let through = || self.bsdf.lobes().iter().zip(self.followed).filter(|(lobe, _)| lobe.goes_through());
        through().next().is_some() && through().all(|(_, followed)| !followed)
    }

    /// Where a shadow ray starts.
    fn origin(&self, sample: &LightSample, terminator: bool) -> DVec3 {
        let (surface, point) = (self.surface, &self.surface.point);
        let reflected = sample.direction.dot(surface.smooth) > 0.0;
        if reflected && terminator {
            let mut lifted = *point;
            lifted.position += surface.lift();
            // On the viewer's side, even where the light is just below the flat triangle.
            lifted.spawn(surface.geometric.as_dvec3())
        } else {
            point.spawn(sample.direction.as_dvec3())
        }
    }
}

impl<K: Kernel> Tracer<'_, K> {
    /// Radiance to the viewer by one reflection of what all lights send.
    pub(super) fn direct(&mut self, lit: &Lit<'_, K>) -> Vec3 {
        let stage = self.stage;
        let position = lit.surface.point.position;
        let numbers = |branch: u32| {
            let sampler = lit.sampler.branch(branch);
            (sampler.get1(Dimension::LightChoice(lit.bounce)), sampler.get2(Dimension::LightPosition(lit.bounce)))
        };
        let mut total = Vec3::ZERO;
        for (i, light) in stage.lights.punctual.iter().enumerate() {
            let (_, u) = numbers(PUNCTUAL + i as u32);
            if let Some(sample) = light.sample(position, u) {
                total += self.arriving(lit, &sample, RayKind::ShadowPunctual);
            }
        }
        for (i, light) in stage.lights.area.shapes.iter().enumerate() {
            let (_, u) = numbers(SHAPE + i as u32);
            if let Some(sample) = light.sample(position, u) {
                total += self.arriving(lit, &sample, RayKind::ShadowArea);
            }
        }
        if let Some(light) = &stage.lights.area.mesh {
            let (choice, u) = numbers(MESH);
            if let Some((mut sample, hit)) = light.sample(position, choice, u, lit.surface.id) {
                sample.radiance *= stage.glow::<K>(&hit, sample.direction);
                total += self.arriving(lit, &sample, RayKind::ShadowArea);
            }
        }
        total += self.surroundings(lit);
        total
    }

    fn arriving(&mut self, lit: &Lit<'_, K>, sample: &LightSample, kind: RayKind) -> Vec3 {
        let light = lit.scattered(sample) * sample.radiance;
        if !(light.max_element() > 0.0) {
            return Vec3::ZERO;
        }
        let origin = lit.origin(sample, self.stage.terminator);
        light * self.transmittance(kind, origin, sample, lit.surface.id)
    }

    /// Light from around. What is the same from everywhere is best sampled by the cosine. A map is sampled both ways
    /// by several candidates, of which one is chosen in proportion to the light that it would send if nothing were in
    /// the way: Talbot, Cline and Egbert, "Importance Resampling for Global Illumination" (2005). So no shadow ray is
    /// lost on what lies below the horizon or reflects little.
    fn surroundings(&mut self, lit: &Lit<'_, K>) -> Vec3 {
        /// Half of them drawn from the map, half by the cosine.
        const CANDIDATES: u32 = 4;
        let stage = self.stage;
        let Some(environment) = stage.lights.environment.as_ref().filter(|_| stage.lights.sample_environment) else {
            return Vec3::ZERO;
        };
        let towards = |direction, radiance, pdf| LightSample {
            direction,
            radiance,
            pdf: Some(pdf),
            end: LightEnd::Infinity,
            target: None,
        };
        if environment.is_constant() {
            let u = lit.sampler.branch(ENVIRONMENT).get2(Dimension::LightPosition(lit.bounce));
            let direction = lit.bsdf.world(warp::cosine_hemisphere(u));
            let pdf = stage.environment_pdf(direction, lit.bsdf.normal);
            if !(pdf > 0.0) {
                return Vec3::ZERO;
            }
            let sample = towards(direction, environment.radiance(direction) / pdf, pdf);
            let mut light = self.arriving(lit, &sample, RayKind::ShadowEnvironment);
            if lit.gathers_behind() {
                // The same direction mirrored, in which no ray is followed.
                let normal = lit.bsdf.normal;
                let direction = direction - normal * (2.0 * direction.dot(normal));
                let sample = towards(direction, environment.radiance(direction) / pdf, pdf);
                light += self.arriving(lit, &sample, RayKind::ShadowEnvironment);
            }
            return light;
        }
        let (mut chosen, mut sum) = (None, 0.0);
        for i in 0..CANDIDATES {
            let sampler = lit.sampler.branch(ENVIRONMENT + i);
            let u = sampler.get2(Dimension::LightPosition(lit.bounce));
            let (direction, radiance) = if i % 2 == 0 {
                let Some(sample) = environment.sample(u) else { continue };
                (sample.direction, sample.radiance)
            } else {
                let direction = lit.bsdf.world(warp::cosine_hemisphere(u));
                (direction, environment.radiance(direction))
            };
            let pdf = environment.pdf(direction);
            let cosine = direction.dot(lit.bsdf.normal).max(0.0) * FRAC_1_PI;
            let sample = towards(direction, radiance, pdf);
            let light = lit.scattered(&sample) * radiance;
            let strength = luminance(light);
            let weight = strength / (0.5 * (pdf + cosine));
            if !(weight > 0.0 && weight.is_finite()) {
                continue;
            }
            sum += weight;
            if sampler.get1(Dimension::LightChoice(lit.bounce)) * sum < weight {
                chosen = Some((sample, light / strength));
            }
        }
        let Some((sample, color)) = chosen else { return Vec3::ZERO };
        let origin = lit.origin(&sample, stage.terminator);
        let arrives = self.transmittance(RayKind::ShadowEnvironment, origin, &sample, lit.surface.id);
        color * arrives * (sum / CANDIDATES as f32)
    }
}

impl crate::Stage {
    /// Density with which direct light chooses a direction of the environment, at a point with this shading normal.
    pub(super) fn environment_pdf(&self, direction: Vec3, normal: Vec3) -> f32 {
        match &self.lights.environment {
            _ if !self.lights.sample_environment => 0.0,
            Some(e) if e.is_constant() => direction.dot(normal).max(0.0) * FRAC_1_PI,
            Some(e) => e.pdf(direction),
            None => 0.0,
        }
    }
}

/// Whether an integrator that follows `kinds` follows this lobe of a surface.
pub(super) fn is_followed(lobe: &Lobe, kinds: LobeKind, reference: bool) -> bool {
    kinds.contains(lobe.kind())
        && match lobe {
            Lobe::GgxReflection(ggx) => {
                reference || ggx.alpha <= super::ROUGHEST_FOLLOWED || ggx.fresnel.reflectance(1.0).max_element() >= 0.2
            }
            Lobe::AnisotropicGgx(ggx) => {
                reference
                    || ggx.alpha.min_element() <= super::ROUGHEST_FOLLOWED
                    || ggx.fresnel.reflectance(1.0).max_element() >= 0.2
            }
            Lobe::Clearcoat(coat) => coat.alpha <= super::ROUGHEST_FOLLOWED,
            _ => true,
        }
}
