//! Which of many candidates become probes ([Wang et al. 2019] §3: "the fewest number of probes needed").
//!
//! *Ours*: the paper puts a probe at every candidate, and has their density set by hand. Here a greedy choice takes the candidate that
//! sees the most of what no probe before it saw, until enough is seen, or there are enough probes. Once enough is seen, what has been seen
//! once counts next, then what has been seen twice: each place should be seen from many sides. Where candidates are left that see nothing
//! new, further ones come from the free space before the sides that are still unseen, so that full coverage is always in reach.

use super::coverage::{Row, Sides, bits};
use crate::transport::World;
use glam::Vec3;
use rayon::prelude::*;

/// Candidates that are added at a time for sides that no candidate sees.
const MORE: usize = 128;
/// What counts as nothing, as a share of all sides' area.
const NOTHING: f64 = 1e-9;

/// When there are enough probes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Enough {
    /// So many probes.
    pub count: Option<usize>,
    /// This share of the reachable sides is seen; with a count, what counts as all.
    pub coverage: f64,
    /// Most probes, whatever they see.
    pub most: usize,
    /// Whether to go on after `coverage` up to `count`.
    pub fill: bool,
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
pub fn choose(world: &World, sides: &Sides, mut candidates: Vec<Vec3>, enough: &Enough) -> Chosen {
    let mut rows = sides.rows(world, &candidates);
    let mut left: Vec<bool> = vec![true; candidates.len()];
    let mut times = vec![0u32; sides.list.len()];
    let mut chosen = Chosen::default();
    let mut level = 0;
    let most = enough.count.unwrap_or(usize::MAX).min(enough.most);
    while chosen.positions.len() < most {
        let unseen = where_seen(&times, 0);
        let is_covered = 1.0 - sides.share(&unseen) >= enough.coverage;
        if is_covered && !enough.fill {
            break;
        }
        if is_covered {
            level = level.max(1);
        }
        let wanted = if level == 0 { unseen } else { where_seen(&times, level) };
        if let Some(best) = best(sides, &rows, &left, &wanted) {
            left[best] = false;
            bits(rows[best].iter().copied()).for_each(|i| times[i] += 1);
            chosen.positions.push(candidates[best]);
            chosen.rows.push(rows[best].clone());
        } else if level == 0 {
            // A side's witness sees at least that side: each round gets on, or ends.
            let more = witnesses(sides, &wanted);
            let new = sides.rows(world, &more);
            if more.is_empty() || new.iter().all(|row| sides.area_of(common(row, &wanted)) <= NOTHING * sides.area) {
                level = 1;
                if !enough.fill {
                    break;
                }
            }
            left.extend(more.iter().map(|_| true));
            candidates.extend(more);
            rows.extend(new);
        } else if left.contains(&true) {
            level += 1;
        } else {
            break;
        }
    }
    chosen.candidates = candidates.len();
    chosen
}

/// Sides that at most `times_most` probes see.
fn where_seen(times: &[u32], times_most: u32) -> Row {
    let word = |chunk: &[u32]| chunk.iter().enumerate().map(|(k, &n)| u64::from(n <= times_most) << k).sum();
    times.chunks(64).map(word).collect()
}

fn common<'a>(a: &'a [u64], b: &'a [u64]) -> impl Iterator<Item = u64> + 'a {
    a.iter().zip(b).map(|(a, b)| a & b)
}

/// The candidate that sees most of `wanted`, the first of equals; none where all see nothing of it.
fn best(sides: &Sides, rows: &[Row], left: &[bool], wanted: &Row) -> Option<usize> {
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
