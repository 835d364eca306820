//! The last passes: filling what no probe served, averaging sub-pixels, adding the layers.

use super::gbuffer::{GBuffer, Pixel};
use crate::base::math::Rgb;
use crate::lightmap::LightMap;
use crate::method::glossy_probes::gather::Gathered;
use crate::scene::{Camera, Scene};
use rayon::prelude::*;
use std::sync::Arc;

/// The last frame's view and glossy layer.
pub struct Previous {
    /// Its camera, at the size of its buffers.
    pub view: Arc<GBuffer>,
    /// Its filtered glossy layer.
    pub glossy: Vec<Rgb>,
}

/// Two depths within this fraction are one surface.
pub(crate) const DEPTH_TOLERANCE: f32 = 0.02;

/// Fills pixels that no probe served with last frame's glossy layer, where it saw the same surface (§5.2).
/// Returns how many pixels stay without a sample. Their energy stays infinite: they give nothing to the filter.
pub fn reproject_previous(view: &GBuffer, gathered: &mut [Gathered], previous: Option<&Previous>) -> usize {
    let mut unserved = 0;
    for (pixel, out) in view.pixels.iter().zip(gathered) {
        let Some(p) = pixel.as_ref().filter(|p| p.alpha.is_some() && out.energy.is_infinite()) else { continue };
        match previous.and_then(|prev| lookup_previous(prev, &prev.view.camera, p.surface.p, p.surface.material)) {
            // It matches as well as anything at hand: an energy of 1 keeps its confidence below that of a good sample.
            Some(color) => *out = Gathered { color, energy: 1.0, best: None },
            None => unserved += 1,
        }
    }
    unserved
}

fn lookup_previous(previous: &Previous, camera: &Camera, p: glam::Vec3, material: u32) -> Option<Rgb> {
    let [width, height] = previous.view.size();
    let at = camera.project(p)?;
    if !(at.x >= 0.0 && at.y >= 0.0 && at.x < width as f32 && at.y < height as f32) {
        return None;
    }
    let i = at.y as usize * width + at.x as usize;
    let there = previous.view.pixels[i].as_ref()?;
    let depth = camera.position().distance(p);
    let same = there.surface.material == material && (there.depth - depth).abs() < DEPTH_TOLERANCE * depth;
    same.then(|| previous.glossy[i])
}

/// The emission layer: LE, emission seen directly, and the environment.
pub fn emission_layer(view: &GBuffer) -> Vec<Rgb> {
    view.pixels.par_iter().zip(&view.background).map(|(p, &sky)| p.as_ref().map_or(sky, |p| p.emission)).collect()
}

/// The diffuse layer: the light map's E times the view's factor of the diffuse lobe, `diffuse_out(ω) E / π`.
pub fn diffuse_layer(scene: &Scene, view: &GBuffer, lightmap: &LightMap) -> Vec<Rgb> {
    let radiance = |p: &Pixel| lightmap.diffuse_radiance(scene, &p.surface, p.wo);
    view.pixels.par_iter().map(|pixel| pixel.as_ref().map_or(Rgb::ZERO, radiance)).collect()
}

/// Mean over the n x n sub-pixels of each pixel. `size` is that of `fine`.
pub fn downsample(fine: &[Rgb], size: [usize; 2], n: usize) -> Vec<Rgb> {
    let (width, height) = (size[0] / n, size[1] / n);
    let scale = 1.0 / (n * n) as f32;
    (0..width * height)
        .into_par_iter()
        .with_min_len(width)
        .map(|i| {
            let (x, y) = (i % width * n, i / width * n);
            let block = (0..n * n).map(|k| fine[(y + k / n) * size[0] + x + k % n]);
            block.sum::<Rgb>() * scale
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn downsample_is_the_mean_of_each_block() {
        let fine: Vec<Rgb> = (0..24).map(|i| Rgb::splat(i as f32)).collect();
        let coarse = downsample(&fine, [6, 4], 2);
        let expected = [3.5, 5.5];
        assert_eq!(coarse.len(), 6);
        assert_eq!(coarse[0], Rgb::splat(expected[0]));
        assert_eq!(coarse[1], Rgb::splat(expected[1]));
        assert_eq!(coarse[5], Rgb::splat((16 + 17 + 22 + 23) as f32 / 4.0));
    }
}
