//! The forms of x86: AVX2, and AVX-512 on eight lanes.

use super::{COMPRESS, Simd};
use std::arch::x86_64::*;

/// AVX2 and FMA. Only [`Avx2::detect`] makes one.
#[derive(Clone, Copy)]
pub struct Avx2(());

/// AVX-512 on eight lanes: masks in registers of their own, twice as many registers. Only [`Avx512::detect`] makes one.
#[derive(Clone, Copy)]
pub struct Avx512(());

impl Avx2 {
    /// Permission to use AVX2 and FMA, where the machine has them.
    pub fn detect() -> Option<Self> {
        (std::arch::is_x86_feature_detected!("avx2") && std::arch::is_x86_feature_detected!("fma")).then_some(Self(()))
    }
}

impl Avx512 {
    /// Permission to use AVX-512 F and VL, where the machine has them beside AVX2 and FMA.
    pub fn detect() -> Option<Self> {
        let has = Avx2::detect().is_some()
            && std::arch::is_x86_feature_detected!("avx512f")
            && std::arch::is_x86_feature_detected!("avx512vl");
        has.then_some(Self(()))
    }
}

// SAFETY, for all blocks below: the intrinsics ask for AVX2 (or AVX, which it includes), FMA and, in `Avx512` alone, AVX-512 F
// and VL. `self` exists, so its `detect` has seen them. Loads and stores go through references to arrays of the whole width
// (8 bytes for `_mm_loadl_epi64`), in the forms that ask for no alignment.

