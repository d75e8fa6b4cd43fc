//! The nearest points of ellipsoids, and of ellipses.

use glam::{DMat3, DVec3};

use crate::Real;
use crate::transform::similarity;

/// The point nearest to the origin of all `center + axes * n`, `|n| = 1`; and that `n`.
pub(super) fn on_ellipsoid(center: DVec3, axes: DMat3) -> (DVec3, DVec3) {
    if let Some(radius) = similarity(&axes) {
        let distance = center.length();
        if !(distance > 0.0) {
            return (axes.x_axis, DVec3::X);
        }
        let outward = center / -distance;
        let unit = (axes.transpose() * (outward / radius)).normalize_or(DVec3::X);
        return (outward * (radius - distance), unit);
    }
    let axes = Axes::new([axes.x_axis, axes.y_axis, axes.z_axis]);
    let at = on_axes(axes.lengths, axes.coordinates(-center));
    let point = center + axes.directions[0] * at[0] + axes.directions[1] * at[1] + axes.directions[2] * at[2];
    let [a, b, c] = [0, 1, 2].map(|k| at[k] / axes.lengths[k]);
    (point, (axes.turn * DVec3::new(a, b, c)).normalize_or(DVec3::X))
}

/// Three vectors made orthogonal: `[x y z] = [directions * lengths] turn^T`, a singular value decomposition.
pub(super) struct Axes {
    pub(super) directions: [DVec3; 3],
    pub(super) lengths: [f64; 3],
    /// A rotation.
    turn: DMat3,
}

impl Axes {
    /// By one-sided Jacobi rotations (Hestenes 1958), which keep the digits of short axes beside long ones.
    pub(super) fn new(mut columns: [DVec3; 3]) -> Self {
        let mut turn = [DVec3::X, DVec3::Y, DVec3::Z];
        // In units of about the longest, so that squares neither overflow nor vanish.
        let k = columns.iter().fold(0.0f64, |m, c| m.max(c.abs().max_element())).power_of_two_below();
        columns = columns.map(|c| c / k);
        // They converge quadratically: after a few sweeps nothing is left to turn.
        for _ in 0..32 {
            let mut turned = false;
            for (i, j) in [(0, 1), (0, 2), (1, 2)] {
                let (aa, bb) = (columns[i].length_squared(), columns[j].length_squared());
                let ab = columns[i].dot(columns[j]);
                if ab.abs() <= f64::EPSILON * (aa * bb).sqrt() {
                    continue;
                }
                turned = true;
                let zeta = (bb - aa) / (2.0 * ab);
                let tan = zeta.signum() / (zeta.abs() + zeta.hypot(1.0));
                let cos = 1.0 / tan.hypot(1.0);
                let sin = tan * cos;
                for v in [&mut columns, &mut turn] {
                    (v[i], v[j]) = (v[i] * cos - v[j] * sin, v[i] * sin + v[j] * cos);
                }
            }
            if !turned {
                break;
            }
        }
        Self {
            directions: columns.map(|c| c.normalize_or_zero()),
            lengths: columns.map(|c| c.length() * k),
            turn: DMat3::from_cols(turn[0], turn[1], turn[2]),
        }
    }

    /// Of a point, along the directions.
    pub(super) fn coordinates(&self, p: DVec3) -> [f64; 3] {
        self.directions.map(|d| d.dot(p))
    }
}

/// [`on_axes`] in the plane.
pub(super) fn on_ellipse([a, b]: [f64; 2], [x, y]: [f64; 2]) -> [f64; 2] {
    // From a point without a third coordinate, an axis which is not the shortest takes no part.
    let [x, y, _] = on_axes([a, b, a.max(b) * 2.0], [x, y, 0.0]);
    [x, y]
}

