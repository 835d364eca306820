//! Mirror rays: the twin of [`crate::view::mirror`].

use super::View;
use crate::Result;
use crate::gpu::camera::GpuCamera;
use crate::gpu::commands::Commands;
use crate::gpu::kernel::{Kernel, groups, shader};
use crate::gpu::scene::{GpuScene, MATERIALS, RAYS};
use crate::scene::Camera;

/// Edges of a workgroup, pixels.
const WORKGROUP: [u32; 2] = [8, 8];

/// The kernel.
pub(crate) struct Mirror(Kernel);

impl Mirror {
    pub(crate) fn new(scene: &GpuScene) -> Result<Self> {
        let source = [RAYS, MATERIALS, shader!("camera", "camera_ray", "view", "mirror")].concat();
        Ok(Self(Kernel::in_scene(scene, &source, "mirror_pass", [3, 1], &[])?))
    }

    /// Fills the reflected hits of a view whose other planes are there.
    pub(crate) fn run(&self, scene: &GpuScene, commands: &mut Commands, camera: &Camera, view: &View) -> Result<()> {
        let camera = scene.gpu.upload("the camera", bytemuck::bytes_of(&GpuCamera::from(camera)))?;
        let buffers = [&camera, &view.hits, &view.guides.materials, &view.reflected];
        commands.run("mirror", &self.0, &buffers, groups(view.size, WORKGROUP));
        Ok(())
    }
}
