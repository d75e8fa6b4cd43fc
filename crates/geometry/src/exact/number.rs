//! One formula, three arithmetics: `f64` with its error, twice the digits with their error, exact numbers.
//!
//! A sign is asked of the cheapest first; it answers if it can, and if it answers it is right.

use super::dyadic::Dyadic;
use super::twofold::{Twofold, two_sum};

/// What formulas are made of.
pub(crate) trait Number: Clone {
    /// A finite number.
    fn new(x: f64) -> Self;
    /// `a - b`.
    fn difference(a: f64, b: f64) -> Self;
    fn plus(&self, o: &Self) -> Self;
    fn minus(&self, o: &Self) -> Self;
    fn times(&self, o: &Self) -> Self;
    /// -1, 0 or 1, if that is certain.
    fn sign(&self) -> Option<i32>;
    /// About the value; may be no number.
    fn value(&self) -> f64;

    fn squared(&self) -> Self {
        self.times(self)
    }
    fn twice(&self) -> Self {
        self.plus(self)
    }
}

/// `a . b`
pub(crate) fn dot<N: Number>(a: &[N; 3], b: &[N; 3]) -> N {
    a[0].times(&b[0]).plus(&a[1].times(&b[1])).plus(&a[2].times(&b[2]))
}

/// `a x b`
pub(crate) fn cross<N: Number>(a: &[N; 3], b: &[N; 3]) -> [N; 3] {
    core::array::from_fn(|i| {
        let (j, k) = ((i + 1) % 3, (i + 2) % 3);
        a[j].times(&b[k]).minus(&a[k].times(&b[j]))
    })
}

/// A vector.
pub(crate) fn vector<N: Number>(v: glam::DVec3) -> [N; 3] {
    v.to_array().map(N::new)
}

/// `a - b`
pub(crate) fn differences<N: Number>(a: glam::DVec3, b: glam::DVec3) -> [N; 3] {
    core::array::from_fn(|i| N::difference(a[i], b[i]))
}

/// Unit roundoff.
const U: f64 = f64::EPSILON / 2.0;
/// More than what is lost where products underflow.
const TINY: f64 = f64::MIN_POSITIVE;
/// Covers the roundings of a sum of up to six non-negative numbers or products, and its own.
const ROOM: f64 = 1.0 + 16.0 * U;

/// A number within `error` of `value`. If either is no finite number, nothing is known.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Ball {
    value: f64,
    error: f64,
}

impl Ball {
    /// Of a computed `value`, from the error of the operands.
    #[inline(always)]
    fn rounded(value: f64, inherited: f64) -> Self {
        // Half an ulp is at most u times the rounded number, but for numbers so small that this underflows.
        Self { value, error: (inherited + value.abs() * U + TINY) * ROOM }
    }

    #[inline(always)]
    fn is_zero(&self) -> bool {
        self.value == 0.0 && self.error == 0.0
    }
}

impl Number for Ball {
    #[inline(always)]
    fn new(value: f64) -> Self {
        Self { value, error: 0.0 }
    }
    #[inline(always)]
    fn difference(a: f64, b: f64) -> Self {
        // Mostly the coordinates are those of f32, and their difference is exact.
        let (value, error) = two_sum(a, -b);
        Self { value, error: error.abs() }
    }
    #[inline(always)]
    fn plus(&self, o: &Self) -> Self {
        let value = self.value + o.value;
        // A computed sum is 0 only if it is exact.
        if value == 0.0 {
            return Self { value, error: (self.error + o.error) * ROOM };
        }
        Self::rounded(value, self.error + o.error)
    }
    #[inline(always)]
    fn minus(&self, o: &Self) -> Self {
        self.plus(&Self { value: -o.value, error: o.error })
    }
    #[inline(always)]
    fn times(&self, o: &Self) -> Self {
        // Zeros are common, and exact: directions along an axis, coefficients of a cylinder.
        if self.is_zero() || o.is_zero() {
            return Self::new(0.0);
        }
        let inherited = self.value.abs() * o.error + o.value.abs() * self.error + self.error * o.error;
        Self::rounded(self.value * o.value, inherited)
    }
    #[inline(always)]
    fn sign(&self) -> Option<i32> {
        if self.value.abs() > self.error {
            // An infinite value has an infinite error.
            Some(if self.value > 0.0 { 1 } else { -1 })
        } else {
            self.is_zero().then_some(0)
        }
    }
    #[inline(always)]
    fn value(&self) -> f64 {
        self.value
    }
}

/// A number within `error` of a [`Twofold`].
#[derive(Clone, Copy, Debug)]
pub(crate) struct Wide {
    value: Twofold,
    error: f64,
}

impl Wide {
    /// Of an operation on operands of this size.
    #[inline(always)]
    fn rounded(value: Twofold, size: f64, inherited: f64) -> Self {
        // 2^-100, and 2^-1000 for what that loses to underflow; ROOM cannot reach 2^-40.
        const RELATIVE: f64 = 7.888_609_052_210_118e-31;
        const ABSOLUTE: f64 = 9.332_636_185_032_189e-302;
        Self { value, error: (inherited + size * RELATIVE + ABSOLUTE) * (1.0 + 1e-12) }
    }

    #[inline(always)]
    fn is_zero(&self) -> bool {
        self.value.high == 0.0 && self.error == 0.0
    }
}

