//! Sums of two floats: twice the digits of `f64`, for rounding correctly what `f64` alone cannot.
//!
//! Dekker 1971; Joldes, Muller, Popescu, "Tight and rigorous error bounds for basic building blocks of double-word
//! arithmetic", ACM TOMS 44(2) 2017. No fused multiply-add: on stock x86-64 that is a slow call.

use core::ops::{Add, Mul, Sub};

/// The unevaluated sum `high + low`, `|low| <= ulp(high) / 2`. Operations are good to a relative 2^-100 of the sum of
/// the absolute values of their operands, as long as nothing overflows or underflows.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Twofold {
    pub(super) high: f64,
    pub(super) low: f64,
}

impl Twofold {
    #[inline(always)]
    pub(super) fn difference(a: f64, b: f64) -> Self {
        let (high, low) = two_sum(a, -b);
        Self { high, low }
    }
    #[inline(always)]
    pub(super) fn abs(self) -> f64 {
        self.high.abs()
    }
}

impl From<f64> for Twofold {
    #[inline(always)]
    fn from(high: f64) -> Self {
        Self { high, low: 0.0 }
    }
}

impl Add for Twofold {
    type Output = Self;
    #[inline(always)]
    fn add(self, o: Self) -> Self {
        let (s, e) = two_sum(self.high, o.high);
        let (t, f) = two_sum(self.low, o.low);
        let (s, e) = quick_two_sum(s, e + t);
        let (high, low) = quick_two_sum(s, e + f);
        Self { high, low }
    }
}

impl Sub for Twofold {
    type Output = Self;
    #[inline(always)]
    fn sub(self, o: Self) -> Self {
        self + Self { high: -o.high, low: -o.low }
    }
}

impl Mul for Twofold {
    type Output = Self;
    #[inline(always)]
    fn mul(self, o: Self) -> Self {
        let (p, e) = two_product(self.high, o.high);
        let (high, low) = quick_two_sum(p, e + (self.high * o.low + self.low * o.high));
        Self { high, low }
    }
}

/// `a + b = s + e` exactly (Knuth).
#[inline(always)]
pub(super) fn two_sum(a: f64, b: f64) -> (f64, f64) {
    let s = a + b;
    let t = s - a;
    (s, (a - (s - t)) + (b - t))
}

/// The same for `|a| >= |b|` (Dekker).
#[inline(always)]
fn quick_two_sum(a: f64, b: f64) -> (f64, f64) {
    let s = a + b;
    (s, b - (s - a))
}

/// `a * b = p + e` exactly (Dekker, with Veltkamp's splitting).
#[inline(always)]
fn two_product(a: f64, b: f64) -> (f64, f64) {
    let split = |x: f64| {
        let c = x * 134_217_729.0;
        let high = c - (c - x);
        (high, x - high)
    };
    let p = a * b;
    let ((ah, al), (bh, bl)) = (split(a), split(b));
    (p, ((ah * bh - p) + ah * bl + al * bh) + al * bl)
}

#[cfg(test)]
mod tests {
    use super::super::{dyadic::Dyadic, number::Number as _};
    use super::*;
    use proptest::prelude::*;

    fn number() -> impl Strategy<Value = Twofold> {
        (-1e3..1e3f64, -1.0..1.0f64, -40i32..40).prop_map(|(h, l, e)| {
            let (high, low) = quick_two_sum(h * 2f64.powi(e), l * 2f64.powi(e - 50));
            Twofold { high, low }
        })
    }

    fn exact(x: Twofold) -> Dyadic {
        Dyadic::new(x.high) + Dyadic::new(x.low)
    }

    proptest! {
        #[test]
        fn operations_keep_a_hundred_bits(a in number(), b in number()) {
            let close = |got: Twofold, want: Dyadic, size: f64| {
                let off = exact(got) - want;
                off.squared() <= Dyadic::new(size * 2f64.powi(-100)).squared()
            };
            prop_assert!(close(a + b, exact(a) + exact(b), a.abs() + b.abs()));
            prop_assert!(close(a - b, exact(a) - exact(b), a.abs() + b.abs()));
            prop_assert!(close(a * b, exact(a) * exact(b), a.abs() * b.abs()));
            prop_assert!(close(Twofold::difference(a.high, b.high), Dyadic::new(a.high) - Dyadic::new(b.high), 0.0));
        }
    }
}
