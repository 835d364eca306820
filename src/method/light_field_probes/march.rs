//! A ray through one probe's map: where it meets a surface that the probe sees, or goes behind one.
//!
//! *Paper* (McGuire 2017, §4.1; Wang 2019, §4.2): a ray is a chain of at most four straight lines on the octahedral map, one an octant. Along
//! them the ray's distance from the probe is compared with what is stored: with the least distance of a square of texels first, and
//! texel by texel where that does not say that the ray is in front. Two levels of squares make McGuire's search, all of them Wang's.
//! A square is passed over only where the ray is nearer than everything in it, so that both find the same.

use super::probe::Surfels;
use super::pyramid::Pyramid;
use crate::base::octahedral::within_octant;
use glam::{Vec2, Vec3};
use serde::{Deserialize, Serialize};
use std::cmp::Ordering;

/// How the squares of texels are searched.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Search {
    /// 16 x 16 texels, then single ones.
    TwoScale,
    /// All levels.
    HiZ,
}

impl std::fmt::Display for Search {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        f.write_str(match self {
            Self::TwoScale => "two-scale",
            Self::HiZ => "hi-z",
        })
    }
}

impl std::str::FromStr for Search {
    type Err = String;

    fn from_str(text: &str) -> std::result::Result<Self, String> {
        let known = [Self::TwoScale, Self::HiZ].into_iter().find(|search| search.to_string() == text);
        known.ok_or_else(|| "expected two-scale or hi-z".into())
    }
}

/// Level of the coarse squares of [`Search::TwoScale`].
pub(crate) const COARSE: usize = 4;
/// Coarsest level of [`Search::HiZ`]: squares that hold a quarter of an edge hold near and far.
pub(crate) const SECOND_TOP: usize = 2;

/// What becomes of a ray, by what one probe knows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum March {
    /// It meets a surface at `t`, seen in a texel.
    Hit {
        /// Distance along the ray.
        t: f32,
        /// Index of the texel.
        texel: usize,
    },
    /// At `t` it goes behind a surface.
    Hidden {
        /// Distance along the ray.
        t: f32,
    },
    /// It meets nothing up to its end.
    Free,
}

/// A probe's surfaces, ready for rays.
#[derive(Debug, Clone)]
pub struct Map {
    /// The surfaces.
    pub surfels: Surfels,
    /// Their bounds.
    pub pyramid: Pyramid,
}

/// A ray relative to a probe.
#[derive(Debug, Clone, Copy)]
pub struct LocalRay {
    /// Origin less the probe's position, metres.
    pub o: Vec3,
    /// Unit direction.
    pub d: Vec3,
}

impl LocalRay {
    fn at(&self, t: f32) -> Vec3 {
        self.o + self.d * t
    }

    /// Where its pieces from `t[0]` to `t[1]` begin and end, of which each is within an octant: so many distances along it, ascending.
    pub fn cuts(&self, t: [f32; 2]) -> ([f32; 5], usize) {
        let mut cuts = [t[0], f32::NAN, f32::NAN, f32::NAN, t[1]];
        let mut count = 1;
        for axis in 0..3 {
            let cut = -self.o[axis] / self.d[axis];
            if cut > t[0] && cut < t[1] {
                cuts[count] = cut;
                count += 1;
            }
        }
        cuts[1..count].sort_unstable_by(f32::total_cmp);
        cuts[count] = t[1];
        (cuts, count + 1)
    }

    /// A piece between two neighbouring cuts: the ends of its straight line on the map, in [0, 1]², and |p|₁ there. `None` where it is no
    /// longer than rounding.
    pub fn piece(&self, t: [f32; 2]) -> Option<([Vec2; 2], [f32; 2])> {
        let ends = t.map(|t| self.at(t));
        let signs = Vec3::ONE.copysign(ends[0] + ends[1]);
        let weight = ends.map(|p| p.dot(signs));
        if t[1].partial_cmp(&t[0]) != Some(Ordering::Greater) || weight.iter().any(|w| *w <= 0.0) {
            return None;
        }
        Some((ends.map(|p| (within_octant(p, signs) * 0.5 + 0.5).clamp(Vec2::ZERO, Vec2::ONE)), weight))
    }

    /// Greatest distance from the probe between two places, which is at one of them.
    fn farthest(&self, t: [f32; 2]) -> f32 {
        t.map(|t| self.at(t).length_squared()).into_iter().fold(0.0, f32::max).sqrt()
    }
}

/// A piece of a ray within an octant: a straight line on the map.
struct Line {
    t: [f32; 2],
    /// Its ends, texels.
    from: Vec2,
    along: Vec2,
    /// |p|₁ at the ends.
    weight: [f32; 2],
}

