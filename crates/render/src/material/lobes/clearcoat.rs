//! A clear coat (KHR_materials_clearcoat): a dielectric reflection about a normal of its own.
//!
//! The extension takes Fresnel's law at the angle to the normal; here it is at that to the facet, as for every other
//! reflection, so that the lobe is the same both ways. What lies below is dimmed by [`Clearcoat::passed`].

use glam::{Mat3, Vec3};

use super::{GgxReflection, LobeSample};
use crate::material::fresnel::Fresnel;
use crate::material::microfacet::Masking;
use crate::warp;

/// Reflectance of an index of refraction of 1.5 along the normal.
const F0: f32 = 0.04;

/// A GGX reflection that covers everything else in part or whole.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Clearcoat {
    /// How much of it there is, 0 to 1.
    pub(crate) weight: f32,
    /// Its own roughness, > 0.
    pub(crate) alpha: f32,
    /// Its own normal, unit, in the frame of the lobes.
    pub(crate) normal: Vec3,
}

impl Clearcoat {
    const FRESNEL: Fresnel = Fresnel::Schlick { f0: Vec3::splat(F0), f90: 1.0, eta: 1.0 };

    /// What of the light below gets out towards a viewer at this cosine to the coat's normal.
    pub(crate) fn passed(weight: f32, cos: f32) -> f32 {
        1.0 - weight * Self::FRESNEL.reflectance(cos.clamp(0.0, 1.0)).x
    }

    fn ggx(&self) -> GgxReflection {
        let scale = Vec3::splat(self.weight);
        GgxReflection { alpha: self.alpha, fresnel: Self::FRESNEL, masking: Masking::Correlated, scale }
    }

    /// From the coat's own frame to that of the lobes.
    fn frame(&self) -> Mat3 {
        if self.normal == Vec3::Z {
            return Mat3::IDENTITY;
        }
        let (x, y) = warp::frame(self.normal);
        Mat3::from_cols(x, y, self.normal)
    }

    pub(super) fn eval(&self, wo: Vec3, wi: Vec3) -> Vec3 {
        if !(wi.z > 0.0) {
            return Vec3::ZERO;
        }
        let inward = self.frame().transpose();
        self.ggx().eval(inward * wo, inward * wi)
    }

    pub(super) fn pdf(&self, wo: Vec3, wi: Vec3) -> f32 {
        if !(wi.z > 0.0) {
            return 0.0;
        }
        let inward = self.frame().transpose();
        self.ggx().pdf(inward * wo, inward * wi)
    }

    pub(super) fn sample(&self, wo: Vec3, u: [f32; 2]) -> Option<LobeSample> {
        let frame = self.frame();
        let s = self.ggx().sample(frame.transpose() * wo, u)?;
        let wi = frame * s.wi;
        // What the coat's normal sends below the surface is lost.
        (wi.z > 0.0).then_some(LobeSample { wi, ..s })
    }

    pub(super) fn albedo(&self, wo: Vec3) -> Vec3 {
        self.ggx().albedo(Vec3::Z * wo.dot(self.normal))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_full_coat_takes_what_it_reflects_from_what_is_below() {
        assert_eq!(Clearcoat::passed(0.0, 0.3), 1.0);
        assert!((Clearcoat::passed(1.0, 1.0) - 0.96).abs() < 1e-6);
        assert!((Clearcoat::passed(0.5, 0.0) - 0.5).abs() < 1e-6);
    }
}
