//! Affine transforms in double precision with their inverse and their errors.

use glam::{DAffine3, DMat3, DVec3};

use crate::{Aabb, Ray, Real};

/// The largest condition number of a usable transform: past it a round trip through the inverse leaves fewer digits
/// than `f32` has.
pub const MAX_CONDITION: f64 = (1u64 << 20) as f64;

/// A transform that cannot be used.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum TransformError {
    /// A coefficient is NaN or infinite.
    #[error("the transform is not finite")]
    NotFinite,
    /// It maps space onto a plane, line or point.
    #[error("the transform is singular")]
    Singular,
    /// Its inverse would lose too many digits.
    #[error("the transform's condition number is {condition:.3e}, above {MAX_CONDITION:.3e}")]
    IllConditioned {
        /// Ratio of the largest to the smallest stretch.
        condition: f64,
    },
}

/// An invertible affine map `x -> linear * x + translation`, from an object's space to the world.
///
/// ```
/// use firsthit_geometry::{Ray, transform::Transform};
/// use glam::{DAffine3, DVec3};
///
/// let placed = Transform::new(DAffine3::from_scale_rotation_translation(
///     DVec3::splat(2.0), Default::default(), DVec3::new(1e7, 0.0, 0.0)))?;
/// let local = placed.ray_to_object(&Ray::new(DVec3::new(1e7 + 4.0, 0.0, 0.0), DVec3::NEG_X));
/// assert_eq!(local.origin, DVec3::new(2.0, 0.0, 0.0));
/// assert_eq!(local.at(1.0) * 2.0, DVec3::new(3.0, 0.0, 0.0)); // t means the same on both sides
/// # Ok::<(), firsthit_geometry::transform::TransformError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Transform {
    linear: DMat3,
    translation: DVec3,
    inverse: DMat3,
    normal: DMat3,
    /// See [`Transform::longest_preimage`].
    longest_preimage: f64,
    mirrors: bool,
    /// The linear part is a multiple of the identity, as that of most meshes: worth a test for every ray.
    uniform: bool,
}

impl Transform {
    /// Checks and inverts.
    ///
    /// # Errors
    /// When the map is not finite, singular, or has a condition number (in the 2-norm) above [`MAX_CONDITION`].
    pub fn new(m: DAffine3) -> Result<Self, TransformError> {
        if !(m.matrix3.is_finite() && m.translation.is_finite()) {
            return Err(TransformError::NotFinite);
        }
        // A power of two taken out keeps determinants of tiny and huge scales from under- and overflowing.
        let k = largest(&m.matrix3).power_of_two_below();
        let unit = m.matrix3 * (1.0 / k);
        let cofactor = cofactor(unit);
        let det = unit.x_axis.dot(cofactor.x_axis);
        if !(det != 0.0 && det.is_finite()) {
            return Err(TransformError::Singular);
        }
        let inverse = cofactor.transpose() * (1.0 / det);
        let stretch = norm(inverse);
        let condition = norm(unit) * stretch;
        if !inverse.is_finite() || !(condition <= MAX_CONDITION * (1.0 + 1e-9)) {
            return Err(TransformError::IllConditioned { condition });
        }
        // The inverse transpose up to a positive factor: it keeps the outside outside when the map mirrors.
        let normal = cofactor * det.signum();
        let uniform = m.matrix3 == DMat3::IDENTITY * m.matrix3.x_axis.x;
        let (linear, inverse) = (m.matrix3, inverse * (1.0 / k));
        let longest_preimage = stretch / k * (1.0 + 1e-6);
        Ok(Self { linear, translation: m.translation, inverse, normal, longest_preimage, mirrors: det < 0.0, uniform })
    }

    /// The linear part.
    #[must_use]
    pub fn linear(&self) -> DMat3 {
        self.linear
    }

    /// Whether left becomes right: the determinant is negative.
    #[must_use]
    pub fn mirrors(&self) -> bool {
        self.mirrors
    }

    /// Whether the linear part is a multiple of the identity.
    #[must_use]
    pub fn is_uniform(&self) -> bool {
        self.uniform
    }

    /// The inverse of the linear part.
    #[must_use]
    pub fn inverse_linear(&self) -> DMat3 {
        self.inverse
    }

    /// What normals are multiplied with, before they are made unit: the inverse transpose of the linear part, up to a
    /// positive factor.
    #[must_use]
    pub fn normal_linear(&self) -> DMat3 {
        self.normal
    }

    /// Where the object's origin lies in the world.
    #[must_use]
    pub fn translation(&self) -> DVec3 {
        self.translation
    }

    /// The same transform for an object measured in units of `s`, a power of two: exact.
    #[must_use]
    pub fn with_object_scale(&self, s: f64) -> Self {
        let longest_preimage = self.longest_preimage / s;
        Self { linear: self.linear * s, inverse: self.inverse * (1.0 / s), longest_preimage, ..*self }
    }

