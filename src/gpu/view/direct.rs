//! Light straight from emitters in every pixel: the twin of [`crate::view::direct`].

use super::pixel_run::{PIXEL_RUN, PixelRun, runs};
use super::{PIXEL, REFLECTED, SHADING, ViewBuffers};
use crate::Result;
use crate::gpu::camera::CAMERA;
use crate::gpu::commands::Commands;
use crate::gpu::kernel::{Kernel, area};
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
pub(crate) struct DirectLight(Kernel);

impl DirectLight {
    pub(crate) fn new(scene: &GpuScene) -> Result<Self> {
        Ok(Self(Kernel::in_scene(scene, &DIRECT_LIGHT, &[])?))
    }

    /// Takes another scene of the same triangles.
    pub(crate) fn rebind(&mut self, scene: &GpuScene) {
        self.0.rebind(scene);
    }

    /// Adds the mean of so many samples a pixel to the view's diffuse light, whose random streams follow from seed and frame.
    pub(crate) fn run(
        &self,
        scene: &GpuScene,
        (commands, pass): (&mut Commands, &'static str),
        (camera, view): (&Camera, &ViewBuffers),
        samples: u32,
        seeds: [u32; 2],
    ) -> Result<()> {
        if samples == 0 {
            return Ok(());
        }
        for run in runs(area(view.size) as u32, samples) {
            let params = scene.gpu.uniform("parameters of direct light", &PixelRun::new(camera, seeds, run, samples))?;
            commands.run(pass, &self.0, &[&params, &view.pixels, &view.shading], [run.1, 1]);
        }
        Ok(())
    }
}
