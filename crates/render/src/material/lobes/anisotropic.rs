//! Reflection by GGX microfacets that are rougher along one direction than across (KHR_materials_anisotropy).
//!
//! Heitz, "Sampling the GGX Distribution of Visible Normals" (2018), with the spherical caps of Dupuy and Benyoub
//! (2023). The frame's x is the direction of the greater roughness.

use std::f32::consts::PI;

use glam::{Vec2, Vec3};

use super::LobeSample;
use crate::material::fresnel::Fresnel;

/// A brushed mirror.
#[derive(Clone, Copy, Debug)]
pub(crate) struct AnisotropicGgx {
    /// Roughness along x and along y, > 0.
    pub(crate) alpha: Vec2,
    /// Reflectance of each facet.
    pub(crate) fresnel: Fresnel,
    /// Multiplies all of it.
    pub(crate) scale: Vec3,
}

impl AnisotropicGgx {
    fn density(&self, h: Vec3) -> f32 {
        let (x, y) = (h.x / self.alpha.x, h.y / self.alpha.y);
        let s = x * x + y * y + h.z * h.z;
        if h.z > 0.0 { 1.0 / (PI * self.alpha.x * self.alpha.y * s * s) } else { 0.0 }
    }

    fn lambda(&self, w: Vec3) -> f32 {
        let (x, y) = (w.x * self.alpha.x, w.y * self.alpha.y);
        0.5 * ((1.0 + (x * x + y * y) / (w.z * w.z)).sqrt() - 1.0)
    }

    pub(super) fn eval(&self, wo: Vec3, wi: Vec3) -> Vec3 {
        if !(wo.z > 0.0 && wi.z > 0.0) {
            return Vec3::ZERO;
        }
        let h = (wo + wi).normalize();
        let f = self.fresnel.reflectance(wo.dot(h).clamp(0.0, 1.0)) * self.scale;
        let g = 1.0 / (1.0 + self.lambda(wo) + self.lambda(wi));
        f * (self.density(h) * g / (4.0 * wo.z))
    }

    fn pdf_of_facet(&self, wo: Vec3, h: Vec3) -> f32 {
        self.density(h) / ((1.0 + self.lambda(wo)) * 4.0 * wo.z)
    }

    pub(super) fn pdf(&self, wo: Vec3, wi: Vec3) -> f32 {
        if wo.z > 0.0 && wi.z > 0.0 { self.pdf_of_facet(wo, (wo + wi).normalize()) } else { 0.0 }
    }

    pub(super) fn sample(&self, wo: Vec3, u: [f32; 2]) -> Option<LobeSample> {
        let stretched = Vec3::new(wo.x * self.alpha.x, wo.y * self.alpha.y, wo.z).normalize();
        let (sin_phi, cos_phi) = (2.0 * PI * u[0]).sin_cos();
        let z = (1.0 - u[1]) * (1.0 + stretched.z) - stretched.z;
        let r = (1.0 - z * z).max(0.0).sqrt();
        let h = Vec3::new(r * cos_phi, r * sin_phi, z) + stretched;
        let h = Vec3::new(h.x * self.alpha.x, h.y * self.alpha.y, h.z.max(0.0)).try_normalize()?;
        let cos = wo.dot(h);
        let wi = (h * (2.0 * cos) - wo).normalize();
        if !(cos > 0.0 && wo.z > 0.0 && wi.z > 0.0) {
            return None;
        }
        let (masked, both) = (1.0 + self.lambda(wo), 1.0 + self.lambda(wo) + self.lambda(wi));
        let weight = self.fresnel.reflectance(cos.min(1.0)) * self.scale * (masked / both);
        Some(LobeSample { wi, weight, pdf: Some(self.pdf_of_facet(wo, h)) })
    }

    pub(super) fn albedo(&self, wo: Vec3) -> Vec3 {
        self.fresnel.reflectance(wo.z.clamp(0.0, 1.0)) * self.scale
    }
}