impl Number for Wide {
    #[inline(always)]
    fn new(x: f64) -> Self {
        Self { value: x.into(), error: 0.0 }
    }
    #[inline(always)]
    fn difference(a: f64, b: f64) -> Self {
        Self { value: Twofold::difference(a, b), error: 0.0 }
    }
    #[inline(always)]
    fn plus(&self, o: &Self) -> Self {
        if self.is_zero() {
            return *o;
        }
        if o.is_zero() {
            return *self;
        }
        Self::rounded(self.value + o.value, self.value.abs() + o.value.abs(), self.error + o.error)
    }
    #[inline(always)]
    fn minus(&self, o: &Self) -> Self {
        self.plus(&Self { value: Twofold { high: -o.value.high, low: -o.value.low }, error: o.error })
    }
    #[inline(always)]
    fn times(&self, o: &Self) -> Self {
        if self.is_zero() || o.is_zero() {
            return Self::new(0.0);
        }
        let (a, b) = (self.value.abs(), o.value.abs());
        let size = a * b;
        // Where splitting overflows, or the low half of the product underflows, nothing is known.
        let in_range = a == 0.0 || b == 0.0 || (size > 1e-240 && size < 1e270 && a < 1e270 && b < 1e270);
        let inherited = if in_range { a * o.error + b * self.error + self.error * o.error } else { f64::NAN };
        Self::rounded(self.value * o.value, size, inherited)
    }
    #[inline(always)]
    fn sign(&self) -> Option<i32> {
        // The low half is less than u times the high one.
        if self.value.abs() > self.error * (1.0 + 1e-12) {
            Some(if self.value.high > 0.0 { 1 } else { -1 })
        } else {
            self.is_zero().then_some(0)
        }
    }
    #[inline(always)]
    fn value(&self) -> f64 {
        self.value.high
    }
}

impl Number for Dyadic {
    fn new(x: f64) -> Self {
        Self::new(x)
    }
    fn difference(a: f64, b: f64) -> Self {
        Self::new(a) - Self::new(b)
    }
    fn plus(&self, o: &Self) -> Self {
        self + o
    }
    fn minus(&self, o: &Self) -> Self {
        self - o
    }
    fn times(&self, o: &Self) -> Self {
        self * o
    }
    fn sign(&self) -> Option<i32> {
        Some(self.signum())
    }
    fn value(&self) -> f64 {
        self.approximate_quotient(&Self::new(1.0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Near one another, so that differences cancel; or anything.
    fn number() -> impl Strategy<Value = f64> {
        prop_oneof![
            3 => (-8i32..8).prop_map(f64::from),
            3 => (-8i32..8, -4i64..4).prop_map(|(x, ulps)| f64::from_bits((f64::from(x).to_bits() as i64 + ulps) as u64)),
            2 => (-1.0..1.0f64, -1074i32..1023).prop_map(|(x, e)| x * 2f64.powi(e / 2) * 2f64.powi(e - e / 2)),
            1 => any::<f32>().prop_map(f64::from),
        ]
        .prop_filter("finite", |x| x.is_finite())
    }

    /// A sum, product or difference of what came before, in every step.
    fn calculate<N: Number>(x: &[f64; 6], steps: &[(u8, usize, usize)]) -> N {
        let mut known: Vec<N> = x.iter().map(|&x| N::new(x)).collect();
        known.push(N::difference(x[0], x[1]));
        for &(step, i, k) in steps {
            let (a, b) = (&known[i % known.len()], &known[k % known.len()]);
            known.push(match step % 3 {
                0 => a.plus(b),
                1 => a.minus(b),
                _ => a.times(b),
            });
        }
        known.swap_remove(known.len() - 1)
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(20_000))]

        #[test]
        fn errors_are_within_their_bounds(
            x in prop::array::uniform6(number()), steps in prop::collection::vec((0..3u8, 0..20usize, 0..20usize), 1..8)
        ) {
            let exact: Dyadic = calculate(&x, &steps);
            let (ball, wide): (Ball, Wide) = (calculate(&x, &steps), calculate(&x, &steps));
            for sign in [ball.sign(), wide.sign()].into_iter().flatten() {
                prop_assert_eq!(sign, exact.signum());
            }
            if ball.value.is_finite() && ball.error.is_finite() {
                let off = &exact - &Dyadic::new(ball.value);
                prop_assert!(off.squared() <= Dyadic::new(ball.error).squared(), "{ball:?}");
            }
            if wide.value.high.is_finite() && wide.value.low.is_finite() && wide.error.is_finite() {
                let off = &exact - &(Dyadic::new(wide.value.high) + Dyadic::new(wide.value.low));
                prop_assert!(off.squared() <= Dyadic::new(wide.error).squared(), "{wide:?}");
            }
        }
    }

    #[test]
    fn zeros_are_known_to_be_zero() {
        let zero = Ball::new(0.0).times(&Ball::new(0.1).times(&Ball::new(0.1)));
        assert_eq!(zero.plus(&zero).sign(), Some(0));
        assert_eq!(Ball::difference(0.1, 0.1).sign(), Some(0));
        // Not exact, so not known.
        let x = Ball::new(0.1).times(&Ball::new(0.1));
        assert_eq!(x.minus(&x).sign(), None);
    }
}
