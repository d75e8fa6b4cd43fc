//! What eight lanes in one register of 256 bits do alike, with AVX2 and with AVX-512VL.

/// The methods of `Lanes` that need AVX2 and FMA alone, for a type that is a tuple of one `__m256`.
macro_rules! ymm {
    () => {
        #[inline(always)]
        fn splat(x: f32) -> Self {
            unsafe { Self(_mm256_set1_ps(x)) }
        }
        #[inline(always)]
        fn load(x: &[f32; 8]) -> Self {
            unsafe { Self(_mm256_loadu_ps(x.as_ptr())) }
        }
        #[inline(always)]
        fn load_row(rows: &[[f32; 8]; 6], row: Row) -> Self {
            // SAFETY: a `Row` is the start of one of six times eight numbers.
            unsafe { Self(_mm256_loadu_ps(rows.as_ptr().cast::<f32>().add(row.0))) }
        }
        #[inline(always)]
        fn load_halves(low: &[f32; 4], high: &[f32; 4]) -> Self {
            unsafe { Self(_mm256_set_m128(_mm_loadu_ps(high.as_ptr()), _mm_loadu_ps(low.as_ptr()))) }
        }
        #[inline(always)]
        fn store(self) -> [f32; 8] {
            let mut out = [0.0; 8];
            unsafe { _mm256_storeu_ps(out.as_mut_ptr(), self.0) };
            out
        }
        #[inline(always)]
        fn add(self, o: Self) -> Self {
            unsafe { Self(_mm256_add_ps(self.0, o.0)) }
        }
        #[inline(always)]
        fn sub(self, o: Self) -> Self {
            unsafe { Self(_mm256_sub_ps(self.0, o.0)) }
        }
        #[inline(always)]
        fn mul(self, o: Self) -> Self {
            unsafe { Self(_mm256_mul_ps(self.0, o.0)) }
        }
        #[inline(always)]
        fn div(self, o: Self) -> Self {
            unsafe { Self(_mm256_div_ps(self.0, o.0)) }
        }
        #[inline(always)]
        fn mul_sub(self, b: Self, c: Self) -> Self {
            unsafe { Self(_mm256_fmsub_ps(self.0, b.0, c.0)) }
        }
        #[inline(always)]
        fn mul_add(self, b: Self, c: Self) -> Self {
            unsafe { Self(_mm256_fmadd_ps(self.0, b.0, c.0)) }
        }
        #[inline(always)]
        fn load_bytes(rows: &[[u8; 8]; 6], row: Row) -> Self {
            // SAFETY: a `Row` is the start of one of six times eight numbers.
            let row = unsafe { _mm_loadl_epi64(rows.as_ptr().cast::<u8>().add(row.0).cast()) };
            unsafe { Self(_mm256_cvtepi32_ps(_mm256_cvtepu8_epi32(row))) }
        }
        #[inline(always)]
        fn min(self, o: Self) -> Self {
            unsafe { Self(_mm256_min_ps(self.0, o.0)) }
        }
        #[inline(always)]
        fn max(self, o: Self) -> Self {
            unsafe { Self(_mm256_max_ps(self.0, o.0)) }
        }
        #[inline(always)]
        fn abs(self) -> Self {
            unsafe { Self(_mm256_andnot_ps(_mm256_set1_ps(-0.0), self.0)) }
        }
        #[inline(always)]
        fn turned_by(self, o: Self) -> Self {
            unsafe { Self(_mm256_xor_ps(self.0, _mm256_and_ps(_mm256_set1_ps(-0.0), o.0))) }
        }
        #[inline(always)]
        fn negative(self) -> u32 {
            unsafe { _mm256_movemask_ps(self.0) as u32 }
        }
    };
}

pub(super) use ymm;
