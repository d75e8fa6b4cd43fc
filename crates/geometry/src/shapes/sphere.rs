//! Spheres.

use super::{Primitive, ShapeError, SurfaceHit};
use crate::{Aabb, Ray, Real, Vector3};

/// All points at `radius` from `center`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sphere<R: Real> {
    /// The middle.
    pub center: R::Vec3,
    /// Distance of the surface from the middle, > 0.
    pub radius: R,
}

impl<R: Real> Sphere<R> {
    /// A sphere.
    ///
    /// # Errors
    /// When a number is not finite or the radius is not positive.
    pub fn new(center: R::Vec3, radius: R) -> Result<Self, ShapeError> {
        if !center.is_finite() {
            return Err(ShapeError::NotFinite { what: "center", value: center.to_f64().element_sum() });
        }
        if !(radius > R::ZERO && radius.is_finite()) {
            return Err(ShapeError::OutOfRange { what: "radius", expected: "> 0 and finite", value: radius.to_f64() });
        }
        Ok(Self { center, radius })
    }
}

impl<R: Real> Primitive<R> for Sphere<R> {
    fn bounds(&self) -> Aabb<R> {
        let r = R::Vec3::splat(self.radius);
        Aabb::new(self.center - r, self.center + r)
    }

    fn closest_hit(&self, ray: &Ray<R>) -> Option<SurfaceHit<R>> {
        if !ray.is_valid() {
            return None;
        }
        let d = ray.direction;
        let l = ray.origin - self.center;
        let (a, b, c) = (d.dot(d), l.dot(d), l.dot(l) - self.radius * self.radius);
        let disc = b * b - a * c;
        if !(disc >= R::ZERO) {
            return None;
        }
        let q = -(b + disc.sqrt().copysign(b));
        let (t0, t1) = (q / a, c / q);
        let (t0, t1) = if t0 <= t1 { (t0, t1) } else { (t1, t0) };
        let t = if ray.contains(t0) { t0 } else { t1 };
        let n = ray.at(t) - self.center;
        let n = n * (R::ONE / n.length());
        ray.contains(t).then_some(SurfaceHit { t, u: R::ZERO, v: R::ZERO, normal: Some(n) })
    }
}
