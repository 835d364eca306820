//! Sample points: Owen-scrambled Sobol, one decorrelated stream a pixel or texel.
//!
//! *Ours*: dimensions come in sets of four (Burley's padding: the first four Sobol dimensions again and again, each set
//! scrambled and shuffled with a seed of its own), so that a set is well distributed in all its projections and sets are
//! independent. A path draws two sets a vertex; past [`SOBOL_SETS`], where stratification no longer shows, sets are plain
//! hashes, which cost a third.

use crate::base::math::{hash_words, hash64, unit};
use crate::base::simd::{Kernel, Lanes, Simd};
use glam::Vec2;
use sobol_burley::parts::{hash, owen_scramble_rev, sobol_int4_rev};
use std::sync::LazyLock;

/// Sets of four dimensions that are Sobol points; later ones are hashes. Four path vertices.
pub(crate) const SOBOL_SETS: u32 = 8;

/// The sample dimensions of one path, drawn in order.
#[derive(Debug, Clone)]
pub struct Sampler {
    stream: u32,
    index: u32,
    /// The set that is drawn next.
    set: u32,
    values: [f32; 4],
    used: usize,
}

impl Sampler {
    /// Sample `index` of the stream `stream` (a hash of seed and pixel: see [`crate::base::math::hash_words`]).
    pub fn new(stream: u32, index: u32) -> Self {
        Self { stream, index, set: 0, values: [0.0; 4], used: 4 }
    }

    /// The same sample of another stream: one for each of several continuations of a path, which must not share numbers.
    pub fn branch(&self, k: u32) -> Self {
        Self::new(hash_words(&[self.stream, k]), self.index)
    }

    /// The next set of four dimensions, each in [0, 1); what is left of the set before is passed over.
    pub fn next_4d(&mut self) -> [f32; 4] {
        let set = self.set;
        self.skip_4d();
        if set < SOBOL_SETS {
            self.sobol([set; 2])[0]
        } else {
            let key = (u64::from(self.stream) << 32 | u64::from(self.index)).wrapping_mul(0x9e37_79b9_7f4a_7c15);
            let first = hash64(key ^ hash64(u64::from(set)));
            let second = hash64(first.wrapping_add(0x9e37_79b9_7f4a_7c15));
            [first, first >> 32, second, second >> 32].map(|bits| unit(bits as u32))
        }
    }

    /// The next two sets, for little more than one of them: a path's vertex takes two.
    pub fn next_two_4d(&mut self) -> [[f32; 4]; 2] {
        let set = self.set;
        if set + 1 >= SOBOL_SETS {
            return [self.next_4d(), self.next_4d()];
        }
        (self.used, self.set) = (4, set + 2);
        self.sobol([set, set + 1])
    }

    fn sobol(&self, sets: [u32; 2]) -> [[f32; 4]; 2] {
        // The sequence ends at 2^16: longer ones go on with another scramble.
        let seed = self.stream ^ (self.index >> 16).wrapping_mul(0x85eb_ca6b);
        let seeds = sets.map(|set| seed.wrapping_add(set.wrapping_mul(0x9e37_79b9)));
        Lanes::chosen().run(Sobol { index: self.index & 0xffff, seeds })
    }

    /// Passes over a set of four dimensions, as if it had been drawn.
    pub fn skip_4d(&mut self) {
        (self.used, self.set) = (4, self.set + 1);
    }

    /// The next dimension, in [0, 1).
    pub fn next_1d(&mut self) -> f32 {
        self.refill_for(1);
        self.used += 1;
        self.values[self.used - 1]
    }

    /// The next two dimensions of one set.
    pub fn next_2d(&mut self) -> Vec2 {
        self.refill_for(2);
        self.used += 2;
        Vec2::new(self.values[self.used - 2], self.values[self.used - 1])
    }

    fn refill_for(&mut self, n: usize) {
        if self.used + n > 4 {
            self.values = self.next_4d();
            self.used = 0;
        }
    }
}

