//! Sheen (KHR_materials_sheen): fibres that stand on a surface, as of velvet.
//!
//! Estevez and Kulla, "Production Friendly Microfacet Sheen BRDF" (2017): the "Charlie" distribution with their fit of
//! its shadowing. Directions are drawn evenly, as they recommend: most of the light is near the horizon.

use std::f32::consts::{FRAC_1_PI, PI};

use glam::Vec3;

use super::LobeSample;

/// Below this, the distribution is all but a ring at the horizon that f32 cannot resolve.
const LEAST_ROUGHNESS: f32 = 0.07;

/// Light that fibres scatter.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Sheen {
    /// Share of light reflected, by colour.
    pub(crate) color: Vec3,
    /// Square of the extension's roughness, > 0.
    alpha: f32,
}

impl Sheen {
    /// `roughness`: the extension's, 0 to 1.
    pub(crate) fn new(color: Vec3, roughness: f32) -> Self {
        let roughness = roughness.max(LEAST_ROUGHNESS);
        Self { color, alpha: roughness * roughness }
    }

    /// Distribution of the fibres' normals by the sine of the angle to the surface's.
    fn density(&self, sin2: f32) -> f32 {
        let inverse = 1.0 / self.alpha;
        (2.0 + inverse) * sin2.powf(0.5 * inverse) * (0.5 * FRAC_1_PI)
    }

    /// The fit of Smith's Lambda.
    fn lambda(&self, cos: f32) -> f32 {
        let t = (1.0 - self.alpha) * (1.0 - self.alpha);
        let mix = |a: f32, b: f32| a + (b - a) * t;
        let (a, b, c) = (mix(21.5473, 25.3245), mix(3.829_87, 3.324_35), mix(0.198_23, 0.168_01));
        let (d, e) = (mix(-1.977_60, -1.273_93), mix(-4.320_54, -4.859_67));
        let fit = |x: f32| a / (1.0 + b * x.powf(c)) + d * x + e;
        if cos < 0.5 { fit(cos).exp() } else { (2.0 * fit(0.5) - fit(1.0 - cos)).exp() }
    }

    pub(super) fn eval(&self, wo: Vec3, wi: Vec3) -> Vec3 {
        if !(wo.z > 0.0 && wi.z > 0.0) {
            return Vec3::ZERO;
        }
        let h = (wo + wi).normalize();
        let masked = 1.0 + self.lambda(wo.z) + self.lambda(wi.z);
        self.color * (self.density((h.x * h.x + h.y * h.y).min(1.0)) / (masked * 4.0 * wo.z))
    }

    pub(super) fn pdf(&self, _: Vec3, wi: Vec3) -> f32 {
        if wi.z > 0.0 { 0.5 * FRAC_1_PI } else { 0.0 }
    }

    pub(super) fn sample(&self, wo: Vec3, u: [f32; 2]) -> Option<LobeSample> {
        // Never the horizon itself.
        let z = 1.0 - u[0];
        let r = (1.0 - z * z).max(0.0).sqrt();
        let (sin, cos) = (2.0 * PI * u[1]).sin_cos();
        let wi = Vec3::new(r * cos, r * sin, z);
        (wo.z > 0.0).then(|| LobeSample { wi, weight: self.eval(wo, wi) * (2.0 * PI), pdf: Some(0.5 * FRAC_1_PI) })
    }

    pub(super) fn albedo(&self, wo: Vec3) -> Vec3 {
        self.color * crate::material::energy::sheen(wo.z, self.alpha.sqrt())
    }
}
