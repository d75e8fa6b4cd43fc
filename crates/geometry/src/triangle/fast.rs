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
    let inverse = R::ONE / det;
    let s = origin - v[0];
    let u = s.dot(p) * inverse;
    // Written so that NaN (no area, a parallel ray, overflow) is a miss.
    if !(u >= R::ZERO && u <= R::ONE) {
        return None;
    }
    let q = s.cross(e1);
    let v = direction.dot(q) * inverse;
    if !(v >= R::ZERO && u + v <= R::ONE) {
        return None;
    }
    let t = e2.dot(q) * inverse;
    (inverse.is_finite() && t.is_finite()).then_some(TriangleHit { t, u, v })
}
