//! A thin rough sheet: light goes through unbent, blurred as by reflection (KHR_materials_transmission).

use glam::Vec3;

use super::{GgxReflection, LobeSample};
use crate::material::fresnel::Fresnel;
use crate::material::microfacet::Masking;

/// The mirror image of a GGX reflection below the surface, for what is not reflected.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ThinTransmission {
    /// Roughness, > 0.
    pub(crate) alpha: f32,
    /// What the facets reflect does not go through.
    pub(crate) fresnel: Fresnel,
    /// Multiplies what goes through.
    pub(crate) tint: Vec3,
}

impl ThinTransmission {
    fn mirrored(&self) -> GgxReflection {
        let fresnel = Fresnel::Constant(Vec3::ONE);
        GgxReflection { alpha: self.alpha, fresnel, masking: Masking::Correlated, scale: Vec3::ONE }
    }

    /// What goes through when `up` is the mirror image of where the light comes from.
    fn passed(&self, wo: Vec3, up: Vec3) -> Vec3 {
        let cos = wo.dot((wo + up).normalize()).clamp(0.0, 1.0);
        self.fresnel.passed(cos) * self.tint
    }

    pub(super) fn eval(&self, wo: Vec3, wi: Vec3) -> Vec3 {
        let up = Vec3::new(wi.x, wi.y, -wi.z);
        if wo.z > 0.0 && up.z > 0.0 { self.mirrored().eval(wo, up) * self.passed(wo, up) } else { Vec3::ZERO }
    }

    pub(super) fn pdf(&self, wo: Vec3, wi: Vec3) -> f32 {
        self.mirrored().pdf(wo, Vec3::new(wi.x, wi.y, -wi.z))
    }

    pub(super) fn sample(&self, wo: Vec3, u: [f32; 2]) -> Option<LobeSample> {
        let s = self.mirrored().sample(wo, u)?;
        let wi = Vec3::new(s.wi.x, s.wi.y, -s.wi.z);
        Some(LobeSample { wi, weight: s.weight * self.passed(wo, s.wi), pdf: s.pdf })
    }

    pub(super) fn albedo(&self, wo: Vec3) -> Vec3 {
        self.fresnel.passed(wo.z) * self.tint
    }
}
