//! Pixels that no probe served take their colour from the frame before: the twin of [`crate::method::glossy_probes::previous`].

use super::gather::{GATHERED, Sums};
use crate::Result;
use crate::gpu::Gpu;
use crate::gpu::camera::{CAMERA, GpuCamera};
use crate::gpu::commands::Commands;
use crate::gpu::kernel::Kernel;
use crate::gpu::spec::Access::{Read, ReadWrite, Uniform};
use crate::gpu::spec::{KernelSpec, StructLayout, layout};
use crate::gpu::view::composite::Layers;
use crate::gpu::view::{PIXEL, REFLECTED, ViewBuffers};
use crate::scene::Camera;
use bytemuck::{Pod, Zeroable};

/// `Params` of fill.wgsl.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct FillParams {
    previous: GpuCamera,
    width: u32,
    height: u32,
    has_previous: u32,
    padding: u32,
}

/// What fills pixels that no probe served.
pub(crate) const FILL: KernelSpec = KernelSpec {
    file: "glossy_probes/fill.wgsl",
    twin: "src/method/glossy_probes/previous.rs: reproject_previous",
    workgroup: [16, 4],
    scene: false,
    bindings: &[
        ("params", Uniform),
        ("view", Read),
        ("sums", Read),
        ("previous_view", Read),
        ("previous_glossy", Read),
        ("gathered", ReadWrite),
        ("unserved", ReadWrite),
    ],
    structs: &[&FILL_PARAMS, &CAMERA, &PIXEL, &REFLECTED, &GATHERED],
};
const FILL_PARAMS: StructLayout = layout!(FillParams as "Params" { previous, width, height, has_previous });

/// The kernel.
pub(crate) struct Fill(Kernel);

impl Fill {
    pub(crate) fn new(gpu: &Gpu) -> Result<Self> {
        Ok(Self(Kernel::new(gpu, &FILL)?))
    }

    /// Divides the gathered sums by their weights, and fills pixels that no probe served from the last frame's `glossy` layer.
    /// `previous` is that frame's camera, where there is one, with its pixels.
    pub(crate) fn run(
        &self,
        gpu: &Gpu,
        commands: &mut Commands,
        (view, camera, gathered): (&ViewBuffers, &Camera, &wgpu::Buffer),
        sums: &Sums,
        (previous, pixels, glossy): (Option<&Camera>, &wgpu::Buffer, &wgpu::Buffer),
        layers: &Layers,
    ) -> Result<()> {
        let [width, height] = view.size;
        let previous_camera = previous.unwrap_or(camera).into();
        let params = FillParams { previous: previous_camera, width, height, has_previous: previous.is_some().into(), padding: 0 };
        let params = gpu.uniform("the parameters of pixels to fill", &params)?;
        gpu.clear(&layers.unserved);
        let buffers = [&params, &view.pixels, &sums.sums, pixels, glossy, gathered, &layers.unserved];
        commands.run("gather", &self.0, &buffers, view.size);
        Ok(())
    }
}
