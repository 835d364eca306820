//! Mirror rays: the twin of [`crate::view::mirror`].

use super::{PIXEL, REFLECTED, ViewBuffers};
use crate::Result;
use crate::gpu::camera::{CAMERA, GpuCamera};
use crate::gpu::commands::Commands;
use crate::gpu::kernel::Kernel;
use crate::gpu::scene::GpuScene;
use crate::gpu::spec::Access::{ReadWrite, Uniform};
use crate::gpu::spec::KernelSpec;
use crate::scene::Camera;

/// The kernel.
pub(crate) const MIRROR_PASS: KernelSpec = KernelSpec {
    file: "shared/mirror_pass.wgsl",
    twin: "src/view/mirror.rs: mirror_pass",
    workgroup: [8, 8],
    scene: true,
    bindings: &[("camera", Uniform), ("view", ReadWrite)],
    structs: &[&CAMERA, &PIXEL, &REFLECTED],
};

/// The kernel, compiled.
pub(crate) struct Mirror(Kernel);

impl Mirror {
    pub(crate) fn new(scene: &GpuScene) -> Result<Self> {
        Ok(Self(Kernel::in_scene(scene, &MIRROR_PASS, &[])?))
    }

    /// Fills the reflected hits of a view whose pixels are there.
    pub(crate) fn run(&self, scene: &GpuScene, commands: &mut Commands, camera: &Camera, view: &ViewBuffers) -> Result<()> {
        let camera = scene.gpu.uniform("the camera", &GpuCamera::from(camera))?;
        commands.run("mirror", &self.0, &[&camera, &view.pixels], view.size);
        Ok(())
    }
}
