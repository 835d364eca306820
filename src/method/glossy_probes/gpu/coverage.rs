//! Rays along edges: the twin of [`crate::method::glossy_probes::coverage`].

use crate::Result;
use crate::gpu::camera::{CAMERA, GpuCamera};
use crate::gpu::commands::Commands;
use crate::gpu::kernel::Kernel;
use crate::gpu::scene::GpuScene;
use crate::gpu::spec::Access::{Read, ReadWrite, Uniform};
use crate::gpu::spec::{KernelSpec, StructLayout, layout};
use crate::gpu::view::composite::{LAYER_PIXEL, Layers};
use crate::gpu::view::{PIXEL, REFLECTED, ViewBuffers};
use crate::scene::Camera;
use bytemuck::{Pod, Zeroable};

/// `CoverageParams` of cover.wgsl.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct Params {
    camera: GpuCamera,
    sub_pixels: u32,
    rays: u32,
    mirrors: u32,
    padding: u32,
}

/// The kernel.
pub(crate) const COVER: KernelSpec = KernelSpec {
    file: "glossy_probes/cover.wgsl",
    twin: "src/method/glossy_probes/coverage.rs: covered_pixels",
    workgroup: [8, 8],
    scene: true,
    bindings: &[("coverage_params", Uniform), ("view", Read), ("view_glossy", Read), ("frame", ReadWrite)],
    structs: &[&PARAMS, &CAMERA, &PIXEL, &REFLECTED, &LAYER_PIXEL],
};
const PARAMS: StructLayout = layout!(Params as "CoverageParams" { camera, sub_pixels, rays, mirrors });

/// The kernel, compiled.
pub(crate) struct Coverage {
    kernel: Kernel,
    rays: u32,
}

impl Coverage {
    /// For N x N rays a pixel.
    pub(crate) fn new(scene: &GpuScene, rays: u32) -> Result<Self> {
        Ok(Self { kernel: Kernel::in_scene(scene, &COVER, &[])?, rays })
    }

    /// Renders the pixels along edges anew. `camera` is of the frame's size; `mirrors` says that `glossy` lacks what perfect mirrors show.
    pub(crate) fn run(
        &self,
        scene: &GpuScene,
        commands: &mut Commands,
        camera: &Camera,
        (view, glossy, mirrors): (&ViewBuffers, &wgpu::Buffer, bool),
        layers: &Layers,
    ) -> Result<()> {
        let params = Params {
            camera: camera.into(),
            sub_pixels: view.size[0] / camera.size[0],
            rays: self.rays,
            mirrors: mirrors.into(),
            padding: 0,
        };
        let params = scene.gpu.uniform("the coverage's parameters", &params)?;
        commands.run("coverage", &self.kernel, &[&params, &view.pixels, glossy, &layers.frame], camera.size);
        Ok(())
    }
}
