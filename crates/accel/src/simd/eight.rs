//! Eight `f64`, for packets of rays: one in each lane. [`Portable`] is their meaning, as for [`Lanes`](super::Lanes).

use super::Portable;

/// Eight `f64`, each operation rounded by itself. Comparisons answer with one bit for each lane, false for NaN.
pub(crate) trait Eight: Copy {
    fn splat(x: f64) -> Self;
    fn load(x: &[f64; 8]) -> Self;
    fn store(self, to: &mut [f64; 8]);
    fn add(self, o: Self) -> Self;
    fn sub(self, o: Self) -> Self;
    fn mul(self, o: Self) -> Self;
    fn div(self, o: Self) -> Self;
    /// The smaller; `o` where one is NaN.
    fn min(self, o: Self) -> Self;
    /// The larger; `o` where one is NaN.
    fn max(self, o: Self) -> Self;
    fn abs(self) -> Self;
    /// The bits of the exponent alone: of a normal number, the power of two at or below its magnitude.
    fn exponent(self) -> Self;
    /// Lanes where `self < o`.
    fn lt(self, o: Self) -> u32;
    /// Lanes where `self <= o`.
    fn le(self, o: Self) -> u32;
    /// `self` in the lanes of the mask, `o` in the others.
    fn select(self, mask: u32, o: Self) -> Self;
}

/// What packets need of eight `f32` beyond `Lanes`.
pub(crate) trait Packed: Copy {
    type Eight: Eight;
    /// Exactly these.
    fn widen(self) -> Self::Eight;
    /// Rounded to nearest.
    fn narrow(x: Self::Eight) -> Self;
    /// `self` in the lanes of the mask, `o` in the others.
    fn choose(self, mask: u32, o: Self) -> Self;
    /// Writes the lanes to where they are kept.
    fn put(self, to: &mut [f32; 8]);
    /// The smallest lane, where none is NaN.
    fn smallest(self) -> f32;
    /// The largest lane, where none is NaN.
    fn largest(self) -> f32;
}

/// The bits of an `f64`'s exponent.
pub(super) const EXPONENT: u64 = 0x7ff << 52;

/// An array.
#[derive(Clone, Copy, Debug)]
#[repr(align(64))]
pub(crate) struct PortableEight([f64; 8]);

impl PortableEight {
    #[inline(always)]
    fn zip(self, o: Self, f: impl Fn(f64, f64) -> f64) -> Self {
        let mut out = self;
        for k in 0..8 {
            out.0[k] = f(self.0[k], o.0[k]);
        }
        out
    }

    #[inline(always)]
    fn mask(self, o: Self, f: impl Fn(f64, f64) -> bool) -> u32 {
        let mut mask = 0;
        for k in 0..8 {
            mask |= u32::from(f(self.0[k], o.0[k])) << k;
        }
        mask
    }
}

impl Eight for PortableEight {
    #[inline(always)]
    fn splat(x: f64) -> Self {
        Self([x; 8])
    }
    #[inline(always)]
    fn load(x: &[f64; 8]) -> Self {
        Self(*x)
    }
    #[inline(always)]
    fn store(self, to: &mut [f64; 8]) {
        *to = self.0;
    }
    #[inline(always)]
    fn add(self, o: Self) -> Self {
        self.zip(o, |a, b| a + b)
    }
    #[inline(always)]
    fn sub(self, o: Self) -> Self {
        self.zip(o, |a, b| a - b)
    }
    #[inline(always)]
    fn mul(self, o: Self) -> Self {
        self.zip(o, |a, b| a * b)
    }
    #[inline(always)]
    fn div(self, o: Self) -> Self {
        self.zip(o, |a, b| a / b)
    }
    #[inline(always)]
    fn min(self, o: Self) -> Self {
        self.zip(o, |a, b| if a < b { a } else { b })
    }
    #[inline(always)]
    fn max(self, o: Self) -> Self {
        self.zip(o, |a, b| if a > b { a } else { b })
    }
    #[inline(always)]
    fn abs(self) -> Self {
        self.zip(self, |a, _| a.abs())
    }
    #[inline(always)]
    fn exponent(self) -> Self {
        self.zip(self, |a, _| f64::from_bits(a.to_bits() & EXPONENT))
    }
    #[inline(always)]
    fn lt(self, o: Self) -> u32 {
        self.mask(o, |a, b| a < b)
    }
    #[inline(always)]
    fn le(self, o: Self) -> u32 {
        self.mask(o, |a, b| a <= b)
    }
    #[inline(always)]
    fn select(self, mask: u32, o: Self) -> Self {
        let mut out = o;
        for k in 0..8 {
            if mask >> k & 1 == 1 {
                out.0[k] = self.0[k];
            }
        }
        out
    }
}

