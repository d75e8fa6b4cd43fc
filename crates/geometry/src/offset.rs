//! Leaving a surface: where a new ray may start so that it does not hit what it starts from.
//!
//! No epsilon of the scene's: the point moves along the normal by exactly the bound on its own error, and each
//! coordinate then steps to the next value outward (Pharr, Jakob and Humphreys, Physically Based Rendering, 4th ed.,
//! section 6.8.6).

use crate::{Real, Vector3};

/// A point on the same side of the surface as `direction` points to, for every position that `point` may really have.
///
/// `error` bounds the absolute error of `point` in each axis; `normal` is the unit normal.
///
/// ```
/// use firsthit_geometry::offset::leave;
/// use glam::DVec3;
/// let p = leave::<f64>(DVec3::ZERO, DVec3::splat(1e-9), DVec3::Z, DVec3::new(1.0, 0.0, 0.1));
/// assert!(p.z >= 1e-9 && p.z < 1.1e-9 && p.x == 0.0);
/// ```
#[must_use]
pub fn leave<R: Real>(point: R::Vec3, error: R::Vec3, normal: R::Vec3, direction: R::Vec3) -> R::Vec3 {
    let distance = normal.abs().dot(error);
    let side = if direction.dot(normal) < R::ZERO { -R::ONE } else { R::ONE };
    let shift = normal * (side * distance);
    let moved = point + shift;
    let outward = |i: usize| {
        let (x, by) = (moved.axis(i), shift.axis(i));
        if by > R::ZERO {
            x.next_up()
        } else if by < R::ZERO {
            x.next_down()
        } else {
            x
        }
    };
    R::Vec3::new(outward(0), outward(1), outward(2))
}
