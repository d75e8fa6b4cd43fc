//! Triangles: two intersection tests, the accurate normal, and the choice between them by tier.
//!
//! A triangle is its three vertices, `[R::Vec3; 3]`. Both tests are closed (edges and vertices belong to it), report
//! the ray parameter and the weights `u` of vertex 1 and `v` of vertex 2, do not cull, and never hit a triangle
//! without area.

mod fast;
mod watertight;

pub use fast::{fast, moeller_trumbore};
pub use watertight::{Shear, Weights, watertight};

use glam::DVec3;

use crate::{Precision, Ray, Real, Vector3, exact::ExactRay};

/// Where a ray meets a triangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TriangleHit<R: Real> {
    /// Ray parameter, in lengths of the ray's direction.
    pub t: R,
    /// Weight of vertex 1, in `[0, 1]`.
    pub u: R,
    /// Weight of vertex 2, in `[0, 1]`.
    pub v: R,
}

/// The hit of a ray with a triangle by the test of a tier, rounded to `R`. A hit beyond the largest number of `R` is
/// none, nor is one with a vertex that is not finite.
///
/// * [`Precision::Fast`] is [`fast()`].
/// * [`Precision::Robust`] is [`watertight()`] in `R`.
/// * [`Precision::Double`] is [`watertight()`] in `f64` (to keep its digits, take `R = f64`).
/// * [`Precision::Exact`] is [`ExactRay::hit`](crate::exact::ExactRay::hit), `t` rounded to `R` once.
///
/// ```
/// use firsthit_geometry::{Precision, Ray, triangle};
/// use glam::Vec3;
///
/// let ray = Ray::new(Vec3::new(0.25, 0.5, 1.0), Vec3::NEG_Z);
/// let hit = triangle::intersect(Precision::Robust, [Vec3::ZERO, Vec3::X, Vec3::Y], &ray).unwrap();
/// assert_eq!((hit.t, hit.u, hit.v), (1.0, 0.25, 0.5));
/// ```
#[must_use]
pub fn intersect<R: Real>(precision: Precision, vertices: [R::Vec3; 3], ray: &Ray<R>) -> Option<TriangleHit<R>> {
    let hit = match precision {
        Precision::Fast => fast(vertices, ray),
        Precision::Robust => watertight(vertices, ray),
        Precision::Double => {
            let hit = watertight::<f64>(vertices.map(Vector3::to_f64), &ray.to_f64())?;
            Some(TriangleHit { t: R::from_f64(hit.t), u: R::from_f64(hit.u), v: R::from_f64(hit.v) })
        }
        Precision::Exact => {
            let ray = ExactRay::new(ray.to_f64()).filter(|_| vertices.iter().all(|v| v.is_finite()))?;
            let hit = ray.hit(vertices.map(Vector3::to_f64))?;
            let single = size_of::<R>() == size_of::<f32>();
            let t = if single { R::from_f32(ray.t_f32(&hit)) } else { R::from_f64(hit.t) };
            Some(TriangleHit { t, u: R::from_f64(hit.u), v: R::from_f64(hit.v) })
        }
    };
    hit.filter(|hit| hit.t.is_finite())
}

/// The vector `(v1 - v0) x (v2 - v0)` in double precision: normal by winding, as long as twice the area.
///
/// It is formed from the two shortest edges, whose angle is nearest to a right one; then the error is that of the
/// edges alone, and for `f32` vertices of similar magnitude the edges are exact. Zero for a triangle without area.
#[inline(always)]
#[must_use]
pub fn area_vector(v: [DVec3; 3]) -> DVec3 {
    let e = [v[2] - v[1], v[0] - v[2], v[1] - v[0]];
    let l = [e[0].length_squared(), e[1].length_squared(), e[2].length_squared()];
    // Any two edges in cyclic order give the same vector; the longest is left out.
    if l[0] >= l[1] && l[0] >= l[2] {
        e[1].cross(e[2])
    } else if l[1] >= l[2] {
        e[2].cross(e[0])
    } else {
        e[0].cross(e[1])
    }
}

