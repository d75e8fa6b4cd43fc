//! Numbers `m * 2^e` with `m` an integer of any length: what sums and products of floats are, exactly.

use core::cmp::Ordering;
use core::ops::{Add, Mul, Neg, Sub};

use glam::DVec3;
use smallvec::SmallVec;

/// An exact number. Its size follows what is stored in it; numbers of up to 384 bits, nearly all, need no allocation.
#[derive(Clone, Debug, Default)]
pub(crate) struct Dyadic {
    negative: bool,
    /// Least significant first; none of the ends is 0. Zero has no limbs.
    limbs: SmallVec<[u64; 6]>,
    /// Of the least significant bit.
    exponent: i32,
}

impl Dyadic {
    /// The value of a finite number.
    pub(crate) fn new(x: f64) -> Self {
        debug_assert!(x.is_finite());
        let bits = x.to_bits();
        let (e, m) = ((bits >> 52 & 0x7ff) as i32, bits & ((1 << 52) - 1));
        // A denormal has the exponent of the least normal, and no hidden bit.
        let (m, e) = if e == 0 { (m, -1074) } else { (m | 1 << 52, e - 1075) };
        if m == 0 {
            return Self::default();
        }
        let zeros = m.trailing_zeros();
        Self { negative: x < 0.0, limbs: SmallVec::from_slice(&[m >> zeros]), exponent: e + zeros as i32 }
    }

    /// The sign: -1, 0 or 1.
    pub(crate) fn signum(&self) -> i32 {
        match (self.limbs.is_empty(), self.negative) {
            (true, _) => 0,
            (_, true) => -1,
            (_, false) => 1,
        }
    }

    /// `self * 2^e`.
    pub(crate) fn scaled(mut self, e: i32) -> Self {
        self.exponent += e;
        self
    }

    /// `(m, e)` with the number about `m * 2^e`, to a relative 2^-52, and `0.5 <= |m| <= 1`; `(0, 0)` for zero.
    pub(crate) fn approximate(&self) -> (f64, i32) {
        let n = self.limbs.len();
        let Some(&top) = self.limbs.last() else { return (0.0, 0) };
        let zeros = top.leading_zeros();
        let next = if n > 1 { self.limbs[n - 2] } else { 0 };
        let word = if zeros == 0 { top } else { top << zeros | next >> (64 - zeros) };
        // 2^-64: the word as a fraction.
        let m = word as f64 * 5.421_010_862_427_522e-20;
        (if self.negative { -m } else { m }, self.exponent + n as i32 * 64 - zeros as i32)
    }

    /// About the quotient, to a few roundings; the divisor must not be 0. May overflow to infinity or underflow.
    pub(crate) fn approximate_quotient(&self, divisor: &Self) -> f64 {
        let ((n, en), (d, ed)) = (self.approximate(), divisor.approximate());
        // In two steps, since 2^(en - ed) alone may overflow.
        let e = (en - ed).clamp(-2100, 2100);
        n / d * 2f64.powi(e / 2) * 2f64.powi(e - e / 2)
    }

    /// The magnitude's bits above `exponent`, which must not lie above the own one.
    fn aligned(&self, exponent: i32) -> SmallVec<[u64; 6]> {
        let shift = (self.exponent - exponent) as usize;
        let (words, bits) = (shift / 64, shift % 64);
        let mut out = SmallVec::from_elem(0, words);
        if bits == 0 {
            out.extend_from_slice(&self.limbs);
        } else {
            let mut carry = 0;
            for &limb in &self.limbs {
                out.push(limb << bits | carry);
                carry = limb >> (64 - bits);
            }
            out.push(carry);
        }
        out
    }

    /// From parts in any form.
    fn normal(negative: bool, mut limbs: SmallVec<[u64; 6]>, exponent: i32) -> Self {
        while limbs.last() == Some(&0) {
            limbs.pop();
        }
        let zeros = limbs.iter().take_while(|&&l| l == 0).count();
        if limbs.is_empty() {
            return Self::default();
        }
        if zeros > 0 {
            limbs.drain(..zeros);
        }
        Self { negative, limbs, exponent: exponent + zeros as i32 * 64 }
    }
}

