//! How many samples a texel takes.
//!
//! *Ours*: decided from the first samples of a texel and of those around it in its chart, within their block, so that a block stays a function
//! of scene, parameters and seed alone. Stopping as soon as the texel's own samples agree would favour those that have missed a rare bright
//! path so far.

use super::bake::{BLOCK, FIRST_SAMPLES, Plan};
use crate::transport::follow::{PathSum, samples_to_error};
use rayon::prelude::*;
use std::collections::HashMap;

/// E_T below which errors matter less than in proportion: that of a white wall of radiance .01.
pub const DIM: f32 = 0.03;

/// Light of some samples of a texel, and how many they are; `None` where no light came.
type Light = Option<(PathSum, u32)>;

impl Plan<'_> {
    /// Samples that bring each texel's standard error down to `error` of its light and [`DIM`], by the variance of the first samples in and
    /// around it, whose light is `light`.
    pub(super) fn samples_for(&self, error: f32, most: u32, items: &[(u32, bool)], light: &[Light]) -> Vec<u32> {
        let block = |(items, light): (&[(u32, bool)], &[Light])| {
            let at = |&(texel, back): &(u32, bool)| (self.texels.pixel[texel as usize], self.texels.chart[texel as usize], back);
            let index: HashMap<_, usize> = items.iter().enumerate().map(|(i, item)| (at(item), i)).collect();
            let [width, height] = self.atlas.size;
            let of = |item: &(u32, bool)| {
                let (pixel, chart, back) = at(item);
                let [columns, rows] =
                    [(pixel % width, width), (pixel / width, height)].map(|(i, n)| i.saturating_sub(1)..(i + 2).min(n));
                let pixels = rows.flat_map(|y| columns.clone().map(move |x| y * width + x));
                let around = pixels.filter_map(|p| light[*index.get(&(p, chart, back))?]);
                samples_to_error(error, DIM, [FIRST_SAMPLES.min(most), most], around)
            };
            items.iter().map(of).collect::<Vec<_>>()
        };
        items.par_chunks(BLOCK).zip(light.par_chunks(BLOCK)).map(block).collect::<Vec<_>>().concat()
    }
}
