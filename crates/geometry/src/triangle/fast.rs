//! The short test: Moeller and Trumbore 1997.

use super::TriangleHit;
use crate::{Ray, Real, Vector3};

/// The hit by Moeller and Trumbore's formulas in the arithmetic of `R`: 51 flops and a division.
///
/// Not watertight: two triangles round a shared edge differently, and a ray may slip between them.
#[inline]
#[must_use]
pub fn fast<R: Real>(vertices: [R::Vec3; 3], ray: &Ray<R>) -> Option<TriangleHit<R>> {
    let hit = moeller_trumbore(vertices, ray.origin, ray.direction)?;
    (ray.is_valid() && ray.contains(hit.t)).then_some(hit)
}

/// The same for a finite ray without an interval; `t` may be anything finite.
#[inline(always)]
#[must_use]
pub fn moeller_trumbore<R: Real>(v: [R::Vec3; 3], origin: R::Vec3, direction: R::Vec3) -> Option<TriangleHit<R>> {
    let (e1, e2) = (v[1] - v[0], v[2] - v[0]);
    let p = direction.cross(e2);
    let det = e1.dot(p);
    let s = origin - v[0];
    let q = s.cross(e1);
    // Times the determinant: signs tell, and nothing is divided for triangles that are missed.
    let (u, v, t) = (s.dot(p), direction.dot(q), e2.dot(q));
    let turned = |x: R| if det.is_sign_negative() { -x } else { x };
    // Written so that NaN (overflow) is a miss.
    if !(turned(u) >= R::ZERO && turned(v) >= R::ZERO && turned(u) + turned(v) <= det.abs()) {
        return None;
    }
    let inverse = R::ONE / det;
    let t = t * inverse;
    // No area, or a parallel ray: the reciprocal is infinite. Near overflow it is 0 or has lost digits, and the weights
    // might be above 1.
    let usable = inverse.is_finite() && inverse.abs() >= R::MIN_POSITIVE;
    (usable && t.is_finite()).then_some(TriangleHit { t, u: u * inverse, v: v * inverse })
}
