//! A view on the device, a record a pixel: the twin of [`crate::view::gbuffer::GBuffer`] and of [`Reflected`].

pub(crate) mod composite;
pub(crate) mod direct;
pub mod frame;
pub(crate) mod gbuffer;
pub(crate) mod mirror;
pub(crate) mod mirror_light;
pub(crate) mod pixel_run;

use super::Gpu;
use super::kernel::area;
use super::spec::{StructLayout, layout};
use crate::Result;
use crate::view::mirror::Reflected;
use bytemuck::{Pod, Zeroable};
use glam::Vec3;

/// `Reflected` of view.wgsl.
#[repr(C)]
#[derive(Clone, Copy, Default, Pod, Zeroable)]
pub(crate) struct GpuReflected {
    point: [f32; 3],
    material: u32,
}

/// `Pixel` of view.wgsl: what passes look for most often.
#[repr(C)]
#[derive(Clone, Copy, Default, Pod, Zeroable)]
pub(crate) struct GpuPixel {
    pub(crate) p: [f32; 3],
    pub(crate) alpha: f32,
    pub(crate) n: [f32; 3],
    pub(crate) depth: f32,
    pub(crate) reflected: GpuReflected,
    /// [`crate::method::glossy_probes::filter::NOT_GLOSSY`] where no probe is asked.
    pub(crate) material: u32,
    pub(crate) triangle: u32,
    pub(crate) u: f32,
    pub(crate) v: f32,
}

/// `Shading` of view.wgsl: what they take from there in the end.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
pub(crate) struct GpuShading {
    pub(crate) curvature: [f32; 4],
    emission: [f32; 3],
    padding0: u32,
    diffuse: [f32; 3],
    padding1: u32,
    albedo: [f32; 3],
    padding2: u32,
}

pub(crate) const REFLECTED: StructLayout = layout!(GpuReflected as "Reflected" { point, material });
pub(crate) const PIXEL: StructLayout = layout!(GpuPixel as "Pixel" { p, alpha, n, depth, reflected, material, triangle, u, v });
pub(crate) const SHADING: StructLayout = layout!(GpuShading as "Shading" { curvature, emission, diffuse, albedo });

/// The pixels that a frame looks at, and those of the frame before.
pub(crate) fn pixels(gpu: &Gpu, size: [u32; 2]) -> Result<wgpu::Buffer> {
    gpu.output("the view", size_of::<GpuPixel>() as u64 * area(size))
}

/// The records.
pub(crate) struct ViewBuffers {
    /// Width and height, pixels.
    pub(crate) size: [u32; 2],
    pub(crate) pixels: wgpu::Buffer,
    pub(crate) shading: wgpu::Buffer,
}

impl ViewBuffers {
    /// Bytes a pixel.
    pub(crate) const BYTES: u64 = (size_of::<GpuPixel>() + size_of::<GpuShading>()) as u64;

    pub(crate) fn new(gpu: &Gpu, size: [u32; 2]) -> Result<Self> {
        let shading = gpu.output("the view's shading", size_of::<GpuShading>() as u64 * area(size))?;
        Ok(Self { size, pixels: pixels(gpu, size)?, shading })
    }

    /// The mirror hits.
    pub(crate) fn read_reflected(&self, gpu: &Gpu) -> Result<Vec<Reflected>> {
        let reflected = |p: &GpuPixel| Reflected { point: Vec3::from(p.reflected.point), material: p.reflected.material as u16 };
        Ok(gpu.read::<GpuPixel>(&self.pixels)?.iter().map(reflected).collect())
    }

    /// Both principal curvatures.
    pub(crate) fn read_curvatures(&self, gpu: &Gpu) -> Result<Vec<[f32; 2]>> {
        Ok(gpu.read::<GpuShading>(&self.shading)?.iter().map(|s| [s.curvature[0], s.curvature[1]]).collect())
    }
}