/// The unit normal by winding, `None` where there is no area.
///
/// ```
/// use firsthit_geometry::triangle;
/// use glam::DVec3;
/// assert_eq!(triangle::normal([DVec3::ZERO, DVec3::X, DVec3::Y]), Some(DVec3::Z));
/// assert_eq!(triangle::normal([DVec3::ZERO, DVec3::X, DVec3::X * 2.0]), None);
/// ```
#[must_use]
pub fn normal(v: [DVec3; 3]) -> Option<DVec3> {
    // Scaled first: the area of a triangle of size 1e-160 underflows.
    let size = v.iter().map(|p| (*p - v[0]).abs().max_element()).fold(0.0, f64::max);
    let k = 1.0 / size.power_of_two_below();
    let n = area_vector(v.map(|p| (p - v[0]) * k));
    (n != DVec3::ZERO).then(|| n.normalize())
}

/// The ray parameter of a triangle's plane: `n.(v0 - o) / n.d`, in double precision.
///
/// `None` when the triangle has no area or the ray lies parallel to it.
#[inline(always)]
#[must_use]
pub fn plane_parameter(v: [DVec3; 3], origin: DVec3, direction: DVec3) -> Option<f64> {
    let n = area_vector(v);
    // Of the three vertices, the one nearest to the origin cancels least.
    let r = [v[0] - origin, v[1] - origin, v[2] - origin];
    let l = [r[0].length_squared(), r[1].length_squared(), r[2].length_squared()];
    let near = if l[0] <= l[1] && l[0] <= l[2] {
        r[0]
    } else if l[1] <= l[2] {
        r[1]
    } else {
        r[2]
    };
    let t = n.dot(near) / n.dot(direction);
    // 0 / 0 and x / 0: no area, or parallel.
    t.is_finite().then_some(t)
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;
    use proptest::prelude::*;

    fn coordinate() -> impl Strategy<Value = f32> {
        -10.0f32..10.0
    }
    fn point() -> impl Strategy<Value = Vec3> {
        (coordinate(), coordinate(), coordinate()).prop_map(|(x, y, z)| Vec3::new(x, y, z))
    }

    /// The textbook solution of `o + t d = v0 + u e1 + v e2` by Cramer's rule, in double precision.
    fn cramer(v: [Vec3; 3], ray: &Ray<f32>) -> (f64, f64, f64) {
        let [a, b, c] = v.map(|p| p.as_dvec3());
        let (o, d) = (ray.origin.as_dvec3(), ray.direction.as_dvec3());
        let det = |x: DVec3, y: DVec3, z: DVec3| x.dot(y.cross(z));
        let (e1, e2, s) = (b - a, c - a, o - a);
        let m = det(-d, e1, e2);
        (det(s, e1, e2) / m, det(-d, s, e2) / m, det(-d, e1, s) / m)
    }

    proptest! {
        #[test]
        fn all_tiers_agree_with_cramer_off_the_margin(v in [point(), point(), point()], o in point(), d in point()) {
            let ray = Ray::new(o, d);
            let (t, a, b) = cramer(v, &ray);
            let least = a.min(b).min(1.0 - a - b).min(t);
            prop_assume!(least.abs() > 1e-3 && t.abs() < 1e3);
            for p in Precision::ALL {
                let hit = intersect(p, v, &ray);
                prop_assert_eq!(hit.is_some(), least > 0.0, "{}", p);
                if let Some(h) = hit {
                    prop_assert!((f64::from(h.t) - t).abs() <= 1e-3 * (1.0 + t), "{}: {} {}", p, h.t, t);
                    prop_assert!((f64::from(h.u) - a).abs() < 1e-3 && (f64::from(h.v) - b).abs() < 1e-3);
                }
            }
        }

        #[test]
        fn neighbours_leave_no_gap_at_their_edge(v in [point(), point(), point(), point()], s in 0.0f32..=1.0, o in point()) {
            // Two triangles on either side of the edge v0 v1, and a ray aimed at the edge. Seen from o they must lie
            // on different sides, or the edge is a silhouette and a miss is right.
            let [a, b, c, d] = v;
            let target = a + (b - a) * s;
            let ray = Ray::new(o, target - o);
            let side = |p: Vec3| {
                let (o, a, b, p) = (o.as_dvec3(), a.as_dvec3(), b.as_dvec3(), p.as_dvec3());
                (a - o).cross(b - o).dot(p - o)
            };
            prop_assume!(side(c) * side(d) < -1e-3);
            // Away from the ends, where other triangles of a closed mesh would take over.
            prop_assume!((0.01..=0.99).contains(&s));
            for p in [Precision::Robust, Precision::Double] {
                prop_assert!(
                    intersect(p, [a, b, c], &ray).is_some() || intersect(p, [b, a, d], &ray).is_some(),
                    "{}", p
                );
            }
        }

        #[test]
        fn powers_of_two_change_no_digit(v in [point(), point(), point()], o in point(), d in point(), e in -40i32..40) {
            let s = 2.0f32.powi(e);
            let h = watertight(v, &Ray::new(o, d));
            let scaled = watertight(v.map(|p| p * s), &Ray::new(o * s, d * s));
            prop_assert_eq!(h, scaled);
        }
    }

    #[test]
    fn normal_of_a_sliver() {
        // Aspect 1e7: the plain cross product of two long f32 edges would be off by degrees.
        let v = [DVec3::ZERO, DVec3::new(1e7, 1.0, 0.0), DVec3::new(1e7, 0.0, 1.0)];
        let n = normal(v).unwrap();
        let exact = DVec3::new(1.0, -1e7, -1e7) / (2e14f64 + 1.0).sqrt();
        assert!((n - exact).length() < 1e-15 || (n + exact).length() < 1e-15);
    }

    #[test]
    fn no_area_and_parallel_never_hit() {
        for p in Precision::ALL {
            let ray = Ray::new(Vec3::new(0.5, 0.0, 1.0), Vec3::NEG_Z);
            assert_eq!(intersect(p, [Vec3::ZERO, Vec3::X, Vec3::X * 2.0], &ray), None);
            assert_eq!(intersect(p, [Vec3::X; 3], &ray), None);
            let along = Ray::new(Vec3::new(-1.0, 0.25, 0.0), Vec3::X);
            assert_eq!(intersect(p, [Vec3::ZERO, Vec3::X, Vec3::Y], &along), None);
        }
    }

    #[test]
    fn extreme_sizes() {
        for s in [1e-38f32, 1e-30, 1e-15, 1e15, 1e30, 1e38] {
            let v = [Vec3::new(-s, -s, 0.0), Vec3::new(s, -s, 0.0), Vec3::new(0.0, s, 0.0)];
            for p in [Precision::Robust, Precision::Double] {
                let hit = intersect(p, v, &Ray::new(Vec3::new(0.0, 0.0, s), Vec3::new(0.0, 0.0, -s)));
                assert_eq!(hit.map(|h| h.t), Some(1.0), "{p} {s}");
            }
        }
    }

    #[test]
    fn invalid_rays_never_hit() {
        let v = [Vec3::new(-1.0, -1.0, 0.0), Vec3::new(1.0, -1.0, 0.0), Vec3::new(0.0, 1.0, 0.0)];
        let good = Ray::new(Vec3::Z, Vec3::NEG_Z);
        let bad = [
            Ray { origin: Vec3::new(f32::NAN, 0.0, 1.0), ..good },
            Ray { direction: Vec3::ZERO, ..good },
            Ray { direction: Vec3::new(0.0, 0.0, f32::NEG_INFINITY), ..good },
            good.with_interval(2.0, 1.0),
            good.with_interval(f32::NAN, 1.0),
        ];
        for p in Precision::ALL {
            assert!(intersect(p, v, &good).is_some());
            assert!(intersect(p, v, &good.with_interval(1.0, 1.0)).is_some(), "closed interval");
            for ray in &bad {
                assert_eq!(intersect(p, v, ray), None);
            }
        }
    }
}
