//! Error-free and error-bounded arithmetic.

use crate::Real;

/// `a * b - c * d` in double precision with the right sign, and 0 only where it is 0 (barring under- and overflow).
///
/// Products of `f32` are exact in `f64`; for `f64` the rounding errors of the two products are recovered by fused
/// multiply-adds and added back (Kahan; Jeannerod, Louvet and Muller 2013). Meant for rare fallbacks: on targets
/// without a hardware FMA `mul_add` is slow, though right.
///
/// ```
/// use firsthit_geometry::error::difference_of_products;
/// // In f32 both products round to the same value; their difference does not vanish.
/// let a = 1.0 + f32::EPSILON;
/// assert_eq!(a * a - (1.0 + 2.0 * f32::EPSILON) * 1.0, 0.0);
/// assert!(difference_of_products(a, a, 1.0 + 2.0 * f32::EPSILON, 1.0) > 0.0);
/// ```
#[must_use]
pub fn difference_of_products<R: Real>(a: R, b: R, c: R, d: R) -> f64 {
    let (a, b, c, d) = (a.to_f64(), b.to_f64(), c.to_f64(), d.to_f64());
    let (p, q) = (a * b, c * d);
    let difference = p - q;
    // Two values that round alike differ only in their errors; otherwise the sign is already right.
    difference + (a.mul_add(b, -p) - c.mul_add(d, -q))
}

/// The smallest `f32` that is not below `x`; NaN stays NaN.
#[inline]
#[must_use]
pub fn f32_up(x: f64) -> f32 {
    let y = x.to_f32();
    if f64::from(y) < x { y.next_up() } else { y }
}

/// The largest `f32` that is not above `x`; NaN stays NaN.
#[inline]
#[must_use]
pub fn f32_down(x: f64) -> f32 {
    let y = x.to_f32();
    if f64::from(y) > x { y.next_down() } else { y }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn sign_of_difference_is_exact_for_integers(
            a in -(1i64 << 52)..1i64 << 52, b in -(1i64 << 52)..1i64 << 52,
            d in -3i64..3, e in -3i64..3,
        ) {
            // Neighbours of (a, b): the two products are close and usually round alike.
            let (c, f) = (a + d, b + e);
            let exact = i128::from(a) * i128::from(b) - i128::from(c) * i128::from(f);
            let got = difference_of_products(a as f64, b as f64, c as f64, f as f64);
            prop_assert_eq!(got.partial_cmp(&0.0), Some(exact.cmp(&0)));
        }

        #[test]
        fn rounding_is_directed(x in proptest::num::f64::NORMAL) {
            prop_assert!(f64::from(f32_down(x)) <= x && x <= f64::from(f32_up(x)));
        }
    }
}
