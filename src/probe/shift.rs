//! Moves probes a little, to where they see what no probe sees.
//!
//! [Silvennoinen and Lehtinen 2017] §4.1 asks that every surface point be visible from a probe, but places probes by their density alone. *Ours*: of all moves of a
//! probe to a candidate no farther than the spacing, the one after which most is seen, again and again, as long as that is more than before. The
//! count stays, and the density nearly. Candidates that come into question: for each unseen side the nearest that sees it, and the one
//! nearest to the point of the free space that sees it, neither farther than the spacing; of these, as few as see all that they see together.

use super::coverage::{Row, Side, Sides, bits};
use super::select::best;
use super::skeleton::nearest::Nearest;
use crate::transport::World;
use glam::Vec3;
use rayon::prelude::*;
use std::collections::BTreeSet;

/// Unseen sides for which candidates are looked for, evenly among all.
const SIDES: usize = 512;
/// Most candidates that are looked through from.
const PLACES: usize = 128;
/// What a move has to bring, as a share of all sides' area: for less, probes crowd in vases.
const LEAST: f64 = 5e-4;

/// Probes, and what each sees.
#[derive(Debug, Clone, PartialEq)]
pub struct Watch {
    /// The probes, metres.
    pub positions: Vec<Vec3>,
    /// What each sees.
    pub rows: Vec<Row>,
}

/// Moves probes to some of `candidates`, each no farther than `reach` metres.
pub fn shift(world: &World, sides: &Sides, candidates: &[Vec3], reach: f32, watch: &mut Watch) {
    let mut times = sides.times_seen(&watch.rows);
    let in_reach = |c: &&Vec3| watch.positions.iter().any(|p| p.distance(**c) <= reach);
    let candidates: Vec<Vec3> = candidates.iter().filter(in_reach).copied().collect();
    let places = places((world, sides), &candidates, reach, &seen_by(sides, &times, 0));
    let views = sides.rows(world, &places);
    loop {
        let (none, one) = (seen_by(sides, &times, 0), seen_by(sides, &times, 1));
        let best_of = |c: usize| {
            let gain = sides.area_of(views[c].iter().zip(&none).map(|(a, b)| a & b));
            let near = (0..watch.positions.len()).filter(|&i| watch.positions[i].distance(places[c]) <= reach);
            let net = |i: usize| {
                let lost = watch.rows[i].iter().zip(&views[c]).zip(&one).map(|((row, view), one)| row & !view & one);
                (gain - sides.area_of(lost), i, c)
            };
            near.map(net).reduce(|a, b| if b.0 > a.0 { b } else { a })
        };
        let moves: Vec<_> = (0..places.len()).into_par_iter().filter_map(best_of).collect();
        match moves.into_iter().reduce(|a, b| if b.0 > a.0 { b } else { a }) {
            Some((gain, i, c)) if gain > LEAST * sides.area => {
                bits(watch.rows[i].iter().copied()).for_each(|side| times[side] -= 1);
                bits(views[c].iter().copied()).for_each(|side| times[side] += 1);
                (watch.positions[i], watch.rows[i]) = (places[c], views[c].clone());
            }
            _ => break,
        }
    }
}

/// The sides that so many probes see.
fn seen_by(sides: &Sides, times: &[u32], count: u32) -> Row {
    row_of(sides, (0..times.len()).filter(|&i| times[i] == count))
}

fn row_of(sides: &Sides, list: impl Iterator<Item = usize>) -> Row {
    let mut row = sides.no_row();
    list.for_each(|i| row[i / 64] |= 1 << (i % 64));
    row
}

/// Candidates that together see all of some of the unseen sides, so far as any of them sees it; those that see most first.
fn places((world, sides): (&World, &Sides), candidates: &[Vec3], reach: f32, unseen: &Row) -> Vec<Vec3> {
    let tree = Nearest::new(candidates.iter().copied());
    let all: Vec<usize> = bits(unseen.iter().copied()).collect();
    let list: Vec<usize> = all.iter().copied().step_by(all.len().div_ceil(SIDES).max(1)).collect();
    let near = |side: &Side| {
        let near = |p: Vec3| {
            // Within reach first: a ray takes longer.
            let sees = |i: u32| {
                let candidate = candidates[i as usize];
                candidate.distance_squared(p) <= reach * reach && side.seen_from(world, candidate).is_some()
            };
            tree.find(p, &sees).map(|(i, _)| i as usize)
        };
        [side.p, side.witness].into_iter().filter_map(near).collect::<Vec<_>>()
    };
    let found: Vec<usize> = list.par_iter().flat_map_iter(|&i| near(&sides.list[i])).collect();
    let found: Vec<usize> = found.into_iter().collect::<BTreeSet<_>>().into_iter().collect();
    let row = |c: usize| row_of(sides, list.iter().copied().filter(|&i| sides.list[i].seen_from(world, candidates[c]).is_some()));
    let rows: Vec<Row> = found.par_iter().map(|&c| row(c)).collect();
    let mut wanted = row_of(sides, list.iter().copied());
    let (mut left, mut places) = (vec![true; found.len()], Vec::new());
    while places.len() < PLACES
        && let Some(c) = best(sides, &rows, &left, &wanted)
    {
        left[c] = false;
        wanted.iter_mut().zip(&rows[c]).for_each(|(wanted, row)| *wanted &= !row);
        places.push(candidates[found[c]]);
    }
    places
}
