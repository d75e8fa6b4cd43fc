//! Four `f64` in one register of AVX.
//!
//! As in `avx2`: every method is meant to be inlined into a `run`.

use core::arch::x86_64::*;

use super::avx2::Avx2;
use super::avx512::Avx512;
use super::eight::EXPONENT;
use super::four::{Four, OfFour, TWICE_THE_BIAS};

/// All four.
#[derive(Clone, Copy)]
pub(crate) struct Quad(__m256d);

// SAFETY of all blocks below: the intrinsics need AVX2, which the `run` of whoever names the type promises; pointers come
// from references to as many bytes as are read or written.
#[allow(clippy::undocumented_unsafe_blocks, reason = "one reason for all, above")]
impl Four for Quad {
    #[inline(always)]
    fn splat(x: f64) -> Self {
        unsafe { Self(_mm256_set1_pd(x)) }
    }
    #[inline(always)]
    fn new(x: f64, y: f64, z: f64, w: f64) -> Self {
        unsafe { Self(_mm256_setr_pd(x, y, z, w)) }
    }
    #[inline(always)]
    fn store(self) -> [f64; 4] {
        let mut out = [0.0; 4];
        unsafe { _mm256_storeu_pd(out.as_mut_ptr(), self.0) };
        out
    }
    #[inline(always)]
    fn sub(self, o: Self) -> Self {
        unsafe { Self(_mm256_sub_pd(self.0, o.0)) }
    }
    #[inline(always)]
    fn mul(self, o: Self) -> Self {
        unsafe { Self(_mm256_mul_pd(self.0, o.0)) }
    }
    #[inline(always)]
    fn abs(self) -> Self {
        unsafe { Self(_mm256_andnot_pd(_mm256_set1_pd(-0.0), self.0)) }
    }
    #[inline(always)]
    fn le(self, o: Self) -> u32 {
        unsafe { _mm256_movemask_pd(_mm256_cmp_pd::<_CMP_LE_OQ>(self.0, o.0)) as u32 }
    }
    #[inline(always)]
    fn largest(self) -> f64 {
        unsafe {
            let (low, high) = (_mm256_castpd256_pd128(self.0), _mm256_extractf128_pd::<1>(self.0));
            let most = _mm_max_sd(low, high);
            _mm_cvtsd_f64(_mm_max_sd(_mm_unpackhi_pd(low, low), most))
        }
    }
    #[inline(always)]
    fn powers(self) -> (Self, Self) {
        unsafe {
            let largest = _mm256_castpd_si256(_mm256_set1_pd(self.largest()));
            let exponent = _mm256_and_si256(largest, _mm256_set1_epi64x(EXPONENT as i64));
            let reciprocal = _mm256_sub_epi64(_mm256_set1_epi64x(TWICE_THE_BIAS as i64), exponent);
            (Self(_mm256_castsi256_pd(exponent)), Self(_mm256_castsi256_pd(reciprocal)))
        }
    }
}

/// Alike with AVX2 and with AVX-512VL.
macro_rules! of_four {
    ($lanes:ident) => {
        #[allow(clippy::undocumented_unsafe_blocks, reason = "one reason for all, above")]
        impl OfFour for $lanes {
            type Four = Quad;
            #[inline(always)]
            fn narrow_four(x: Quad) -> Self {
                unsafe { Self(_mm256_zextps128_ps256(_mm256_cvtpd_ps(x.0))) }
            }
            #[inline(always)]
            fn reordered(self, lanes: &[u32; 8]) -> Self {
                unsafe { Self(_mm256_permutevar8x32_ps(self.0, _mm256_loadu_si256(lanes.as_ptr().cast()))) }
            }
        }
    };
}

of_four!(Avx2);
of_four!(Avx512);
