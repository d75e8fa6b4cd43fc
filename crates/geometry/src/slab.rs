//! Ray against axis-aligned box: the slab test, plain and padded.
//!
//! Planes are chosen by the *sign bit* of the direction, so that -0.0 picks the right one; reciprocals may be infinite;
//! NaN (an origin on a plane that the ray is parallel to) is dropped by the minima and maxima, which makes it "inside",
//! as is right for a closed box.

use crate::{Aabb, Ray, Real, Vector3};

/// What the slab test needs to know of a ray: made once per ray.
#[derive(Clone, Copy, Debug)]
pub struct Slabs<R: Real> {
    /// Subtracted from the planes where the ray enters.
    pub near_origin: R::Vec3,
    /// Subtracted from the planes where the ray leaves.
    pub far_origin: R::Vec3,
    /// Reciprocal of the direction; may be infinite.
    pub inverse: R::Vec3,
    /// Sign bits of the direction.
    pub negative: [bool; 3],
}

impl<R: Real> Slabs<R> {
    /// Setup for a ray.
    #[inline]
    #[must_use]
    pub fn new(origin: R::Vec3, direction: R::Vec3) -> Self {
        let d = direction;
        Self {
            near_origin: origin,
            far_origin: origin,
            inverse: R::Vec3::new(R::ONE / d.x(), R::ONE / d.y(), R::ONE / d.z()),
            negative: [d.x().is_sign_negative(), d.y().is_sign_negative(), d.z().is_sign_negative()],
        }
    }

    /// The same for a ray that is known only to within `delta` (>= 0) in each axis: every box is met as if it were
    /// larger by `delta` on each side.
    #[inline]
    #[must_use]
    pub fn widened(self, delta: R::Vec3) -> Self {
        let signed = |i: usize| if self.negative[i] { -delta.axis(i) } else { delta.axis(i) };
        let s = R::Vec3::new(signed(0), signed(1), signed(2));
        Self { near_origin: self.near_origin + s, far_origin: self.far_origin - s, ..self }
    }

    /// Where the ray enters and leaves the box, within `[t_min, t_max]`; it misses unless enter <= leave. Each has at
    /// most three roundings.
    #[inline(always)]
    #[must_use]
    pub fn interval(&self, aabb: &Aabb<R>, t_min: R, t_max: R) -> (R, R) {
        let (mut enter, mut leave) = (t_min, t_max);
        for i in 0..3 {
            let (near, far) = if self.negative[i] { (aabb.max, aabb.min) } else { (aabb.min, aabb.max) };
            let inverse = self.inverse.axis(i);
            // The operand that may be NaN is the argument: `max` and `min` drop it.
            enter = enter.max((near.axis(i) - self.near_origin.axis(i)) * inverse);
            leave = leave.min((far.axis(i) - self.far_origin.axis(i)) * inverse);
        }
        (enter, leave)
    }

    /// As [`Slabs::interval`], with the far end moved outward by twice the error of three roundings (Ize, "Robust BVH
    /// Ray Traversal", JCGT 2(2) 2013): a box that the ray meets is never missed. The ends may be off by that much.
    #[inline(always)]
    #[must_use]
    pub fn padded(&self, aabb: &Aabb<R>, t_min: R, t_max: R) -> (R, R) {
        let (enter, leave) = self.interval(aabb, t_min, R::INFINITY);
        // A positive end grows by the larger factor, a negative one by the smaller.
        (enter, (leave * (R::ONE + pad())).max(leave * (R::ONE - pad())).min(t_max))
    }
}

/// `2 gamma(3)`, and one more for the padding itself.
#[inline(always)]
fn pad<R: Real>() -> R {
    R::TWO * R::gamma(4)
}

/// Where a ray enters and leaves a closed box, within its interval: the plain test, which may lose a ray that touches
/// the box. Empty boxes (`min > max`) and invalid rays miss.
///
/// ```
/// use firsthit_geometry::{Aabb, Ray, slab};
/// use glam::Vec3;
/// let cube = Aabb::new(Vec3::ZERO, Vec3::ONE);
/// let ray = Ray::new(Vec3::new(-2.0, 0.0, 0.5), Vec3::X); // along a face
/// assert_eq!(slab::plain(&cube, &ray), Some((2.0, 3.0)));
/// ```
#[must_use]
pub fn plain<R: Real>(aabb: &Aabb<R>, ray: &Ray<R>) -> Option<(R, R)> {
    checked(aabb, ray, Slabs::interval)
}

