//! Lambert's diffuse reflection, optionally under a reflecting coat.

use std::f32::consts::FRAC_1_PI;

use glam::Vec3;

use super::LobeSample;
use crate::material::fresnel::Fresnel;
use crate::warp;

/// Reflects evenly in all directions what a coat, if there is one, lets through.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Lambert {
    /// Share of light reflected.
    pub(crate) albedo: Vec3,
    /// Reflectance of the coat, by the angle to the half vector: glTF 2.0, appendix B.
    pub(crate) coat: Option<Fresnel>,
}

impl Lambert {
    fn passed(&self, wo: Vec3, wi: Vec3) -> Vec3 {
        match self.coat {
            None => Vec3::ONE,
            Some(coat) => match (wo + wi).try_normalize() {
                Some(h) => coat.passed(wo.dot(h).clamp(0.0, 1.0)),
                None => Vec3::ZERO,
            },
        }
    }

    pub(super) fn eval(&self, wo: Vec3, wi: Vec3) -> Vec3 {
        if wi.z > 0.0 { self.albedo * self.passed(wo, wi) * (FRAC_1_PI * wi.z) } else { Vec3::ZERO }
    }

    pub(super) fn pdf(&self, _: Vec3, wi: Vec3) -> f32 {
        FRAC_1_PI * wi.z.max(0.0)
    }

    pub(super) fn sample(&self, wo: Vec3, u: [f32; 2]) -> Option<LobeSample> {
        let wi = warp::cosine_hemisphere(u);
        let pdf = self.pdf(wo, wi);
        (pdf > 0.0).then(|| LobeSample { wi, weight: self.albedo * self.passed(wo, wi), pdf: Some(pdf) })
    }

    pub(super) fn albedo(&self, wo: Vec3) -> Vec3 {
        self.albedo * self.coat.map_or(Vec3::ONE, |coat| coat.passed(wo.z))
    }
}
