//! Real roots of quadratics, without cancellation.

use crate::{Ray, Real};

/// The real roots of `a t^2 + 2 b t + c = 0` in ascending order, equal where there is only one.
///
/// `b` is *half* the linear coefficient. `None` when there is no real root, when every `t` is a root (all
/// coefficients zero) and when a coefficient is NaN. With `a = 0` the equation is linear. A root may be infinite
/// when `a` is tiny.
///
/// The text-book `(-b +- sqrt(b^2 - a c)) / a` subtracts nearly equal numbers when `a c` is small against `b^2`, and
/// divides by zero when `a` is. Here the two addends have the same sign: `q = -(b + sign(b) sqrt(b^2 - a c))`, and the
/// roots are `q / a` and `c / q` (Higham, *Accuracy and Stability of Numerical Algorithms*, section 1.8).
///
/// ```
/// use firsthit_geometry::quadratic::roots;
/// // t^2 - 2e8 t + 1: the text-book form finds 0 for the small root.
/// let [small, large] = roots(1.0_f64, -1e8, 1.0).unwrap();
/// assert_eq!([small, large], [5e-9, 2e8]);
/// ```
#[inline]
#[must_use]
pub fn roots<R: Real>(a: R, b: R, c: R) -> Option<[R; 2]> {
    roots_of_discriminant(a, b, c, b * b - a * c)
}

/// [`roots`] with the quarter discriminant `b^2 - a c` given, for callers that know it better than by this formula.
#[inline]
#[must_use]
pub fn roots_of_discriminant<R: Real>(a: R, b: R, c: R, discriminant: R) -> Option<[R; 2]> {
    if a == R::ZERO {
        let t = -c / (R::TWO * b);
        return (b != R::ZERO && !t.is_nan()).then_some([t, t]);
    }
    if !(discriminant >= R::ZERO) {
        return None;
    }
    let q = -(b + discriminant.sqrt().copysign(b));
    if q == R::ZERO {
        // Only when b and the discriminant are zero: a double root at zero.
        return Some([R::ZERO; 2]);
    }
    let (s, t) = (q / a, c / q);
    Some(if s <= t { [s, t] } else { [t, s] })
}

/// The smallest of some ascending values that is finite and in the ray's closed interval.
#[inline]
pub(crate) fn first_admitted<R: Real>(ray: &Ray<R>, ascending: [R; 2]) -> Option<R> {
    ascending.into_iter().find(|&t| ray.contains(t) && t.is_finite())
}

#[cfg(test)]
mod tests {
    use super::roots;
    use proptest::prelude::*;

    #[test]
    fn linear_and_empty_equations() {
        assert_eq!(roots(0.0, 1.0, 4.0), Some([-2.0, -2.0]));
        assert_eq!(roots(0.0, 0.0, 4.0), None);
        assert_eq!(roots(0.0, 0.0, 0.0), None);
        assert_eq!(roots(1.0, 0.0, 1.0), None);
        assert_eq!(roots(f64::NAN, 1.0, 1.0), None);
        assert_eq!(roots(0.0, 1.0, f64::NAN), None);
        assert_eq!(roots(1.0, 0.0, 0.0), Some([0.0, 0.0]));
    }

    #[test]
    fn opposite_sign_of_the_leading_coefficient_keeps_the_order() {
        let [a, b] = roots(-1.0, 2.0, 5.0).unwrap();
        assert!(a < b);
    }

    proptest! {
        /// Roots are chosen first, so the answer is known. The error of a root is that of the coefficients
        /// (3 roundings each), amplified by the distance of the roots.
        #[test]
        fn finds_the_roots_it_was_made_from(a in -1e3..1e3_f64, r in -1e6..1e6_f64, s in -1e6..1e6_f64) {
            prop_assume!(a != 0.0 && r != s);
            let (lo, hi) = (r.min(s), r.max(s));
            let [t0, t1] = roots(a, -a * (r + s) / 2.0, a * r * s).unwrap_or([(r + s) / 2.0; 2]);
            let bound = 32.0 * f64::EPSILON * (r.abs() + s.abs()) * (r.abs() + s.abs()) / (hi - lo);
            prop_assert!((t0 - lo).abs() <= bound && (t1 - hi).abs() <= bound, "{t0} {lo} {t1} {hi}");
        }
    }
}
