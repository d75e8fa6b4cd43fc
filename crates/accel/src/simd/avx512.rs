//! Eight lanes in one register of AVX-512VL: as `avx2`, with masks for lanes and 32 registers.

use core::arch::x86_64::*;

use super::{Lanes, Row, Work};

/// Eight `f32`.
#[derive(Clone, Copy)]
pub(super) struct Avx512(pub(super) __m256);

/// Does the work with AVX-512 F and VL, and what comes with AVX2.
///
/// # Safety
/// The processor must have them.
#[target_feature(enable = "avx2,fma,bmi1,bmi2,lzcnt,popcnt,avx512f,avx512vl")]
pub(super) unsafe fn run<W: Work>(work: W) -> W::Output {
    work.run::<Avx512>()
}

// SAFETY of all blocks below: the intrinsics need AVX-512 F, VL and FMA, which `run` promises; pointers come from
// references to as many bytes as are read or written.
#[allow(clippy::undocumented_unsafe_blocks, reason = "one reason for all, above")]
impl Lanes for Avx512 {
    super::ymm::ymm!();
    #[inline(always)]
    fn look_up(words: &[u32; 8], vertex: usize, table: &[u32; 16]) -> Self {
        unsafe {
            let words = _mm256_loadu_si256(words.as_ptr().cast());
            let index = match vertex {
                0 => words,
                1 => _mm256_srli_epi32::<4>(words),
                _ => _mm256_srli_epi32::<8>(words),
            };
            let (low, high) = (_mm256_loadu_ps(table.as_ptr().cast()), _mm256_loadu_ps(table.as_ptr().add(8).cast()));
            // The low four bits count.
            Self(_mm256_permutex2var_ps(low, index, high))
        }
    }
    #[inline(always)]
    fn le(self, o: Self) -> u32 {
        unsafe { u32::from(_mm256_cmp_ps_mask::<_CMP_LE_OQ>(self.0, o.0)) }
    }
    #[inline(always)]
    fn pack(self, words: &[u32; 8], mask: u32) -> [u64; 8] {
        let mut out = [0u64; 8];
        unsafe {
            let high = _mm256_maskz_compress_epi32(mask as u8, _mm256_castps_si256(self.0));
            let low = _mm256_maskz_compress_epi32(mask as u8, _mm256_loadu_si256(words.as_ptr().cast()));
            let (first, second) =
                (_mm256_setr_epi32(0, 8, 1, 9, 2, 10, 3, 11), _mm256_setr_epi32(4, 12, 5, 13, 6, 14, 7, 15));
            _mm256_storeu_si256(out.as_mut_ptr().cast(), _mm256_permutex2var_epi32(low, first, high));
            _mm256_storeu_si256(out.as_mut_ptr().add(4).cast(), _mm256_permutex2var_epi32(low, second, high));
        }
        out
    }
    #[inline(always)]
    fn pack_words(words: &[u32; 8], mask: u32) -> [u32; 8] {
        let mut out = [0u32; 8];
        unsafe {
            let packed = _mm256_maskz_compress_epi32(mask as u8, _mm256_loadu_si256(words.as_ptr().cast()));
            _mm256_storeu_si256(out.as_mut_ptr().cast(), packed);
        }
        out
    }
}
