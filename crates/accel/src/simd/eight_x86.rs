//! Eight `f64` in two registers of AVX, or in one of AVX-512.
//!
//! As in `avx2`: every method is meant to be inlined into a `run`.

use core::arch::x86_64::*;

use super::Packed;
use super::avx2::Avx2;
use super::avx512::Avx512;
use super::eight::{EXPONENT, Eight};

/// The lower four and the upper four.
#[derive(Clone, Copy)]
pub(crate) struct Ymm([__m256d; 2]);

impl Ymm {
    /// All bits of the lanes in the mask.
    #[inline(always)]
    fn lanes(mask: u32) -> Self {
        // SAFETY: as of all blocks below.
        unsafe {
            let mask = _mm256_set1_epi64x(mask.into());
            let (low, high) = (_mm256_setr_epi64x(1, 2, 4, 8), _mm256_setr_epi64x(16, 32, 64, 128));
            let low = _mm256_cmpeq_epi64(_mm256_and_si256(mask, low), low);
            let high = _mm256_cmpeq_epi64(_mm256_and_si256(mask, high), high);
            Self([_mm256_castsi256_pd(low), _mm256_castsi256_pd(high)])
        }
    }

    #[inline(always)]
    fn mask(self) -> u32 {
        // SAFETY: as of all blocks below.
        unsafe { (_mm256_movemask_pd(self.0[0]) | _mm256_movemask_pd(self.0[1]) << 4) as u32 }
    }
}

// SAFETY of all blocks below: the intrinsics need AVX2 (or AVX-512 F), which the `run` of whoever names the type promises;
// pointers come from references to as many bytes as are read or written.
#[allow(clippy::undocumented_unsafe_blocks, reason = "one reason for all, above")]
impl Eight for Ymm {
    #[inline(always)]
    fn splat(x: f64) -> Self {
        unsafe { Self([_mm256_set1_pd(x); 2]) }
    }
    #[inline(always)]
    fn load(x: &[f64; 8]) -> Self {
        unsafe { Self([_mm256_loadu_pd(x.as_ptr()), _mm256_loadu_pd(x.as_ptr().add(4))]) }
    }
    #[inline(always)]
    fn store(self, to: &mut [f64; 8]) {
        unsafe {
            _mm256_storeu_pd(to.as_mut_ptr(), self.0[0]);
            _mm256_storeu_pd(to.as_mut_ptr().add(4), self.0[1]);
        }
    }
    #[inline(always)]
    fn add(self, o: Self) -> Self {
        unsafe { Self([_mm256_add_pd(self.0[0], o.0[0]), _mm256_add_pd(self.0[1], o.0[1])]) }
    }
    #[inline(always)]
    fn sub(self, o: Self) -> Self {
        unsafe { Self([_mm256_sub_pd(self.0[0], o.0[0]), _mm256_sub_pd(self.0[1], o.0[1])]) }
    }
    #[inline(always)]
    fn mul(self, o: Self) -> Self {
        unsafe { Self([_mm256_mul_pd(self.0[0], o.0[0]), _mm256_mul_pd(self.0[1], o.0[1])]) }
    }
    #[inline(always)]
    fn div(self, o: Self) -> Self {
        unsafe { Self([_mm256_div_pd(self.0[0], o.0[0]), _mm256_div_pd(self.0[1], o.0[1])]) }
    }
    #[inline(always)]
    fn min(self, o: Self) -> Self {
        unsafe { Self([_mm256_min_pd(self.0[0], o.0[0]), _mm256_min_pd(self.0[1], o.0[1])]) }
    }
    #[inline(always)]
    fn max(self, o: Self) -> Self {
        unsafe { Self([_mm256_max_pd(self.0[0], o.0[0]), _mm256_max_pd(self.0[1], o.0[1])]) }
    }
    #[inline(always)]
    fn abs(self) -> Self {
        unsafe {
            let sign = _mm256_set1_pd(-0.0);
            Self([_mm256_andnot_pd(sign, self.0[0]), _mm256_andnot_pd(sign, self.0[1])])
        }
    }
    #[inline(always)]
    fn exponent(self) -> Self {
        unsafe {
            let bits = _mm256_castsi256_pd(_mm256_set1_epi64x(EXPONENT as i64));
            Self([_mm256_and_pd(bits, self.0[0]), _mm256_and_pd(bits, self.0[1])])
        }
    }
    #[inline(always)]
    fn lt(self, o: Self) -> u32 {
        unsafe {
            let low = _mm256_cmp_pd::<_CMP_LT_OQ>(self.0[0], o.0[0]);
            Self([low, _mm256_cmp_pd::<_CMP_LT_OQ>(self.0[1], o.0[1])]).mask()
        }
    }
    #[inline(always)]
    fn le(self, o: Self) -> u32 {
        unsafe {
            let low = _mm256_cmp_pd::<_CMP_LE_OQ>(self.0[0], o.0[0]);
            Self([low, _mm256_cmp_pd::<_CMP_LE_OQ>(self.0[1], o.0[1])]).mask()
        }
    }
    #[inline(always)]
    fn select(self, mask: u32, o: Self) -> Self {
        unsafe {
            let lanes = Self::lanes(mask);
            let low = _mm256_blendv_pd(o.0[0], self.0[0], lanes.0[0]);
            Self([low, _mm256_blendv_pd(o.0[1], self.0[1], lanes.0[1])])
        }
    }
}

