//! Pixels that no probe served take their colour from the frame before (§5.2).

use super::gather::Gathered;
use crate::base::math::Rgb;
use crate::scene::Camera;
use crate::view::gbuffer::{GBuffer, Pixel};
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
    let fill = |(pixel, out): (&Option<Pixel>, &mut Gathered)| {
        let Some(p) = pixel.as_ref().filter(|p| p.alpha.is_some()) else { return 0 };
        match previous.and_then(|prev| lookup_previous(prev, &prev.view.camera, p.surface.p, p.surface.material)) {
            // It matches as well as anything at hand: an energy of 1 keeps its confidence below that of a good sample.
            Some(color) => *out = Gathered { color, energy: 1.0, best: None },
            None => return 1,
        }
        0
    };
    // The colours first: they are less than the view.
    let unserved = view.pixels.par_iter().zip(gathered).with_min_len(view.size()[0]).filter(|(_, out)| out.energy.is_infinite());
    unserved.map(fill).sum()
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
