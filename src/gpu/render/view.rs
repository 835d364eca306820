//! A view on the device, a pixel an entry in each of its planes: the twin of [`crate::render::gbuffer::GBuffer`] and of [`Reflected`].

use super::super::Gpu;
use super::area;
use crate::Result;
use crate::render::mirror::Reflected;
use bytemuck::{Pod, Zeroable};
use glam::Vec3;

/// A reflected hit as shaders have it.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct GpuReflected {
    point: [f32; 3],
    material: u32,
}

/// What the frame after this one looks at, too.
pub(super) struct Guides {
    /// Shading normal on the camera's side, and distance to the camera.
    pub(super) normals: wgpu::Buffer,
    /// Materials; [`crate::render::filter::NOT_GLOSSY`] where no probe is asked.
    pub(super) materials: wgpu::Buffer,
}

impl Guides {
    pub(super) fn new(gpu: &Gpu, pixels: u64) -> Result<Self> {
        Ok(Self { normals: gpu.output("normals", 16 * pixels)?, materials: gpu.output("materials", 4 * pixels)? })
    }
}

/// The planes.
pub(super) struct View {
    /// Width and height, pixels.
    pub(super) size: [u32; 2],
    /// What the later passes look at most.
    pub(super) guides: Guides,
    /// What the camera's rays meet.
    pub(super) hits: wgpu::Buffer,
    /// The surface seen, and alpha.
    pub(super) positions: wgpu::Buffer,
    /// Principal curvatures, and the first one's direction in the tangents of [`crate::math::Frame::from_normal`].
    pub(super) curvatures: wgpu::Buffer,
    /// Mirror hits.
    pub(super) reflected: wgpu::Buffer,
    /// Radiance emitted towards the camera; the environment's where nothing is seen.
    pub(super) emission: wgpu::Buffer,
    /// Radiance of the diffuse lobe, by the light map.
    pub(super) diffuse: wgpu::Buffer,
    /// Directional albedo of the glossy lobe at the probes' roughness.
    pub(super) albedos: wgpu::Buffer,
}

impl View {
    /// Bytes a pixel, with the [`Guides`].
    pub(super) const BYTES: u64 = 8 * 16 + 4;

    pub(super) fn new(gpu: &Gpu, size: [u32; 2]) -> Result<Self> {
        let pixels = area(size);
        let plane = |label| gpu.output(label, 16 * pixels);
        Ok(Self {
            size,
            guides: Guides::new(gpu, pixels)?,
            hits: plane("hits")?,
            positions: plane("positions")?,
            curvatures: plane("curvatures")?,
            reflected: plane("reflected hits")?,
            emission: plane("emission")?,
            diffuse: plane("diffuse factors")?,
            albedos: plane("glossy albedos")?,
        })
    }

    /// The mirror hits.
    pub(super) fn read_reflected(&self, gpu: &Gpu) -> Result<Vec<Reflected>> {
        let read: Vec<GpuReflected> = gpu.read(&self.reflected)?;
        Ok(read.iter().map(|r| Reflected { point: Vec3::from(r.point), material: r.material as u16 }).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::super::super::kernel::shader;
    use super::super::super::layout::check;
    use super::*;

    #[test]
    fn structs_are_laid_out_as_in_the_shader() {
        check!(shader!("math", "view"), GpuReflected as "Reflected" { point, material });
    }
}
