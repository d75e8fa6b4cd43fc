//! The light that reaches one point from all lights.

use glam::{DVec3, Vec3};

use super::Tracer;
use crate::RayKind;
use crate::light::{LightSample, power_heuristic};
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
pub(super) struct Lit<'a> {
    pub(super) surface: &'a Surface<'a>,
    pub(super) bsdf: &'a Bsdf,
    /// Which lobes are also followed by rays, which may find the same lights: they share by weights.
    pub(super) followed: [bool; 3],
    pub(super) sampler: PixelSampler,
    pub(super) bounce: u32,
    /// Light goes into a solid here, out of which it comes bent another time: only rays that follow it tell.
    pub(super) enters: bool,
}

impl Lit<'_> {
    /// f |cos| towards a light, each lobe weighted against what following it would find.
    fn scattered(&self, sample: &LightSample) -> Vec3 {
        let (wo, wi) = (self.bsdf.to_local(self.surface.wo), self.bsdf.to_local(sample.direction));
        let before = sample.direction.dot(self.surface.smooth) > 0.0;
        let behind = sample.direction.dot(self.surface.geometric) < 0.0;
        let mut total = Vec3::ZERO;
        for (lobe, followed) in self.bsdf.lobes().iter().zip(self.followed) {
            let through = lobe.kind() == LobeKind::TRANSMISSION;
            if !(if through { behind && !self.enters } else { before }) {
                continue;
            }
            let weight = match sample.pdf {
                Some(pdf) if followed => power_heuristic(pdf, lobe.pdf(wo, wi)),
                _ => 1.0,
            };
            total += lobe.eval(wo, wi) * weight;
        }
        total
    }

    /// Where a shadow ray starts.
    fn origin(&self, sample: &LightSample, terminator: bool) -> DVec3 {
        let (surface, point) = (self.surface, &self.surface.point);
        let reflected = sample.direction.dot(surface.smooth) > 0.0;
        if reflected && terminator {
            let mut lifted = *point;
            lifted.position += surface.lift;
            // On the viewer's side, even where the light is just below the flat triangle.
            lifted.spawn(surface.geometric.as_dvec3())
        } else {
            point.spawn(sample.direction.as_dvec3())
        }
    }
}

impl<const TEXTURES: bool, const FILTERED: bool> Tracer<'_, TEXTURES, FILTERED> {
    /// Radiance to the viewer by one reflection of what all lights send.
    pub(super) fn direct(&mut self, lit: &Lit<'_>) -> Vec3 {
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
                let glow = stage.world.attributes(&hit, true);
                sample.radiance *= stage.materials[stage.world.material(hit.id)].emission::<TEXTURES>(&glow);
                total += self.arriving(lit, &sample, RayKind::ShadowArea);
            }
        }
        if let Some(sample) = self.environment_sample(lit, numbers(ENVIRONMENT).1) {
            total += self.arriving(lit, &sample, RayKind::ShadowEnvironment);
        }
        total
    }

    fn arriving(&mut self, lit: &Lit<'_>, sample: &LightSample, kind: RayKind) -> Vec3 {
        let light = lit.scattered(sample) * sample.radiance;
        if !(light.max_element() > 0.0) {
            return Vec3::ZERO;
        }
        let origin = lit.origin(sample, !self.stage.reference);
        light * self.transmittance(kind, origin, sample, lit.surface.id)
    }

    /// Light from around. What is the same from everywhere is best sampled by the cosine.
    fn environment_sample(&self, lit: &Lit<'_>, u: [f32; 2]) -> Option<LightSample> {
        let environment = self.stage.lights.environment.as_ref()?;
        let end = crate::light::LightEnd::Infinity;
        if environment.is_constant() {
            let w = warp::cosine_hemisphere(u);
            let direction = lit.bsdf.to_world(w);
            let pdf = self.stage.environment_pdf(direction, lit.bsdf.normal);
            let radiance = environment.radiance(direction) / pdf;
            return (pdf > 0.0).then_some(LightSample { direction, radiance, pdf: Some(pdf), end, target: None });
        }
        let sample = environment.sample(u)?;
        let radiance = sample.radiance / sample.pdf;
        Some(LightSample { direction: sample.direction, radiance, pdf: Some(sample.pdf), end, target: None })
    }
}

impl crate::Stage {
    /// Density with which direct light chooses a direction of the environment, at a point with this shading normal.
    pub(super) fn environment_pdf(&self, direction: Vec3, normal: Vec3) -> f32 {
        match &self.lights.environment {
            Some(e) if e.is_constant() => direction.dot(normal).max(0.0) * std::f32::consts::FRAC_1_PI,
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
            _ => true,
        }
}
