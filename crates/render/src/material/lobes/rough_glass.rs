//! Refraction by GGX microfacets: Walter et al. 2007, single scattering, uncorrelated masking.

use glam::Vec3;

use super::LobeSample;
use crate::material::fresnel::{Fresnel, refracted_cos};
use crate::material::microfacet::{Masking, density, g1, g2, sample_visible, visible_pdf};

/// The light that goes through a rough boundary between two media.
#[derive(Clone, Copy, Debug)]
pub(crate) struct GgxTransmission {
    /// Roughness, > 0.
    pub(crate) alpha: f32,
    /// Index of the other side over that of this side; not 1.
    pub(crate) eta: f32,
    /// What the facets reflect does not go through.
    pub(crate) fresnel: Fresnel,
    /// Multiplies what goes through.
    pub(crate) tint: Vec3,
    /// Change of radiance by the change of index: 1 / eta^2, or 1 where that is left out.
    pub(crate) scale: f32,
}

impl GgxTransmission {
    /// The facet that refracts `wo` into `-wi`, if one does.
    fn facet(&self, wo: Vec3, wi: Vec3) -> Option<Vec3> {
        if !(wo.z > 0.0 && wi.z < 0.0) {
            return None;
        }
        let h = (wo + wi * self.eta).try_normalize()?;
        let h = if h.z < 0.0 { -h } else { h };
        (wo.dot(h) > 0.0 && wi.dot(h) < 0.0).then_some(h)
    }

    /// Solid angle of facets over solid angle of refracted directions.
    fn jacobian(&self, wo: Vec3, wi: Vec3, h: Vec3) -> f32 {
        let d = wi.dot(h) + wo.dot(h) / self.eta;
        wi.dot(h).abs() / (d * d)
    }

    fn passed(&self, cos: f32) -> Vec3 {
        self.fresnel.passed(cos.clamp(0.0, 1.0)) * self.tint
    }

    pub(super) fn eval(&self, wo: Vec3, wi: Vec3) -> Vec3 {
        let Some(h) = self.facet(wo, wi) else { return Vec3::ZERO };
        let cos = wo.dot(h);
        let g = g2(wo, wi, self.alpha, Masking::Separate);
        self.passed(cos) * (self.scale * density(h, self.alpha) * g * cos / wo.z * self.jacobian(wo, wi, h))
    }

    pub(super) fn pdf(&self, wo: Vec3, wi: Vec3) -> f32 {
        let Some(h) = self.facet(wo, wi) else { return 0.0 };
        visible_pdf(wo, h, self.alpha) * self.jacobian(wo, wi, h)
    }

    pub(super) fn sample(&self, wo: Vec3, u: [f32; 2]) -> Option<LobeSample> {
        let h = sample_visible(wo, self.alpha, u);
        let cos = wo.dot(h);
        let cos_t = refracted_cos(cos.min(1.0), self.eta)?;
        let wi = (h * (cos / self.eta - cos_t) - wo / self.eta).normalize();
        if !(cos > 0.0 && wo.z > 0.0 && wi.z < 0.0) {
            return None;
        }
        let weight = self.passed(cos) * (self.scale * g2(wo, wi, self.alpha, Masking::Separate) / g1(wo, self.alpha));
        Some(LobeSample { wi, weight, pdf: Some(visible_pdf(wo, h, self.alpha) * self.jacobian(wo, wi, h)) })
    }

    pub(super) fn albedo(&self, wo: Vec3) -> Vec3 {
        self.passed(wo.z)
    }
}
