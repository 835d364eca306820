//! Moves probes to where they see more, less at a slant and from farther away ([Wang et al. 2019] §3.2, §3.3).
//!
//! The fitness of a set P is R(P) = Σ π over the sides of the atlas's texels (Eq. 1), with π = Σ_k (w1 Ω_k + w2 d_k) V_k over the probes
//! (Eq. 2). *Reading*: that sum has no term for the union of what probes see, which §3.2 maximises and Figure 5 shows; a place seen twice would
//! count as much as two places. So π = w0 ∪_k V_k + (1/n) Σ_k (w1 Ω_k + w2 d_k) V_k here, each side by its area, the whole over that of all
//! sides. *Reading*: d_k is the distance of the side from the probe; over the box's diagonal, so that all terms are shares.
//!
//! *Paper*: a probe in turn; eight support probes on the corners of a cube around it; stochastic direction sampling along x, y and z by linear
//! models of the fitness (Figure 6); Gibbs sampling, which accepts where ξ < R(P')/R(P). *Ours*: models and ratio are of that part of R which is
//! the moved probe's own, for the rest is the same in P and P' and would drown the difference, and both are of its power β, without which the
//! walk hardly prefers better places to worse ones (measured: it ends where it likes); the cube shrinks from pass to pass, against
//! oscillation; a point outside of the free space, or nearer to surfaces than candidates may be, has no fitness; and the best set after any
//! pass is kept, the first one included: a random walk may end below where it began.

use super::coverage::{Row, Side, Sides};
use super::skeleton::space::Space;
use crate::base::math::{hash_words, unit};
use crate::base::progress::Progress;
use crate::transport::World;
use glam::Vec3;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// Half the edge of the first cube of support probes, as a share of the distance to the nearest surface; and the least, voxels.
const CUBE: (f32, f32) = (0.5, 1.0);
/// Where a ratio ends: from nothing to something it has none.
const RATIO_MAX: f64 = 1e6;
/// How much smaller the last cube is.
const CUBE_END: f32 = 0.25;

/// Parameters of [`refine`].
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RefineParams {
    /// Passes over all probes.
    pub passes: u32,
    /// Weight of what any probe sees (w0).
    pub union: f32,
    /// Weight of the view's distortion Ω (w1).
    pub angle: f32,
    /// Weight of the distance d (w2).
    pub distance: f32,
    /// Power of the fitness in models and ratio, β; the paper's is 1.
    pub sharpness: f64,
    /// Sides that the fitness of a move is estimated from.
    pub samples: u32,
}

impl Default for RefineParams {
    /// *Ours*: the paper gives no weights. Coverage leads: a side that nobody saw is worth more than one that is seen better.
    fn default() -> Self {
        Self { passes: 0, union: 1.0, angle: 0.2, distance: 0.1, sharpness: 24.0, samples: 2048 }
    }
}

/// How good a set is.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Fitness {
    /// R(P), from 0 to the sum of the weights.
    pub fitness: f64,
    /// Share of the reachable sides that is seen.
    pub coverage: f64,
}

/// What refinement comes to.
#[derive(Debug, Clone)]
pub struct Refined {
    /// The probes.
    pub positions: Vec<Vec3>,
    /// What each sees.
    pub rows: Vec<Row>,
    /// Before.
    pub before: Fitness,
    /// After.
    pub after: Fitness,
}

/// A side that stands for some area, and how many other probes see it.
struct Sample {
    side: Side,
    area: f32,
    others: u32,
}

/// What a moved probe is held against.
struct Others<'a> {
    samples: &'a [Sample],
    /// How many probes there are, the moved one among them.
    probes: usize,
}

/// All that does not change.
struct Walk<'a> {
    world: &'a World,
    space: &'a Space,
    sides: &'a Sides,
    params: &'a RefineParams,
    /// What distances are shares of, metres.
    diagonal: f32,
    /// Least distance from surfaces, metres.
    cull: f32,
    seed: u32,
}

