//! Interference in a thin film (KHR_materials_iridescence): a law of reflectance with hues.
//!
//! Belcour and Barla, "A Practical Extension to Microfacet Theory for the Modeling of Varying Iridescence" (2017), with
//! the approximations of the extension's text: Schlick's law at both interfaces, no polarisation, metals by the
//! dielectric of the same reflectance.

use std::f32::consts::{PI, TAU};

use glam::{Mat3, Vec3};

/// A film between what is outside and the base.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Film {
    /// How much of it shows, 0 to 1.
    pub(crate) factor: f32,
    /// Index of refraction outside: of air, or of a clear coat.
    pub(crate) outside: f32,
    /// Its own index of refraction.
    pub(crate) ior: f32,
    /// Nanometres.
    pub(crate) thickness: f32,
}

/// From CIE XYZ to linear Rec. 709.
const RGB_OF_XYZ: Mat3 = Mat3::from_cols(
    Vec3::new(3.240_454_2, -0.969_266, 0.055_643_4),
    Vec3::new(-1.537_138_5, 1.876_010_8, -0.204_025_9),
    Vec3::new(-0.498_531_4, 0.041_556, 1.057_225_2),
);

fn square(x: f32) -> f32 {
    x * x
}

/// Reflectance along the normal between two indices of refraction.
fn between(inner: f32, outer: f32) -> f32 {
    square((inner - outer) / (inner + outer))
}

fn schlick(f0: f32, cos: f32) -> f32 {
    let x = (1.0 - cos).clamp(0.0, 1.0);
    f0 + (1.0 - f0) * square(square(x)) * x
}

/// The eye's response to a spectrum that oscillates with a path difference (nanometres) and a phase shift: Gaussians
/// fitted to the colour matching functions, in Fourier space.
fn sensitivity(difference: f32, shift: Vec3) -> Vec3 {
    const AMPLITUDE: Vec3 = Vec3::new(5.4856e-13, 4.4201e-13, 5.2481e-13);
    const CENTRE: Vec3 = Vec3::new(1.6810e6, 1.7953e6, 2.2084e6);
    const VARIANCE: Vec3 = Vec3::new(4.3278e9, 9.3046e9, 6.6121e9);
    let phase = TAU * difference * 1e-9;
    let mut xyz = AMPLITUDE
        * (VARIANCE * TAU).map(f32::sqrt)
        * (CENTRE * phase + shift).map(f32::cos)
        * (VARIANCE * -square(phase)).map(f32::exp);
    // The second hump of x.
    xyz.x +=
        9.7470e-14 * (TAU * 4.5282e9).sqrt() * (2.2399e6 * phase + shift.x).cos() * (-4.5282e9 * square(phase)).exp();
    RGB_OF_XYZ * (xyz / 1.0685e-7)
}