/// Orders magnitudes; limbs may begin with zeros at the top.
fn compare(a: &[u64], b: &[u64]) -> Ordering {
    let at = |x: &[u64], i: usize| x.get(i).copied().unwrap_or(0);
    (0..a.len().max(b.len())).rev().map(|i| at(a, i).cmp(&at(b, i))).find(|o| o.is_ne()).unwrap_or(Ordering::Equal)
}

impl Add for &Dyadic {
    type Output = Dyadic;

    fn add(self, o: &Dyadic) -> Dyadic {
        if self.limbs.is_empty() {
            return o.clone();
        }
        if o.limbs.is_empty() {
            return self.clone();
        }
        let exponent = self.exponent.min(o.exponent);
        let (mut a, mut b) = (self.aligned(exponent), o.aligned(exponent));
        let mut negative = self.negative;
        if self.negative == o.negative {
            if a.len() < b.len() {
                core::mem::swap(&mut a, &mut b);
            }
            let mut carry = false;
            for (i, x) in a.iter_mut().enumerate() {
                let (s, c0) = x.overflowing_add(b.get(i).copied().unwrap_or(0));
                let (s, c1) = s.overflowing_add(carry.into());
                *x = s;
                carry = c0 | c1;
            }
            if carry {
                a.push(1);
            }
        } else {
            if compare(&a, &b).is_lt() {
                core::mem::swap(&mut a, &mut b);
                negative = o.negative;
            }
            let mut borrow = false;
            for (i, x) in a.iter_mut().enumerate() {
                let (s, c0) = x.overflowing_sub(b.get(i).copied().unwrap_or(0));
                let (s, c1) = s.overflowing_sub(borrow.into());
                *x = s;
                borrow = c0 | c1;
            }
        }
        Dyadic::normal(negative, a, exponent)
    }
}

impl Neg for Dyadic {
    type Output = Self;

    fn neg(mut self) -> Self {
        self.negative = !self.negative;
        self
    }
}

impl Sub for &Dyadic {
    type Output = Dyadic;

    fn sub(self, o: &Dyadic) -> Dyadic {
        self + &-o.clone()
    }
}

impl Mul for &Dyadic {
    type Output = Dyadic;

    fn mul(self, o: &Dyadic) -> Dyadic {
        let mut limbs = SmallVec::from_elem(0u64, self.limbs.len() + o.limbs.len());
        for (i, &x) in self.limbs.iter().enumerate() {
            let mut carry = 0u128;
            for (k, &y) in o.limbs.iter().enumerate() {
                let s = u128::from(x) * u128::from(y) + u128::from(limbs[i + k]) + carry;
                limbs[i + k] = s as u64;
                carry = s >> 64;
            }
            limbs[i + o.limbs.len()] = carry as u64;
        }
        Dyadic::normal(self.negative != o.negative, limbs, self.exponent + o.exponent)
    }
}

// By value too, so that formulas read like formulas.
macro_rules! by_value {
    ($($op:ident $f:ident),*) => {$(
        impl $op for Dyadic {
            type Output = Self;
            fn $f(self, o: Self) -> Self {
                (&self).$f(&o)
            }
        }
    )*};
}
by_value!(Add add, Sub sub, Mul mul);

impl PartialEq for Dyadic {
    fn eq(&self, o: &Self) -> bool {
        self.cmp(o).is_eq()
    }
}

impl Eq for Dyadic {}

impl PartialOrd for Dyadic {
    fn partial_cmp(&self, o: &Self) -> Option<Ordering> {
        Some(self.cmp(o))
    }
}

impl Ord for Dyadic {
    fn cmp(&self, o: &Self) -> Ordering {
        (self - o).signum().cmp(&0)
    }
}

/// A vector of exact numbers.
pub(crate) type Vector = [Dyadic; 3];

