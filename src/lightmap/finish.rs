//! From the values of texel sides to those of pixels: texels that nobody sees, gutters, seams.

use super::bake::{CONTACT, OPEN, Plan, SPLIT};
use super::{fill, seam};
use crate::base::math::Rgb;
use glam::Vec2;
use rayon::prelude::*;

/// One side of the atlas in the making.
pub(super) struct Side {
    pub pixels: Vec<Rgb>,
    pub flags: Vec<u32>,
}

impl Side {
    pub fn new(plan: &Plan) -> Self {
        let n = (plan.atlas.size[0] * plan.atlas.size[1]) as usize;
        Self { pixels: vec![Rgb::ZERO; n], flags: vec![0; n] }
    }
}

impl Plan<'_> {
    pub(super) fn finish(&self, mut side: Side, back: bool) -> Vec<Rgb> {
        self.lighten_hidden(&mut side, back);
        let valid: Vec<bool> = side.flags.iter().map(|f| f & (OPEN | CONTACT) != 0).collect();
        fill::dilate(&self.atlas, &mut side.pixels, &valid);
        let active = |chart: u32| self.active[chart as usize][back as usize];
        seam::close(&self.world.scene.geometry, &self.atlas, &mut side.pixels, &valid, &active);
        side.pixels
    }

    /// Texels in the dark behind a wall, and texels pressed against something, take the light of their neighbours in the
    /// open, so that interpolation up to a wall or a foot does not reach into the dark. Those further in keep their own:
    /// they may be seen through a crack.
    fn lighten_hidden(&self, side: &mut Side, back: bool) {
        let width = self.atlas.size[0] as i64;
        let mut texel_at = vec![u32::MAX; side.pixels.len()];
        for (i, &pixel) in self.texels.pixel.iter().enumerate() {
            texel_at[pixel as usize] = i as u32;
        }
        let visibility = self.visibility();
        let centre = |texel: usize| visibility.sample(texel, Vec2::splat(0.5));
        let changes: Vec<(usize, Rgb)> = (0..self.texels.len())
            .into_par_iter()
            .filter_map(|i| {
                let pixel = self.texels.pixel[i] as usize;
                let pressed = side.flags[pixel] & CONTACT != 0;
                let void = side.flags[pixel] & OPEN != 0 && side.pixels[pixel] == Rgb::ZERO;
                if !pressed && !void {
                    return None;
                }
                let in_the_open = |&p: &usize| {
                    let chart = |t: u32| self.texels.chart[t as usize];
                    side.flags.get(p).is_some_and(|f| f & OPEN != 0)
                        && chart(texel_at[p]) == self.texels.chart[i]
                        && (pressed
                            || side.pixels[p] != Rgb::ZERO
                                && (side.flags[p] & SPLIT != 0
                                    || !visibility.together(&centre(i), &centre(texel_at[p] as usize), back)))
                };
                let around = [-width - 1, -width, 1 - width, -1, 1, width - 1, width, width + 1];
                let lit: Vec<usize> = around.into_iter().map(|d| (pixel as i64 + d) as usize).filter(in_the_open).collect();
                (!lit.is_empty()).then(|| (pixel, lit.iter().map(|&p| side.pixels[p]).sum::<Rgb>() / lit.len() as f32))
            })
            .collect();
        for (pixel, value) in changes {
            side.pixels[pixel] = value;
        }
    }
}
