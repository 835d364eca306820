//! A ray through many probes: each follows it as far as it sees it, and the next goes on from there.
//!
//! *Paper* (McGuire 2017, §4.1; Wang 2019, §4.1): the probes about the ray's origin, the nearest first; where one loses the ray behind a surface,
//! the probes about that place are asked. They are the eight of the grid's cell, or those of the octree's leaf. *Ours*: behind those of the leaf
//! come the eight nearest, as a leaf knows four at most. Every probe is asked at most once, so that a query ends.

use super::field::LightField;
use super::march::{LocalRay, March, Search};
use super::octree::{NO_PROBE, WIDTH};
use crate::base::ray::Ray;
use glam::Vec3;

/// Probes that a ray may be followed by.
pub(crate) const MOST_PROBES: usize = 32;
/// Stands for no probe.
const NONE: usize = usize::MAX;

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

/// One probe's part in a query.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Step {
    /// Probe.
    pub probe: usize,
    /// Distance along the ray from which it was asked, metres.
    pub t: f32,
    /// What it said.
    pub march: March,
}

/// Follows a ray; its end must be finite.
pub fn trace(field: &LightField, ray: &Ray, search: Search, thickness: f32) -> Found {
    follow(field, ray, search, thickness, &mut |_| {})
}

/// Follows a ray, and tells of every probe that is asked.
pub fn follow(field: &LightField, ray: &Ray, search: Search, thickness: f32, tell: &mut dyn FnMut(Step)) -> Found {
    let mut asked = [NONE; MOST_PROBES];
    let mut t = ray.t_min;
    let mut farthest = (NONE, t);
    for count in 0..MOST_PROBES {
        let Some(probe) = next(field, ray.at(t), &asked[..count]) else { break };
        asked[count] = probe;
        let local = LocalRay { o: ray.o - field.places.position(probe), d: ray.d };
        let march = field.maps[probe].march(&local, [t, ray.t_max], search, thickness);
        tell(Step { probe, t, march });
        match march {
            March::Hit { t, texel } => return Found::Surface { probe, texel, t },
            March::Free => return Found::Nothing,
            March::Hidden { t: lost } => {
                if farthest.0 == NONE || lost > farthest.1 {
                    farthest = (probe, lost);
                }
                t = t.max(lost);
            }
        }
    }
    match farthest {
        (NONE, _) => Found::Nothing,
        (probe, t) => Found::Lost { probe, t },
    }
}

/// The first probe about a place that has not been asked.
fn next(field: &LightField, p: Vec3, asked: &[usize]) -> Option<usize> {
    let is_new = |probe: usize| !asked.contains(&probe);
    if let Some(octree) = &field.octree {
        let leaf: [u32; WIDTH] = octree.at(p);
        if let Some(probe) = leaf.into_iter().filter(|&i| i != NO_PROBE).map(|i| i as usize).find(|&i| is_new(i)) {
            return Some(probe);
        }
    }
    let around = field.places.around(p).map(|w| w.probe).into_iter();
    let usable = around.filter(|&i| !field.places.is_blocked(i) && is_new(i));
    let nearer = |a: &usize, b: &usize| {
        let [a, b] = [*a, *b].map(|i| field.places.position(i).distance_squared(p));
        a.total_cmp(&b)
    };
    usable.min_by(nearer)
}