#[allow(clippy::undocumented_unsafe_blocks, reason = "one reason for all, above")]
impl Packed for Avx2 {
    type Eight = Ymm;
    #[inline(always)]
    fn widen(self) -> Ymm {
        unsafe {
            let (low, high) = (_mm256_castps256_ps128(self.0), _mm256_extractf128_ps::<1>(self.0));
            Ymm([_mm256_cvtps_pd(low), _mm256_cvtps_pd(high)])
        }
    }
    #[inline(always)]
    fn narrow(x: Ymm) -> Self {
        unsafe { Self(_mm256_set_m128(_mm256_cvtpd_ps(x.0[1]), _mm256_cvtpd_ps(x.0[0]))) }
    }
    #[inline(always)]
    fn choose(self, mask: u32, o: Self) -> Self {
        unsafe {
            let bits = _mm256_setr_epi32(1, 2, 4, 8, 16, 32, 64, 128);
            let lanes = _mm256_cmpeq_epi32(_mm256_and_si256(_mm256_set1_epi32(mask as i32), bits), bits);
            Self(_mm256_blendv_ps(o.0, self.0, _mm256_castsi256_ps(lanes)))
        }
    }
    #[inline(always)]
    fn put(self, to: &mut [f32; 8]) {
        unsafe { _mm256_storeu_ps(to.as_mut_ptr(), self.0) }
    }
    #[inline(always)]
    fn smallest(self) -> f32 {
        unsafe {
            let x = _mm_min_ps(_mm256_castps256_ps128(self.0), _mm256_extractf128_ps::<1>(self.0));
            let x = _mm_min_ps(x, _mm_movehl_ps(x, x));
            _mm_cvtss_f32(_mm_min_ss(x, _mm_movehdup_ps(x)))
        }
    }
    #[inline(always)]
    fn largest(self) -> f32 {
        unsafe {
            let x = _mm_max_ps(_mm256_castps256_ps128(self.0), _mm256_extractf128_ps::<1>(self.0));
            let x = _mm_max_ps(x, _mm_movehl_ps(x, x));
            _mm_cvtss_f32(_mm_max_ss(x, _mm_movehdup_ps(x)))
        }
    }
}

/// All eight.
#[derive(Clone, Copy)]
pub(crate) struct Zmm(__m512d);

