//! From the unit square to disks, spheres, cones and triangles, keeping areas.
//!
//! Each function maps points of [0, 1)^2 so that equal areas stay equal: uniform points come out uniform (or
//! cosine-weighted, where it says so), stratified ones stay stratified.

use std::f32::consts::{FRAC_PI_4, TAU};

use glam::{Vec2, Vec3};

/// Two unit vectors that form a right-handed frame with the unit vector `n`: (first, second, n).
///
/// Duff et al., *Building an Orthonormal Basis, Revisited*, JCGT 6(1), 2017.
#[inline]
#[must_use]
pub fn frame(n: Vec3) -> (Vec3, Vec3) {
    let sign = 1.0_f32.copysign(n.z);
    let a = -1.0 / (sign + n.z);
    let b = n.x * n.y * a;
    (Vec3::new(1.0 + sign * n.x * n.x * a, sign * b, -sign * n.x), Vec3::new(b, sign + n.y * n.y * a, -n.y))
}

/// Uniform in the unit disk. Shirley and Chiu, *A Low Distortion Map Between Disk and Square*, 1997.
#[inline]
#[must_use]
pub fn disk(u: [f32; 2]) -> Vec2 {
    let (x, y) = (2.0 * u[0] - 1.0, 2.0 * u[1] - 1.0);
    if x == 0.0 && y == 0.0 {
        return Vec2::ZERO;
    }
    if x.abs() > y.abs() {
        let (sin, cos) = sin_cos_of_eighth(FRAC_PI_4 * (y / x));
        x * Vec2::new(cos, sin)
    } else {
        let (sin, cos) = sin_cos_of_eighth(FRAC_PI_4 * (x / y));
        y * Vec2::new(sin, cos)
    }
}

/// Sine and cosine of an angle between -pi/4 and pi/4, to two roundings: the polynomials of the Cephes library by Moshier.
#[inline]
fn sin_cos_of_eighth(x: f32) -> (f32, f32) {
    let z = x * x;
    let sin = ((-1.951_529_6e-4 * z + 8.332_161e-3) * z - 1.666_665_5e-1) * z * x + x;
    let cos = ((2.443_315_7e-5 * z - 1.388_731_6e-3) * z + 4.166_664_6e-2) * z * z - 0.5 * z + 1.0;
    (sin, cos)
}

/// Cosine-weighted in the hemisphere around +Z: pdf = z / pi.
#[inline]
#[must_use]
pub fn cosine_hemisphere(u: [f32; 2]) -> Vec3 {
    let p = disk(u);
    p.extend((1.0 - p.length_squared()).max(0.0).sqrt())
}

/// Uniform on the unit sphere: pdf = 1 / 4 pi.
#[inline]
#[must_use]
pub fn sphere(u: [f32; 2]) -> Vec3 {
    let z = 1.0 - 2.0 * u[0];
    around_z(z, 1.0 - z * z, u[1])
}

/// Uniform in the cone of directions around +Z with `z >= cos_max`, given 1 - `cos_max` (which keeps thin cones
/// exact): pdf = 1 / (2 pi (1 - `cos_max`)).
#[inline]
#[must_use]
pub fn cone(u: [f32; 2], one_minus_cos_max: f32) -> Vec3 {
    let w = u[0] * one_minus_cos_max;
    around_z(1.0 - w, w * (2.0 - w), u[1])
}

/// Uniform in a triangle: the weights of its first, second and third corner.
///
/// Heitz, *A Low-Distortion Map Between Triangle and Square*, 2019.
#[inline]
#[must_use]
pub fn triangle(u: [f32; 2]) -> [f32; 3] {
    let [x, y] = u;
    let (b, c) = if y > x { (0.5 * x, y - 0.5 * x) } else { (x - 0.5 * y, 0.5 * y) };
    [1.0 - b - c, b, c]
}

/// The unit vector of this z and squared distance from the axis, turned by a share of the full angle.
#[inline]
fn around_z(z: f32, radius_squared: f32, turn: f32) -> Vec3 {
    (radius_squared.max(0.0).sqrt() * Vec2::from_angle(TAU * turn)).extend(z)
}

#[cfg(test)]
mod tests {
    use super::*;

    const N: u32 = 128;

    fn grid() -> impl Iterator<Item = [f32; 2]> {
        (0..N * N).map(|i| [((i % N) as f32 + 0.5) / N as f32, ((i / N) as f32 + 0.5) / N as f32])
    }

    fn mean(f: impl Fn([f32; 2]) -> f64) -> f64 {
        grid().map(f).sum::<f64>() / f64::from(N * N)
    }

    /// Moments that are known in closed form, by the midpoint rule (error ~ 1/N^2).
    #[test]
    fn moments_are_those_of_the_uniform_distributions() {
        let close = |a: f64, b: f64| assert!((a - b).abs() < 2e-3, "{a} is not {b}");
        close(mean(|u| f64::from(disk(u).length_squared())), 0.5);
        close(mean(|u| f64::from(disk(u).x)), 0.0);
        close(mean(|u| f64::from(cosine_hemisphere(u).z)), 2.0 / 3.0);
        close(mean(|u| f64::from(sphere(u).z.powi(2))), 1.0 / 3.0);
        close(mean(|u| f64::from(sphere(u).x.powi(2))), 1.0 / 3.0);
        close(mean(|u| f64::from(cone(u, 0.25).z)), 1.0 - 0.125);
        for corner in 0..3 {
            close(mean(|u| f64::from(triangle(u)[corner])), 1.0 / 3.0);
            close(mean(|u| f64::from(triangle(u)[corner].powi(2))), 1.0 / 6.0);
        }
    }

    #[test]
    fn sines_and_cosines_have_their_digits() {
        for i in -1000..=1000 {
            let x = FRAC_PI_4 * i as f32 / 1000.0;
            let (sin, cos) = sin_cos_of_eighth(x);
            let (exact_sin, exact_cos) = f64::from(x).sin_cos();
            assert!((f64::from(sin) - exact_sin).abs() <= 1.2e-7 * exact_sin.abs(), "{x}: {sin}");
            assert!((f64::from(cos) - exact_cos).abs() <= 1.2e-7, "{x}: {cos}");
        }
    }

    #[test]
    fn directions_are_unit_and_inside() {
        for u in grid().chain([[0.0, 0.0], [1.0 - f32::EPSILON, 1.0 - f32::EPSILON], [0.5, 0.5]]) {
            assert!((sphere(u).length() - 1.0).abs() < 1e-6);
            assert!((cosine_hemisphere(u).length() - 1.0).abs() < 1e-6);
            assert!(cosine_hemisphere(u).z >= 0.0);
            assert!(disk(u).length() <= 1.0 + 1e-6);
            let d = cone(u, 1e-6);
            assert!((d.length() - 1.0).abs() < 1e-6 && 1.0 - d.z <= 1.2e-6);
            assert!(triangle(u).iter().all(|w| (-1e-7..=1.0).contains(w)));
        }
    }

    #[test]
    fn frames_are_orthonormal_and_right_handed() {
        for n in
            grid().map(sphere).chain([Vec3::Z, Vec3::NEG_Z, Vec3::X, Vec3::new(0.0, 0.0, -0.0).normalize_or(Vec3::Y)])
        {
            let (a, b) = frame(n);
            assert!(a.dot(b).abs() < 1e-6 && a.dot(n).abs() < 1e-6 && b.dot(n).abs() < 1e-6);
            assert!((a.length() - 1.0).abs() < 1e-6 && (a.cross(b) - n).length() < 1e-6);
        }
    }
}
