//! Eight floats at a time, with AVX-512, with AVX2 and without.
//!
//! Every operation but `mul_sub` is one IEEE operation a lane, so all forms give the same numbers. `min` and `max` answer
//! their second operand where either is NaN, as the machine's do. [`Lanes`] says which form runs; [`lane`] has operators.

pub mod functions;
pub mod lane;
mod portable;
mod which;
#[cfg(target_arch = "x86_64")]
mod x86;

pub use portable::Portable;
pub use which::{Kernel, Lanes};
#[cfg(target_arch = "x86_64")]
pub use x86::{Avx2, Avx512};

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

/// The operations. A value of a type that implements this is the permission to use them.
pub trait Simd: Copy {
    /// Eight floats.
    type F: Copy;
    /// Eight indices.
    type I: Copy;
    /// Eight answers.
    type M: Copy;
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
    /// √a.
    fn sqrt(self, a: Self::F) -> Self::F;
    /// The largest whole number not above.
    fn floor(self, a: Self::F) -> Self::F;
    /// |a|.
    fn abs(self, a: Self::F) -> Self::F;
    /// |a| with the sign of b.
    fn with_sign(self, a: Self::F, b: Self::F) -> Self::F;
    /// a < b.
    fn less(self, a: Self::F, b: Self::F) -> Self::M;
    /// a = b.
    fn same_ids(self, a: Self::I, b: Self::I) -> Self::M;
    /// a and b.
    fn both(self, a: Self::M, b: Self::M) -> Self::M;
    /// a or b.
    fn either(self, a: Self::M, b: Self::M) -> Self::M;
    /// not a.
    fn not(self, a: Self::M) -> Self::M;
    /// A bit for each lane that says yes.
    fn mask(self, a: Self::M) -> u32;
    /// a where `m` says yes, b elsewhere.
    fn choose(self, m: Self::M, a: Self::F, b: Self::F) -> Self::F;
    /// Eight times `x`.
    fn splat_ids(self, x: u32) -> Self::I;
    /// Whole part of numbers within i32's range.
    fn ids(self, a: Self::F) -> Self::I;
    /// As floats, of numbers within i32's range.
    fn floats(self, a: Self::I) -> Self::F;
    /// The bits of floats.
    fn bits(self, a: Self::F) -> Self::I;
    /// Floats of those bits.
    fn of_bits(self, a: Self::I) -> Self::F;
    /// a + b, wrapping.
    fn add_ids(self, a: Self::I, b: Self::I) -> Self::I;
    /// a b, wrapping.
    fn mul_ids(self, a: Self::I, b: Self::I) -> Self::I;
    /// a and b, bit by bit.
    fn and_ids(self, a: Self::I, b: Self::I) -> Self::I;
    /// a or b but not both, bit by bit.
    fn xor_ids(self, a: Self::I, b: Self::I) -> Self::I;
    /// a times two to the power of `BITS`.
    fn shift_up<const BITS: i32>(self, a: Self::I) -> Self::I;
    /// The upper bits.
    fn shift_down<const BITS: i32>(self, a: Self::I) -> Self::I;
    /// Four floats in a row at each of eight offsets into `from`: all first ones, all second ones, and so on. An offset past the end
    /// counts as the last one that has four.
    ///
    /// # Panics
    /// If there are fewer than four.
    fn fours(self, from: &[f32], at: Self::I) -> [Self::F; 4];
    /// [`Simd::fours`] of eight offsets that begin at `at` and lie four apart.
    ///
    /// # Panics
    /// If there are not as many.
    fn fours_in_row(self, from: &[f32], at: usize) -> [Self::F; 4];
    /// The one at each of eight places in `from`; a place past the end counts as the last.
    ///
    /// # Panics
    /// If there is none.
    fn ones(self, from: &[u32], at: Self::I) -> Self::I;
    /// The sum of the eight: of those that lie four apart, then two apart, then one.
    fn sum(self, a: Self::F) -> f32;
    /// The least of the eight, none of which is NaN.
    fn least(self, a: Self::F) -> f32;
}
