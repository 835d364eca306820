//! Light straight from emitters in every pixel: the twin of [`crate::view::direct`].

use super::pixel_run::{PIXEL_RUN, PixelPass};
use super::{PIXEL, REFLECTED, SHADING, ViewBuffers};
use crate::Result;
use crate::gpu::camera::CAMERA;
use crate::gpu::commands::Commands;
use crate::gpu::scene::GpuScene;
use crate::gpu::spec::Access::{Read, ReadWrite, Uniform};
use crate::gpu::spec::KernelSpec;
use crate::scene::Camera;

/// The kernel.
pub(crate) const DIRECT_LIGHT: KernelSpec = KernelSpec {
    file: "shared/direct_light.wgsl",
    twin: "src/view/direct.rs: direct",
    workgroup: [64, 1],
    scene: true,
    bindings: &[("params", Uniform), ("view", Read), ("shading", ReadWrite)],
    structs: &[&PIXEL_RUN, &CAMERA, &PIXEL, &REFLECTED, &SHADING],
};

/// The kernel, compiled.
pub(crate) struct DirectLight(PixelPass);

impl DirectLight {
    pub(crate) fn new(scene: &GpuScene) -> Result<Self> {
        Ok(Self(PixelPass::new(scene, &DIRECT_LIGHT)?))
    }

    /// Takes another scene of the same triangles.
    pub(crate) fn rebind(&mut self, scene: &GpuScene) {
        self.0.rebind(scene);
    }

    /// Adds the mean of so many samples a pixel to the view's diffuse light, whose random streams follow from seed and frame.
    pub(crate) fn run(
        &self,
        scene: &GpuScene,
        pass: (&mut Commands, &'static str),
        (camera, view): (&Camera, &ViewBuffers),
        samples: u32,
        seeds: [u32; 2],
    ) -> Result<()> {
        match samples {
            0 => Ok(()),
            _ => self.0.run(&scene.gpu, pass, camera, (samples, seeds), samples, &[&view.pixels, &view.shading]),
        }
    }
}
