//! Sample points: Owen-scrambled Sobol, one decorrelated stream a pixel or texel.
//!
//! *Ours*: dimensions come in sets of four (Burley's padding: the first four Sobol dimensions again and again, each set
//! scrambled and shuffled with a seed of its own), so that a set is well distributed in all its projections and sets are
//! independent. A path draws two sets a vertex; past [`SOBOL_SETS`], where stratification no longer shows, sets are plain
//! hashes, which cost a third.

use crate::base::math::{hash_words, hash64, unit};
use glam::Vec2;
use sobol_burley::parts::{Int4, hash, hash_int4, owen_scramble_int4_rev, owen_scramble_rev, sobol_int4_rev};
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
        self.used = 4;
        let set = self.set;
        self.set += 1;
        if set < SOBOL_SETS {
            // The sequence ends at 2^16: longer ones go on with another scramble.
            let seed = self.stream ^ (self.index >> 16).wrapping_mul(0x85eb_ca6b);
            sobol_4d(self.index & 0xffff, seed.wrapping_add(set.wrapping_mul(0x9e37_79b9)))
        } else {
            let key = (u64::from(self.stream) << 32 | u64::from(self.index)).wrapping_mul(0x9e37_79b9_7f4a_7c15);
            let first = hash64(key ^ hash64(u64::from(set)));
            let second = hash64(first.wrapping_add(0x9e37_79b9_7f4a_7c15));
            [first, first >> 32, second, second >> 32].map(|bits| unit(bits as u32))
        }
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
static NIBBLES: LazyLock<[[Int4; 16]; 4]> =
    LazyLock::new(|| [28, 24, 20, 16].map(|shift| std::array::from_fn(|nibble| sobol_int4_rev((nibble as u32) << shift, 0))));

/// `sobol_burley::sample_4d` of dimension set 0, which goes through the index bit by bit: the same numbers.
fn sobol_4d(index: u32, seed: u32) -> [f32; 4] {
    let shuffled = owen_scramble_rev(index.reverse_bits(), hash(seed ^ 0x79c6_8e4a));
    let [a, b, c, d] = &*NIBBLES;
    let of = |table: &[Int4; 16], shift: u32| table[(shuffled >> shift & 15) as usize];
    let point = of(a, 28) ^ of(b, 24) ^ of(c, 20) ^ of(d, 16);
    let scramble = Int4::from([seed.wrapping_mul(0x9c8f_2d3b); 4]) ^ [0x912f_69ba, 0x174f_18ab, 0x691e_72ca, 0xb40c_c1b8].into();
    owen_scramble_int4_rev(point, hash_int4(scramble)).reverse_bits().to_f32_norm()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_are_those_of_the_library() {
        for index in (0..1 << 16).step_by(7) {
            let seed = hash_words(&[index]);
            assert_eq!(sobol_4d(index, seed), sobol_burley::sample_4d(index, 0, seed), "index {index}");
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
