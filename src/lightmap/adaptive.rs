//! How many samples a texel takes.
//!
//! *Ours*: decided from the first samples of a texel and of those around it in its chart, within their block, so that a block stays a function
//! of scene, parameters and seed alone. Stopping as soon as the texel's own samples agree would favour those that have missed a rare bright
//! path so far.

use super::bake::{BLOCK, FIRST_SAMPLES, Plan};
use super::gather::Sum;
use rayon::prelude::*;
use std::collections::HashMap;

/// E_T below which errors matter less than in proportion: that of a white wall of radiance .01.
pub const DIM: f32 = 0.03;

impl Plan<'_> {
    /// Samples that bring each texel's standard error down to `error` of its light and [`DIM`], by the variance of the first samples in and
    /// around it; `light`: their sums, `None` where no light came.
    pub(super) fn samples_for(&self, error: f32, most: u32, items: &[(u32, bool)], light: &[Option<Sum>]) -> Vec<u32> {
        let block = |(items, light): (&[(u32, bool)], &[Option<Sum>])| {
            let at = |&(texel, back): &(u32, bool)| (self.texels.pixel[texel as usize], self.texels.chart[texel as usize], back);
            let index: HashMap<_, usize> = items.iter().enumerate().map(|(i, item)| (at(item), i)).collect();
            let [width, height] = self.atlas.size;
            let of = |item: &(u32, bool)| {
                let (pixel, chart, back) = at(item);
                let [columns, rows] =
                    [(pixel % width, width), (pixel / width, height)].map(|(i, n)| i.saturating_sub(1)..(i + 2).min(n));
                let pixels = rows.flat_map(|y| columns.clone().map(move |x| y * width + x));
                let around = pixels.filter_map(|p| light[*index.get(&(p, chart, back))?]);
                samples(error, most, around)
            };
            items.iter().map(of).collect::<Vec<_>>()
        };
        items.par_chunks(BLOCK).zip(light.par_chunks(BLOCK)).map(block).collect::<Vec<_>>().concat()
    }
}

/// Samples that bring the standard error of texels like these down to `error`.
fn samples(error: f32, most: u32, around: impl Iterator<Item = Sum>) -> u32 {
    let (mut squares, mut degrees, mut sum, mut count) = (0.0, 0.0, 0.0, 0.0);
    for Sum { paths, count: n, .. } in around {
        let n = f64::from(n);
        squares += (paths.squares - paths.luminance * paths.luminance / n).max(0.0);
        degrees += n - 1.0;
        sum += paths.luminance;
        count += n;
    }
    let least = FIRST_SAMPLES.min(most);
    if degrees == 0.0 {
        return least;
    }
    let allowed = f64::from(error) * (sum / count + f64::from(DIM));
    ((squares / degrees / (allowed * allowed)).ceil() as u32).clamp(least, most)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::transport::follow::PathSum;

    #[test]
    fn the_number_of_samples_is_the_variance_over_the_square_of_what_is_allowed() {
        // Eight samples of 1 and eight of 2, in a texel and in one beside it.
        let paths = PathSum { luminance: 24.0, squares: 40.0, ..PathSum::default() };
        let texel = Sum { paths, count: 16, ..Sum::default() };
        let (variance, allowed) = (4.0 / 15.0, 0.02 * (1.5 + f64::from(DIM)));
        let expected = (variance / (allowed * allowed)).ceil() as u32;
        for around in [vec![texel], vec![texel, texel]] {
            assert!(samples(0.02, 1 << 20, around.into_iter()).abs_diff(expected) <= 1, "in place of {expected}");
        }
        assert_eq!(samples(0.02, 100, [texel].into_iter()), 100, "no more than the most");
        assert_eq!(samples(1e3, 100, [texel].into_iter()), FIRST_SAMPLES);
        assert_eq!(samples(0.02, 100, std::iter::empty()), FIRST_SAMPLES, "nothing is lit");
    }
}
