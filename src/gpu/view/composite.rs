//! The last passes: the twin of [`crate::view::composite`].

use super::{SHADING, ViewBuffers};
use crate::Result;
use crate::base::math::Rgb;
use crate::gpu::Gpu;
use crate::gpu::commands::Commands;
use crate::gpu::kernel::Kernel;
use crate::gpu::spec::Access::{Read, ReadWrite, Uniform};
use crate::gpu::spec::{KernelSpec, StructLayout, layout};
use bytemuck::{Pod, Zeroable};
use glam::Vec3;

/// `Params` of layers.wgsl.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct LayerParams {
    width: u32,
    height: u32,
    supersample: u32,
    mirrors: u32,
}

/// `LayerPixel` of layer_pixel.wgsl.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct LayerPixel {
    emission: [f32; 4],
    diffuse: [f32; 4],
    glossy: [f32; 4],
}

/// What averages sub-pixels.
pub(crate) const LAYERS: KernelSpec = KernelSpec {
    file: "shared/layers.wgsl",
    twin: "src/view/composite.rs: downsample",
    workgroup: [16, 4],
    scene: false,
    bindings: &[("layer_params", Uniform), ("shading", Read), ("glossy", Read), ("mirrored_light", Read), ("frame", ReadWrite)],
    structs: &[&LAYER_PARAMS, &SHADING, &LAYER_PIXEL],
};
const LAYER_PARAMS: StructLayout = layout!(LayerParams as "Params" { width, height, supersample, mirrors });
pub(crate) const LAYER_PIXEL: StructLayout = layout!(LayerPixel as "LayerPixel" { emission, diffuse, glossy });

/// A frame's layers on the device.
pub(crate) struct Layers {
    pub(crate) frame: wgpu::Buffer,
    /// How many sub-pixels nothing served.
    pub(crate) unserved: wgpu::Buffer,
}

impl Layers {
    /// Bytes a pixel.
    pub(crate) const BYTES: u64 = size_of::<LayerPixel>() as u64;

    pub(crate) fn new(gpu: &Gpu, pixels: u64) -> Result<Self> {
        let frame = gpu.output("the frame's layers", Self::BYTES * pixels)?;
        Ok(Self { frame, unserved: gpu.output("unserved pixels", size_of::<u32>() as u64)? })
    }

    /// Emission, diffuse and glossy; and how many sub-pixels nothing served.
    pub(crate) fn read(&self, gpu: &Gpu) -> Result<([Vec<Rgb>; 3], usize)> {
        let frame: Vec<LayerPixel> = gpu.read(&self.frame)?;
        let layer = |of: fn(&LayerPixel) -> [f32; 4]| frame.iter().map(|p| Vec3::from_slice(&of(p))).collect();
        Ok(([layer(|p| p.emission), layer(|p| p.diffuse), layer(|p| p.glossy)], gpu.read::<u32>(&self.unserved)?[0] as usize))
    }
}

/// The kernel.
pub(crate) struct Composite {
    layers: Kernel,
    supersample: u32,
}

impl Composite {
    pub(crate) fn new(gpu: &Gpu, supersample: u32) -> Result<Self> {
        Ok(Self { layers: Kernel::new(gpu, &LAYERS)?, supersample })
    }

    /// Averages sub-pixels into the frame's layers. `mirrored` is what perfect mirrors show ([`crate::gpu::view::mirror_light`]), where `glossy` lacks
    /// it.
    pub(crate) fn layers(
        &self,
        gpu: &Gpu,
        commands: &mut Commands,
        view: &ViewBuffers,
        (glossy, mirrored): (&wgpu::Buffer, Option<&wgpu::Buffer>),
        layers: &Layers,
    ) -> Result<()> {
        let ([width, height], supersample) = (view.size, self.supersample);
        let params = LayerParams { width, height, supersample, mirrors: mirrored.is_some().into() };
        let params = gpu.uniform("the composite's parameters", &params)?;
        let buffers = [&params, &view.shading, glossy, mirrored.unwrap_or(glossy), &layers.frame];
        commands.run("composite", &self.layers, &buffers, view.size.map(|n| n / supersample));
        Ok(())
    }
}
