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

/// Unseen sides for which candidates are looked for.
const SIDES: usize = 512;
/// Most candidates that are looked through from.
const PLACES: usize = 128;
/// What a move has to bring, as a share of all sides' area.
const LEAST: f64 = 5e-5;

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
    let places = places((world, sides), candidates, reach, &seen_by(sides, &times, 0));
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
    let mut row = sides.no_row();
    (0..times.len()).filter(|&i| times[i] == count).for_each(|i| row[i / 64] |= 1 << (i % 64));
    row
}

/// Candidates that together see all of the unseen sides that any of them sees, those that see most of it first.
fn places((world, sides): (&World, &Sides), candidates: &[Vec3], reach: f32, unseen: &Row) -> Vec<Vec3> {
    let tree = Nearest::new(candidates.iter().copied());
    let list: Vec<usize> = bits(unseen.iter().copied()).collect();
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
    let step = list.len().div_ceil(SIDES).max(1);
    let found: Vec<usize> = list.par_iter().step_by(step).flat_map_iter(|&i| near(&sides.list[i])).collect();
    let found: Vec<usize> = found.into_iter().collect::<BTreeSet<_>>().into_iter().collect();
    let row = |&c: &usize| {
        let mut row = sides.no_row();
        let seen = list.iter().filter(|&&i| sides.list[i].seen_from(world, candidates[c]).is_some());
        seen.for_each(|&i| row[i / 64] |= 1 << (i % 64));
        row
    };
    let rows: Vec<Row> = found.par_iter().map(row).collect();
    let (mut left, mut wanted, mut places) = (vec![true; found.len()], unseen.clone(), Vec::new());
    while places.len() < PLACES
        && let Some(c) = best(sides, &rows, &left, &wanted)
    {
        left[c] = false;
        wanted.iter_mut().zip(&rows[c]).for_each(|(wanted, row)| *wanted &= !row);
        places.push(candidates[found[c]]);
    }
    places
}
