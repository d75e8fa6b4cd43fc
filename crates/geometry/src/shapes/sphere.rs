//! Spheres, solved twice: algebraically and geometrically; and exactly.

use glam::DVec3;

use super::common::{balanced, cast, finite, longitude, padded, positive, unit};
use super::exact::visit_roots;
use super::{ExactVisitor, Primitive, ShapeError, SurfaceHit};
use crate::exact::number::{Number, differences, dot, vector};
use crate::exact::quadratic::{Equation, Quadratic};
use crate::quadratic::{first_admitted, roots_of_discriminant};
use crate::{Aabb, Ray, Real, Vector3};

/// All points at `radius` from `center`.
///
/// `u` is the longitude (0..1, counter-clockwise from +X seen from +Y), `v` the latitude (0 at the -Y pole, 1 at the
/// +Y pole). The normal points outward. A ray that starts inside hits the far side.
///
/// Error of `t` (stable form): at most `16 kappa u` relative, where `kappa` is the condition of the root, about
/// `|center - origin| / (half chord)`. A tangent ray keeps only half the digits, whatever the formula.
///
/// ```
/// use firsthit_geometry::{Primitive, Ray, shapes::Sphere};
/// use glam::DVec3;
/// let sphere = Sphere::new(DVec3::ZERO, 1.0)?;
/// let hit = sphere.closest_hit(&Ray::new(DVec3::new(0.0, 0.0, 5.0), DVec3::NEG_Z)).unwrap();
/// assert_eq!((hit.t, hit.normal), (4.0, Some(DVec3::Z)));
/// # Ok::<(), firsthit_geometry::ShapeError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sphere<R: Real> {
    center: R::Vec3,
    radius: R,
}

impl<R: Real> Sphere<R> {
    /// A sphere.
    ///
    /// # Errors
    /// When a number is not finite or the radius is not positive.
    pub fn new(center: R::Vec3, radius: R) -> Result<Self, ShapeError> {
        Ok(Self { center: finite::<R>("center", center)?, radius: positive("radius", radius)? })
    }

    /// The middle.
    #[must_use]
    pub fn center(&self) -> R::Vec3 {
        self.center
    }

    /// Distance of the surface from the middle, > 0.
    #[must_use]
    pub fn radius(&self) -> R {
        self.radius
    }

    /// The same sphere in another arithmetic.
    ///
    /// # Errors
    /// When a parameter leaves the range of `S`.
    pub fn cast<S: Real>(&self) -> Result<Sphere<S>, ShapeError> {
        Sphere::new(cast::<R, S>(self.center), S::from_f64(self.radius.to_f64()))
    }

    /// Where the whole line meets the sphere, ascending: the **algebraic** solution.
    ///
    /// Puts `o + t d` into `|p - c|^2 = r^2` and solves the quadratic `d.d t^2 + 2 L.d t + L.L - r^2 = 0`, `L = o - c`,
    /// with the stable form of the roots. Cheapest (30 flops), but the discriminant subtracts numbers of size
    /// `(L.d)^2`: seen from `L` away, the silhouette is off by about `u (L/r)^2 / 2` radii.
    #[inline]
    #[must_use]
    pub fn roots_algebraic(&self, ray: &Ray<R>) -> Option<[R; 2]> {
        let d = ray.direction;
        let l = ray.origin - self.center;
        let (a, b, c) = (d.dot(d), l.dot(d), l.dot(l) - self.radius * self.radius);
        roots_of_discriminant(a, b, c, b * b - a * c)
    }

