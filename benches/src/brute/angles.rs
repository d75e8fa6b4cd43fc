//! Winding numbers by the solid angles of all triangles, without an arc tangent for each: the angles of complex numbers add up
//! as these are multiplied, and what goes once around is counted.

use std::f64::consts::PI;

use glam::DVec3;

use super::precise::half_angle;

/// Triangles that are looked at together.
const LANES: usize = 8;

/// Of so many products in a row none is too large or too small.
const STEPS: usize = 2;

/// All triangles, coordinate by coordinate.
pub struct Angles {
    /// By coordinates of the three corners.
    corners: [Vec<f64>; 9],
    wide: bool,
}

impl Angles {
    /// Of a mesh.
    #[must_use]
    pub fn new(corners: &[[DVec3; 3]]) -> Self {
        let size = corners.iter().flatten().fold(0.0f64, |m, p| m.max(p.abs().max_element()));
        // What is padded has no angle: it is a point, and none of the mesh.
        let padded = corners.len().next_multiple_of(LANES * STEPS);
        let column = |k: usize| {
            let of = |t: &[DVec3; 3]| t[k / 3].to_array()[k % 3];
            let mut column: Vec<f64> = corners.iter().map(of).collect();
            column.resize(padded, size * 16.0);
            column
        };
        #[cfg(target_arch = "x86_64")]
        let wide = is_x86_feature_detected!("avx512f") && is_x86_feature_detected!("avx512dq");
        #[cfg(not(target_arch = "x86_64"))]
        let wide = false;
        Self { corners: std::array::from_fn(column), wide }
    }

    /// How often the triangles wind around a point.
    #[must_use]
    pub fn winding_number(&self, point: DVec3) -> f64 {
        #[cfg(target_arch = "x86_64")]
        if self.wide {
            // SAFETY: `wide` says that the processor has these.
            return unsafe { wide(self, point) };
        }
        sum(self, point)
    }

    /// The same, with the angles of some triangles by numbers of twice as many digits: those of triangles that are very near are
    /// rounded much.
    #[must_use]
    pub fn with_care(&self, point: DVec3, near: &[u32], corners: &[[DVec3; 3]]) -> f64 {
        let better = near.iter().map(|&t| {
            let corners = corners[t as usize];
            let columns: [f64; 9] = std::array::from_fn(|k| corners[k / 3].to_array()[k % 3]);
            let (re, im) = half(columns, point);
            half_angle(corners, point) - im.atan2(re)
        });
        self.winding_number(point) + better.sum::<f64>() / (2.0 * PI)
    }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx512f,avx512dq,avx512vl,avx2,fma")]
fn wide(angles: &Angles, point: DVec3) -> f64 {
    sum(angles, point)
}

/// Complex numbers, their angles in all the turns of half a circle each has made.
struct Product {
    re: [f64; LANES],
    im: [f64; LANES],
    turns: [f64; LANES],
}

#[inline(always)]
#[allow(clippy::needless_range_loop, reason = "lanes side by side")]
fn sum(angles: &Angles, point: DVec3) -> f64 {
    let count = angles.corners[0].len();
    let columns: [&[f64]; 9] = std::array::from_fn(|k| &angles.corners[k][..count]);
    let mut product = Product { re: [1.0; LANES], im: [0.0; LANES], turns: [0.0; LANES] };
    for start in (0..count).step_by(LANES * STEPS) {
        for step in 0..STEPS {
            let at = start + step * LANES;
            let part: [&[f64; LANES]; 9] =
                std::array::from_fn(|k| columns[k][at..at + LANES].try_into().unwrap_or(&[0.0; LANES]));
            for i in 0..LANES {
                let (re, im) = half(std::array::from_fn(|k| part[k][i]), point);
                let (x, y) = (product.re[i], product.im[i]);
                let (next_re, next_im) = (x * re - y * im, x * im + y * re);
                // Past the half circle, from above or from below.
                let over = (y >= 0.0) & (im >= 0.0) & (next_im < 0.0);
                let under = (y < 0.0) & (im < 0.0) & (next_im >= 0.0);
                product.turns[i] += if over { 1.0 } else { 0.0 } - if under { 1.0 } else { 0.0 };
                (product.re[i], product.im[i]) = (next_re, next_im);
            }
        }
        for i in 0..LANES {
            let inverse = 1.0 / (product.re[i].abs() + product.im[i].abs());
            product.re[i] *= inverse;
            product.im[i] *= inverse;
        }
    }
    let angle = |i: usize| product.im[i].atan2(product.re[i]) + 2.0 * PI * product.turns[i];
    // These are halves of the solid angles.
    (0..LANES).map(angle).sum::<f64>() / (2.0 * PI)
}

/// A complex number with half the solid angle of a triangle (van Oosterom and Strackee 1983), of size about 1.
#[inline(always)]
fn half(part: [f64; 9], p: DVec3) -> (f64, f64) {
    let (ax, ay, az) = (part[0] - p.x, part[1] - p.y, part[2] - p.z);
    let (bx, by, bz) = (part[3] - p.x, part[4] - p.y, part[5] - p.z);
    let (cx, cy, cz) = (part[6] - p.x, part[7] - p.y, part[8] - p.z);
    let la = (ax * ax + ay * ay + az * az).sqrt();
    let lb = (bx * bx + by * by + bz * bz).sqrt();
    let lc = (cx * cx + cy * cy + cz * cz).sqrt();
    let (ab, bc, ca) = (ax * bx + ay * by + az * bz, bx * cx + by * cy + bz * cz, cx * ax + cy * ay + cz * az);
    let around = la * lb * lc + ab * lc + bc * la + ca * lb;
    let volume = ax * (by * cz - bz * cy) + ay * (bz * cx - bx * cz) + az * (bx * cy - by * cx);
    // Nothing as seen from one of its own corners.
    let nothing = (around == 0.0) & (volume == 0.0);
    (if nothing { 1.0 } else { around }, volume)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::brute::{corners, scene};
    use firsthit_accel::reference;
    use firsthit_measure::mesh::icosphere;
    use firsthit_measure::random::Rng;

    #[test]
    fn sums_of_angles_are_those_of_the_slow_twin() {
        let mut mesh = icosphere(3);
        mesh.triangles.truncate(1000);
        let scene = scene(&mesh, 0).unwrap();
        let corners = corners(&mesh);
        let mut rng = Rng(9);
        for wide in [false, true] {
            let mut angles = Angles::new(&corners);
            angles.wide &= wide;
            for k in 0..300 {
                let p = match k % 3 {
                    0 => rng.in_cube(),
                    1 => corners[rng.below(1000)][0] * (1.0 + 1e-6 * rng.signed()),
                    _ => rng.in_cube() * 50.0,
                };
                let expected = reference::winding_number(&scene, p);
                assert!((angles.winding_number(p) - expected).abs() < 1e-9, "{p} {expected}");
                assert!((angles.with_care(p, &[3, 5, 7], &corners) - expected).abs() < 1e-9, "{p} {expected}");
            }
        }
    }
}
