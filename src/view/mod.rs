//! What every method that renders views shares: G-buffer, mirror rays and their light, layers, auxiliary layers, denoisers.

pub mod aov;
pub mod baseline;
pub mod composite;
pub mod denoise;
pub mod denoiser;
pub mod direct;
pub mod gbuffer;
pub mod layers;
pub mod mirror;
pub mod mirror_light;
pub mod oidn;

use crate::scene::Camera;

/// Most rays along a pixel's side through all of a method's passes.
pub const MOST_SUPERSAMPLES: u32 = 8;

/// A frame of a camera path.
#[derive(Debug, Clone)]
pub struct View {
    /// Its number in the path: the name of its file, and part of its random streams.
    pub frame: u32,
    /// Its camera.
    pub camera: Camera,
}

impl View {
    /// Size of the largest of some views, pixels.
    pub fn largest(views: &[Self]) -> [u32; 2] {
        views.iter().map(|v| v.camera.size).max_by_key(|&[w, h]| u64::from(w) * u64::from(h)).unwrap_or([0, 0])
    }
}
