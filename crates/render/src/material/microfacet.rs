//! The GGX (Trowbridge-Reitz) distribution of microfacets with Smith masking, isotropic.
//!
//! Directions are in the local frame of the surface, +z the normal, and point away from it. Sources: Walter et al.,
//! "Microfacet Models for Refraction through Rough Surfaces" (2007); Heitz, "Understanding the Masking-Shadowing
//! Function" (2014); Dupuy and Benyoub, "Sampling Visible GGX Normals with Spherical Caps" (2023).

use std::f32::consts::PI;

use glam::Vec3;

/// Density of facets with normal `h`: integrates to 1 when weighted with `h.z`.
pub(crate) fn density(h: Vec3, alpha: f32) -> f32 {
    // In this form nothing cancels for a small alpha, where 1 - h.z^2 would.
    let (x, y) = (h.x / alpha, h.y / alpha);
    let s = x * x + y * y + h.z * h.z;
    if h.z > 0.0 { 1.0 / (PI * alpha * alpha * s * s) } else { 0.0 }
}

/// Smith's Lambda: masked over visible area of facets seen from `w`.
fn lambda(w: Vec3, alpha: f32) -> f32 {
    let tan2 = (w.x * w.x + w.y * w.y) / (w.z * w.z);
    0.5 * ((1.0 + alpha * alpha * tan2).sqrt() - 1.0)
}

/// Share of facets that is visible from `w`.
pub(crate) fn g1(w: Vec3, alpha: f32) -> f32 {
    1.0 / (1.0 + lambda(w, alpha))
}

/// How masking and shadowing go together.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Masking {
    /// Height-correlated: what is deep is both masked and shadowed.
    Correlated,
    /// The product of both, as Walter et al. have it.
    Separate,
}

/// Share of facets that is visible from both directions.
pub(crate) fn g2(wo: Vec3, wi: Vec3, alpha: f32, masking: Masking) -> f32 {
    match masking {
        Masking::Correlated => 1.0 / (1.0 + lambda(wo, alpha) + lambda(wi, alpha)),
        Masking::Separate => g1(wo, alpha) * g1(wi, alpha),
    }
}

/// A facet normal, distributed as seen from `wo`.
pub(crate) fn sample_visible(wo: Vec3, alpha: f32, u: [f32; 2]) -> Vec3 {
    let w = Vec3::new(wo.x * alpha, wo.y * alpha, wo.z).normalize();
    let (sin_phi, cos_phi) = (2.0 * PI * u[0]).sin_cos();
    let z = (1.0 - u[1]) * (1.0 + w.z) - w.z;
    let r = (1.0 - z * z).max(0.0).sqrt();
    let h = Vec3::new(r * cos_phi, r * sin_phi, z) + w;
    Vec3::new(h.x * alpha, h.y * alpha, h.z.max(0.0)).try_normalize().unwrap_or(Vec3::Z)
}

/// Density of [`sample_visible`] over solid angle.
pub(crate) fn visible_pdf(wo: Vec3, h: Vec3, alpha: f32) -> f32 {
    g1(wo, alpha) * wo.dot(h).max(0.0) * density(h, alpha) / wo.z
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Integrates over the upper hemisphere by the midpoint rule, f64 sums.
    fn integrate(f: impl Fn(Vec3) -> f32) -> f64 {
        let (n, m) = (2000, 256);
        let mut sum = 0.0;
        for i in 0..n {
            // Dense near the pole, where the peak of smooth surfaces is.
            let s = (f64::from(i) + 0.5) / f64::from(n);
            let theta = s * s * std::f64::consts::FRAC_PI_2;
            let width = 2.0 * s * std::f64::consts::FRAC_PI_2 / f64::from(n);
            for j in 0..m {
                let phi = (f64::from(j) + 0.5) / f64::from(m) * std::f64::consts::TAU;
                let w =
                    Vec3::new((theta.sin() * phi.cos()) as f32, (theta.sin() * phi.sin()) as f32, theta.cos() as f32);
                sum += f64::from(f(w)) * theta.sin() * width * std::f64::consts::TAU / f64::from(m);
            }
        }
        sum
    }

    #[test]
    fn projected_facets_cover_the_surface() {
        for alpha in [0.02, 0.1, 0.5, 1.0] {
            let area = integrate(|h| density(h, alpha) * h.z);
            assert!((area - 1.0).abs() < 2e-3, "alpha {alpha}: {area}");
        }
    }

    #[test]
    fn visible_facets_cover_the_projected_area_from_any_side() {
        for alpha in [0.1, 0.5, 1.0] {
            for z in [1.0f32, 0.7, 0.2] {
                let wo = Vec3::new((1.0 - z * z).sqrt(), 0.0, z);
                let total = integrate(|h| visible_pdf(wo, h, alpha));
                assert!((total - 1.0).abs() < 4e-3, "alpha {alpha}, cos {z}: {total}");
            }
        }
    }
}