/// The first four dimensions by each of the four nibbles of an index of 16 bits, its bits reversed: a point is the sum of four of these, without carry.
static NIBBLES: LazyLock<Nibbles> = LazyLock::new(|| {
    let point = |bits: u32| bytemuck::cast::<[u32; 4], u128>(sobol_int4_rev(bits, 0).into());
    [28, 24, 20, 16].map(|shift| std::array::from_fn(|nibble| point((nibble as u32) << shift)))
});

/// Four numbers of 32 bits each, as they lie in memory.
type Nibbles = [[u128; 16]; 4];

/// `sobol_burley::sample_4d` of dimension set 0 under two seeds, side by side: the same numbers.
struct Sobol {
    /// Below 2^16.
    index: u32,
    seeds: [u32; 2],
}

impl Kernel for Sobol {
    type Output = [[f32; 4]; 2];

    #[inline(always)]
    fn run<S: Simd>(self, s: S) -> [[f32; 4]; 2] {
        let [a, b] = self.seeds;
        let (index, nibbles) = (self.index.reverse_bits(), &*NIBBLES);
        let shuffled = |seed: u32| owen_scramble_rev(index, hash(seed ^ 0x79c6_8e4a));
        let points = s.load_ids(&bytemuck::cast([point(nibbles, shuffled(a)), point(nibbles, shuffled(b))]));
        let seeds = s.mul_ids(s.load_ids(&[a, a, a, a, b, b, b, b]), s.splat_ids(0x9c8f_2d3b));
        let axes = [0x912f_69ba, 0x174f_18ab, 0x691e_72ca, 0xb40c_c1b8, 0x912f_69ba, 0x174f_18ab, 0x691e_72ca, 0xb40c_c1b8];
        let bits = reversed(s, owen_scrambled(s, points, hashed(s, s.xor_ids(seeds, s.load_ids(&axes)))));
        let one = s.add_ids(s.shift_down::<9>(bits), s.splat_ids(1f32.to_bits()));
        let mut numbers = [0.0; 8];
        s.store(s.sub(s.of_bits(one), s.splat(1.0)), &mut numbers);
        let [p0, p1, p2, p3, q0, q1, q2, q3] = numbers;
        [[p0, p1, p2, p3], [q0, q1, q2, q3]]
    }
}

/// The first four dimensions of a shuffled index, all bits reversed.
#[inline(always)]
fn point([a, b, c, d]: &Nibbles, shuffled: u32) -> u128 {
    let nibble = |shift: u32| (shuffled >> shift & 15) as usize;
    a[nibble(28)] ^ b[nibble(24)] ^ c[nibble(20)] ^ d[nibble(16)]
}

/// [`owen_scramble_rev`], eight at a time.
#[inline(always)]
fn owen_scrambled<S: Simd>(s: S, n: S::I, scramble: S::I) -> S::I {
    // The upper half, made odd.
    let factor = s.add_ids(s.and_ids(s.shift_down::<16>(scramble), s.splat_ids(0xfffe)), s.splat_ids(1));
    let n = s.mul_ids(s.add_ids(with_multiple(s, n, 0x3d20_adea), scramble), factor);
    with_multiple(s, with_multiple(s, n, 0x0552_6c56), 0x53a2_2864)
}

/// Each number and a multiple of it, a bit at a time. (No closure: those are not compiled for the machine's lanes.)
#[inline(always)]
fn with_multiple<S: Simd>(s: S, n: S::I, factor: u32) -> S::I {
    s.xor_ids(n, s.mul_ids(n, s.splat_ids(factor)))
}

/// [`hash`], eight at a time.
#[inline(always)]
fn hashed<S: Simd>(s: S, n: S::I) -> S::I {
    let n = s.xor_ids(n, s.splat_ids(0xe6fe_3beb));
    let n = s.mul_ids(s.xor_ids(n, s.shift_down::<16>(n)), s.splat_ids(0x7feb_352d));
    let n = s.mul_ids(s.xor_ids(n, s.shift_down::<15>(n)), s.splat_ids(0x846c_a68b));
    s.xor_ids(n, s.shift_down::<16>(n))
}

