//! Pixels that no probe served take their colour from the frame before (§5.2).

use super::gather::Gathered;
use super::shown::Shown;
use crate::base::math::Rgb;
use crate::scene::Camera;
use crate::view::gbuffer::Pixel;

/// What the last frame showed, and its glossy layer.
pub struct Previous {
    /// Its camera, at the size of its buffers.
    pub camera: Camera,
    /// Its pixels, rows from the top.
    pub shown: Vec<Shown>,
    /// Its filtered glossy layer.
    pub glossy: Vec<Rgb>,
}

/// Two depths within this fraction are one surface.
pub(crate) const DEPTH_TOLERANCE: f32 = 0.02;

/// Last frame's glossy layer where it saw the surface of a pixel that no probe served (§5.2).
pub fn reproject_previous(pixel: &Pixel, previous: &Previous) -> Option<Rgb> {
    let (camera, p) = (&previous.camera, pixel.surface.p);
    let [width, height] = camera.size.map(|s| s as usize);
    let at = camera.project(p)?;
    if !(at.x >= 0.0 && at.y >= 0.0 && at.x < width as f32 && at.y < height as f32) {
        return None;
    }
    let i = at.y as usize * width + at.x as usize;
    let there = &previous.shown[i];
    let depth = camera.position().distance(p);
    // What shows no surface has no material either.
    let same = there.material == pixel.surface.material && (there.depth - depth).abs() < DEPTH_TOLERANCE * depth;
    same.then(|| previous.glossy[i])
}

impl Gathered {
    /// Takes the colour of a pixel that no probe served from the frame before. Whether it has one now, or needs none.
    pub(crate) fn or_previous(&mut self, pixel: &Option<Pixel>, previous: Option<&Previous>) -> bool {
        let Some(p) = pixel.as_ref().filter(|p| p.alpha.is_some()) else { return true };
        let found = previous.and_then(|previous| reproject_previous(p, previous));
        if let Some(color) = found {
            // It matches as well as anything at hand: an energy of 1 keeps its confidence below that of a good sample.
            *self = Self { color, energy: 1.0, best: None };
        }
        found.is_some()
    }
}