impl Line {
    /// Distance along the ray at a share of the line: the map is projective.
    fn t_at(&self, share: f32) -> f32 {
        let (a, b) = (share * self.weight[0], (1.0 - share) * self.weight[1]);
        self.t[0] + (self.t[1] - self.t[0]) * (a / (a + b)).clamp(0.0, 1.0)
    }
}

impl Map {
    /// Of a probe's surfaces.
    pub fn new(surfels: Surfels) -> Self {
        Self { pyramid: Pyramid::new(&surfels), surfels }
    }

    /// Follows a ray from `t[0]` to `t[1]`, both finite. `thickness`: how far behind a surface, in texels, a ray still counts as at it.
    pub fn march(&self, ray: &LocalRay, t: [f32; 2], search: Search, thickness: f32) -> March {
        let (cuts, count) = ray.cuts(t);
        for ends in cuts[..count].windows(2) {
            let found = self.line([ends[0], ends[1]], ray).map(|line| self.follow(ray, &line, search, thickness));
            if let Some(found) = found.filter(|f| *f != March::Free) {
                return found;
            }
        }
        March::Free
    }

    /// The piece of a ray between two neighbouring cuts; `None` where it is no longer than rounding.
    fn line(&self, t: [f32; 2], ray: &LocalRay) -> Option<Line> {
        let (places, weight) = ray.piece(t)?;
        let [from, to] = places.map(|p| p * self.pyramid.size as f32);
        Some(Line { t, from, along: to - from, weight })
    }

    fn follow(&self, ray: &LocalRay, line: &Line, search: Search, thickness: f32) -> March {
        let n = self.pyramid.size;
        let top = match search {
            Search::TwoScale => COARSE.min(self.pyramid.top()),
            Search::HiZ => self.pyramid.top().saturating_sub(SECOND_TOP),
        };
        // Each texel and each square is entered once, and left by a step; rounding may repeat some.
        let most = 16 * n + 64;
        let (mut share, mut level) = (0f32, top);
        for _ in 0..most {
            let (square, exit) = leave(line, share, level, n);
            let t = [line.t_at(share), line.t_at(exit)];
            if ray.farthest(t) >= self.pyramid.at(level, square[0], square[1]) {
                if level > 0 {
                    level = if search == Search::TwoScale { 0 } else { level - 1 };
                    continue;
                }
                match self.texel(ray, t, square[1] * n + square[0], thickness) {
                    March::Free => {}
                    found => return found,
                }
            }
            if exit >= 1.0 {
                return March::Free;
            }
            share = exit;
            level = match search {
                Search::HiZ => (level + 1).min(top),
                // Up again where the coarse square is left.
                Search::TwoScale if leave(line, share, top, n).0 != square.map(|c| c >> (top - level)) => top,
                Search::TwoScale => level,
            };
        }
        March::Hidden { t: line.t_at(share) }
    }

    /// A ray within one texel, against the texel's plane.
    fn texel(&self, ray: &LocalRay, t: [f32; 2], i: usize, thickness: f32) -> March {
        let Some(plane) = self.surfels.plane(i) else { return March::Free };
        let [above, then] = t.map(|t| plane.above(ray.at(t)));
        let meets = plane.normal.dot(ray.d) < 0.0;
        if above > 0.0 {
            return match meets && then <= 0.0 {
                true => March::Hit { t: t[0] + (t[1] - t[0]) * (above / (above - then)).min(1.0), texel: i },
                false => March::Free,
            };
        }
        let slack = thickness * self.surfels.texel_angle() * self.surfels.distance[i];
        match above >= -slack {
            // Between two texels' planes; but so near to the ray's origin it is the surface that the ray leaves.
            true if meets && t[0] >= slack => March::Hit { t: t[0], texel: i },
            true => March::Free,
            false => March::Hidden { t: t[0] },
        }
    }
}

/// The square of a level in which a line is at `share`, and the share at which it leaves it: always further on.
fn leave(line: &Line, share: f32, level: usize, n: usize) -> ([usize; 2], f32) {
    let side = (1usize << level) as f32;
    let last = (n >> level) - 1;
    let mut square = [0; 2];
    let mut exit = 1f32;
    for (axis, square) in square.iter_mut().enumerate() {
        let along = line.along[axis];
        // Just past a border it is in the square that it goes to.
        let at = line.from[axis] + along * share + along.signum() * 1e-4;
        *square = ((at / side).floor().max(0.0) as usize).min(last);
        if along != 0.0 {
            let border = (*square + usize::from(along > 0.0)) as f32 * side;
            exit = exit.min((border - line.from[axis]) / along);
        }
    }
    let least = share + 1e-5 / line.along.abs().max_element().max(1e-3);
    (square, exit.max(least).min(1.0))
}
