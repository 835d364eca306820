//! What mirrors show of lamps and diffuse light: the twin of [`crate::view::mirror_light`].

use super::{View, bands};
use crate::Result;
use crate::gpu::camera::GpuCamera;
use crate::gpu::commands::Commands;
use crate::gpu::kernel::{Kernel, groups, shader};
use crate::gpu::scene::{GpuScene, MATERIALS, PATHS, RAYS};
use crate::scene::Camera;
use crate::view::mirror_light::ChainParams;
use bytemuck::{Pod, Zeroable};

/// Edges of a workgroup, pixels.
const WORKGROUP: [u32; 2] = [8, 8];
/// Most mirror rays of a dispatch: well below a second on a slow GPU.
const MOST_RAYS: u64 = 1 << 22;

/// `MirrorLightParams` of mirror_light.wgsl.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct Params {
    camera: GpuCamera,
    first_row: u32,
    rays: u32,
    max_alpha: f32,
    max_first_alpha: f32,
}

fn source() -> String {
    [RAYS, MATERIALS, PATHS, shader!("camera", "camera_ray", "view", "mirror", "gbuffer", "mirror_light")].concat()
}

/// The kernel.
pub(crate) struct MirrorLight(Kernel);

impl MirrorLight {
    pub(crate) fn new(scene: &GpuScene) -> Result<Self> {
        Ok(Self(Kernel::in_scene(scene, &source(), "mirror_light", [3, 1], &[])?))
    }

    /// Fills `out`, 16 bytes a pixel, for the pixels whose alpha is `max_first_alpha` at most: radiance along the mirror direction, and the
    /// first hit's distance. Black at others.
    pub(crate) fn run(
        &self,
        scene: &GpuScene,
        commands: &mut Commands,
        (camera, view): (&Camera, &View),
        (params, max_first_alpha): (&ChainParams, f32),
        out: &wgpu::Buffer,
    ) -> Result<()> {
        for (first_row, rows) in bands(view.size, MOST_RAYS, u64::from(params.rays)) {
            let ChainParams { rays, max_alpha } = *params;
            let params = Params { camera: camera.into(), first_row, rays, max_alpha, max_first_alpha };
            let params = scene.gpu.upload("the mirror rays' parameters", bytemuck::bytes_of(&params))?;
            let buffers = [&params, &view.hits, &view.guides.materials, out];
            commands.run("mirror", &self.0, &buffers, groups([view.size[0], rows], WORKGROUP));
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gpu::layout::check;

    #[test]
    fn structs_are_laid_out_as_in_the_shader() {
        check!(&source(), Params as "MirrorLightParams" { camera, first_row, rays, max_alpha, max_first_alpha });
    }
}
