//! Disks and annuli.

use super::common::{cast, finite_number, padded, positive, tangents, turn};
use super::exact::{Coordinate, OnPlane, visit_roots};
use super::{ExactVisitor, Plane, Primitive, ShapeError, SurfaceHit};
use crate::exact::number::Number;
use crate::exact::quadratic::Formula;
use crate::{Aabb, Ray, Real, Vector3};

/// The points of a plane whose distance from `center` is between `inner_radius` and `radius`, both included.
///
/// `u` is the angle about the normal as a fraction of a turn, `v` runs from 0 at the inner rim (or centre) to 1 at the
/// outer. A ray in the plane misses the disk.
///
/// Error of `t`: that of [`Plane`]. A hit within some `u (|o - c| + t |d|)` of a rim may be decided wrong.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Disk<R: Real> {
    plane: Plane<R>,
    radius: R,
    inner_radius: R,
}

impl<R: Real> Disk<R> {
    /// A disk, or an annulus when `inner_radius > 0`. The normal need not be unit.
    ///
    /// # Errors
    /// When a number is not finite, the normal is zero, or not `0 <= inner_radius <= radius`, `0 < radius`.
    pub fn new(center: R::Vec3, normal: R::Vec3, radius: R, inner_radius: R) -> Result<Self, ShapeError> {
        let plane = Plane::new(center, normal)?;
        positive("radius", radius)?;
        finite_number("inner radius", inner_radius)?;
        if !(R::ZERO <= inner_radius && inner_radius <= radius) {
            let (expected, value) = ("between 0 and the radius", inner_radius.to_f64());
            return Err(ShapeError::OutOfRange { what: "inner radius", expected, value });
        }
        Ok(Self { plane, radius, inner_radius })
    }

    /// The middle.
    #[must_use]
    pub fn center(&self) -> R::Vec3 {
        self.plane.point()
    }

    /// The unit normal.
    #[must_use]
    pub fn normal(&self) -> R::Vec3 {
        self.plane.normal()
    }

    /// Radius of the outer rim, > 0.
    #[must_use]
    pub fn radius(&self) -> R {
        self.radius
    }

    /// Radius of the hole, 0 where there is none.
    #[must_use]
    pub fn inner_radius(&self) -> R {
        self.inner_radius
    }

    /// The same disk in another arithmetic.
    ///
    /// # Errors
    /// When a parameter leaves the range of `S`.
    pub fn cast<S: Real>(&self) -> Result<Disk<S>, ShapeError> {
        let plane = self.plane.cast::<S>()?;
        let [radius, inner] = [self.radius, self.inner_radius].map(|r| S::from_f64(r.to_f64()));
        let disk = Disk::new(cast::<R, S>(self.center()), plane.normal(), radius, inner)?;
        Ok(Disk { plane, ..disk })
    }

    /// The hit at a point given relative to the centre.
    pub(super) fn hit(&self, t: R, l: R::Vec3) -> SurfaceHit<R> {
        let (tangent, bitangent) = tangents::<R>(self.plane.normal());
        let width = self.radius - self.inner_radius;
        let v = if width > R::ZERO { (l.length() - self.inner_radius) / width } else { R::ZERO };
        let v = v.max(R::ZERO).min(R::ONE);
        SurfaceHit::new(t, turn(l.dot(tangent), l.dot(bitangent)), v, Some(self.plane.normal()))
    }

    /// A point of the ray relative to the centre, moved into the plane.
    fn in_plane(&self, ray: &Ray<R>, t: R) -> R::Vec3 {
        let n = self.plane.normal();
        let l = (ray.origin - self.plane.point()) + ray.direction * t;
        l - n * n.dot(l)
    }

    /// `t` and the hit relative to the centre, moved into the plane exactly.
    fn nearest(&self, ray: &Ray<R>) -> Option<(R, R::Vec3)> {
        let t = self.plane.nearest(ray)?;
        let l = self.in_plane(ray, t);
        // In units of the radius, so that the squares stay in range.
        let scale = R::ONE / self.radius.power_of_two_below();
        let (s, outer, inner) = (l * scale, self.radius * scale, self.inner_radius * scale);
        let s = s.dot(s);
        (inner * inner <= s && s <= outer * outer).then_some((t, l))
    }
}

/// `|p - c|^2 - r^2` at the hit point, times a positive number.
struct Beyond<'a> {
    plane: &'a OnPlane,
    radius: f64,
}

impl Formula for Beyond<'_> {
    fn value<N: Number>(&self, equation: &[N; 3]) -> N {
        let OnPlane { origin, direction, point, .. } = *self.plane;
        let square = |i: usize| {
            Coordinate { origin: origin[i], direction: direction[i], from: point[i] }.value(equation).squared()
        };
        let radius = N::new(self.radius).times(&equation[1].twice());
        square(0).plus(&square(1)).plus(&square(2)).minus(&radius.squared())
    }
}

impl<R: Real> Primitive<R> for Disk<R> {
    fn bounds(&self) -> Aabb<R> {
        // A circle reaches r sqrt(1 - n_i^2) along axis i.
        let n = self.plane.normal();
        let reach = |a: R, b: R| self.radius * (a * a + b * b).sqrt();
        let e = R::Vec3::new(reach(n.y(), n.z()), reach(n.z(), n.x()), reach(n.x(), n.y()));
        let pad = R::Vec3::splat(R::gamma(16) * self.radius);
        padded(Aabb::new(self.center() - e - pad, self.center() + e + pad))
    }

    fn closest_hit(&self, ray: &Ray<R>) -> Option<SurfaceHit<R>> {
        self.nearest(ray).map(|(t, l)| self.hit(t, l))
    }

    fn visit_exact(&self, ray: &Ray<R>, visit: &mut ExactVisitor<'_, R>) -> bool {
        let Some(equation) = self.plane.equation(ray) else { return false };
        let beyond = |radius: R| equation.sign(&Beyond { plane: equation.equation(), radius: radius.to_f64() });
        let admitted = |_| beyond(self.radius) <= 0 && (self.inner_radius == R::ZERO || beyond(self.inner_radius) >= 0);
        visit_roots(&equation, ray, admitted, |t| self.hit(t, self.in_plane(ray, t)), visit)
    }

    fn any_hit(&self, ray: &Ray<R>) -> bool {
        self.nearest(ray).is_some()
    }

    /// Projects along the normal, as for a plane.
    fn refine(&self, point: R::Vec3, _: Option<R::Vec3>) -> (R::Vec3, R) {
        self.plane.project(point)
    }

    fn is_flat(&self) -> bool {
        true
    }
}
