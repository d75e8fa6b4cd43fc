//! Reflection by GGX microfacets, single scattering.

use glam::Vec3;

use super::LobeSample;
use crate::material::fresnel::Fresnel;
use crate::material::microfacet::{Masking, density, g1, g2, sample_visible, visible_pdf};

/// A rough mirror: D * F * G / (4 cos cos).
#[derive(Clone, Copy, Debug)]
pub(crate) struct GgxReflection {
    /// Roughness, > 0.
    pub(crate) alpha: f32,
    /// Reflectance of each facet.
    pub(crate) fresnel: Fresnel,
    /// Masking and shadowing.
    pub(crate) masking: Masking,
    /// Multiplies all of it.
    pub(crate) scale: Vec3,
}

impl GgxReflection {
    pub(super) fn eval(&self, wo: Vec3, wi: Vec3) -> Vec3 {
        self.eval_and_pdf(wo, wi).0
    }

    pub(super) fn pdf(&self, wo: Vec3, wi: Vec3) -> f32 {
        self.eval_and_pdf(wo, wi).1
    }

    #[inline]
    pub(super) fn eval_and_pdf(&self, wo: Vec3, wi: Vec3) -> (Vec3, f32) {
        if !(wo.z > 0.0 && wi.z > 0.0) {
            return (Vec3::ZERO, 0.0);
        }
        let h = (wo + wi).normalize();
        let (cos, density) = (wo.dot(h), density(h, self.alpha) / (4.0 * wo.z));
        let f = self.fresnel.reflectance(cos.clamp(0.0, 1.0)) * self.scale;
        // The density of visible facets is wo.h D G1 / wo.z, that of directions a 4 wo.h-th of it.
        (f * (density * g2(wo, wi, self.alpha, self.masking)), density * g1(wo, self.alpha))
    }

    pub(super) fn sample(&self, wo: Vec3, u: [f32; 2]) -> Option<LobeSample> {
        let h = sample_visible(wo, self.alpha, u);
        let cos = wo.dot(h);
        let wi = (h * (2.0 * cos) - wo).normalize();
        if !(cos > 0.0 && wo.z > 0.0 && wi.z > 0.0) {
            return None;
        }
        let f = self.fresnel.reflectance(cos.min(1.0)) * self.scale;
        let weight = f * (g2(wo, wi, self.alpha, self.masking) / g1(wo, self.alpha));
        Some(LobeSample { wi, weight, pdf: Some(visible_pdf(wo, h, self.alpha) / (4.0 * cos)) })
    }

    pub(super) fn albedo(&self, wo: Vec3) -> Vec3 {
        self.fresnel.reflectance(wo.z.clamp(0.0, 1.0)) * self.scale
    }
}
