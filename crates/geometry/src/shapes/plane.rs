//! Infinite planes.

use super::common::{balanced, cast, finite, tangents, unit};
use super::exact::{OnPlane, visit_roots};
use super::{ExactVisitor, Primitive, ShapeError, SurfaceHit};
use crate::exact::quadratic::Quadratic;
use crate::{Aabb, Ray, Real, Vector3};

/// All points `p` with `normal . (p - point) = 0`.
///
/// `u` and `v` are coordinates in the plane, in world units from `point`, along two axes that form a right-handed frame
/// with the normal. A ray in the plane misses it.
///
/// Error of `t`: `16 kappa u` relative, `kappa = sum |n_i d_i| / |n.d|`; a ray that grazes the plane at `1e-7` radians
/// has no digit left in f32.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Plane<R: Real> {
    point: R::Vec3,
    /// The normal as given: dividing by its length would tilt the plane by the rounding.
    given: R::Vec3,
    /// The same but for a power of two, so that products stay in range.
    raw: R::Vec3,
    /// The unit normal.
    normal: R::Vec3,
    /// Whether rays that come from behind (travelling along the normal) pass through.
    pub cull_back: bool,
}

impl<R: Real> Plane<R> {
    /// A plane through `point`, seen from both sides. The normal need not be unit.
    ///
    /// # Errors
    /// When a number is not finite or the normal is zero.
    pub fn new(point: R::Vec3, normal: R::Vec3) -> Result<Self, ShapeError> {
        finite::<R>("point", point)?;
        finite::<R>("normal", normal)?;
        let unit = unit::<R>(normal).ok_or(ShapeError::Degenerate("the normal is zero"))?;
        Ok(Self { point, given: normal, raw: balanced::<R>(normal), normal: unit, cull_back: false })
    }

    /// The same plane with culling of its back side on or off.
    #[must_use]
    pub fn with_culling(self, cull_back: bool) -> Self {
        Self { cull_back, ..self }
    }

    /// A point of the plane.
    #[must_use]
    pub fn point(&self) -> R::Vec3 {
        self.point
    }

    /// The unit normal.
    #[must_use]
    pub fn normal(&self) -> R::Vec3 {
        self.normal
    }

    /// The normal as given.
    pub(super) fn given(&self) -> R::Vec3 {
        self.given
    }

    /// The same plane in another arithmetic.
    ///
    /// # Errors
    /// When a parameter leaves the range of `S`.
    pub fn cast<S: Real>(&self) -> Result<Plane<S>, ShapeError> {
        // The smaller arithmetic may not hold a long or short normal.
        let same = cast::<R, S>(self.given).to_f64() == self.given.to_f64();
        let plane = Plane::new(cast::<R, S>(self.point), cast::<R, S>(if same { self.given } else { self.raw }))?;
        Ok(plane.with_culling(self.cull_back))
    }

    /// Where the whole line meets the plane; `None` when it is parallel to it or comes from a culled side.
    ///
    /// `n.(p - o) / n.d`, with `p - o` first: the stored offset `n.p` of the text-book form loses digits when the
    /// plane is far from the origin.
    #[inline]
    #[must_use]
    pub fn crossing(&self, ray: &Ray<R>) -> Option<R> {
        let slope = self.raw.dot(ray.direction);
        if slope == R::ZERO || (self.cull_back && slope > R::ZERO) {
            return None;
        }
        Some(self.raw.dot(self.point - ray.origin) / slope)
    }

    /// [`Self::crossing`] in the interval of a valid ray.
    #[inline]
    pub(super) fn nearest(&self, ray: &Ray<R>) -> Option<R> {
        if !ray.is_valid() {
            return None;
        }
        self.crossing(ray).filter(|&t| ray.contains(t) && t.is_finite())
    }

    pub(super) fn hit(&self, ray: &Ray<R>, t: R) -> SurfaceHit<R> {
        let l = (ray.origin - self.point) + ray.direction * t;
        let (tangent, bitangent) = tangents::<R>(self.normal);
        SurfaceHit::new(t, l.dot(tangent), l.dot(bitangent), Some(self.normal))
    }

    /// The exact equation along a valid ray; `None` for a ray that comes from a culled side.
    pub(super) fn equation(&self, ray: &Ray<R>) -> Option<Quadratic<OnPlane>> {
        let Ray { origin, direction, .. } = ray.to_f64();
        let equation = OnPlane { origin, direction, point: self.point.to_f64(), normal: self.given.to_f64() };
        let equation = ray.is_valid().then(|| Quadratic::new(equation))?;
        (!self.cull_back || equation.slope() <= 0).then_some(equation)
    }

    /// Projects a point onto the plane; see [`Primitive::refine`].
    pub(super) fn project(&self, point: R::Vec3) -> (R::Vec3, R) {
        let l = point - self.point;
        let p = point - self.normal * self.normal.dot(l);
        // 3 units of |l| from the normal and the inner product, 3 from the next test, 2 from the coordinates.
        let error = R::gamma(16) * l.abs().max_element() + R::gamma(3) * p.abs().max_element();
        (p, error.max(R::MIN_POSITIVE))
    }
}

impl<R: Real> Primitive<R> for Plane<R> {
    fn bounds(&self) -> Aabb<R> {
        Aabb::infinite()
    }

    fn closest_hit(&self, ray: &Ray<R>) -> Option<SurfaceHit<R>> {
        self.nearest(ray).map(|t| self.hit(ray, t))
    }

    fn visit_exact(&self, ray: &Ray<R>, visit: &mut ExactVisitor<'_, R>) -> bool {
        let Some(equation) = self.equation(ray) else { return false };
        visit_roots(&equation, ray, |_| true, |t| self.hit(ray, t), visit)
    }

    fn any_hit(&self, ray: &Ray<R>) -> bool {
        self.nearest(ray).is_some()
    }

    /// Projects along the normal; leaves some units of the distance from `point` and of the coordinates.
    fn refine(&self, point: R::Vec3, _: Option<R::Vec3>) -> (R::Vec3, R) {
        self.project(point)
    }

    fn is_flat(&self) -> bool {
        true
    }
}
