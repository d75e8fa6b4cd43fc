//! Eight numbers at a time: the only room with `unsafe`.
//!
//! [`Lanes`] is what a traversal is written over; [`Portable`] is its meaning, in plain Rust, and every other form must
//! give the same bits (there is a test), but for [`Lanes::mul_sub`] and [`Lanes::mul_add`], which may round once or twice and so
//! have their place in conservative tests only. [`run`] enters a function compiled for a [`Level`], chosen once per query.

#[cfg(target_arch = "x86_64")]
mod avx2;
#[cfg(target_arch = "x86_64")]
mod avx512;
mod eight;
#[cfg(target_arch = "x86_64")]
mod eight_x86;
mod four;
#[cfg(target_arch = "x86_64")]
mod four_x86;
mod portable;
mod stack;
#[cfg(target_arch = "x86_64")]
mod ymm;

pub(crate) use eight::{Eight, Packed};
pub(crate) use four::{Four, OfFour};
pub(crate) use portable::Portable;
pub(crate) use stack::{Stack, Stacks};

/// Which instructions the queries of a scene use. Answers do not depend on it (of [`Precision::Fast`], those at the
/// very edges of boxes may).
///
/// [`Precision::Fast`]: firsthit_geometry::Precision::Fast
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Level {
    /// What every processor has; the compiler does with it what it can.
    Scalar,
    /// AVX2, FMA and BMI2 of x86-64.
    Avx2,
    /// The same and AVX-512 F and VL: registers of the same width, but twice as many.
    #[default]
    Avx512,
}

impl Level {
    /// Every level, from the least demanding.
    pub const ALL: [Self; 3] = [Self::Scalar, Self::Avx2, Self::Avx512];

    /// Whether this processor has it.
    #[must_use]
    pub fn is_available(self) -> bool {
        match self {
            Self::Scalar => true,
            #[cfg(target_arch = "x86_64")]
            Self::Avx2 => {
                is_x86_feature_detected!("avx2")
                    && is_x86_feature_detected!("fma")
                    && is_x86_feature_detected!("bmi1")
                    && is_x86_feature_detected!("bmi2")
                    && is_x86_feature_detected!("lzcnt")
                    && is_x86_feature_detected!("popcnt")
            }
            #[cfg(target_arch = "x86_64")]
            Self::Avx512 => {
                Self::Avx2.is_available() && is_x86_feature_detected!("avx512f") && is_x86_feature_detected!("avx512vl")
            }
            #[cfg(not(target_arch = "x86_64"))]
            Self::Avx2 | Self::Avx512 => false,
        }
    }

    /// The name used on command lines and in reports.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Scalar => "scalar",
            Self::Avx2 => "avx2",
            Self::Avx512 => "avx512",
        }
    }
}

impl core::fmt::Display for Level {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str(self.name())
    }
}

impl core::str::FromStr for Level {
    type Err = String;

    fn from_str(s: &str) -> Result<Self, String> {
        Self::ALL
            .into_iter()
            .find(|l| l.name() == s)
            .ok_or_else(|| format!("unknown SIMD level '{s}' (scalar, avx2 or avx512)"))
    }
}