/// What both have in common.
macro_rules! common {
    () => {
        type F = __m256;
        type I = __m256i;

        #[inline(always)]
        fn splat(self, x: f32) -> __m256 {
            unsafe { _mm256_set1_ps(x) }
        }
        #[inline(always)]
        fn load(self, x: &[f32; 8]) -> __m256 {
            unsafe { _mm256_loadu_ps(x.as_ptr()) }
        }
        #[inline(always)]
        fn store(self, a: __m256, to: &mut [f32; 8]) {
            unsafe { _mm256_storeu_ps(to.as_mut_ptr(), a) }
        }
        #[inline(always)]
        fn add(self, a: __m256, b: __m256) -> __m256 {
            unsafe { _mm256_add_ps(a, b) }
        }
        #[inline(always)]
        fn sub(self, a: __m256, b: __m256) -> __m256 {
            unsafe { _mm256_sub_ps(a, b) }
        }
        #[inline(always)]
        fn mul(self, a: __m256, b: __m256) -> __m256 {
            unsafe { _mm256_mul_ps(a, b) }
        }
        #[inline(always)]
        fn mul_sub(self, a: __m256, b: __m256, c: __m256) -> __m256 {
            unsafe { _mm256_fmsub_ps(a, b, c) }
        }
        #[inline(always)]
        fn div(self, a: __m256, b: __m256) -> __m256 {
            unsafe { _mm256_div_ps(a, b) }
        }
        #[inline(always)]
        fn min(self, a: __m256, b: __m256) -> __m256 {
            unsafe { _mm256_min_ps(a, b) }
        }
        #[inline(always)]
        fn max(self, a: __m256, b: __m256) -> __m256 {
            unsafe { _mm256_max_ps(a, b) }
        }
        #[inline(always)]
        fn sqrt(self, a: __m256) -> __m256 {
            unsafe { _mm256_sqrt_ps(a) }
        }
        #[inline(always)]
        fn floor(self, a: __m256) -> __m256 {
            unsafe { _mm256_floor_ps(a) }
        }
        #[inline(always)]
        fn abs(self, a: __m256) -> __m256 {
            unsafe { _mm256_andnot_ps(_mm256_set1_ps(-0.0), a) }
        }
        #[inline(always)]
        fn with_sign(self, a: __m256, b: __m256) -> __m256 {
            unsafe {
                let sign = _mm256_set1_ps(-0.0);
                _mm256_or_ps(_mm256_andnot_ps(sign, a), _mm256_and_ps(sign, b))
            }
        }
        #[inline(always)]
        fn splat_ids(self, x: u32) -> __m256i {
            unsafe { _mm256_set1_epi32(x as i32) }
        }
        #[inline(always)]
        fn ids(self, a: __m256) -> __m256i {
            unsafe { _mm256_cvttps_epi32(a) }
        }
        #[inline(always)]
        fn floats(self, a: __m256i) -> __m256 {
            unsafe { _mm256_cvtepi32_ps(a) }
        }
        #[inline(always)]
        fn bits(self, a: __m256) -> __m256i {
            unsafe { _mm256_castps_si256(a) }
        }
        #[inline(always)]
        fn of_bits(self, a: __m256i) -> __m256 {
            unsafe { _mm256_castsi256_ps(a) }
        }
        #[inline(always)]
        fn add_ids(self, a: __m256i, b: __m256i) -> __m256i {
            unsafe { _mm256_add_epi32(a, b) }
        }
        #[inline(always)]
        fn mul_ids(self, a: __m256i, b: __m256i) -> __m256i {
            unsafe { _mm256_mullo_epi32(a, b) }
        }
        #[inline(always)]
        fn and_ids(self, a: __m256i, b: __m256i) -> __m256i {
            unsafe { _mm256_and_si256(a, b) }
        }
        #[inline(always)]
        fn xor_ids(self, a: __m256i, b: __m256i) -> __m256i {
            unsafe { _mm256_xor_si256(a, b) }
        }
        #[inline(always)]
        fn shift_up<const BITS: i32>(self, a: __m256i) -> __m256i {
            unsafe { _mm256_slli_epi32::<BITS>(a) }
        }
        #[inline(always)]
        fn shift_down<const BITS: i32>(self, a: __m256i) -> __m256i {
            unsafe { _mm256_srli_epi32::<BITS>(a) }
        }
        #[inline(always)]
        fn fours(self, from: &[f32], at: __m256i) -> [__m256; 4] {
            assert!(from.len() >= 4, "nothing to load from");
            let last = u32::try_from(from.len() - 4).unwrap_or(u32::MAX);
            let mut offsets = [0; 8];
            self.store_ids(unsafe { _mm256_min_epu32(at, self.splat_ids(last)) }, &mut offsets);
            unsafe {
                // In bounds: no offset is past the last at which there are four.
                let p = from.as_ptr();
                let o = offsets;
                let a = _mm256_loadu2_m128(p.add(o[4] as usize), p.add(o[0] as usize));
                let b = _mm256_loadu2_m128(p.add(o[5] as usize), p.add(o[1] as usize));
                let c = _mm256_loadu2_m128(p.add(o[6] as usize), p.add(o[2] as usize));
                let d = _mm256_loadu2_m128(p.add(o[7] as usize), p.add(o[3] as usize));
                let (ab, cd) = (_mm256_unpacklo_ps(a, b), _mm256_unpacklo_ps(c, d));
                let (ab_high, cd_high) = (_mm256_unpackhi_ps(a, b), _mm256_unpackhi_ps(c, d));
                [
                    _mm256_shuffle_ps::<0b01_00_01_00>(ab, cd),
                    _mm256_shuffle_ps::<0b11_10_11_10>(ab, cd),
                    _mm256_shuffle_ps::<0b01_00_01_00>(ab_high, cd_high),
                    _mm256_shuffle_ps::<0b11_10_11_10>(ab_high, cd_high),
                ]
            }
        }
        #[inline(always)]
        fn fours_in_row(self, from: &[f32], at: usize) -> [__m256; 4] {
            let row = &from[at..at + 32];
            unsafe {
                // In bounds: the last of the four begins at 24.
                let p = row.as_ptr();
                let (p01, p23) = (_mm256_loadu_ps(p), _mm256_loadu_ps(p.add(8)));
                let (p45, p67) = (_mm256_loadu_ps(p.add(16)), _mm256_loadu_ps(p.add(24)));
                let (a, b) = (_mm256_permute2f128_ps::<0x20>(p01, p45), _mm256_permute2f128_ps::<0x31>(p01, p45));
                let (c, d) = (_mm256_permute2f128_ps::<0x20>(p23, p67), _mm256_permute2f128_ps::<0x31>(p23, p67));
                let (ab, cd) = (_mm256_unpacklo_ps(a, b), _mm256_unpacklo_ps(c, d));
                let (ab_high, cd_high) = (_mm256_unpackhi_ps(a, b), _mm256_unpackhi_ps(c, d));
                [
                    _mm256_shuffle_ps::<0b01_00_01_00>(ab, cd),
                    _mm256_shuffle_ps::<0b11_10_11_10>(ab, cd),
                    _mm256_shuffle_ps::<0b01_00_01_00>(ab_high, cd_high),
                    _mm256_shuffle_ps::<0b11_10_11_10>(ab_high, cd_high),
                ]
            }
        }
        #[inline(always)]
        fn ones(self, from: &[u32], at: __m256i) -> __m256i {
            assert!(!from.is_empty(), "nothing to load from");
            let last = u32::try_from(from.len() - 1).unwrap_or(u32::MAX);
            let mut o = [0; 8];
            self.store_ids(unsafe { _mm256_min_epu32(at, self.splat_ids(last)) }, &mut o);
            // In bounds: no place is past the last.
            unsafe {
                let p = from.as_ptr().cast::<i32>();
                _mm256_setr_epi32(
                    *p.add(o[0] as usize),
                    *p.add(o[1] as usize),
                    *p.add(o[2] as usize),
                    *p.add(o[3] as usize),
                    *p.add(o[4] as usize),
                    *p.add(o[5] as usize),
                    *p.add(o[6] as usize),
                    *p.add(o[7] as usize),
                )
            }
        }
        #[inline(always)]
        fn sum(self, a: __m256) -> f32 {
            unsafe {
                let a = _mm_add_ps(_mm256_castps256_ps128(a), _mm256_extractf128_ps::<1>(a));
                let a = _mm_add_ps(a, _mm_movehl_ps(a, a));
                _mm_cvtss_f32(_mm_add_ss(a, _mm_movehdup_ps(a)))
            }
        }
        #[inline(always)]
        fn least(self, a: __m256) -> f32 {
            unsafe {
                let a = _mm_min_ps(_mm256_castps256_ps128(a), _mm256_extractf128_ps::<1>(a));
                let a = _mm_min_ps(a, _mm_movehl_ps(a, a));
                _mm_cvtss_f32(_mm_min_ss(a, _mm_movehdup_ps(a)))
            }
        }
        #[inline(always)]
        fn load_ids(self, x: &[u32; 8]) -> __m256i {
            unsafe { _mm256_loadu_si256(x.as_ptr().cast()) }
        }
        #[inline(always)]
        fn store_ids(self, a: __m256i, to: &mut [u32; 8]) {
            unsafe { _mm256_storeu_si256(to.as_mut_ptr().cast(), a) }
        }
        #[inline(always)]
        fn octant_order(self, octant: u32) -> __m256i {
            unsafe {
                let reversed = _mm256_setr_epi32(7, 6, 5, 4, 3, 2, 1, 0);
                _mm256_xor_si256(reversed, _mm256_set1_epi32(octant as i32))
            }
        }
        #[inline(always)]
        fn permute(self, a: __m256, by: __m256i) -> __m256 {
            unsafe { _mm256_permutevar8x32_ps(a, by) }
        }
        #[inline(always)]
        fn permute_ids(self, a: __m256i, by: __m256i) -> __m256i {
            unsafe { _mm256_permutevar8x32_epi32(a, by) }
        }
    };
}