/// A finite vector, exactly.
pub(crate) fn vector(v: DVec3) -> Vector {
    v.to_array().map(Dyadic::new)
}

/// `a - b`.
pub(crate) fn minus(a: &Vector, b: &Vector) -> Vector {
    core::array::from_fn(|i| &a[i] - &b[i])
}

/// `a x b`.
pub(crate) fn cross(a: &Vector, b: &Vector) -> Vector {
    core::array::from_fn(|i| {
        let (j, k) = ((i + 1) % 3, (i + 2) % 3);
        &a[j] * &b[k] - &a[k] * &b[j]
    })
}

/// `a . b`.
pub(crate) fn dot(a: &Vector, b: &Vector) -> Dyadic {
    &(&(&a[0] * &b[0]) + &(&a[1] * &b[1])) + &(&a[2] * &b[2])
}

/// A real number's place among the floats.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Place {
    /// The largest `f64` not above it.
    floor: f64,
    /// Against the middle between `floor` and its successor; `None` where the number *is* `floor`.
    middle: Option<Ordering>,
}

impl Place {
    /// Finds a number by comparisons alone: `order` says how it compares with an exact one. A good `guess` takes three.
    pub(crate) fn find(guess: f64, order: impl Fn(&Dyadic) -> Ordering) -> Self {
        let against = |x: f64| order(&Dyadic::new(x));
        let guess = if guess.is_nan() { 0.0 } else { guess.clamp(-f64::MAX, f64::MAX) };
        // [low, high] in steps of one float, widened from the guess.
        let (mut low, mut high) = (key(guess), key(guess));
        let mut step = 1i64;
        if against(guess).is_lt() {
            loop {
                high = low;
                low = low.saturating_sub(step).max(key(-f64::MAX));
                step = step.saturating_mul(2);
                match against(float(low)) {
                    Ordering::Less if low == key(-f64::MAX) => {
                        return Self { floor: f64::NEG_INFINITY, middle: Some(order(&-beyond())) };
                    }
                    Ordering::Less => {}
                    _ => break,
                }
            }
        } else {
            loop {
                if low == key(f64::MAX) {
                    break;
                }
                high = high.saturating_add(step).min(key(f64::MAX));
                step = step.saturating_mul(2);
                if against(float(high)).is_lt() {
                    break;
                }
                low = high;
            }
        }
        // Not below low, below high (or low is the last).
        while high.abs_diff(low) > 1 {
            let middle = i64::midpoint(low, high);
            if against(float(middle)).is_lt() { high = middle } else { low = middle }
        }
        let floor = float(low);
        if against(floor).is_eq() {
            return Self { floor, middle: None };
        }
        let middle =
            if floor == f64::MAX { beyond() } else { (Dyadic::new(floor) + Dyadic::new(floor.next_up())).scaled(-1) };
        Self { floor, middle: Some(order(&middle)) }
    }

    /// The nearest `f64`, ties to even.
    pub(crate) fn to_f64(self) -> f64 {
        match self.middle {
            None | Some(Ordering::Less) => self.floor,
            Some(Ordering::Equal) if self.floor.to_bits() & 1 == 0 => self.floor,
            Some(_) => self.floor.next_up(),
        }
    }

    /// The nearest `f32`, ties to even: from the `f64` beside it whose last bit is odd, which is on no tie of `f32`.
    pub(crate) fn to_f32(self) -> f32 {
        match self.middle {
            None => self.floor as f32,
            Some(_) if self.floor.to_bits() & 1 == 1 => self.floor as f32,
            Some(_) => self.floor.next_up() as f32,
        }
    }
}

/// Half a step beyond the largest float: from here on, rounding gives infinity.
fn beyond() -> Dyadic {
    (Dyadic::new(f64::MAX) + Dyadic::new(1.0).scaled(1024)).scaled(-1)
}

/// Floats as integers in the same order; both zeros are 0.
fn key(x: f64) -> i64 {
    let bits = x.to_bits() as i64;
    if bits < 0 { i64::MIN.wrapping_sub(bits) } else { bits }
}

