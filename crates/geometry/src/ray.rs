//! The ray.

use crate::{Real, Vector3};

/// `origin + t * direction` for `t` in the closed interval `[t_min, t_max]`.
///
/// The direction need not be unit: `t` counts lengths of the direction. `t_min` may be negative (a line).
///
/// ```
/// use firsthit_geometry::Ray;
/// use glam::DVec3;
/// let ray = Ray::new(DVec3::ZERO, DVec3::new(0.0, 0.0, -2.0));
/// assert_eq!(ray.at(1.5), DVec3::new(0.0, 0.0, -3.0));
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ray<R: Real> {
    /// Where `t` is 0.
    pub origin: R::Vec3,
    /// Direction of growing `t`; any length but zero.
    pub direction: R::Vec3,
    /// Start of the closed interval.
    pub t_min: R,
    /// End of the closed interval; may be infinite.
    pub t_max: R,
}

// The constructors name the vector type `V`, from which the compiler finds `R`.
impl<R: Real> Ray<R> {
    /// The ray over `[0, infinity]`.
    #[inline]
    #[must_use]
    pub fn new<V: Vector3<R>>(origin: V, direction: V) -> Self
    where
        R: Real<Vec3 = V>,
    {
        Self { origin, direction, t_min: R::ZERO, t_max: R::INFINITY }
    }

    /// The same ray over another interval.
    #[inline]
    #[must_use]
    pub fn with_interval(self, t_min: R, t_max: R) -> Self {
        Self { t_min, t_max, ..self }
    }

    /// From one point to another: `t` is 0 at `from` and 1 at `to`, both included.
    #[inline]
    #[must_use]
    pub fn segment<V: Vector3<R>>(from: V, to: V) -> Self
    where
        R: Real<Vec3 = V>,
    {
        Self::new(from, to - from).with_interval(R::ZERO, R::ONE)
    }

    /// The point at `t`. Error: at most `u |o| + 2 u |t d|` in each component.
    #[inline]
    #[must_use]
    pub fn at(&self, t: R) -> R::Vec3 {
        self.origin + self.direction * t
    }

    /// Whether the ray can hit anything: finite origin and direction, a direction other than zero, and a non-empty
    /// interval without NaN. Queries answer "no hit" for a ray that is not valid.
    #[inline]
    #[must_use]
    pub fn is_valid(&self) -> bool {
        self.origin.is_finite()
            && self.direction.is_finite()
            && self.direction != R::Vec3::default()
            && self.t_min <= self.t_max
    }

    /// Whether `t` lies in the closed interval; false for NaN.
    #[inline]
    #[must_use]
    pub fn contains(&self, t: R) -> bool {
        self.t_min <= t && t <= self.t_max
    }

    /// The ray in double precision, exactly.
    #[must_use]
    pub fn to_f64(&self) -> Ray<f64> {
        Ray {
            origin: self.origin.to_f64(),
            direction: self.direction.to_f64(),
            t_min: self.t_min.to_f64(),
            t_max: self.t_max.to_f64(),
        }
    }
}
