//! Without the machine's lanes.

use super::{COMPRESS, Simd};

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
    type M = [bool; 8];

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
    #[inline(always)]
    fn sqrt(self, a: [f32; 8]) -> [f32; 8] {
        a.map(f32::sqrt)
    }
    #[inline(always)]
    fn floor(self, a: [f32; 8]) -> [f32; 8] {
        a.map(f32::floor)
    }
    #[inline(always)]
    fn abs(self, a: [f32; 8]) -> [f32; 8] {
        a.map(f32::abs)
    }
    #[inline(always)]
    fn with_sign(self, a: [f32; 8], b: [f32; 8]) -> [f32; 8] {
        zip(a, b, f32::copysign)
    }
    #[inline(always)]
    fn less(self, a: [f32; 8], b: [f32; 8]) -> [bool; 8] {
        std::array::from_fn(|i| a[i] < b[i])
    }
    #[inline(always)]
    fn same_ids(self, a: [u32; 8], b: [u32; 8]) -> [bool; 8] {
        std::array::from_fn(|i| a[i] == b[i])
    }
    #[inline(always)]
    fn both(self, a: [bool; 8], b: [bool; 8]) -> [bool; 8] {
        std::array::from_fn(|i| a[i] & b[i])
    }
    #[inline(always)]
    fn either(self, a: [bool; 8], b: [bool; 8]) -> [bool; 8] {
        std::array::from_fn(|i| a[i] | b[i])
    }
    #[inline(always)]
    fn not(self, a: [bool; 8]) -> [bool; 8] {
        a.map(|a| !a)
    }
    #[inline(always)]
    fn mask(self, a: [bool; 8]) -> u32 {
        (0..8).fold(0, |mask, i| mask | u32::from(a[i]) << i)
    }
    #[inline(always)]
    fn choose(self, m: [bool; 8], a: [f32; 8], b: [f32; 8]) -> [f32; 8] {
        std::array::from_fn(|i| if m[i] { a[i] } else { b[i] })
    }
    #[inline(always)]
    fn splat_ids(self, x: u32) -> [u32; 8] {
        [x; 8]
    }
    #[inline(always)]
    fn ids(self, a: [f32; 8]) -> [u32; 8] {
        a.map(|a| a as i32 as u32)
    }
    #[inline(always)]
    fn floats(self, a: [u32; 8]) -> [f32; 8] {
        a.map(|a| a as i32 as f32)
    }
    #[inline(always)]
    fn bits(self, a: [f32; 8]) -> [u32; 8] {
        a.map(f32::to_bits)
    }
    #[inline(always)]
    fn of_bits(self, a: [u32; 8]) -> [f32; 8] {
        a.map(f32::from_bits)
    }
    #[inline(always)]
    fn add_ids(self, a: [u32; 8], b: [u32; 8]) -> [u32; 8] {
        std::array::from_fn(|i| a[i].wrapping_add(b[i]))
    }
    #[inline(always)]
    fn mul_ids(self, a: [u32; 8], b: [u32; 8]) -> [u32; 8] {
        std::array::from_fn(|i| a[i].wrapping_mul(b[i]))
    }
    #[inline(always)]
    fn and_ids(self, a: [u32; 8], b: [u32; 8]) -> [u32; 8] {
        std::array::from_fn(|i| a[i] & b[i])
    }
    #[inline(always)]
    fn xor_ids(self, a: [u32; 8], b: [u32; 8]) -> [u32; 8] {
        std::array::from_fn(|i| a[i] ^ b[i])
    }
    #[inline(always)]
    fn shift_up<const BITS: i32>(self, a: [u32; 8]) -> [u32; 8] {
        a.map(|a| a << BITS)
    }
    #[inline(always)]
    fn shift_down<const BITS: i32>(self, a: [u32; 8]) -> [u32; 8] {
        a.map(|a| a >> BITS)
    }
    #[inline(always)]
    fn fours(self, from: &[f32], at: [u32; 8]) -> [[f32; 8]; 4] {
        assert!(from.len() >= 4, "nothing to load from");
        let row = at.map(|at| (at as usize).min(from.len() - 4));
        std::array::from_fn(|k| row.map(|row| from[row + k]))
    }
    #[inline(always)]
    fn fours_in_row(self, from: &[f32], at: usize) -> [[f32; 8]; 4] {
        let row = &from[at..at + 32];
        std::array::from_fn(|k| std::array::from_fn(|i| row[4 * i + k]))
    }
    #[inline(always)]
    fn ones(self, from: &[u32], at: [u32; 8]) -> [u32; 8] {
        assert!(!from.is_empty(), "nothing to load from");
        at.map(|at| from[(at as usize).min(from.len() - 1)])
    }
    #[inline(always)]
    fn sum(self, a: [f32; 8]) -> f32 {
        let b: [f32; 4] = std::array::from_fn(|i| a[i] + a[i + 4]);
        (b[0] + b[2]) + (b[1] + b[3])
    }
    #[inline(always)]
    fn least(self, a: [f32; 8]) -> f32 {
        a.into_iter().fold(f32::INFINITY, f32::min)
    }
}