/// The inverse of [`key`].
fn float(key: i64) -> f64 {
    f64::from_bits(if key < 0 { i64::MIN.wrapping_sub(key) } else { key } as u64)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn finite() -> impl Strategy<Value = f64> {
        any::<u64>().prop_map(f64::from_bits).prop_filter("finite", |x| x.is_finite())
    }

    fn of(x: i64) -> Dyadic {
        // In two parts, each of which a float holds.
        Dyadic::new((x >> 32) as f64).scaled(32) + Dyadic::new((x & 0xffff_ffff) as f64)
    }

    fn wide(x: i128) -> Dyadic {
        of((x >> 64) as i64).scaled(64) + of((x >> 32 & 0xffff_ffff) as i64).scaled(32) + of((x & 0xffff_ffff) as i64)
    }

    proptest! {
        #[test]
        fn arithmetic_is_that_of_i128(a in any::<i64>(), b in any::<i64>(), s in 0i32..60) {
            let (x, y) = (i128::from(a), i128::from(b));
            prop_assert_eq!(&of(a) + &of(b), wide(x + y));
            prop_assert_eq!(&of(a) - &of(b), wide(x - y));
            prop_assert_eq!(&of(a) * &of(b), wide(x * y));
            prop_assert_eq!(of(a).scaled(s), wide(x << s));
            prop_assert_eq!(of(a).cmp(&of(b)), x.cmp(&y));
            prop_assert_eq!(i128::from(of(a).signum()), x.signum());
        }

        #[test]
        fn floats_keep_their_order_and_their_value(a in finite(), b in finite()) {
            prop_assert_eq!(Some(Dyadic::new(a).cmp(&Dyadic::new(b))), a.partial_cmp(&b));
            let (m, e) = Dyadic::new(a).approximate();
            prop_assert_eq!(m * 2f64.powi(e / 2) * 2f64.powi(e - e / 2), a);
        }

        #[test]
        fn products_distribute(a in finite(), b in finite(), c in finite()) {
            let [x, y, z] = [a, b, c].map(Dyadic::new);
            prop_assert_eq!(&x * &(&y + &z), &x * &y + &x * &z);
            prop_assert_eq!(&(&x - &x) * &z, Dyadic::default());
        }

        /// Sums and products of floats are rounded as the processor rounds them, wherever the search begins.
        #[test]
        fn rounding_is_that_of_ieee(a in finite(), b in finite(), guess in finite(), near in any::<bool>()) {
            let (x, y) = (Dyadic::new(a), Dyadic::new(b));
            for (exact, rounded) in [(&x + &y, a + b), (&x * &y, a * b)] {
                let guess = if near { rounded } else { guess };
                prop_assert_eq!(Place::find(guess, |m| exact.cmp(m)).to_f64(), rounded);
            }
        }

        /// Products of three f32 need more digits than f64 has; the reference is rounded from integers.
        #[test]
        fn rounding_to_f32_is_not_double(a in 1u32..1 << 24, b in 1u32..1 << 24, c in 1u32..1 << 24) {
            let product = u128::from(a) * u128::from(b) * u128::from(c);
            let exact = Dyadic::new(a.into()) * Dyadic::new(b.into()) * Dyadic::new(c.into());
            prop_assert_eq!(Place::find(0.0, |m| exact.cmp(m)).to_f32(), product as f32);
        }
    }

    #[test]
    fn beyond_the_range_is_infinite() {
        let huge = Dyadic::new(f64::MAX) * Dyadic::new(2.0);
        assert_eq!(Place::find(1.0, |m| huge.cmp(m)).to_f64(), f64::INFINITY);
        assert_eq!(Place::find(1.0, |m| (-huge.clone()).cmp(m)).to_f64(), f64::NEG_INFINITY);
        let tiny = Dyadic::new(f64::from_bits(1)).scaled(-2);
        assert_eq!(Place::find(1.0, |m| tiny.cmp(m)).to_f64(), 0.0);
    }
}
