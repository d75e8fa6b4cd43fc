//! Integers of fixed size, in which the geometry of `f32` input is exact.
//!
//! Every finite `f32` is a whole multiple of 2^-149. Scaled by 2^149, coordinates fit in 277 bits and a sign, a triple
//! product of their differences in 841: everything is decided by integers of a size known beforehand, without
//! allocation and without a case that does not fit.

use core::cmp::Ordering;

/// A signed integer of `N` 64-bit limbs in two's complement, least significant first.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Int<const N: usize>([u64; N]);

impl<const N: usize> Int<N> {
    pub(super) const ZERO: Self = Self([0; N]);

    /// `x * 2^149`, exactly; `x` must be finite and `N` at least 5.
    pub(super) fn from_f32(x: f32) -> Self {
        let bits = x.to_bits();
        let (e, m) = (bits >> 23 & 0xff, bits & 0x7f_ffff);
        // A denormal has the exponent of the least normal, and no hidden bit.
        let (m, shift) = if e == 0 { (m, 0) } else { (m | 0x80_0000, e - 1) };
        let mut out = Self::ZERO;
        out.0[0] = m.into();
        let out = out.shl(shift);
        if x < 0.0 { out.neg() } else { out }
    }

    /// The sign: -1, 0 or 1.
    pub(super) fn signum(&self) -> i32 {
        if self.is_negative() { -1 } else { i32::from(self.0.iter().any(|&l| l != 0)) }
    }

    fn is_negative(&self) -> bool {
        self.0[N - 1] >> 63 == 1
    }

    pub(super) fn neg(&self) -> Self {
        let mut carry = true;
        Self(self.0.map(|l| {
            let (l, c) = (!l).overflowing_add(carry.into());
            carry = c;
            l
        }))
    }

    pub(super) fn add(&self, o: &Self) -> Self {
        let mut carry = false;
        let mut out = [0; N];
        for (out, (&a, &b)) in out.iter_mut().zip(self.0.iter().zip(&o.0)) {
            let (s, c0) = a.overflowing_add(b);
            let (s, c1) = s.overflowing_add(carry.into());
            *out = s;
            carry = c0 | c1;
        }
        Self(out)
    }

    pub(super) fn sub(&self, o: &Self) -> Self {
        self.add(&o.neg())
    }

    /// `self * 2^bits`; the caller sees to it that it fits.
    pub(super) fn shl(&self, bits: u32) -> Self {
        let (limbs, bits) = ((bits / 64) as usize, bits % 64);
        let at = |i: usize| if i >= limbs { self.0[i - limbs] } else { 0 };
        Self(core::array::from_fn(|i| {
            let low = if bits > 0 && i > 0 { at(i - 1) >> (64 - bits) } else { 0 };
            at(i) << bits | low
        }))
    }

    /// The same number with more limbs.
    pub(super) fn widen<const M: usize>(&self) -> Int<M> {
        let fill = if self.is_negative() { u64::MAX } else { 0 };
        Int(core::array::from_fn(|i| self.0.get(i).copied().unwrap_or(fill)))
    }

    /// The product, in as many limbs as the caller says (enough, or it wraps).
    pub(super) fn mul<const M: usize, const P: usize>(&self, o: &Int<M>) -> Int<P> {
        let (a, b) = (self.magnitude(), o.magnitude());
        let mut out = [0u64; P];
        for (i, &x) in a.0.iter().enumerate().filter(|(_, x)| **x != 0) {
            let mut carry = 0u128;
            for (k, out) in out.iter_mut().enumerate().skip(i) {
                let y = b.0.get(k - i).copied().unwrap_or(0);
                let s = u128::from(x) * u128::from(y) + u128::from(*out) + carry;
                *out = s as u64;
                carry = s >> 64;
            }
        }
        let out = Int(out);
        if self.is_negative() != o.is_negative() { out.neg() } else { out }
    }

    pub(super) fn magnitude(&self) -> Self {
        if self.is_negative() { self.neg() } else { *self }
    }

    /// `(m, e)` with the number about `m * 2^e`, to a relative 2^-52, and `0.5 <= |m| <= 1`; `(0, 0)` for zero.
    pub(super) fn approximate(&self) -> (f64, i32) {
        let a = self.magnitude();
        let Some(top) = a.0.iter().rposition(|&l| l != 0) else { return (0.0, 0) };
        let zeros = a.0[top].leading_zeros();
        let next = if top > 0 { a.0[top - 1] } else { 0 };
        let word = if zeros == 0 { a.0[top] } else { a.0[top] << zeros | next >> (64 - zeros) };
        // 2^-64: the word as a fraction.
        let m = word as f64 * 5.421_010_862_427_522e-20;
        let e = (top as i32 + 1) * 64 - zeros as i32;
        (if self.is_negative() { -m } else { m }, e)
    }
}

impl<const N: usize> PartialOrd for Int<N> {
    fn partial_cmp(&self, o: &Self) -> Option<Ordering> {
        Some(self.cmp(o))
    }
}

impl<const N: usize> Ord for Int<N> {
    fn cmp(&self, o: &Self) -> Ordering {
        // Negative numbers first; within a sign, two's complement orders like the bits.
        o.is_negative().cmp(&self.is_negative()).then_with(|| self.0.iter().rev().cmp(o.0.iter().rev()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn of(x: i128) -> Int<5> {
        let fill = if x < 0 { u64::MAX } else { 0 };
        Int([x as u64, (x >> 64) as u64, fill, fill, fill])
    }

    fn finite() -> impl Strategy<Value = f32> {
        any::<u32>().prop_map(f32::from_bits).prop_filter("finite", |x| x.is_finite())
    }

    proptest! {
        #[test]
        fn arithmetic_is_that_of_i128(a in any::<i64>(), b in any::<i64>(), s in 0u32..60) {
            let (x, y) = (i128::from(a), i128::from(b));
            prop_assert_eq!(of(x).add(&of(y)), of(x + y));
            prop_assert_eq!(of(x).sub(&of(y)), of(x - y));
            prop_assert_eq!(of(x).mul::<5, 5>(&of(y)), of(x * y));
            prop_assert_eq!(of(x).shl(s), of(x << s));
            prop_assert_eq!(of(x).cmp(&of(y)), x.cmp(&y));
            prop_assert_eq!(of(x).signum() as i128, x.signum());
            prop_assert_eq!(of(x).neg().widen::<9>(), of(-x).widen::<9>());
        }

        #[test]
        fn floats_keep_their_order_and_their_value(a in finite(), b in finite()) {
            let (x, y) = (Int::<5>::from_f32(a), Int::<5>::from_f32(b));
            prop_assert_eq!(Some(x.cmp(&y)), a.partial_cmp(&b));
            let (m, e) = x.approximate();
            // f32 has fewer digits than the approximation keeps: it is exact.
            prop_assert_eq!(m * 2f64.powi(e - 149), f64::from(a));
        }

        #[test]
        fn products_distribute(a in finite(), b in finite(), c in finite()) {
            let [x, y, z] = [a, b, c].map(Int::<5>::from_f32);
            let left: Int<10> = x.mul(&y.add(&z));
            let right = x.mul::<5, 10>(&y).add(&x.mul(&z));
            prop_assert_eq!(left, right);
            let third: Int<15> = left.mul(&z);
            prop_assert_eq!(third.signum(), left.signum() * z.signum());
        }
    }
}