/// Moves probes of the free space that stand at least `cull` metres from surfaces (or not: those never move nearer).
pub fn refine(
    (world, space, sides): (&World, &Space, &Sides),
    positions: &[Vec3],
    cull: f32,
    params: &RefineParams,
    (seed, progress): (u32, &dyn Progress),
) -> Refined {
    let voxels = &space.field.voxels;
    let walk = Walk { world, space, sides, params, diagonal: (voxels.upper() - voxels.lower).length(), cull, seed };
    let mut now = positions.to_vec();
    let (mut rows, before) = walk.fitness(&now);
    let mut best = Refined { positions: now.clone(), rows: rows.clone(), before, after: before };
    progress.start("refining", u64::from(params.passes));
    for pass in 0..params.passes {
        walk.pass(pass, &mut now, &rows);
        let fitness;
        (rows, fitness) = walk.fitness(&now);
        if fitness.fitness > best.after.fitness && fitness.coverage >= best.after.coverage {
            best = Refined { positions: now.clone(), rows: rows.clone(), before, after: fitness };
        }
        progress.advance(1);
    }
    progress.finish();
    best
}

impl Walk<'_> {
    /// Equation 1 over all sides, and what each probe sees.
    fn fitness(&self, probes: &[Vec3]) -> (Vec<Row>, Fitness) {
        let of_probe = |&p: &Vec3| {
            let (mut row, mut own) = (self.sides.no_row(), 0.0);
            for (i, side) in self.sides.list.iter().enumerate() {
                if let Some(seen) = side.seen_from(self.world, p) {
                    row[i / 64] |= 1 << (i % 64);
                    own += f64::from(side.area) * f64::from(self.quality(seen));
                }
            }
            (row, own)
        };
        let (rows, own): (Vec<Row>, Vec<f64>) = probes.par_iter().map(of_probe).collect::<Vec<_>>().into_iter().unzip();
        let mut union = self.sides.no_row();
        rows.iter().for_each(|row| union.iter_mut().zip(row).for_each(|(u, r)| *u |= r));
        let coverage = self.sides.share(&union);
        let quality = own.iter().sum::<f64>() / (self.sides.area.max(f64::MIN_POSITIVE) * probes.len().max(1) as f64);
        (rows, Fitness { fitness: f64::from(self.params.union) * coverage + quality, coverage })
    }

    /// w1 Ω + w2 d of a side that is seen at this cosine from so many metres away.
    fn quality(&self, (cos, distance): (f32, f32)) -> f32 {
        self.params.angle * cos + self.params.distance * (distance / self.diagonal).min(1.0)
    }

    /// Moves each probe in turn.
    fn pass(&self, pass: u32, probes: &mut [Vec3], rows: &[Row]) {
        let mut samples = self.samples(pass, rows);
        let (picks, mut samples): (Vec<usize>, Vec<Sample>) = samples.drain(..).unzip();
        let share = pass as f32 / self.params.passes.max(2).saturating_sub(1) as f32;
        let scale = 1.0 + (CUBE_END - 1.0) * share;
        for k in 0..probes.len() {
            // From here on the samples know the others only.
            for (&i, sample) in picks.iter().zip(&mut samples) {
                sample.others -= (rows[k][i / 64] >> (i % 64) & 1) as u32;
            }
            let random = |j: u32| unit(hash_words(&[self.seed, pass, k as u32, j]));
            let half = scale * (CUBE.0 * self.space.field.at(probes[k])).max(CUBE.1 * self.space.field.voxels.edge);
            let others = Others { samples: &samples, probes: probes.len() };
            let now = self.own(probes[k], &others);
            let proposal = self.propose((probes[k], now), half, &others, &random);
            let accepts = || f64::from(random(7)) < self.ratio(self.own(proposal, &others), now);
            if self.may_stand(proposal, probes[k]) && accepts() {
                probes[k] = proposal;
            }
            let seen: Vec<bool> = samples.par_iter().map(|s| s.side.seen_from(self.world, probes[k]).is_some()).collect();
            samples.iter_mut().zip(seen).for_each(|(sample, seen)| sample.others += u32::from(seen));
        }
    }

    /// Sides that stand for all in this pass, with their numbers: of what nobody sees as many as of the rest, if there are as many.
    fn samples(&self, pass: u32, rows: &[Row]) -> Vec<(usize, Sample)> {
        let times = self.sides.times_seen(rows);
        let half = (self.params.samples as usize / 2).max(1);
        let mut found = Vec::new();
        for is_seen in [false, true] {
            let list: Vec<usize> = (0..times.len()).filter(|&i| (times[i] > 0) == is_seen).collect();
            let stride = list.len() as f64 / half.min(list.len()).max(1) as f64;
            let start = f64::from(unit(hash_words(&[self.seed, pass, u32::from(is_seen), u32::MAX])));
            let picks = (0..half.min(list.len())).map(|k| list[((k as f64 + start) * stride) as usize % list.len()]);
            found.extend(picks.map(|i| {
                let side = self.sides.list[i];
                (i, Sample { side, area: side.area * stride as f32, others: times[i] })
            }));
        }
        found
    }

    /// The part of R that is a probe's at `p`: what it alone sees, and how it sees everything.
    fn own(&self, p: Vec3, others: &Others) -> f64 {
        let mut sum = 0.0;
        for sample in others.samples {
            if let Some(seen) = sample.side.seen_from(self.world, p) {
                let union = if sample.others == 0 { self.params.union } else { 0.0 };
                sum += f64::from(sample.area * (union + self.quality(seen) / others.probes as f32));
            }
        }
        sum
    }

    /// (R(P') / R(P))^β of a probe's own parts.
    fn ratio(&self, then: f64, now: f64) -> f64 {
        if now > 0.0 { (then / now).powf(self.params.sharpness).min(RATIO_MAX) } else { RATIO_MAX }
    }

    /// Whether a probe that stands at `now` may move to `p`.
    fn may_stand(&self, p: Vec3, now: Vec3) -> bool {
        let field = &self.space.field;
        field.at(p) >= self.cull.min(field.at(now)) && self.space.has(self.world, p)
    }

    /// Stochastic direction sampling (Figure 6) in the cube of half the edge `half` around `p`, whose own part is `now`.
    fn propose(&self, (p, now): (Vec3, f64), half: f32, others: &Others, random: &dyn Fn(u32) -> f32) -> Vec3 {
        let corner = |k: usize| {
            let sign = |axis: usize| if k >> axis & 1 == 1 { half } else { -half };
            p + Vec3::new(sign(0), sign(1), sign(2))
        };
        let fitness = |k: usize| match corner(k) {
            c if self.may_stand(c, p) => self.ratio(self.own(c, others), now),
            _ => 0.0,
        };
        let mut ends: Vec<(Vec3, f64)> = (0..8).into_par_iter().map(|k| (corner(k), fitness(k))).collect();
        // Corners are in order of x, then y, then z: each axis joins neighbours of the list. Four, two and one sample are drawn.
        let mut drawn = 0;
        while ends.len() > 1 {
            ends = ends
                .chunks_exact(2)
                .map(|pair| {
                    let t = along_line(pair[0].1, pair[1].1, random(drawn));
                    drawn += 1;
                    (pair[0].0.lerp(pair[1].0, t), pair[0].1 + (pair[1].1 - pair[0].1) * f64::from(t))
                })
                .collect();
        }
        ends[0].0
    }
}