impl Simd for Avx2 {
    type M = __m256;
    common!();

    #[inline(always)]
    fn le(self, a: __m256, b: __m256) -> u32 {
        unsafe { _mm256_movemask_ps(_mm256_cmp_ps::<_CMP_LE_OQ>(a, b)) as u32 }
    }
    #[inline(always)]
    fn le_permuted(self, a: __m256, b: __m256, by: __m256i) -> u32 {
        unsafe {
            let le = _mm256_cmp_ps::<_CMP_LE_OQ>(a, b);
            _mm256_movemask_ps(_mm256_permutevar8x32_ps(le, by)) as u32
        }
    }
    #[inline(always)]
    fn pack(self, a: __m256, mask: u32) -> __m256 {
        unsafe { _mm256_permutevar8x32_ps(a, lanes_of(mask)) }
    }
    #[inline(always)]
    fn pack_ids(self, a: __m256i, mask: u32) -> __m256i {
        unsafe { _mm256_permutevar8x32_epi32(a, lanes_of(mask)) }
    }

    #[inline(always)]
    fn less(self, a: __m256, b: __m256) -> __m256 {
        unsafe { _mm256_cmp_ps::<_CMP_LT_OQ>(a, b) }
    }
    #[inline(always)]
    fn same_ids(self, a: __m256i, b: __m256i) -> __m256 {
        unsafe { _mm256_castsi256_ps(_mm256_cmpeq_epi32(a, b)) }
    }
    #[inline(always)]
    fn both(self, a: __m256, b: __m256) -> __m256 {
        unsafe { _mm256_and_ps(a, b) }
    }
    #[inline(always)]
    fn either(self, a: __m256, b: __m256) -> __m256 {
        unsafe { _mm256_or_ps(a, b) }
    }
    #[inline(always)]
    fn not(self, a: __m256) -> __m256 {
        unsafe { _mm256_xor_ps(a, _mm256_castsi256_ps(_mm256_set1_epi32(-1))) }
    }
    #[inline(always)]
    fn mask(self, a: __m256) -> u32 {
        unsafe { _mm256_movemask_ps(a) as u32 }
    }
    #[inline(always)]
    fn choose(self, m: __m256, a: __m256, b: __m256) -> __m256 {
        unsafe { _mm256_blendv_ps(b, a, m) }
    }
}

