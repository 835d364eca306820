//! Views lit by radiance of first order on a device: the twin of what [`super::super::shade`] makes of sh1.

use crate::Result;
use crate::gpu::camera::CAMERA;
use crate::gpu::commands::Commands;
use crate::gpu::kernel::{Kernel, area};
use crate::gpu::scene::GpuScene;
use crate::gpu::spec::Access::{Read, ReadWrite, Uniform};
use crate::gpu::spec::KernelSpec;
use crate::gpu::view::frame::Target;
use crate::gpu::view::pixel_run::{PIXEL_RUN, PixelRun, runs};
use crate::gpu::view::{PIXEL, REFLECTED, SHADING};
use crate::scene::Camera;

/// The kernel.
pub(crate) const FIRST_ORDER: KernelSpec = KernelSpec {
    file: "radiance_probes/first_order.wgsl",
    twin: "src/method/radiance_probes/shade.rs: taken_in",
    workgroup: [64, 1],
    scene: true,
    bindings: &[("params", Uniform), ("view", Read), ("shading", ReadWrite), ("glossy", ReadWrite)],
    structs: &[&PIXEL_RUN, &CAMERA, &PIXEL, &REFLECTED, &SHADING],
};

/// The kernel, compiled.
pub(super) struct FirstOrder(Kernel);

impl FirstOrder {
    pub(super) fn new(scene: &GpuScene) -> Result<Self> {
        Ok(Self(Kernel::in_scene(scene, &FIRST_ORDER, &[])?))
    }

    /// Takes another scene of the same triangles.
    pub(super) fn rebind(&mut self, scene: &GpuScene) {
        self.0.rebind(scene);
    }

    /// Puts the glossy layer, with so many samples a pixel of light straight from emitters, and the diffuse one, without any, into a view.
    pub(super) fn run(
        &self,
        scene: &GpuScene,
        commands: &mut Commands,
        (camera, target): (&Camera, &Target),
        samples: u32,
        seeds: [u32; 2],
    ) -> Result<()> {
        let view = &target.view;
        for run in runs(area(view.size) as u32, samples) {
            let params = PixelRun::new(camera, seeds, run, samples);
            let params = scene.gpu.uniform("parameters of light of first order", &params)?;
            commands.run("glossy", &self.0, &[&params, &view.pixels, &view.shading, &target.glossy], [run.1, 1]);
        }
        Ok(())
    }
}
