//! What mirrors show of lamps and diffuse light: the twin of [`crate::view::mirror_light`].

use super::{PIXEL, REFLECTED, ViewBuffers};
use crate::Result;
use crate::gpu::camera::{CAMERA, GpuCamera};
use crate::gpu::commands::Commands;
use crate::gpu::kernel::{Kernel, bands};
use crate::gpu::scene::GpuScene;
use crate::gpu::spec::Access::{Read, ReadWrite, Uniform};
use crate::gpu::spec::{KernelSpec, StructLayout, layout};
use crate::scene::Camera;
use crate::view::mirror_light::ChainParams;
use bytemuck::{Pod, Zeroable};

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

/// The kernel.
pub(crate) const MIRROR_LIGHT: KernelSpec = KernelSpec {
    file: "shared/mirror_light.wgsl",
    twin: "src/view/mirror_light.rs: mirror_chain",
    workgroup: [8, 8],
    scene: true,
    bindings: &[("chain", Uniform), ("view", Read), ("mirrored_light", ReadWrite)],
    structs: &[&PARAMS, &CAMERA, &PIXEL, &REFLECTED],
};
const PARAMS: StructLayout = layout!(Params as "MirrorLightParams" { camera, first_row, rays, max_alpha, max_first_alpha });

/// The kernel, compiled.
pub(crate) struct MirrorLight(Kernel);

impl MirrorLight {
    pub(crate) fn new(scene: &GpuScene) -> Result<Self> {
        Ok(Self(Kernel::in_scene(scene, &MIRROR_LIGHT, &[])?))
    }

    /// Fills `out`, 16 bytes a pixel, for the pixels whose alpha is `max_first_alpha` at most: radiance along the mirror direction, and the
    /// first hit's distance. Black at others.
    pub(crate) fn run(
        &self,
        scene: &GpuScene,
        commands: &mut Commands,
        (camera, view): (&Camera, &ViewBuffers),
        (params, max_first_alpha): (&ChainParams, f32),
        out: &wgpu::Buffer,
    ) -> Result<()> {
        for (first_row, rows) in bands(view.size, MOST_RAYS, u64::from(params.rays)) {
            let ChainParams { rays, max_alpha } = *params;
            let params = Params { camera: camera.into(), first_row, rays, max_alpha, max_first_alpha };
            let params = scene.gpu.uniform("the mirror rays' parameters", &params)?;
            commands.run("mirror", &self.0, &[&params, &view.pixels, out], [view.size[0], rows]);
        }
        Ok(())
    }
}
