//! Which of many candidates become probes ([Wang et al. 2019] §3: "the fewest number of probes needed").
//!
//! *Ours*: the paper puts a probe at every candidate, and has their density set by hand. Here a greedy choice adds one probe after the other.
//! Where coverage is asked for, the next is the candidate that sees the most of what no probe before it saw, until enough is seen; where
//! candidates are left that see nothing new, further ones come from the free space before the sides that are still unseen, so that full
//! coverage is always in reach. Where a number of probes is asked for, it is the candidate that most improves how well all sides are seen by
//! the probe that sees each best (§3.2: not at a slant, and not from far away), those that cameras see first of all. Either gain only shrinks as probes are added: the
//! choice is within 1 - 1/e of the best one (Nemhauser et al. 1978), and gains of earlier rounds bound those of later ones.

use super::coverage::{Row, Side, Sides, bits};
use crate::transport::World;
use glam::Vec3;
use rayon::prelude::*;

/// Candidates that are added at a time for sides that no candidate sees.
const MORE: usize = 128;
/// Candidates whose gains are found at a time.
const BATCH: usize = 32;
/// What counts as nothing, as a share of all sides' area.
const NOTHING: f64 = 1e-9;

/// When there are enough probes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Enough {
    /// This share of the reachable sides is seen, or there are so many probes.
    Coverage {
        /// The share.
        share: f64,
        /// Most probes.
        most: usize,
    },
    /// So many probes.
    Count {
        /// Number of probes.
        count: usize,
        /// Distance at which a side is seen half as well as from close by, metres.
        near: f32,
    },
}

/// The chosen probes.
#[derive(Debug, Clone, Default)]
pub struct Chosen {
    /// Their positions, in the order of their choice.
    pub positions: Vec<Vec3>,
    /// What each sees.
    pub rows: Vec<Row>,
    /// How many there were to choose from, with those added for unseen sides.
    pub candidates: usize,
}

/// Chooses among `candidates`, none of them twice.
pub fn choose(world: &World, sides: &Sides, candidates: Vec<Vec3>, enough: &Enough) -> Chosen {
    match *enough {
        Enough::Coverage { share, most } => until_covered(world, sides, candidates, share, most),
        Enough::Count { count, near } => best_views(world, sides, candidates, count, near),
    }
}

fn until_covered(world: &World, sides: &Sides, mut candidates: Vec<Vec3>, share: f64, most: usize) -> Chosen {
    let mut rows = sides.rows(world, &candidates);
    let mut left: Vec<bool> = vec![true; candidates.len()];
    let mut unseen = sides.no_row();
    (0..sides.list.len()).for_each(|i| unseen[i / 64] |= 1 << (i % 64));
    let mut chosen = Chosen::default();
    while chosen.positions.len() < most {
        if 1.0 - sides.share(&unseen) >= share {
            break;
        }
        if let Some(best) = best(sides, &rows, &left, &unseen) {
            left[best] = false;
            unseen.iter_mut().zip(&rows[best]).for_each(|(unseen, row)| *unseen &= !row);
            chosen.positions.push(candidates[best]);
            chosen.rows.push(rows[best].clone());
        } else {
            // A side's witness sees at least that side: each round gets on, or ends.
            let more = witnesses(sides, &unseen);
            let new = sides.rows(world, &more);
            if more.is_empty() || new.iter().all(|row| sides.area_of(common(row, &unseen)) <= NOTHING * sides.area) {
                break;
            }
            left.extend(more.iter().map(|_| true));
            candidates.extend(more);
            rows.extend(new);
        }
    }
    chosen.candidates = candidates.len();
    chosen
}

fn best_views(world: &World, sides: &Sides, candidates: Vec<Vec3>, count: usize, near: f32) -> Chosen {
    let rows = sides.rows(world, &candidates);
    let mut seen = vec![0f32; sides.list.len()];
    let mut chosen = Chosen { candidates: candidates.len(), ..Chosen::default() };
    // Gains as they were last known, which is no less than what they are.
    let mut order: Vec<(f64, usize)> = (0..candidates.len()).map(|i| (f64::INFINITY, i)).collect();
    while chosen.positions.len() < count && !order.is_empty() {
        let mut best = f64::NEG_INFINITY;
        for at in (0..order.len()).step_by(BATCH) {
            if order[at].0 < best {
                break;
            }
            let end = (at + BATCH).min(order.len());
            let gain = |&(_, i): &(f64, usize)| (gain(sides, &rows[i], candidates[i], &seen, near), i);
            let known: Vec<_> = order[at..end].par_iter().map(gain).collect();
            best = known.iter().fold(best, |best, (gain, _)| best.max(*gain));
            order[at..end].copy_from_slice(&known);
        }
        order.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
        let (_, i) = order.remove(0);
        for side in bits(rows[i].iter().copied()) {
            seen[side] = seen[side].max(view(&sides.list[side], candidates[i], near));
        }
        chosen.positions.push(candidates[i]);
        chosen.rows.push(rows[i].clone());
    }
    chosen
}

/// What a probe would add to how well all sides are seen, m².
fn gain(sides: &Sides, row: &Row, probe: Vec3, seen: &[f32], near: f32) -> f64 {
    let more = |i: usize| {
        let side = &sides.list[i];
        f64::from(side.weight * (view(side, probe, near) - seen[i]).max(0.0))
    };
    bits(row.iter().copied()).map(more).sum()
}

/// How well a probe sees a side, at most 1: about as the side's share of the probe's texels goes, until it fills enough of them.
fn view(side: &Side, probe: Vec3, near: f32) -> f32 {
    let way = probe - side.p;
    let squared = way.length_squared().max(f32::MIN_POSITIVE);
    (side.n.dot(way) / squared.sqrt()).max(0.0) / (1.0 + squared / (near * near))
}

fn common<'a>(a: &'a [u64], b: &'a [u64]) -> impl Iterator<Item = u64> + 'a {
    a.iter().zip(b).map(|(a, b)| a & b)
}

/// The candidate that sees most of `wanted`, the first of equals; none where all see nothing of it.
pub(super) fn best(sides: &Sides, rows: &[Row], left: &[bool], wanted: &Row) -> Option<usize> {
    let gain = |i: usize| if left[i] { sides.area_of(common(&rows[i], wanted)) } else { 0.0 };
    let gains: Vec<f64> = (0..rows.len()).into_par_iter().map(gain).collect();
    let best = (0..gains.len()).rev().max_by(|&a, &b| gains[a].total_cmp(&gains[b]))?;
    (gains[best] > NOTHING * sides.area).then_some(best)
}

/// Points from which some of the unseen sides are seen, the largest sides' first.
fn witnesses(sides: &Sides, unseen: &Row) -> Vec<Vec3> {
    let mut list: Vec<usize> = bits(unseen.iter().copied()).collect();
    list.sort_by(|&a, &b| sides.list[b].area.total_cmp(&sides.list[a].area).then(a.cmp(&b)));
    let step = list.len().div_ceil(MORE).max(1);
    list.into_iter().step_by(step).map(|i| sides.list[i].witness).collect()
}