impl Packed for Portable {
    type Eight = PortableEight;
    #[inline(always)]
    fn widen(self) -> PortableEight {
        let mut out = [0.0; 8];
        for (out, x) in out.iter_mut().zip(self.0) {
            *out = f64::from(x);
        }
        PortableEight(out)
    }
    #[inline(always)]
    fn narrow(x: PortableEight) -> Self {
        let mut out = [0.0; 8];
        for (out, x) in out.iter_mut().zip(x.0) {
            *out = x as f32;
        }
        Self(out)
    }
    #[inline(always)]
    fn choose(self, mask: u32, o: Self) -> Self {
        let mut out = o;
        for k in 0..8 {
            if mask >> k & 1 == 1 {
                out.0[k] = self.0[k];
            }
        }
        out
    }
    #[inline(always)]
    fn put(self, to: &mut [f32; 8]) {
        *to = self.0;
    }
    #[inline(always)]
    fn smallest(self) -> f32 {
        let mut out = self.0[0];
        for k in 1..8 {
            out = if self.0[k] < out { self.0[k] } else { out };
        }
        out
    }
    #[inline(always)]
    fn largest(self) -> f32 {
        let mut out = self.0[0];
        for k in 1..8 {
            out = if self.0[k] > out { self.0[k] } else { out };
        }
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simd::{Available, Lanes, Level, Work, run};
    use proptest::prelude::*;

    struct All<'a>(&'a [f64; 8], &'a [f64; 8], u32);

    impl Work for All<'_> {
        type Output = (Vec<[u64; 8]>, Vec<[u32; 8]>, [u32; 2]);

        #[inline(always)]
        fn run<L: Lanes>(self) -> Self::Output {
            let (a, b, m) = (L::Eight::load(self.0), L::Eight::load(self.1), self.2);
            let wide = [
                a.add(b),
                a.sub(b),
                a.mul(b),
                a.div(b),
                a.min(b),
                a.max(b),
                a.abs(),
                a.exponent(),
                a.select(m, b),
                L::Eight::splat(self.0[3]),
                L::narrow(a).widen(),
            ];
            // Zeros of either sign are as large as each other, and no lane may be NaN.
            let zero = L::splat(0.0);
            let some = L::narrow(a).max(zero).min(L::narrow(b).max(zero));
            let ends = [L::splat(some.smallest().abs()), L::splat(some.largest().abs())];
            let narrow = [L::narrow(a), L::narrow(a).choose(m, L::narrow(b)), ends[0], ends[1]];
            let mut rows = Vec::new();
            for x in wide {
                let mut row = [0.0; 8];
                x.store(&mut row);
                // A NaN has no bits that mean anything.
                rows.push(row.map(|x| if x.is_nan() { u64::MAX } else { x.to_bits() }));
            }
            let mut singles = Vec::new();
            for x in narrow {
                let mut row = [0.0; 8];
                x.put(&mut row);
                singles.push(row.map(|x| if x.is_nan() { u32::MAX } else { x.to_bits() }));
            }
            (rows, singles, [a.lt(b), a.le(b)])
        }
    }

    fn number() -> impl Strategy<Value = f64> {
        prop_oneof![
            any::<f64>(),
            -3.0..3.0f64,
            (-1e-45..1e-45f64),
            prop::sample::select(vec![0.0, -0.0, 1.0, f64::NAN, f64::INFINITY, f64::NEG_INFINITY, f64::MAX, 5e-324]),
        ]
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(4000))]

        #[test]
        fn levels_agree(a in prop::array::uniform8(number()), b in prop::array::uniform8(number()), same: u8, mask: u8) {
            let mut b = b;
            for k in 0..8 {
                if same >> k & 1 == 1 {
                    b[k] = a[k];
                }
            }
            let of = |level| run(Available::up_to(level), All(&a, &b, mask.into()));
            let expected = of(Level::Scalar);
            for level in Level::ALL {
                prop_assert_eq!(&of(level), &expected, "{}", level);
            }
        }
    }
}
