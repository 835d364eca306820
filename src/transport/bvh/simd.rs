//! Eight floats at a time, with AVX-512, with AVX2 and without.
//!
//! Every operation but `mul_sub` is one IEEE operation a lane, so all forms give the same numbers. `min` and `max` answer
//! their second operand where either is NaN, as the machine's do.

/// Which permutation packs the set lanes of a mask to the front.
static COMPRESS: [[u8; 8]; 256] = {
    let mut table = [[0; 8]; 256];
    let mut mask = 0;
    while mask < 256 {
        let (mut lane, mut to) = (0, 0);
        while lane < 8 {
            if mask >> lane & 1 == 1 {
                table[mask][to] = lane as u8;
                to += 1;
            }
            lane += 1;
        }
        mask += 1;
    }
    table
};

/// The operations of the traversal. A value of a type that implements this is the permission to use them.
pub trait Simd: Copy {
    /// Eight floats.
    type F: Copy;
    /// Eight indices.
    type I: Copy;
    /// Eight times `x`.
    fn splat(self, x: f32) -> Self::F;
    /// From memory.
    fn load(self, x: &[f32; 8]) -> Self::F;
    /// To memory.
    fn store(self, a: Self::F, to: &mut [f32; 8]);
    /// a + b.
    fn add(self, a: Self::F, b: Self::F) -> Self::F;
    /// a - b.
    fn sub(self, a: Self::F, b: Self::F) -> Self::F;
    /// a b.
    fn mul(self, a: Self::F, b: Self::F) -> Self::F;
    /// a b - c, rounded once or twice: for boxes, which have room for either.
    fn mul_sub(self, a: Self::F, b: Self::F, c: Self::F) -> Self::F;
    /// a / b.
    fn div(self, a: Self::F, b: Self::F) -> Self::F;
    /// The lesser; b where either is NaN.
    fn min(self, a: Self::F, b: Self::F) -> Self::F;
    /// The greater; b where either is NaN.
    fn max(self, a: Self::F, b: Self::F) -> Self::F;
    /// A bit for each lane where a <= b.
    fn le(self, a: Self::F, b: Self::F) -> u32;
    /// From memory.
    fn load_ids(self, x: &[u32; 8]) -> Self::I;
    /// To memory.
    fn store_ids(self, a: Self::I, to: &mut [u32; 8]);
    /// Lane i of the result is lane (i ^ 7 ^ octant) of `a`.
    fn octant_order(self, octant: u32) -> Self::I;
    /// Lane i of the result is lane `by[i]` of `a`.
    fn permute(self, a: Self::F, by: Self::I) -> Self::F;
    /// Lane i of the result is lane `by[i]` of `a`.
    fn permute_ids(self, a: Self::I, by: Self::I) -> Self::I;
    /// The lanes set in `mask`, packed to the front in order; what follows them is anything.
    fn pack(self, a: Self::F, mask: u32) -> Self::F;
    /// As `pack`.
    fn pack_ids(self, a: Self::I, mask: u32) -> Self::I;
    /// As `le`, of both operands in the order `by`.
    fn le_permuted(self, a: Self::F, b: Self::F, by: Self::I) -> u32;
}

/// Plain arrays.
#[derive(Clone, Copy)]
pub struct Portable;

#[inline(always)]
fn zip(a: [f32; 8], b: [f32; 8], f: impl Fn(f32, f32) -> f32) -> [f32; 8] {
    std::array::from_fn(|i| f(a[i], b[i]))
}

impl Simd for Portable {
    type F = [f32; 8];
    type I = [u32; 8];

    #[inline(always)]
    fn splat(self, x: f32) -> [f32; 8] {
        [x; 8]
    }
    #[inline(always)]
    fn load(self, x: &[f32; 8]) -> [f32; 8] {
        *x
    }
    #[inline(always)]
    fn store(self, a: [f32; 8], to: &mut [f32; 8]) {
        *to = a;
    }
    #[inline(always)]
    fn add(self, a: [f32; 8], b: [f32; 8]) -> [f32; 8] {
        zip(a, b, |x, y| x + y)
    }
    #[inline(always)]
    fn sub(self, a: [f32; 8], b: [f32; 8]) -> [f32; 8] {
        zip(a, b, |x, y| x - y)
    }
    #[inline(always)]
    fn mul(self, a: [f32; 8], b: [f32; 8]) -> [f32; 8] {
        zip(a, b, |x, y| x * y)
    }
    #[inline(always)]
    fn div(self, a: [f32; 8], b: [f32; 8]) -> [f32; 8] {
        zip(a, b, |x, y| x / y)
    }
    #[inline(always)]
    fn min(self, a: [f32; 8], b: [f32; 8]) -> [f32; 8] {
        zip(a, b, |x, y| if x < y { x } else { y })
    }
    #[inline(always)]
    fn max(self, a: [f32; 8], b: [f32; 8]) -> [f32; 8] {
        zip(a, b, |x, y| if x > y { x } else { y })
    }
    #[inline(always)]
    fn le(self, a: [f32; 8], b: [f32; 8]) -> u32 {
        (0..8).fold(0, |mask, i| mask | u32::from(a[i] <= b[i]) << i)
    }
    #[inline(always)]
    fn load_ids(self, x: &[u32; 8]) -> [u32; 8] {
        *x
    }
    #[inline(always)]
    fn store_ids(self, a: [u32; 8], to: &mut [u32; 8]) {
        *to = a;
    }
    #[inline(always)]
    fn octant_order(self, octant: u32) -> [u32; 8] {
        std::array::from_fn(|i| i as u32 ^ 7 ^ octant)
    }
    #[inline(always)]
    fn permute(self, a: [f32; 8], by: [u32; 8]) -> [f32; 8] {
        by.map(|i| a[i as usize & 7])
    }
    #[inline(always)]
    fn permute_ids(self, a: [u32; 8], by: [u32; 8]) -> [u32; 8] {
        by.map(|i| a[i as usize & 7])
    }
    #[inline(always)]
    fn mul_sub(self, a: [f32; 8], b: [f32; 8], c: [f32; 8]) -> [f32; 8] {
        self.sub(self.mul(a, b), c)
    }
    #[inline(always)]
    fn pack(self, a: [f32; 8], mask: u32) -> [f32; 8] {
        self.permute(a, COMPRESS[mask as usize & 255].map(u32::from))
    }
    #[inline(always)]
    fn pack_ids(self, a: [u32; 8], mask: u32) -> [u32; 8] {
        self.permute_ids(a, COMPRESS[mask as usize & 255].map(u32::from))
    }
    #[inline(always)]
    fn le_permuted(self, a: [f32; 8], b: [f32; 8], by: [u32; 8]) -> u32 {
        self.le(self.permute(a, by), self.permute(b, by))
    }
}

#[cfg(target_arch = "x86_64")]
pub use x86::{Avx2, Avx512};

#[cfg(target_arch = "x86_64")]
mod x86 {
    use crate::transport::bvh::simd::{COMPRESS, Simd};
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
    }

    impl Simd for Avx512 {
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
}
