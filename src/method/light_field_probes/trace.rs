//! A ray through many probes: each follows it as far as it sees it, and the next goes on from there.
//!
//! *Paper* (McGuire 2017, §4.1): the eight probes of the grid's cell, the nearest first; where one loses the ray behind a surface, the next goes
//! on from that place. *Ours*: where all eight have lost it, those of the cell in which it was lost last go on, if they have not been asked.
//! Every probe is asked at most once, so that a query ends.

use super::march::{LocalRay, March, Search};
use super::store::LightField;
use crate::base::ray::Ray;
use crate::probe::placement::ProbeGrid;
use glam::Vec3;

/// Cells that a ray may be followed through.
const MOST_CELLS: usize = 4;
/// Probes that it may be followed by.
const MOST_PROBES: usize = 8 * MOST_CELLS;

/// What a ray meets, by what the probes know.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Found {
    /// A surface, at a distance along the ray.
    Surface {
        /// Probe that sees it.
        probe: usize,
        /// Texel in which it does.
        texel: usize,
        /// Distance along the ray, metres.
        t: f32,
    },
    /// Nothing up to the ray's end.
    Nothing,
    /// Every probe has lost it; `probe` is the one that saw it farthest, up to `t`.
    Lost {
        /// Probe.
        probe: usize,
        /// Distance along the ray, metres.
        t: f32,
    },
}

/// Follows a ray; its end must be finite.
pub fn trace(field: &LightField, ray: &Ray, search: Search, thickness: f32) -> Found {
    let mut asked = [usize::MAX; MOST_PROBES];
    let mut count = 0;
    let mut t = ray.t_min;
    let mut farthest = (usize::MAX, t);
    for _ in 0..MOST_CELLS {
        let before = count;
        for probe in nearest_first(&field.grid, ray.at(t)) {
            if asked[..count].contains(&probe) {
                continue;
            }
            asked[count] = probe;
            count += 1;
            let local = LocalRay { o: ray.o - field.grid.position(probe), d: ray.d };
            match field.maps[probe].march(&local, [t, ray.t_max], search, thickness) {
                March::Hit { t, texel } => return Found::Surface { probe, texel, t },
                March::Free => return Found::Nothing,
                March::Hidden { t: lost } => {
                    if farthest.0 == usize::MAX || lost > farthest.1 {
                        farthest = (probe, lost);
                    }
                    t = t.max(lost);
                }
            }
        }
        if count == before {
            break;
        }
    }
    match farthest {
        (usize::MAX, _) => Found::Nothing,
        (probe, t) => Found::Lost { probe, t },
    }
}

/// The probes of the cell around a point that are not blocked, nearest first.
fn nearest_first(grid: &ProbeGrid, p: Vec3) -> impl Iterator<Item = usize> {
    let mut around: [(f32, usize); 8] = grid.around(p).map(|w| {
        let distance = grid.position(w.probe).distance_squared(p);
        (if grid.is_blocked(w.probe) { f32::INFINITY } else { distance }, w.probe)
    });
    around.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    let mut last = usize::MAX;
    around.into_iter().filter(|(distance, _)| distance.is_finite()).map(|(_, probe)| probe).filter(move |&probe| {
        let is_new = probe != last;
        last = probe;
        is_new
    })
}