impl Film {
    /// Reflectance of film and base together, of a base that reflects `f0` along the normal in air.
    pub(crate) fn reflectance(&self, f0: Vec3, cos: f32) -> Vec3 {
        // A film of no thickness is none.
        let t = (self.thickness / 0.03).clamp(0.0, 1.0);
        let ior = self.outside + (self.ior - self.outside) * (t * t * (3.0 - 2.0 * t));
        let cos2 = 1.0 - square(self.outside / ior) * (1.0 - cos * cos);
        if cos2 < 0.0 {
            return Vec3::ONE;
        }
        let cos2 = cos2.sqrt();
        let r12 = schlick(between(ior, self.outside), cos);
        let t121 = 1.0 - r12;
        let phi21 = if ior < self.outside { 0.0 } else { PI };
        // The index of the base; reflectances of 1 would be infinite.
        let root = (f0 + 1e-4).clamp(Vec3::ZERO, Vec3::splat(0.9999)).map(f32::sqrt);
        let base = (Vec3::ONE + root) / (Vec3::ONE - root);
        let r23 = base.map(|base| schlick(between(base, ior), cos2));
        let phi = base.map(|base| phi21 + if base < ior { PI } else { 0.0 });

        let difference = 2.0 * ior * self.thickness * cos2;
        let r123 = (r23 * r12).clamp(Vec3::ZERO, Vec3::splat(0.9999));
        let amplitude = r123.map(f32::sqrt);
        let rs = r23 * square(t121) / (Vec3::ONE - r123);
        let mut reflected = rs + r12;
        let mut order = rs - t121;
        for m in [1.0, 2.0] {
            order *= amplitude;
            reflected += order * sensitivity(m * difference, phi * m) * 2.0;
        }
        reflected.clamp(Vec3::ZERO, Vec3::ONE)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn film(thickness: f32, ior: f32) -> Film {
        Film { factor: 1.0, outside: 1.0, ior, thickness }
    }

    #[test]
    fn without_thickness_the_base_is_as_it_is_near_the_normal() {
        for f0 in [0.04, 0.3, 0.9] {
            // Farther from it, Schlick's law at the film's upper side is not 0 even between equal indices.
            for cos in [1.0, 0.9] {
                let bare = schlick(f0, cos);
                let r = film(0.0, 1.3).reflectance(Vec3::splat(f0), cos);
                assert!((r - Vec3::splat(bare)).abs().max_element() < 4e-3, "{f0} {cos}: {r} instead of {bare}");
            }
        }
    }

    /// Airy's sum at one wavelength, averaged over the visible with the luminous efficiency: an independent way to the
    /// green-yellow part of the colour.
    #[test]
    fn luminance_is_that_of_airys_formula() {
        let luminance = |c: Vec3| 0.2126 * c.x + 0.7152 * c.y + 0.0722 * c.z;
        for thickness in [150.0f32, 250.0, 400.0, 550.0] {
            let (n1, n2, n3) = (1.0f64, 1.4, 1.9);
            let (mut sum, mut weights) = (0.0, 0.0);
            for nm in 380..750 {
                let lambda = f64::from(nm);
                // The two-lobed fit of the luminous efficiency by Wyman, Sloan and Shirley (2013).
                let lobe = |a: f64, m: f64, s1: f64, s2: f64| {
                    let t = (lambda - m) / if lambda < m { s1 } else { s2 };
                    a * (-0.5 * t * t).exp()
                };
                let v = lobe(0.821, 568.8, 46.9, 40.5) + lobe(0.286, 530.9, 16.3, 31.1);
                let (r12, r23) = ((n1 - n2) / (n1 + n2), (n2 - n3) / (n2 + n3));
                let phase = 4.0 * std::f64::consts::PI * n2 * f64::from(thickness) / lambda;
                let cross = 2.0 * r12 * r23 * phase.cos();
                let r = (r12 * r12 + r23 * r23 + cross) / (1.0 + r12 * r12 * r23 * r23 + cross);
                sum += v * r;
                weights += v;
            }
            let f0 = ((1.9f32 - 1.0) / (1.9 + 1.0)).powi(2) - 1e-4;
            let found = f64::from(luminance(film(thickness, 1.4).reflectance(Vec3::splat(f0), 1.0)));
            let expected = sum / weights;
            assert!((found - expected).abs() < 0.012, "{thickness} nm: {found} instead of {expected}");
        }
    }

    #[test]
    fn hues_change_with_thickness_and_angle() {
        let f0 = Vec3::splat(0.04);
        let hue = |thickness, cos| {
            let r = film(thickness, 1.3).reflectance(f0, cos);
            r / r.max_element()
        };
        assert!((hue(300.0, 1.0) - hue(450.0, 1.0)).length() > 0.2);
        assert!((hue(450.0, 1.0) - hue(450.0, 0.5)).length() > 0.1);
        // Thick films lose their hue.
        let thick = hue(20_000.0, 1.0);
        assert!(thick.min_element() > 0.97, "{thick}");
    }
}
