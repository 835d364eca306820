//! A view on the device, a pixel an entry in each of its planes: the twin of [`crate::view::gbuffer::GBuffer`] and of [`Reflected`].

use super::Gpu;
use super::kernel::area;
use crate::Result;
use crate::view::mirror::Reflected;
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
pub(crate) struct Guides {
    /// Shading normal on the camera's side, and distance to the camera.
    pub(crate) normals: wgpu::Buffer,
    /// Materials; [`crate::method::glossy_probes::filter::NOT_GLOSSY`] where no probe is asked.
    pub(crate) materials: wgpu::Buffer,
}

impl Guides {
    pub(crate) fn new(gpu: &Gpu, pixels: u64) -> Result<Self> {
        Ok(Self { normals: gpu.output("normals", 16 * pixels)?, materials: gpu.output("materials", 4 * pixels)? })
    }
}

/// The planes.
pub(crate) struct View {
    /// Width and height, pixels.
    pub(crate) size: [u32; 2],
    /// What the later passes look at most.
    pub(crate) guides: Guides,
    /// What the camera's rays meet.
    pub(crate) hits: wgpu::Buffer,
    /// The surface seen, and alpha.
    pub(crate) positions: wgpu::Buffer,
    /// Principal curvatures, and the first one's direction in the tangents of [`crate::base::math::Frame::from_normal`].
    pub(crate) curvatures: wgpu::Buffer,
    /// Mirror hits.
    pub(crate) reflected: wgpu::Buffer,
    /// Radiance emitted towards the camera; the environment's where nothing is seen.
    pub(crate) emission: wgpu::Buffer,
    /// Radiance of the diffuse lobe, by the light map.
    pub(crate) diffuse: wgpu::Buffer,
    /// Directional albedo of the glossy lobe at the probes' roughness.
    pub(crate) albedos: wgpu::Buffer,
}

impl View {
    /// Bytes a pixel, with the [`Guides`].
    pub(crate) const BYTES: u64 = 8 * 16 + 4;

    pub(crate) fn new(gpu: &Gpu, size: [u32; 2]) -> Result<Self> {
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
    pub(crate) fn read_reflected(&self, gpu: &Gpu) -> Result<Vec<Reflected>> {
        let read: Vec<GpuReflected> = gpu.read(&self.reflected)?;
        Ok(read.iter().map(|r| Reflected { point: Vec3::from(r.point), material: r.material as u16 }).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gpu::kernel::shader;
    use crate::gpu::layout::check;

    #[test]
    fn structs_are_laid_out_as_in_the_shader() {
        check!(shader!("math", "view"), GpuReflected as "Reflected" { point, material });
    }
}