impl Simd for Avx512 {
    type M = __mmask8;
    common!();

    #[inline(always)]
    fn le(self, a: __m256, b: __m256) -> u32 {
        unsafe { u32::from(_mm256_cmp_ps_mask::<_CMP_LE_OQ>(a, b)) }
    }
    #[inline(always)]
    fn le_permuted(self, a: __m256, b: __m256, by: __m256i) -> u32 {
        self.le(self.permute(a, by), self.permute(b, by))
    }
    #[inline(always)]
    fn pack(self, a: __m256, mask: u32) -> __m256 {
        unsafe { _mm256_maskz_compress_ps(mask as u8, a) }
    }
    #[inline(always)]
    fn pack_ids(self, a: __m256i, mask: u32) -> __m256i {
        unsafe { _mm256_maskz_compress_epi32(mask as u8, a) }
    }

    #[inline(always)]
    fn less(self, a: __m256, b: __m256) -> __mmask8 {
        unsafe { _mm256_cmp_ps_mask::<_CMP_LT_OQ>(a, b) }
    }
    #[inline(always)]
    fn same_ids(self, a: __m256i, b: __m256i) -> __mmask8 {
        unsafe { _mm256_cmpeq_epi32_mask(a, b) }
    }
    #[inline(always)]
    fn both(self, a: __mmask8, b: __mmask8) -> __mmask8 {
        a & b
    }
    #[inline(always)]
    fn either(self, a: __mmask8, b: __mmask8) -> __mmask8 {
        a | b
    }
    #[inline(always)]
    fn not(self, a: __mmask8) -> __mmask8 {
        !a
    }
    #[inline(always)]
    fn mask(self, a: __mmask8) -> u32 {
        u32::from(a)
    }
    #[inline(always)]
    fn choose(self, m: __mmask8, a: __m256, b: __m256) -> __m256 {
        unsafe { _mm256_mask_blend_ps(m, b, a) }
    }
}

/// The permutation that packs the set lanes of `mask`.
///
/// # Safety
/// Where AVX2 is.
#[inline(always)]
unsafe fn lanes_of(mask: u32) -> __m256i {
    let lanes = &COMPRESS[mask as usize & 255];
    unsafe { _mm256_cvtepu8_epi32(_mm_loadl_epi64(lanes.as_ptr().cast())) }
}