/// The point nearest to `y` of the ellipsoid `sum (x_i / e_i)^2 = 1`.
///
/// There `y - x` is a multiple `t` of the gradient, so `x_i = e_i^2 y_i / (t + e_i^2)`, and of the roots of
/// `f(t) = sum (e_i y_i / (t + e_i^2))^2 - 1` the largest is wanted: the only one above `-m^2`, `m` the least of `e`
/// (Eberly, *Distance from a Point to an Ellipse, an Ellipsoid, or a Hyperellipsoid*, 2013). There `f` falls and is convex. So
/// Newton's steps from where it is positive never go past the root, and need no safeguard: they begin where the largest
/// term is 1, at most 2 above it. Counted from `-m^2`, the root keeps its digits where it is close to that.
fn on_axes(e: [f64; 3], y: [f64; 3]) -> [f64; 3] {
    let k = e[0].max(e[1]).max(e[2]).power_of_two_below();
    let side = y;
    // What would leave the range of numbers as a factor is nothing.
    let (e, y) = (e.map(|e| e / k), y.map(|y| if (y / k).abs() < 1e-140 { 0.0 } else { y / k }));
    let m = e[0].min(e[1]).min(e[2]);
    // Never less than 0.
    let d = e.map(|e| (e - m) * (e + m));
    let term = |i: usize, s: f64| if y[i] == 0.0 { 0.0 } else { e[i] * y[i].abs() / (s + d[i]) };
    let x = |i: usize, s: f64| if y[i] == 0.0 { 0.0 } else { e[i] * (e[i] * y[i] / (s + d[i])) };
    // In the middle of the shortest axis, and so near that the sides are nearest: the root would be at a pole.
    let short = [0, 1, 2].map(|i| d[i] == 0.0);
    if (0..3).all(|i| !short[i] || y[i] == 0.0) {
        let rest = 1.0 - (0..3).map(|i| term(i, 0.0).powi(2)).sum::<f64>();
        if rest >= 0.0 {
            let mut at = [0, 1, 2].map(|i| x(i, 0.0));
            if let Some(i) = (0..3).find(|&i| short[i]) {
                at[i] = (m * rest.sqrt()).copysign(side[i]);
            }
            return at.map(|x| x * k);
        }
    }
    let mut s = (0..3).map(|i| e[i] * y[i].abs() - d[i]).fold(0.0, f64::max);
    // Some eight steps; each at least adds a digit.
    for _ in 0..64 {
        let terms = [0, 1, 2].map(|i| term(i, s).powi(2));
        let f = terms[0] + terms[1] + terms[2] - 1.0;
        let slope: f64 = (0..3).filter(|&i| terms[i] > 0.0).map(|i| terms[i] / (s + d[i])).sum();
        let next = s + f / (2.0 * slope);
        if !(next > s) {
            break;
        }
        s = next;
    }
    [0, 1, 2].map(|i| x(i, s) * k)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn around(angle: f64) -> (f64, f64) {
        (angle * core::f64::consts::TAU).sin_cos()
    }

    fn ball(u: f64, v: f64) -> DVec3 {
        let ((sin, cos), (y, r)) = (around(u), (core::f64::consts::PI * v).sin_cos());
        DVec3::new(cos * y, r, sin * y)
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(1000))]

        /// All axes, also equal and almost equal ones, and points on them.
        #[test]
        fn the_nearest_point_of_an_ellipsoid_is_on_it(
            e in prop::array::uniform3(prop::sample::select(vec![1.0, 1.0 + 1e-15, 1.0 + 1e-8, 0.5, 1e-6, 1e6, 3.0])),
            y in prop::array::uniform3(prop::sample::select(vec![0.0, 1e-300, 1e-20, 1e-9, 0.3, 0.5, 1.0, 2.0, 1e9, 1e150])),
        ) {
            let x = on_axes(e, y);
            let on: f64 = (0..3).map(|i| (x[i] / e[i]).powi(2)).sum();
            prop_assert!((on - 1.0).abs() < 1e-13, "{x:?}: {on}");
            // Of the eight octants the same.
            for i in 0..3 {
                prop_assert!(x[i] * y[i] >= 0.0);
                let mut mirrored = y;
                mirrored[i] = -y[i];
                let other = on_axes(e, mirrored);
                prop_assert!(other[i].abs() == x[i].abs());
            }
            // No point around it is nearer.
            let square = |x: [f64; 3]| (0..3).map(|i| (x[i] - y[i]).powi(2)).sum::<f64>();
            let size = (0..3).fold(0.0f64, |m, i| m.max(e[i]).max(y[i]));
            for i in -8..=8 {
                for k in -8..=8 {
                    let p = ball(f64::from(i) / 16.0, f64::from(k) / 16.0);
                    let q = [0, 1, 2].map(|i| p[i] * e[i]);
                    prop_assert!(square(q).sqrt() >= square(x).sqrt() - 1e-14 * size, "{q:?} is nearer than {x:?}");
                }
            }
        }
    }
}