/// The bits of each number in reverse: neighbours swap places, then pairs, fours, bytes and halves.
#[inline(always)]
fn reversed<S: Simd>(s: S, n: S::I) -> S::I {
    let n = swapped::<1, S>(s, n, 0x5555_5555);
    let n = swapped::<2, S>(s, n, 0x3333_3333);
    let n = swapped::<4, S>(s, n, 0x0f0f_0f0f);
    let n = swapped::<8, S>(s, n, 0x00ff_00ff);
    s.add_ids(s.shift_down::<16>(n), s.shift_up::<16>(n))
}

/// Groups of so many bits, those of `lower` and their neighbours, in each other's place.
#[inline(always)]
fn swapped<const BITS: i32, S: Simd>(s: S, n: S::I, lower: u32) -> S::I {
    let lower = s.splat_ids(lower);
    s.add_ids(s.and_ids(s.shift_down::<BITS>(n), lower), s.shift_up::<BITS>(s.and_ids(n, lower)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_are_those_of_the_library() {
        for index in (0..1 << 16).step_by(7) {
            let seed = hash_words(&[index]);
            let expected = [seed, !seed].map(|seed| sobol_burley::sample_4d(index, 0, seed));
            for lanes in Lanes::all() {
                assert_eq!(lanes.run(Sobol { index, seeds: [seed, !seed] }), expected, "index {index}, {}", lanes.name());
            }
        }
    }

    #[test]
    fn two_sets_at_once_are_one_and_the_next() {
        let [mut alone, mut together] = [Sampler::new(7, 5), Sampler::new(7, 5)];
        alone.next_4d();
        together.next_4d();
        for _ in 0..SOBOL_SETS {
            assert_eq!(together.next_two_4d(), [alone.next_4d(), alone.next_4d()]);
        }
    }

    #[test]
    fn sixteen_samples_of_every_sobol_pair_fall_into_sixteen_squares() {
        for set in 0..SOBOL_SETS {
            let mut seen = [false; 16];
            for index in 0..16 {
                let mut s = Sampler::new(77, index);
                (0..set).for_each(|_| _ = s.next_4d());
                let p = s.next_2d();
                seen[(p.x * 4.0) as usize * 4 + (p.y * 4.0) as usize] = true;
            }
            assert!(seen.iter().all(|&s| s), "set {set}");
        }
    }

    #[test]
    fn sets_and_branches_are_uncorrelated_and_uniform() {
        const N: u32 = 4096;
        let columns: Vec<Vec<f32>> = (0..2)
            .flat_map(|branch| (0..2 * SOBOL_SETS).map(move |set| (branch, set)))
            .map(|(branch, set)| {
                let value = |index| {
                    let mut s = Sampler::new(5, index).branch(branch);
                    (0..set).for_each(|_| _ = s.next_4d());
                    s.next_4d()[1]
                };
                (0..N).map(value).collect()
            })
            .collect();
        for (i, a) in columns.iter().enumerate() {
            assert!(a.iter().all(|x| (0.0..1.0).contains(x)));
            let mean = a.iter().sum::<f32>() / N as f32;
            assert!((mean - 0.5).abs() < 4.0 * (1.0 / 12.0 / N as f32).sqrt(), "column {i}: mean {mean}");
            for (j, b) in columns.iter().enumerate().take(i) {
                let covariance = a.iter().zip(b).map(|(x, y)| (x - 0.5) * (y - 0.5)).sum::<f32>() / N as f32;
                // Standard deviation of the estimate for independent columns: 1 / (12 sqrt N).
                assert!(covariance.abs() < 5.0 / 12.0 / (N as f32).sqrt(), "columns {i}, {j}: covariance {covariance}");
            }
        }
    }

    #[test]
    fn a_set_passed_over_is_a_set_drawn() {
        let [mut drawn, mut skipped] = [Sampler::new(1, 3), Sampler::new(1, 3)];
        drawn.next_2d();
        skipped.skip_4d();
        assert_eq!(drawn.next_4d(), skipped.next_4d());
    }

    #[test]
    fn samples_past_the_sequence_differ_from_the_first() {
        assert_ne!(Sampler::new(1, 3).next_4d(), Sampler::new(1, 3 + 65536).next_4d());
    }
}