/// Eight `f32`. Comparisons answer with one bit for each lane, false for NaN.
pub(crate) trait Lanes: Packed + OfFour {
    fn splat(x: f32) -> Self;
    fn load(x: &[f32; 8]) -> Self;
    /// One of the rows.
    fn load_row(rows: &[[f32; 8]; 6], row: Row) -> Self;
    /// The lower four lanes from one place, the upper four from another.
    fn load_halves(low: &[f32; 4], high: &[f32; 4]) -> Self;
    /// One of the rows, of whole numbers.
    fn load_bytes(rows: &[[u8; 8]; 6], row: Row) -> Self;
    /// For each lane the number whose bits are in the table, at the index that is in the word's low four bits once it is
    /// shifted by four times `vertex`, which is 0, 1 or 2.
    fn look_up(words: &[u32; 8], vertex: usize, table: &[u32; 16]) -> Self;
    fn store(self) -> [f32; 8];
    fn add(self, o: Self) -> Self;
    fn sub(self, o: Self) -> Self;
    fn mul(self, o: Self) -> Self;
    fn div(self, o: Self) -> Self;
    /// `self * b - c`, rounded once or twice.
    fn mul_sub(self, b: Self, c: Self) -> Self;
    /// `self * b + c`, rounded once or twice.
    fn mul_add(self, b: Self, c: Self) -> Self;
    /// The smaller; `o` where one is NaN.
    fn min(self, o: Self) -> Self;
    /// The larger; `o` where one is NaN.
    fn max(self, o: Self) -> Self;
    fn abs(self) -> Self;
    /// With the sign turned where that of `o` is negative.
    fn turned_by(self, o: Self) -> Self;
    /// Lanes whose sign is negative, -0 too.
    fn negative(self) -> u32;
    /// Lanes where `self <= o`.
    fn le(self, o: Self) -> u32;
    /// For each lane in the mask, from the lowest, `bits(self) << 32 | words`. Returns them all at the front of eight;
    /// what follows is of no use.
    fn pack(self, words: &[u32; 8], mask: u32) -> [u64; 8];
    /// The words of the lanes in the mask alone.
    fn pack_words(words: &[u32; 8], mask: u32) -> [u32; 8];
}

/// The index of one row of six.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Row(usize);

impl Row {
    /// # Panics
    /// If there is no such row.
    #[inline(always)]
    pub(crate) const fn new(row: usize) -> Self {
        assert!(row < 6);
        Self(row * 8)
    }
}

/// Work that is written once for all levels.
pub(crate) trait Work {
    type Output;
    /// Must be `#[inline(always)]`, and so everything below it that should use the level's instructions.
    fn run<L: Lanes>(self) -> Self::Output;
}

/// A level that this processor has.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Available(Level);

impl Available {
    /// The level wished for, or the best there is below it.
    pub(crate) fn up_to(level: Level) -> Self {
        let below = Level::ALL.into_iter().rev().skip_while(|&l| l != level);
        Self(below.into_iter().find(|l| l.is_available()).unwrap_or(Level::Scalar))
    }
}

/// Asks for what will be needed soon.
#[inline(always)]
pub(crate) fn prefetch<T>(what: &T) {
    #[cfg(target_arch = "x86_64")]
    {
        use core::arch::x86_64::{_MM_HINT_T0, _mm_prefetch};
        let start = core::ptr::from_ref(what).cast::<i8>();
        let mut line = 0;
        while line < size_of::<T>() {
            // SAFETY: the address is within what the reference is to, and what is fetched is not looked at.
            unsafe { _mm_prefetch::<_MM_HINT_T0>(start.add(line)) };
            line += 64;
        }
    }
    #[cfg(not(target_arch = "x86_64"))]
    let _ = what;
}

/// Does the work by the instructions of a level.
#[inline(always)]
pub(crate) fn run<W: Work>(level: Available, work: W) -> W::Output {
    // Not by `by_vectors`: what lies between would copy the answer.
    match level.0 {
        // SAFETY: an `Available` is made only of levels that the processor has.
        #[cfg(target_arch = "x86_64")]
        Level::Avx2 => unsafe { avx2::run(work) },
        // SAFETY: as above.
        #[cfg(target_arch = "x86_64")]
        Level::Avx512 => unsafe { avx512::run(work) },
        _ => portable(work),
    }
}

/// The same, if these are not plain Rust, which is large when compiled: then the work comes back.
#[inline(always)]
pub(crate) fn by_vectors<W: Work>(level: Available, work: W) -> Result<W::Output, W> {
    match level.0 {
        // SAFETY: an `Available` is made only of levels that the processor has.
        #[cfg(target_arch = "x86_64")]
        Level::Avx2 => Ok(unsafe { avx2::run(work) }),
        // SAFETY: as above.
        #[cfg(target_arch = "x86_64")]
        Level::Avx512 => Ok(unsafe { avx512::run(work) }),
        _ => Err(work),
    }
}

/// Work in plain Rust. A function of its own, as the others are: compiled once for each work, not for each caller.
#[inline(never)]
pub(crate) fn portable<W: Work>(work: W) -> W::Output {
    work.run::<Portable>()
}