    /// Where the whole line meets the sphere, ascending: the **geometric** solution.
    ///
    /// Finds the point of the line nearest to the centre, at the perpendicular vector `f` from it, and half the chord
    /// by Pythagoras: `sqrt((r - |f|)(r + |f|))`. That is the same discriminant without the cancellation: the
    /// silhouette error falls to about `u L/r` radii (Hearn and Baker; Haines et al., *Ray Tracing Gems* ch. 7). The
    /// second root follows from the product of both, `(|L| - r)(|L| + r)`, so that a ray from just off the surface
    /// keeps its digits too. Lengths are scaled by powers of two against overflow and underflow: 43 flops.
    #[inline]
    #[must_use]
    pub fn roots_geometric(&self, ray: &Ray<R>) -> Option<[R; 2]> {
        let l = ray.origin - self.center;
        let length = l.abs().max_element().max(self.radius).power_of_two_below();
        let speed = ray.direction.abs().max_element().power_of_two_below();
        let (l, r, d) = (l * (R::ONE / length), self.radius / length, ray.direction * (R::ONE / speed));

        let (a, b) = (d.dot(d), l.dot(d));
        let f = (l - d * (b / a)).length();
        let chord = a * ((r - f) * (r + f));
        let l = l.length();
        let [t0, t1] = roots_of_discriminant(a, b, (l - r) * (l + r), chord)?;
        let scale = length / speed;
        Some([t0 * scale, t1 * scale])
    }

    pub(super) fn hit(&self, ray: &Ray<R>, t: R) -> SurfaceHit<R> {
        let normal = unit::<R>((ray.origin - self.center) + ray.direction * t);
        let n = normal.unwrap_or_default();
        let latitude = n.y().to_f64().clamp(-1.0, 1.0).asin() / core::f64::consts::PI + 0.5;
        SurfaceHit::new(t, longitude::<R>(n), R::from_f64(latitude), normal)
    }
}

/// `|o + t d - c|^2 = r^2`
struct OnSphere {
    ray: Ray<f64>,
    center: DVec3,
    radius: f64,
}

impl Equation for OnSphere {
    fn coefficients<N: Number>(&self) -> [N; 3] {
        let (l, d) = (differences(self.ray.origin, self.center), vector(self.ray.direction));
        [dot(&d, &d), dot(&l, &d), dot(&l, &l).minus(&N::new(self.radius).squared())]
    }
}

impl<R: Real> Primitive<R> for Sphere<R> {
    fn bounds(&self) -> Aabb<R> {
        let r = R::Vec3::splat(self.radius);
        padded(Aabb::new(self.center - r, self.center + r))
    }

    fn closest_hit(&self, ray: &Ray<R>) -> Option<SurfaceHit<R>> {
        self.nearest(ray).map(|t| self.hit(ray, t))
    }

    fn closest_hit_fast(&self, ray: &Ray<R>) -> Option<SurfaceHit<R>> {
        let t = ray.is_valid().then(|| self.roots_algebraic(ray)).flatten();
        t.and_then(|roots| first_admitted(ray, roots)).map(|t| self.hit(ray, t))
    }

    fn visit_exact(&self, ray: &Ray<R>, visit: &mut ExactVisitor<'_, R>) -> bool {
        if !ray.is_valid() {
            return false;
        }
        let (center, radius) = (self.center.to_f64(), self.radius.to_f64());
        let quadratic = Quadratic::new(OnSphere { ray: ray.to_f64(), center, radius });
        visit_roots(&quadratic, ray, |_| true, |t| self.hit(ray, t), visit)
    }

    fn any_hit(&self, ray: &Ray<R>) -> bool {
        self.nearest(ray).is_some()
    }

    /// Projects along the radius; leaves `gamma(5) r` and the rounding of the coordinates themselves. The centre, where
    /// every direction is as good, stays.
    fn refine(&self, point: R::Vec3, _: Option<R::Vec3>) -> (R::Vec3, R) {
        let l = balanced::<R>(point - self.center);
        let length = l.length();
        if !(length > R::ZERO) {
            return (point, self.radius);
        }
        let p = self.center + l * (self.radius / length);
        (p, R::gamma(12) * self.radius + R::gamma(2) * p.abs().max_element())
    }
}

impl<R: Real> Sphere<R> {
    fn nearest(&self, ray: &Ray<R>) -> Option<R> {
        if !ray.is_valid() {
            return None;
        }
        first_admitted(ray, self.roots_geometric(ray)?)
    }
}
