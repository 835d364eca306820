//! Frames of a method that fills the glossy layer of a G-buffer, and has the other layers from the view itself and a light map.

use super::composite::{diffuse_layer, downsample, emission_layer};
use super::gbuffer::{GBuffer, gbuffer};
use super::layers::LayerImages;
use crate::base::clock::Clock;
use crate::base::math::Rgb;
use crate::lightmap::LightMap;
use crate::scene::Camera;
use crate::surface::CurvatureMap;
use crate::transport::World;

/// What such frames share.
pub struct Baseline<'a> {
    world: &'a World,
    lightmap: Option<&'a LightMap>,
    flat: CurvatureMap,
    supersample: u32,
}

impl<'a> Baseline<'a> {
    /// For `supersample` x `supersample` rays a pixel. Without a light map the diffuse layer is black.
    pub fn new(world: &'a World, lightmap: Option<&'a LightMap>, supersample: u32) -> Self {
        let flat = CurvatureMap::flat(world.scene.geometry.positions.len());
        Self { world, lightmap, flat, supersample }
    }

    /// The G-buffer, at all of a pixel's rays.
    pub fn gbuffer(&self, camera: &Camera, clock: &mut Clock) -> GBuffer {
        let fine = Camera { size: camera.size.map(|s| s * self.supersample), ..camera.clone() };
        let view = gbuffer(self.world, &self.flat, &fine);
        clock.lap("gbuffer");
        view
    }

    /// The frame's layers, `glossy` being at the G-buffer's size.
    pub fn layers(&self, view: &GBuffer, glossy: &[Rgb], clock: &mut Clock) -> LayerImages {
        let diffuse = match self.lightmap {
            Some(map) => diffuse_layer(&self.world.scene, view, map),
            None => vec![Rgb::ZERO; glossy.len()],
        };
        self.both_layers(view, &diffuse, glossy, clock)
    }

    /// The frame's layers, the given ones being at the G-buffer's size.
    pub fn both_layers(&self, view: &GBuffer, diffuse: &[Rgb], glossy: &[Rgb], clock: &mut Clock) -> LayerImages {
        let small = |fine: &[Rgb]| downsample(fine, view.size(), self.supersample as usize);
        let layers = LayerImages { emission: small(&emission_layer(view)), diffuse: small(diffuse), glossy: small(glossy) };
        clock.lap("composite");
        layers
    }
}
