//! From finished blocks to maps: the values of texel sides without their noise, texels that nobody sees, gutters, seams.

use super::bake::{Baked, CONTACT, First, OPEN, PART, Pass, Plan, SPLIT};
use super::parts::{Record, Store};
use super::visible::Sight;
use super::{LightMap, fill, lookup, seam};
use crate::base::math::Rgb;
use crate::base::progress::Progress;
use crate::{Error, Result};
use glam::Vec2;
use rayon::prelude::*;

/// One side of the atlas in the making.
struct Side {
    pixels: Vec<Rgb>,
    flags: Vec<u32>,
}

/// What all samples of a texel side see, by its flags; `None` where it is not the same.
fn sight(flags: u32) -> Option<Sight> {
    match flags {
        f if f & PART != 0 => None,
        f if f & OPEN != 0 => Some(Sight::Open),
        f if f & CONTACT != 0 => Some(Sight::Contact),
        _ => Some(Sight::Inside),
    }
}

impl Side {
    fn new(plan: &Plan) -> Self {
        let n = (plan.atlas.size[0] * plan.atlas.size[1]) as usize;
        Self { pixels: vec![Rgb::ZERO; n], flags: vec![0; n] }
    }
}

impl Plan<'_> {
    /// A pass's finished map, ready for lookups.
    pub fn map(&self, pass: &Pass, store: &dyn Store, progress: &dyn Progress) -> Result<LightMap> {
        Ok(self.as_map(self.assemble(pass, store, progress)?))
    }

    /// A finished first pass.
    pub fn first(&self, pass: &Pass, store: &dyn Store, progress: &dyn Progress) -> Result<First> {
        let records = self.records(store)?;
        let mut sights = vec![[None; 2]; (self.atlas.size[0] * self.atlas.size[1]) as usize];
        for (&(texel, back), record) in self.items.iter().zip(&records) {
            sights[self.texels.pixel[texel as usize] as usize][usize::from(back)] = sight(record[3]);
        }
        Ok(First { map: self.as_map(self.assembled(pass, records, progress)), sights })
    }

    /// Puts a pass's blocks together: noise, where it shall go; gutters, texels that nobody sees, seams.
    pub fn assemble(&self, pass: &Pass, store: &dyn Store, progress: &dyn Progress) -> Result<Baked> {
        Ok(self.assembled(pass, self.records(store)?, progress))
    }

    fn records(&self, store: &dyn Store) -> Result<Vec<Record>> {
        let mut records = Vec::with_capacity(self.items.len());
        for b in 0..self.blocks() {
            let block = store.get(b, self.block(b).len());
            records.extend(block.ok_or_else(|| Error::Request(format!("block {b} of the light map is missing: bake it again")))?);
        }
        Ok(records)
    }

    fn as_map(&self, Baked { front, back, .. }: Baked) -> LightMap {
        lookup::sides(&self.world.scene.geometry, &self.atlas, front, back)
    }

    fn assembled(&self, pass: &Pass, mut records: Vec<Record>, progress: &dyn Progress) -> Baked {
        if let Some(params) = &pass.denoise {
            self.denoise(pass, &mut records, params, progress);
        }
        let mut sides = [Side::new(self), Side::new(self)];
        for (&(texel, back), r) in self.items.iter().zip(&records) {
            let side = &mut sides[back as usize];
            let pixel = self.texels.pixel[texel as usize] as usize;
            side.pixels[pixel] = Rgb::from_array([r[0], r[1], r[2]].map(f32::from_bits));
            side.flags[pixel] = r[3];
        }
        let samples = records.iter().map(|r| f64::from(r[6])).sum::<f64>() / records.len().max(1) as f64;
        let [front, back] = sides;
        let back = (self.backs() > 0).then(|| self.finish(back, true));
        Baked { front: self.finish(front, false), back, samples }
    }

    fn finish(&self, mut side: Side, back: bool) -> Vec<Rgb> {
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