/// A point of [0, 1] with a density that goes linearly from `a` to `b`, by inversion of its distribution (§3.3).
fn along_line(a: f64, b: f64, xi: f32) -> f32 {
    let (sum, difference) = (a + b, b - a);
    if sum <= 0.0 {
        return 0.5;
    }
    // (b - a) t² / 2 + a t = ξ (a + b) / 2; this root has no difference of near numbers.
    let root = (a * a + difference * sum * f64::from(xi)).max(0.0).sqrt();
    ((f64::from(xi) * sum / (a + root).max(f64::MIN_POSITIVE)) as f32).clamp(0.0, 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_on_a_line_follow_its_density() {
        for (a, b) in [(1.0, 1.0), (0.0, 2.0), (3.0, 0.0), (1.0, 4.0)] {
            let n = 4000;
            let mean = (0..n).map(|i| f64::from(along_line(a, b, (i as f32 + 0.5) / n as f32))).sum::<f64>() / f64::from(n);
            // The mean of a density that goes from a to b.
            let expected = (a + 2.0 * b) / (3.0 * (a + b));
            assert!((mean - expected).abs() < 1e-3, "{a}, {b}: {mean} not {expected}");
        }
        assert_eq!(along_line(0.0, 0.0, 0.9), 0.5);
    }
}
