//! Receivers: sides of texels at which light that changes is gathered, by points in the open that stand for them.

use super::Atlas;
use super::bake::Plan;
use super::fill;
use super::seam;
use super::texels::Point;
use super::visible::Sight;
use crate::base::math::{Rgb, hash_words};
use crate::base::ray::Hit;
use crate::material::Surface;
use crate::scene::Geometry;
use crate::transport::{Sampler, World};
use glam::Vec2;
use rayon::prelude::*;

/// Points of a texel.
pub const POINTS: usize = 4;

/// Marks the back of a pixel.
pub const BACK_BIT: u32 = 1 << 31;

/// Places of a texel that are tried for them.
const TRIES: u32 = 16;

/// A side of a texel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Receiver {
    /// Pixel of the atlas (row · width + column).
    pub pixel: u32,
    /// Whether it is the side that the shading normal points away from.
    pub back: bool,
    /// Points of it; where fewer are in the open, some of them more than once.
    pub points: [Point; POINTS],
}

impl Receiver {
    /// Pixel and side in one word.
    pub fn word(&self) -> u32 {
        self.pixel | if self.back { BACK_BIT } else { 0 }
    }

    /// The surface at one of its points; `world` is the scene's, or a frame's.
    pub fn surface(&self, world: &World, point: usize) -> Surface {
        let p = self.points[point % POINTS];
        world.surface(&Hit { t: 0.0, triangle: p.triangle, u: p.barycentric.x, v: p.barycentric.y })
    }
}

impl Plan<'_> {
    /// The sides that are baked, with points in the open that see each other. A side that has none is none: it takes the light of its
    /// neighbours.
    pub fn receivers(&self) -> Vec<Receiver> {
        self.items.par_iter().filter_map(|&(texel, back)| self.receiver(texel as usize, back)).collect()
    }

    fn receiver(&self, texel: usize, back: bool) -> Option<Receiver> {
        let visibility = self.visibility();
        let pixel = self.texels.pixel[texel];
        let mut found: Vec<Surface> = Vec::with_capacity(POINTS);
        for i in 0..TRIES {
            let surface = visibility.sample(texel, place(i));
            let mut sampler = Sampler::new(hash_words(&[pixel, u32::from(back)]), i);
            let is_open = visibility.view(&surface, back, &mut sampler) == Sight::Open;
            if is_open && found.first().is_none_or(|first| visibility.together(first, &surface, back)) {
                found.push(surface);
            }
            if found.len() == POINTS {
                break;
            }
        }
        let point = |i: usize| {
            let s = &found[i % found.len()];
            Point { triangle: s.triangle, barycentric: s.barycentric }
        };
        (!found.is_empty()).then(|| Receiver { pixel, back, points: std::array::from_fn(point) })
    }
}

/// The same places in every texel (Roberts' R2 sequence), so that what neighbours gather differs by what they see alone.
pub(super) fn place(i: u32) -> Vec2 {
    let n = i as f32 + 0.5;
    Vec2::new((n * 0.754_877_7).fract(), (n * 0.569_840_3).fract())
}

/// Fills gutters and texels without a value from those that are `valid`, and evens out the light across the seams of charts that have any.
pub fn spread(geometry: &Geometry, atlas: &Atlas, pixels: &mut [Rgb], valid: &[bool]) {
    fill::dilate(atlas, pixels, valid);
    let has_light = |chart: u32| {
        let chart = &atlas.charts[chart as usize];
        let at = |i: u32| (chart.corner[1] + i / chart.size[0]) * atlas.size[0] + chart.corner[0] + i % chart.size[0];
        (0..chart.size[0] * chart.size[1]).any(|i| valid[at(i) as usize])
    };
    let active: Vec<bool> = (0..atlas.charts.len() as u32).into_par_iter().map(has_light).collect();
    seam::close(geometry, atlas, pixels, valid, &|chart| active[chart as usize]);
}
