//! What several shapes share: validation, unit vectors, frames, padding of bounds.

use super::ShapeError;
use crate::{Aabb, Real, Vector3};

/// `v`, if all its components are finite.
pub(super) fn finite<R: Real>(what: &'static str, v: R::Vec3) -> Result<R::Vec3, ShapeError> {
    let bad = (0..3).map(|i| v.axis(i)).find(|x| !x.is_finite());
    bad.map_or(Ok(v), |x| Err(ShapeError::NotFinite { what, value: x.to_f64() }))
}

/// `x`, if it is finite.
pub(super) fn finite_number<R: Real>(what: &'static str, x: R) -> Result<R, ShapeError> {
    if x.is_finite() { Ok(x) } else { Err(ShapeError::NotFinite { what, value: x.to_f64() }) }
}

/// `x`, if it is positive and finite.
pub(super) fn positive<R: Real>(what: &'static str, x: R) -> Result<R, ShapeError> {
    finite_number(what, x)?;
    if x > R::ZERO { Ok(x) } else { Err(ShapeError::OutOfRange { what, expected: "> 0", value: x.to_f64() }) }
}

/// `v` scaled by a power of two so that its largest component is about 1: products of such vectors neither overflow
/// nor underflow. Zero stays zero.
pub(super) fn balanced<R: Real>(v: R::Vec3) -> R::Vec3 {
    // Twice, since one scale reaches only half the exponent range.
    let once = |v: R::Vec3| v * (R::ONE / v.abs().max_element().power_of_two_below());
    once(once(v))
}

/// `v / |v|`, computed in f64 and rounded once. `None` for zero, infinite or NaN vectors.
pub(super) fn unit<R: Real>(v: R::Vec3) -> Option<R::Vec3> {
    let v = balanced::<f64>(v.to_f64());
    let length = v.length();
    (length > 0.0 && length.is_finite()).then(|| R::Vec3::from_f64(v / length))
}

/// Two unit vectors that complete the unit vector `n` to a right-handed frame `(tangent, bitangent, n)`
/// (Duff et al., *Building an Orthonormal Basis, Revisited*, JCGT 6(1), 2017).
pub(super) fn tangents<R: Real>(n: R::Vec3) -> (R::Vec3, R::Vec3) {
    let (x, y, z) = (n.x(), n.y(), n.z());
    let sign = R::ONE.copysign(z);
    let a = -R::ONE / (sign + z);
    let b = x * y * a;
    (R::Vec3::new(R::ONE + sign * x * x * a, sign * b, -sign * x), R::Vec3::new(b, sign + y * y * a, -y))
}

/// The angle of `(x, y)` as a fraction of a turn, in [0, 1), counter-clockwise from the x axis.
pub(super) fn turn<R: Real>(x: R, y: R) -> R {
    let turns = y.to_f64().atan2(x.to_f64()) / core::f64::consts::TAU;
    let turns = R::from_f64(if turns < 0.0 { turns + 1.0 } else { turns });
    if turns < R::ONE { turns } else { R::ZERO }
}

/// Longitude about the +Y axis as a fraction of a turn, in [0, 1): counter-clockwise from +X seen from +Y.
pub(super) fn longitude<R: Real>(p: R::Vec3) -> R {
    turn(p.x(), -p.z())
}

/// `bounds` grown by the error of a computed hit point, 16 units of its largest coordinates.
pub(super) fn padded<R: Real>(bounds: Aabb<R>) -> Aabb<R> {
    if bounds.is_empty() {
        return bounds;
    }
    let pad = |x: R| if x.is_finite() { R::gamma(16) * x } else { R::ZERO };
    let m = bounds.min.abs().max(bounds.max.abs());
    let e = R::Vec3::new(pad(m.x()), pad(m.y()), pad(m.z()));
    Aabb::new(bounds.min - e, bounds.max + e)
}

/// `v` in another arithmetic, each component rounded to nearest.
pub(super) fn cast<R: Real, S: Real>(v: R::Vec3) -> S::Vec3 {
    S::Vec3::from_f64(v.to_f64())
}
