//! Eight lanes in one register of AVX2.
//!
//! Every method is meant to be inlined into [`run`], which is compiled for AVX2; only then are the intrinsics single
//! instructions. Called elsewhere they would be slow, and on a processor without AVX2 undefined; the type is private to
//! this module and appears nowhere but as the parameter of the work that `run` is given.

use core::arch::x86_64::*;

use super::{Lanes, Row, Work};

/// Eight `f32`.
#[derive(Clone, Copy)]
pub(super) struct Avx2(pub(super) __m256);

/// Does the work with AVX2, FMA and BMI2.
///
/// # Safety
/// The processor must have them.
#[target_feature(enable = "avx2,fma,bmi1,bmi2,lzcnt,popcnt")]
pub(super) unsafe fn run<W: Work>(work: W) -> W::Output {
    work.run::<Avx2>()
}

/// For each mask, which lanes it has, from the lowest, one byte each.
static LANES: [[u8; 8]; 256] = {
    let mut table = [[0; 8]; 256];
    let mut mask = 0;
    while mask < 256 {
        let (mut lane, mut n) = (0, 0);
        while lane < 8 {
            if mask >> lane & 1 == 1 {
                table[mask][n] = lane;
                n += 1;
            }
            lane += 1;
        }
        mask += 1;
    }
    table
};

// SAFETY of all blocks below: the intrinsics need AVX2 and FMA, which `run` promises; pointers come from references to
// as many bytes as are read or written.
#[allow(clippy::undocumented_unsafe_blocks, reason = "one reason for all, above")]
impl Lanes for Avx2 {
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
            // The low three bits count.
            let low = _mm256_permutevar8x32_ps(_mm256_loadu_ps(table.as_ptr().cast()), index);
            let high = _mm256_permutevar8x32_ps(_mm256_loadu_ps(table.as_ptr().add(8).cast()), index);
            Self(_mm256_blendv_ps(low, high, _mm256_castsi256_ps(_mm256_slli_epi32::<28>(index))))
        }
    }
    #[inline(always)]
    fn le(self, o: Self) -> u32 {
        unsafe { _mm256_movemask_ps(_mm256_cmp_ps::<_CMP_LE_OQ>(self.0, o.0)) as u32 }
    }
    #[inline(always)]
    fn pack(self, words: &[u32; 8], mask: u32) -> [u64; 8] {
        let mut out = [0u64; 8];
        unsafe {
            let lanes = _mm_loadl_epi64(LANES[mask as usize & 255].as_ptr().cast());
            let lanes = _mm256_cvtepu8_epi32(lanes);
            let high = _mm256_permutevar8x32_epi32(_mm256_castps_si256(self.0), lanes);
            let low = _mm256_permutevar8x32_epi32(_mm256_loadu_si256(words.as_ptr().cast()), lanes);
            let (even, odd) = (_mm256_unpacklo_epi32(low, high), _mm256_unpackhi_epi32(low, high));
            _mm256_storeu_si256(out.as_mut_ptr().cast(), _mm256_permute2x128_si256::<0x20>(even, odd));
            _mm256_storeu_si256(out.as_mut_ptr().add(4).cast(), _mm256_permute2x128_si256::<0x31>(even, odd));
        }
        out
    }
    #[inline(always)]
    fn pack_words(words: &[u32; 8], mask: u32) -> [u32; 8] {
        let mut out = [0u32; 8];
        unsafe {
            let lanes = _mm256_cvtepu8_epi32(_mm_loadl_epi64(LANES[mask as usize & 255].as_ptr().cast()));
            let packed = _mm256_permutevar8x32_epi32(_mm256_loadu_si256(words.as_ptr().cast()), lanes);
            _mm256_storeu_si256(out.as_mut_ptr().cast(), packed);
        }
        out
    }
}