    /// How long a vector of the object's space may be, of those that are as long as 1 in the world: the 2-norm of the
    /// inverse, rounded up.
    #[must_use]
    pub fn longest_preimage(&self) -> f64 {
        self.longest_preimage
    }

    /// A point to the world. Error: see [`Transform::point_error`].
    #[inline]
    #[must_use]
    pub fn point(&self, p: DVec3) -> DVec3 {
        self.linear * p + self.translation
    }

    /// A direction to the world.
    #[inline]
    #[must_use]
    pub fn vector(&self, v: DVec3) -> DVec3 {
        self.linear * v
    }

    /// A normal to the world, unit: the outside of a surface stays its outside, also when the transform mirrors.
    #[inline]
    #[must_use]
    pub fn normal(&self, n: DVec3) -> DVec3 {
        self.normal_direction(n).normalize_or_zero()
    }

    /// The same, of any length.
    #[inline]
    #[must_use]
    pub fn normal_direction(&self, n: DVec3) -> DVec3 {
        if self.uniform { n * self.normal.x_axis.x } else { self.normal * n }
    }

    /// A point of the world in the object's space. The translation is subtracted first, where nearby points cancel
    /// exactly, so an object far from the world's origin is as sharp as one at it.
    #[inline]
    #[must_use]
    pub fn point_to_object(&self, p: DVec3) -> DVec3 {
        self.vector_to_object(p - self.translation)
    }

    /// A direction of the world in the object's space, not normalised.
    #[inline]
    #[must_use]
    pub fn vector_to_object(&self, v: DVec3) -> DVec3 {
        if self.uniform { v * self.inverse.x_axis.x } else { self.inverse * v }
    }

    /// A ray of the world in the object's space; `t` keeps its meaning.
    #[inline]
    #[must_use]
    pub fn ray_to_object(&self, ray: &Ray<f64>) -> Ray<f64> {
        Ray {
            origin: self.point_to_object(ray.origin),
            direction: self.vector_to_object(ray.direction),
            t_min: ray.t_min,
            t_max: ray.t_max,
        }
    }

    /// Bound on the absolute error of [`Transform::point`] in each axis, for a point that itself is known to within
    /// `error`.
    #[must_use]
    pub fn point_error(&self, p: DVec3, error: DVec3) -> DVec3 {
        let m = self.linear.abs();
        let g = gamma(4);
        m * error * (1.0 + g) + (m * p.abs() + self.translation.abs()) * g
    }

    /// Bound on the absolute error of [`Transform::point_to_object`] in each axis, without the error of the inverse
    /// itself (a fixed bijection that all rays undergo alike).
    #[must_use]
    pub fn point_to_object_error(&self, p: DVec3) -> DVec3 {
        let from = p - self.translation;
        self.inverse.abs() * (from.abs() * gamma(4))
    }

    /// Bound on how far, in each axis and relative to the distance from the origin of the object, a point is off in the
    /// world when a number of its image in the object's space is off by `64 u` of the largest. The inverse's own error is
    /// included: in contrast to [`Transform::point_to_object_error`] this compares with what [`Transform::point`] maps.
    #[must_use]
    pub fn round_trip(&self) -> f64 {
        let rows = |m: DMat3| (m.x_axis.abs() + m.y_axis.abs() + m.z_axis.abs()).max_element();
        rows(self.linear * self.inverse - DMat3::IDENTITY) + rows(self.linear) * rows(self.inverse) * gamma(72)
    }

    /// A box in the world around the image of `aabb`, padded for every rounding. Infinite boxes stay infinite, empty
    /// ones empty.
    #[must_use]
    pub fn aabb(&self, aabb: &Aabb<f64>) -> Aabb<f64> {
        if aabb.is_empty() {
            return Aabb::empty();
        }
        if !aabb.is_finite() {
            return Aabb::infinite();
        }
        let center = aabb.center();
        let half = (aabb.max - center).max(center - aabb.min);
        let c = self.point(center);
        let h = self.linear.abs() * half;
        let pad = self.point_error(aabb.min.abs().max(aabb.max.abs()), DVec3::ZERO) * 2.0 + h * gamma(8);
        Aabb::new(c - h - pad, c + h + pad)
    }
}

/// By how much a map that keeps angles makes everything longer; `None` for other maps. Some roundings are let pass.
#[must_use]
pub fn similarity(linear: &DMat3) -> Option<f64> {
    let k = largest(linear).power_of_two_below();
    let m = *linear * (1.0 / k);
    let squares = m.transpose() * m;
    let square = (squares.x_axis.x + squares.y_axis.y + squares.z_axis.z) / 3.0;
    let off = squares - DMat3::from_diagonal(DVec3::splat(square));
    (largest(&off) <= square * (16.0 * f64::EPSILON)).then(|| square.sqrt() * k)
}

