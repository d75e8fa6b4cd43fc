//! Light that goes through a surface in all directions (KHR_materials_diffuse_transmission), under a reflecting coat.

use std::f32::consts::{FRAC_1_PI, PI};

use glam::Vec3;

use super::LobeSample;
use crate::material::fresnel::Fresnel;

/// Lambert's law on the other side, for what the surface does not reflect.
#[derive(Clone, Copy, Debug)]
pub(crate) struct DiffuseTransmission {
    /// Share of light that goes through, by colour.
    pub(crate) color: Vec3,
    /// Reflectance of the surface, by the angle to the half vector of the mirrored direction.
    pub(crate) coat: Fresnel,
}

impl DiffuseTransmission {
    fn passed(&self, wo: Vec3, wi: Vec3) -> Vec3 {
        let up = Vec3::new(wi.x, wi.y, -wi.z);
        match (wo + up).try_normalize() {
            Some(h) => self.coat.passed(wo.dot(h).clamp(0.0, 1.0)),
            None => Vec3::ZERO,
        }
    }

    pub(super) fn eval(&self, wo: Vec3, wi: Vec3) -> Vec3 {
        if wi.z < 0.0 { self.color * self.passed(wo, wi) * (FRAC_1_PI * -wi.z) } else { Vec3::ZERO }
    }

    pub(super) fn pdf(&self, _: Vec3, wi: Vec3) -> f32 {
        FRAC_1_PI * (-wi.z).max(0.0)
    }

    pub(super) fn sample(&self, wo: Vec3, u: [f32; 2]) -> Option<LobeSample> {
        let r = u[0].sqrt();
        let (sin, cos) = (2.0 * PI * u[1]).sin_cos();
        let wi = Vec3::new(r * cos, r * sin, -(1.0 - u[0]).max(0.0).sqrt());
        let pdf = self.pdf(wo, wi);
        (pdf > 0.0).then(|| LobeSample { wi, weight: self.color * self.passed(wo, wi), pdf: Some(pdf) })
    }

    pub(super) fn albedo(&self, wo: Vec3) -> Vec3 {
        self.color * self.coat.passed(wo.z.clamp(0.0, 1.0))
    }
}