/// The padded test: never misses a box that the ray meets, even when it only touches it. May report a box that the ray
/// passes within rounding.
#[must_use]
pub fn padded<R: Real>(aabb: &Aabb<R>, ray: &Ray<R>) -> Option<(R, R)> {
    checked(aabb, ray, Slabs::padded)
}

fn checked<R: Real>(
    aabb: &Aabb<R>,
    ray: &Ray<R>,
    test: impl Fn(&Slabs<R>, &Aabb<R>, R, R) -> (R, R),
) -> Option<(R, R)> {
    if !ray.is_valid() || aabb.is_empty() {
        return None;
    }
    let (enter, leave) = test(&Slabs::new(ray.origin, ray.direction), aabb, ray.t_min, ray.t_max);
    (enter <= leave).then_some((enter, leave))
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;
    use proptest::prelude::*;

    const CUBE: Aabb<f32> = Aabb { min: Vec3::NEG_ONE, max: Vec3::ONE };

    #[test]
    fn zero_components_of_either_sign() {
        for zero in [0.0, -0.0] {
            for (y, expected) in [(0.0, true), (1.0, true), (-1.0, true), (1.5, false), (-1.5, false)] {
                let ray = Ray::new(Vec3::new(-3.0, y, 0.0), Vec3::new(1.0, zero, zero));
                assert_eq!(plain(&CUBE, &ray).is_some(), expected, "{y} {zero}");
                assert_eq!(padded(&CUBE, &ray).is_some(), expected, "{y} {zero}");
            }
        }
    }

    #[test]
    fn empty_infinite_and_flat_boxes() {
        let ray = Ray::new(Vec3::new(-3.0, 0.5, 0.0), Vec3::X);
        assert_eq!(padded(&Aabb::empty(), &ray), None);
        assert_eq!(padded(&Aabb::new(Vec3::ONE, Vec3::NEG_ONE), &ray), None);
        assert_eq!(plain(&Aabb::infinite(), &ray), Some((0.0, f32::INFINITY)));
        let flat = Aabb::new(Vec3::new(0.0, -1.0, -1.0), Vec3::new(0.0, 1.0, 1.0));
        assert_eq!(plain(&flat, &ray), Some((3.0, 3.0)));
    }

    #[test]
    fn lines_reach_backwards() {
        let line = Ray::new(Vec3::new(5.0, 0.0, 0.0), Vec3::X).with_interval(f32::NEG_INFINITY, 0.0);
        assert_eq!(plain(&CUBE, &line), Some((-6.0, -4.0)));
        let (_, leave) = padded(&CUBE, &line).unwrap();
        assert!(leave >= -4.0);
    }

    proptest! {
        /// Rays aimed at a point of the box in exact arithmetic: the padded test may not lose one, at any distance.
        #[test]
        fn padded_never_misses(
            lo in [-8i32..8, -8i32..8, -8i32..8], size in [0i32..8, 0i32..8, 0i32..8],
            pick in [0i32..=4, 0i32..=4, 0i32..=4], o in [-99i32..99, -99i32..99, -99i32..99], scale in -20i32..20,
        ) {
            // Integers: the target is on o + 1 * d exactly.
            let s = 2.0f32.powi(scale) / 3.0;
            let v = |a: [i32; 3]| Vec3::new(a[0] as f32, a[1] as f32, a[2] as f32);
            let (lo, size, o) = (v(lo) * 4.0, v(size) * 4.0, v(o));
            let target = lo + size * v(pick) / 4.0;
            prop_assume!(target != o);
            let aabb = Aabb::new(lo, lo + size);
            let d = target - o;
            // A direction of another length is rounded; recompute the truth by moving the box by less than its rounding.
            prop_assert!(padded(&aabb, &Ray::new(o, d)).is_some());
            let exact = Ray::new(o.as_dvec3(), d.as_dvec3() * f64::from(s));
            let wide = Aabb::new(aabb.min.as_dvec3(), aabb.max.as_dvec3());
            prop_assert!(padded(&wide, &exact).is_some());
        }
    }
}
