//! Perfectly smooth surfaces: light goes on in one direction (a delta function).

use glam::Vec3;

use super::LobeSample;
use crate::material::fresnel::{Fresnel, refracted_cos};

/// Mirror reflection.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SpecularReflection {
    /// Share of light reflected.
    pub(crate) fresnel: Fresnel,
}

impl SpecularReflection {
    pub(super) fn eval(&self, _: Vec3, _: Vec3) -> Vec3 {
        Vec3::ZERO
    }

    pub(super) fn pdf(&self, _: Vec3, _: Vec3) -> f32 {
        0.0
    }

    pub(super) fn sample(&self, wo: Vec3, _: [f32; 2]) -> Option<LobeSample> {
        Some(LobeSample { wi: Vec3::new(-wo.x, -wo.y, wo.z), weight: self.fresnel.reflectance(wo.z), pdf: None })
    }

    pub(super) fn albedo(&self, wo: Vec3) -> Vec3 {
        self.fresnel.reflectance(wo.z)
    }
}

/// Refraction by Snell's law.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SpecularTransmission {
    /// Index of the other side over that of this side; 1: straight on.
    pub(crate) eta: f32,
    /// What the surface reflects does not go through.
    pub(crate) fresnel: Fresnel,
    /// Multiplies what goes through.
    pub(crate) tint: Vec3,
    /// Change of radiance by the change of index: 1 / eta^2, or 1 where that is left out.
    pub(crate) scale: f32,
}

impl SpecularTransmission {
    pub(super) fn eval(&self, _: Vec3, _: Vec3) -> Vec3 {
        Vec3::ZERO
    }

    pub(super) fn pdf(&self, _: Vec3, _: Vec3) -> f32 {
        0.0
    }

    pub(super) fn sample(&self, wo: Vec3, _: [f32; 2]) -> Option<LobeSample> {
        let cos_t = refracted_cos(wo.z, self.eta)?;
        let wi = Vec3::new(-wo.x / self.eta, -wo.y / self.eta, -cos_t);
        Some(LobeSample { wi, weight: self.albedo(wo) * self.scale, pdf: None })
    }

    pub(super) fn albedo(&self, wo: Vec3) -> Vec3 {
        self.fresnel.passed(wo.z) * self.tint
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn refraction_obeys_snells_law_and_stops_at_the_critical_angle() {
        for eta in [1.5f32, 1.0 / 1.5] {
            let lobe = SpecularTransmission { eta, fresnel: Fresnel::Dielectric { eta }, tint: Vec3::ONE, scale: 1.0 };
            for degrees in 0..90 {
                let theta = (degrees as f32).to_radians();
                let wo = Vec3::new(theta.sin(), 0.0, theta.cos());
                match lobe.sample(wo, [0.0; 2]) {
                    Some(s) => {
                        assert!((wo.x + eta * s.wi.x).abs() < 1e-6 && s.wi.z < 0.0);
                        assert!((s.wi.length() - 1.0).abs() < 1e-6);
                    }
                    None => assert!(theta.sin() / eta >= 1.0 - 1e-6),
                }
            }
        }
    }

    #[test]
    fn what_is_not_reflected_goes_through() {
        let fresnel = Fresnel::Dielectric { eta: 1.5 };
        let wo = Vec3::new(0.8, 0.0, 0.6);
        let r = SpecularReflection { fresnel }.sample(wo, [0.0; 2]).unwrap();
        let t = SpecularTransmission { eta: 1.5, fresnel, tint: Vec3::ONE, scale: 1.0 }.sample(wo, [0.0; 2]).unwrap();
        assert!((r.weight + t.weight - Vec3::ONE).abs().max_element() < 1e-6);
        assert_eq!(r.wi, Vec3::new(-0.8, 0.0, 0.6));
    }
}
