//! Boxes around quadric surfaces.

use glam::{DMat3, DVec3};

use crate::{Aabb, Real, Vector3};

/// A box around the part of the surface `A..J` inside `clip`; infinite where none can be told.
pub(super) fn surface_bounds<R: Real>(coefficients: [R; 10], clip: Aabb<R>) -> Aabb<R> {
    let q = coefficients.map(R::to_f64);
    // The surface is where both `Q <= 0` and `-Q <= 0`.
    let b = region_bounds(q, clip.to_f64()).intersection(region_bounds(q.map(|c| -c), clip.to_f64()));
    let b = Aabb::<R>::new(R::Vec3::from_f64(b.min), R::Vec3::from_f64(b.max));
    // Rounding to nearest may have shaved half a unit off.
    let pad = |x: R| if x.is_finite() { R::gamma(4) * x } else { R::ZERO };
    let m = b.min.abs().max(b.max.abs());
    let e = R::Vec3::new(pad(m.x()), pad(m.y()), pad(m.z()));
    Aabb::new(b.min - e, b.max + e).intersection(clip)
}

/// A box around `{p in clip: Q(p) <= 0}`.
pub(super) fn region_bounds(q: [f64; 10], clip: Aabb<f64>) -> Aabb<f64> {
    let [a, b, c, d, e, f, g, h, i, j] = q;
    if b == 0.0 && c == 0.0 && f == 0.0 {
        return axis_aligned([a, e, h], [d, g, i], j, clip);
    }
    ellipsoid(DMat3::from_cols_array(&[a, b, c, b, e, f, c, f, h]), DVec3::new(d, g, i), j)
        .map_or(clip, |bounds| bounds.intersection(clip))
}

/// Without mixed terms `Q` is a sum of `a x^2 + 2 b x` over the axes and `j`: what the other axes contribute at least
/// bounds each axis in turn. A second pass uses what the first found.
fn axis_aligned(a: [f64; 3], b: [f64; 3], j: f64, clip: Aabb<f64>) -> Aabb<f64> {
    let mut bounds = clip;
    for axis in [0, 1, 2, 0, 1, 2] {
        if bounds.is_empty() {
            return Aabb::empty();
        }
        let others = (0..3).filter(|&i| i != axis);
        let least: f64 = others.map(|i| least_value(a[i], b[i], bounds.min[i], bounds.max[i])).sum();
        let (low, high) = solutions(a[axis], b[axis], -(least + j));
        bounds.min[axis] = bounds.min[axis].max(low);
        bounds.max[axis] = bounds.max[axis].min(high);
    }
    bounds
}

/// The least value of `a x^2 + 2 b x` for `low <= x <= high`.
fn least_value(a: f64, b: f64, low: f64, high: f64) -> f64 {
    let at = |x: f64| {
        if x.is_finite() {
            x * (a * x + 2.0 * b)
        } else if a != 0.0 {
            a * f64::INFINITY
        } else if b != 0.0 {
            b * x
        } else {
            0.0
        }
    };
    let vertex = (-b / a).clamp(low, high);
    let inner = if a > 0.0 { at(vertex) } else { f64::INFINITY };
    at(low).min(at(high)).min(inner)
}

/// The box around `{x: a x^2 + 2 b x <= s}`, a little too large.
fn solutions(a: f64, b: f64, s: f64) -> (f64, f64) {
    let all = (f64::NEG_INFINITY, f64::INFINITY);
    if !s.is_finite() || a < 0.0 {
        return all;
    }
    if a == 0.0 {
        let x = s / (2.0 * b);
        let x = x + if b > 0.0 { 1.0 } else { -1.0 } * 8.0 * f64::EPSILON * x.abs();
        return if b > 0.0 {
            (f64::NEG_INFINITY, x)
        } else if b < 0.0 {
            (x, f64::INFINITY)
        } else {
            all
        };
    }
    let center = -b / a;
    let square = s / a + center * center;
    let square = square + 16.0 * f64::EPSILON * (s.abs() / a + center * center);
    if square < 0.0 {
        return (f64::INFINITY, f64::NEG_INFINITY);
    }
    let half = square.sqrt() * (1.0 + 8.0 * f64::EPSILON) + 8.0 * f64::EPSILON * center.abs();
    (center - half, center + half)
}

/// The box of `(p - c).M(p - c) <= k` for a positive definite `M`: half extents `sqrt(k (M^-1)_ii)`.
fn ellipsoid(m: DMat3, g: DVec3, j: f64) -> Option<Aabb<f64>> {
    let scale = m.x_axis.abs().max(m.y_axis.abs()).max(m.z_axis.abs()).max_element();
    let unit = m * (1.0 / scale);
    let minors = [unit.x_axis.x, unit.x_axis.x * unit.y_axis.y - unit.x_axis.y * unit.x_axis.y, unit.determinant()];
    // A nearly singular matrix has no trustworthy inverse.
    if !minors.iter().all(|&m| m > 1e-9) {
        return None;
    }
    let inverse = m.inverse();
    let center = -(inverse * g);
    let k = -(j + g.dot(center));
    let k = k + 1e-9 * (j.abs() + g.dot(center).abs());
    if k < 0.0 {
        return Some(Aabb::empty());
    }
    let diagonal = DVec3::new(inverse.x_axis.x, inverse.y_axis.y, inverse.z_axis.z);
    let half = (diagonal * k).map(f64::sqrt) * (1.0 + 1e-6);
    Some(Aabb::new(center - half, center + half))
}
