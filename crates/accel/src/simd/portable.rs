//! Eight lanes in plain Rust.

use super::{Lanes, Row};

/// An array: what the compiler makes of it depends on the target.
#[derive(Clone, Copy, Debug)]
#[repr(align(32))]
pub(crate) struct Portable(pub(super) [f32; 8]);

impl Portable {
    #[inline(always)]
    fn zip(self, o: Self, f: impl Fn(f32, f32) -> f32) -> Self {
        let mut out = self;
        for k in 0..8 {
            out.0[k] = f(self.0[k], o.0[k]);
        }
        out
    }
}

impl Lanes for Portable {
    #[inline(always)]
    fn splat(x: f32) -> Self {
        Self([x; 8])
    }
    #[inline(always)]
    fn load(x: &[f32; 8]) -> Self {
        Self(*x)
    }
    #[inline(always)]
    fn load_row(rows: &[[f32; 8]; 6], row: Row) -> Self {
        Self(rows[row.0 / 8])
    }
    #[inline(always)]
    fn load_halves(low: &[f32; 4], high: &[f32; 4]) -> Self {
        let ([a, b, c, d], [e, f, g, h]) = (*low, *high);
        Self([a, b, c, d, e, f, g, h])
    }
    #[inline(always)]
    fn load_bytes(rows: &[[u8; 8]; 6], row: Row) -> Self {
        let mut out = [0.0; 8];
        for (out, plane) in out.iter_mut().zip(&rows[row.0 / 8]) {
            *out = f32::from(*plane);
        }
        Self(out)
    }
    #[inline(always)]
    fn look_up(words: &[u32; 8], vertex: usize, table: &[u32; 16]) -> Self {
        let mut out = [0.0; 8];
        for (out, word) in out.iter_mut().zip(words) {
            *out = f32::from_bits(table[(word >> (4 * vertex) & 15) as usize]);
        }
        Self(out)
    }
    #[inline(always)]
    fn store(self) -> [f32; 8] {
        self.0
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
    fn mul_sub(self, b: Self, c: Self) -> Self {
        self.mul(b).sub(c)
    }
    #[inline(always)]
    fn mul_add(self, b: Self, c: Self) -> Self {
        self.mul(b).add(c)
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
    fn turned_by(self, o: Self) -> Self {
        self.zip(o, |a, b| f32::from_bits(a.to_bits() ^ (b.to_bits() & 1 << 31)))
    }
    #[inline(always)]
    fn negative(self) -> u32 {
        let mut mask = 0;
        for k in 0..8 {
            mask |= (self.0[k].to_bits() >> 31) << k;
        }
        mask
    }
    #[inline(always)]
    fn le(self, o: Self) -> u32 {
        let mut mask = 0;
        for k in 0..8 {
            mask |= u32::from(self.0[k] <= o.0[k]) << k;
        }
        mask
    }
    #[inline(always)]
    fn pack(self, words: &[u32; 8], mut mask: u32) -> [u64; 8] {
        let mut out = [0; 8];
        let mut n = 0;
        while mask != 0 {
            let k = mask.trailing_zeros() as usize & 7;
            out[n & 7] = u64::from(self.0[k].to_bits()) << 32 | u64::from(words[k]);
            n += 1;
            mask &= mask - 1;
        }
        out
    }
    #[inline(always)]
    fn pack_words(words: &[u32; 8], mut mask: u32) -> [u32; 8] {
        let mut out = [0; 8];
        let mut n = 0;
        while mask != 0 {
            out[n & 7] = words[mask.trailing_zeros() as usize & 7];
            n += 1;
            mask &= mask - 1;
        }
        out
    }
}
