//! Four `f64`: a vector of one ray in one register, with a lane to spare. [`Portable`] is their meaning.

use super::Portable;
use super::eight::EXPONENT;

/// From this an exponent is subtracted for the reciprocal's.
pub(super) const TWICE_THE_BIAS: u64 = 2046 << 52;

/// Four `f64`, each operation rounded by itself. Comparisons answer with one bit for each lane, false for NaN.
pub(crate) trait Four: Copy {
    fn splat(x: f64) -> Self;
    fn new(x: f64, y: f64, z: f64, w: f64) -> Self;
    fn store(self) -> [f64; 4];
    fn sub(self, o: Self) -> Self;
    fn mul(self, o: Self) -> Self;
    fn abs(self) -> Self;
    /// Lanes where `self <= o`.
    fn le(self, o: Self) -> u32;
    /// The largest of the first three lanes, where none is NaN.
    fn largest(self) -> f64;
    /// The power of two at or below the largest of the first three lanes, which is a normal number, and its reciprocal: each in all
    /// lanes.
    fn powers(self) -> (Self, Self);
}

/// What single rays need of eight `f32` beyond `Lanes`.
pub(crate) trait OfFour: Copy {
    type Four: Four;
    /// Rounded to nearest, in the first four lanes; the others are 0.
    fn narrow_four(x: Self::Four) -> Self;
    /// The lanes of these numbers, of which the low three bits count.
    fn reordered(self, lanes: &[u32; 8]) -> Self;
}

/// An array.
#[derive(Clone, Copy, Debug)]
#[repr(align(32))]
pub(crate) struct PortableFour([f64; 4]);

impl PortableFour {
    #[inline(always)]
    fn zip(self, o: Self, f: impl Fn(f64, f64) -> f64) -> Self {
        let mut out = self;
        for k in 0..4 {
            out.0[k] = f(self.0[k], o.0[k]);
        }
        out
    }
}

impl Four for PortableFour {
    #[inline(always)]
    fn splat(x: f64) -> Self {
        Self([x; 4])
    }
    #[inline(always)]
    fn new(x: f64, y: f64, z: f64, w: f64) -> Self {
        Self([x, y, z, w])
    }
    #[inline(always)]
    fn store(self) -> [f64; 4] {
        self.0
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
    fn abs(self) -> Self {
        self.zip(self, |a, _| a.abs())
    }
    #[inline(always)]
    fn le(self, o: Self) -> u32 {
        let mut mask = 0;
        for k in 0..4 {
            mask |= u32::from(self.0[k] <= o.0[k]) << k;
        }
        mask
    }
    #[inline(always)]
    fn largest(self) -> f64 {
        let [x, y, z, _] = self.0;
        let xy = if x > y { x } else { y };
        if xy > z { xy } else { z }
    }
    #[inline(always)]
    fn powers(self) -> (Self, Self) {
        let exponent = self.largest().to_bits() & EXPONENT;
        (Self::splat(f64::from_bits(exponent)), Self::splat(f64::from_bits(TWICE_THE_BIAS.wrapping_sub(exponent))))
    }
}

impl OfFour for Portable {
    type Four = PortableFour;
    #[inline(always)]
    fn narrow_four(x: PortableFour) -> Self {
        let [a, b, c, d] = x.0;
        Self([a as f32, b as f32, c as f32, d as f32, 0.0, 0.0, 0.0, 0.0])
    }
    #[inline(always)]
    fn reordered(self, lanes: &[u32; 8]) -> Self {
        let mut out = self;
        for (out, lane) in out.0.iter_mut().zip(lanes) {
            *out = self.0[*lane as usize & 7];
        }
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simd::{Available, Lanes, Level, Work, run};
    use proptest::prelude::*;

    struct All<'a>([f64; 4], [f64; 4], &'a [u32; 8]);

    impl Work for All<'_> {
        type Output = (Vec<[u64; 4]>, Vec<[u32; 8]>, u32);

        #[inline(always)]
        fn run<L: Lanes>(self) -> Self::Output {
            let [x, y, z, w] = self.0;
            let a = L::Four::new(x, y, z, w);
            let [x, y, z, w] = self.1;
            let b = L::Four::new(x, y, z, w);
            // No lane may be NaN, and zeros of either sign are as large as each other.
            let most = [self.0[0], self.0[1], self.0[2]].map(|x| if x.is_nan() { 1.0 } else { x });
            let most = L::Four::new(most[0], most[1], most[2], f64::NAN).abs().largest();
            let normal = L::Four::splat(most.clamp(1e-300, 1e300)).powers();
            let rows = [a.sub(b), a.mul(b), a.abs(), L::Four::splat(most), normal.0, normal.1];
            let narrow = L::narrow_four(a);
            let mut singles = Vec::new();
            for x in [narrow, narrow.reordered(self.2)] {
                let mut row = [0.0; 8];
                x.put(&mut row);
                singles.push(row.map(|x| if x.is_nan() { u32::MAX } else { x.to_bits() }));
            }
            // A NaN has no bits that mean anything.
            let bits = |x: f64| if x.is_nan() { u64::MAX } else { x.to_bits() };
            (rows.map(|x| x.store().map(bits)).to_vec(), singles, a.le(b))
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
        fn levels_agree(
            a in prop::array::uniform4(number()), b in prop::array::uniform4(number()),
            lanes in prop::array::uniform8(0u32..16),
        ) {
            let of = |level| run(Available::up_to(level), All(a, b, &lanes));
            let expected = of(Level::Scalar);
            for level in Level::ALL {
                prop_assert_eq!(&of(level), &expected, "{}", level);
            }
        }
    }
}
