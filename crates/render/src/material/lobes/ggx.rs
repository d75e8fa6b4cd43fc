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
        if !(wo.z > 0.0 && wi.z > 0.0) {
            return Vec3::ZERO;
        }
        let h = (wo + wi).normalize();
        let f = self.fresnel.reflectance(wo.dot(h).clamp(0.0, 1.0)) * self.scale;
        f * (density(h, self.alpha) * g2(wo, wi, self.alpha, self.masking) / (4.0 * wo.z))
    }

    pub(super) fn pdf(&self, wo: Vec3, wi: Vec3) -> f32 {
        if !(wo.z > 0.0 && wi.z > 0.0) {
            return 0.0;
        }
        let h = (wo + wi).normalize();
        visible_pdf(wo, h, self.alpha) / (4.0 * wo.dot(h))
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