/// The largest component by magnitude.
pub(crate) fn largest(m: &DMat3) -> f64 {
    m.to_cols_array().into_iter().fold(0.0, |largest, x| x.abs().max(largest))
}

/// `n` roundings. (Named in full: std will have a `f64::gamma` of another meaning.)
fn gamma(n: u32) -> f64 {
    <f64 as Real>::gamma(n)
}

/// Matrix of cofactors: maps the cross product of two vectors to that of their images.
fn cofactor(m: DMat3) -> DMat3 {
    DMat3::from_cols(m.y_axis.cross(m.z_axis), m.z_axis.cross(m.x_axis), m.x_axis.cross(m.y_axis))
}

/// Largest stretch of a matrix: root of the largest eigenvalue of `m^T m`, in closed form (Smith 1961).
fn norm(m: DMat3) -> f64 {
    let s = m.transpose() * m;
    let mean = (s.x_axis.x + s.y_axis.y + s.z_axis.z) / 3.0;
    let d = s - DMat3::from_diagonal(DVec3::splat(mean));
    let p = (d.to_cols_array().iter().map(|x| x * x).sum::<f64>() / 6.0).sqrt();
    if p == 0.0 {
        return mean.sqrt();
    }
    let r = ((d * (1.0 / p)).determinant() / 2.0).clamp(-1.0, 1.0);
    (mean + 2.0 * p * (r.acos() / 3.0).cos()).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn number() -> impl Strategy<Value = f64> {
        -3.0..3.0f64
    }
    fn vector() -> impl Strategy<Value = DVec3> {
        (number(), number(), number()).prop_map(|(x, y, z)| DVec3::new(x, y, z))
    }

    #[test]
    fn condition_is_that_of_the_two_norm() {
        for (scale, good) in [
            (DVec3::new(1e-3, 1e3, 1e3), true),
            (DVec3::new(1e-3, -1.0, 1e3), true),
            (DVec3::splat(1e-30), true),
            (DVec3::splat(1e30), true),
            (DVec3::new(1.0, 1.0, 2e6), false),
            (DVec3::new(1.0, 1.0, 0.0), false),
            (DVec3::ZERO, false),
            (DVec3::new(1.0, f64::NAN, 1.0), false),
        ] {
            let turned = DAffine3::from_axis_angle(DVec3::new(1.0, 2.0, 3.0).normalize(), 0.7);
            for m in [DAffine3::from_scale(scale), turned * DAffine3::from_scale(scale) * turned] {
                assert_eq!(Transform::new(m).is_ok(), good, "{scale}");
            }
        }
        assert_eq!(Transform::new(DAffine3::from_scale(DVec3::ZERO)), Err(TransformError::Singular));
    }

    #[test]
    fn a_mirrored_outside_stays_outside() {
        let t = Transform::new(DAffine3::from_scale(DVec3::new(-1.0, 1.0, 1.0))).unwrap();
        assert_eq!(t.normal(DVec3::X), DVec3::NEG_X);
        assert_eq!(t.normal(DVec3::Y), DVec3::Y);
    }

    proptest! {
        #[test]
        fn box_holds_the_image(a in vector(), b in vector(), c in vector(), at in vector(),
                               p in vector(), q in vector(), s in 0.0..=1.0f64, r in 0.0..=1.0f64) {
            let m = DAffine3 { matrix3: DMat3::from_cols(a, b, c), translation: at * 1e6 };
            let t = Transform::new(m);
            prop_assume!(t.is_ok());
            let t = t.unwrap();
            let aabb = Aabb::from_points([p, q]);
            let inside = aabb.min + (aabb.max - aabb.min) * DVec3::new(s, r, s * r);
            prop_assert!(t.aabb(&aabb).contains(t.point(inside)));
        }

        #[test]
        fn normals_stay_perpendicular(a in vector(), b in vector(), c in vector(), p in vector(), q in vector()) {
            let t = Transform::new(DAffine3::from_mat3(DMat3::from_cols(a, b, c)));
            prop_assume!(t.is_ok() && p.cross(q).length() > 1e-3);
            let t = t.unwrap();
            let n = t.normal(p.cross(q));
            prop_assume!(norm(t.linear()) * norm(t.inverse) < 1e4);
            prop_assert!((n.length() - 1.0).abs() < 1e-14);
            prop_assert!(n.dot(t.vector(p)).abs() < 1e-9 * t.vector(p).length());
        }

        #[test]
        fn round_trip(a in vector(), b in vector(), c in vector(), p in vector()) {
            let t = Transform::new(DAffine3 { matrix3: DMat3::from_cols(a, b, c), translation: p * 100.0 });
            prop_assume!(t.is_ok());
            let t = t.unwrap();
            let condition = norm(t.linear()) * norm(t.inverse);
            prop_assert!((t.point_to_object(t.point(p)) - p).length() < 1e-12 * condition * (1.0 + 300.0 * norm(t.inverse)));
        }
    }
}