#[allow(clippy::undocumented_unsafe_blocks, reason = "one reason for all, above")]
impl Eight for Zmm {
    #[inline(always)]
    fn splat(x: f64) -> Self {
        unsafe { Self(_mm512_set1_pd(x)) }
    }
    #[inline(always)]
    fn load(x: &[f64; 8]) -> Self {
        unsafe { Self(_mm512_loadu_pd(x.as_ptr())) }
    }
    #[inline(always)]
    fn store(self, to: &mut [f64; 8]) {
        unsafe { _mm512_storeu_pd(to.as_mut_ptr(), self.0) }
    }
    #[inline(always)]
    fn add(self, o: Self) -> Self {
        unsafe { Self(_mm512_add_pd(self.0, o.0)) }
    }
    #[inline(always)]
    fn sub(self, o: Self) -> Self {
        unsafe { Self(_mm512_sub_pd(self.0, o.0)) }
    }
    #[inline(always)]
    fn mul(self, o: Self) -> Self {
        unsafe { Self(_mm512_mul_pd(self.0, o.0)) }
    }
    #[inline(always)]
    fn div(self, o: Self) -> Self {
        unsafe { Self(_mm512_div_pd(self.0, o.0)) }
    }
    #[inline(always)]
    fn min(self, o: Self) -> Self {
        unsafe { Self(_mm512_min_pd(self.0, o.0)) }
    }
    #[inline(always)]
    fn max(self, o: Self) -> Self {
        unsafe { Self(_mm512_max_pd(self.0, o.0)) }
    }
    #[inline(always)]
    fn abs(self) -> Self {
        unsafe { Self(_mm512_abs_pd(self.0)) }
    }
    #[inline(always)]
    fn exponent(self) -> Self {
        unsafe {
            let bits = _mm512_and_si512(_mm512_castpd_si512(self.0), _mm512_set1_epi64(EXPONENT as i64));
            Self(_mm512_castsi512_pd(bits))
        }
    }
    #[inline(always)]
    fn lt(self, o: Self) -> u32 {
        unsafe { u32::from(_mm512_cmp_pd_mask::<_CMP_LT_OQ>(self.0, o.0)) }
    }
    #[inline(always)]
    fn le(self, o: Self) -> u32 {
        unsafe { u32::from(_mm512_cmp_pd_mask::<_CMP_LE_OQ>(self.0, o.0)) }
    }
    #[inline(always)]
    fn select(self, mask: u32, o: Self) -> Self {
        unsafe { Self(_mm512_mask_blend_pd(mask as u8, o.0, self.0)) }
    }
}

#[allow(clippy::undocumented_unsafe_blocks, reason = "one reason for all, above")]
impl Packed for Avx512 {
    type Eight = Zmm;
    #[inline(always)]
    fn widen(self) -> Zmm {
        unsafe { Zmm(_mm512_cvtps_pd(self.0)) }
    }
    #[inline(always)]
    fn narrow(x: Zmm) -> Self {
        unsafe { Self(_mm512_cvtpd_ps(x.0)) }
    }
    #[inline(always)]
    fn choose(self, mask: u32, o: Self) -> Self {
        unsafe { Self(_mm256_mask_blend_ps(mask as u8, o.0, self.0)) }
    }
    #[inline(always)]
    fn put(self, to: &mut [f32; 8]) {
        unsafe { _mm256_storeu_ps(to.as_mut_ptr(), self.0) }
    }
    #[inline(always)]
    fn smallest(self) -> f32 {
        unsafe {
            let x = _mm_min_ps(_mm256_castps256_ps128(self.0), _mm256_extractf128_ps::<1>(self.0));
            let x = _mm_min_ps(x, _mm_movehl_ps(x, x));
            _mm_cvtss_f32(_mm_min_ss(x, _mm_movehdup_ps(x)))
        }
    }
    #[inline(always)]
    fn largest(self) -> f32 {
        unsafe {
            let x = _mm_max_ps(_mm256_castps256_ps128(self.0), _mm256_extractf128_ps::<1>(self.0));
            let x = _mm_max_ps(x, _mm_movehl_ps(x, x));
            _mm_cvtss_f32(_mm_max_ss(x, _mm_movehdup_ps(x)))
        }
    }
}
