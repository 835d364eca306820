//! A view on the device, a pixel an entry in each of its planes: the twin of [`GBuffer`] and of the mirror pass's [`Reflected`].

use super::super::Gpu;
use crate::Result;
use crate::math::{Frame, Rgb};
use crate::render::filter::NOT_GLOSSY;
use crate::render::gather::view_albedo;
use crate::render::gbuffer::{GBuffer, Pixel};
use crate::render::mirror::Reflected;
use crate::transport::World;
use bytemuck::{Pod, Zeroable};
use glam::{Vec3, Vec4};
use rayon::prelude::*;

/// In a plane of hits: the environment is seen.
const NO_TRIANGLE: u32 = u32::MAX;

/// A reflected hit as shaders have it.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
pub(super) struct GpuReflected {
    pub(super) point: [f32; 3],
    pub(super) material: u32,
}

/// What the frame after this one looks at, too.
pub(super) struct Guides {
    /// Shading normal on the camera's side, and distance to the camera.
    pub(super) normals: wgpu::Buffer,
    /// Materials, [`NOT_GLOSSY`] where no probe is asked.
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
    /// Distance (as bits), triangle and barycentrics (as bits) of the surface seen.
    pub(super) hits: wgpu::Buffer,
    /// The surface seen, and alpha.
    pub(super) positions: wgpu::Buffer,
    /// Principal curvatures, and the first one's direction in the tangents of [`Frame::from_normal`].
    pub(super) curvatures: wgpu::Buffer,
    /// Mirror hits.
    pub(super) reflected: wgpu::Buffer,
    /// Radiance emitted towards the camera; the environment's where nothing is seen.
    pub(super) emission: wgpu::Buffer,
    /// The view's factor of the diffuse lobe; then 1 where the camera sees the shading normal's back.
    pub(super) diffuse: wgpu::Buffer,
    /// Directional albedo of the glossy lobe at the probes' roughness.
    pub(super) albedos: wgpu::Buffer,
}

impl View {
    /// Bytes a pixel, with the [`Guides`].
    pub(super) const BYTES: u64 = 8 * 16 + 4;

    pub(super) fn new(gpu: &Gpu, size: [u32; 2]) -> Result<Self> {
        let pixels = u64::from(size[0]) * u64::from(size[1]);
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

    /// Fills the planes from the CPU's passes; glossy albedos where the probes' `roughness_scale` is given.
    pub(super) fn upload(&self, gpu: &Gpu, world: &World, view: &GBuffer, reflected: &[Reflected], roughness_scale: Option<f32>) {
        plane(gpu, &self.hits, view, [0, NO_TRIANGLE, 0, 0], |p| {
            let s = &p.surface;
            [s.t.to_bits(), s.triangle, s.barycentric.x.to_bits(), s.barycentric.y.to_bits()]
        });
        plane(gpu, &self.guides.normals, view, Vec4::ZERO, |p| p.normal.extend(p.depth));
        let material = |p: &Pixel| if p.alpha.is_some() { p.surface.material } else { NOT_GLOSSY };
        plane(gpu, &self.guides.materials, view, NOT_GLOSSY, material);
        plane(gpu, &self.positions, view, Vec4::ZERO, |p| p.surface.p.extend(p.alpha.unwrap_or(-1.0)));
        plane(gpu, &self.curvatures, view, Vec4::ZERO, |p| {
            let (frame, c) = (Frame::from_normal(p.normal), &p.curvature);
            Vec4::new(c.k1, c.k2, c.d1.dot(frame.s), c.d1.dot(frame.t))
        });
        plane(gpu, &self.diffuse, view, Vec4::ZERO, |p| {
            let wi = p.surface.frame.to_local(p.wo);
            let out = world.scene.materials[p.surface.material as usize].bsdf.diffuse_out(&p.surface, wi);
            out.extend(if wi.z < 0.0 { 1.0 } else { 0.0 })
        });
        plane(gpu, &self.albedos, view, Vec4::ZERO, |p| {
            let glossy = roughness_scale.filter(|_| p.alpha.is_some());
            glossy.map_or(Rgb::ZERO, |scale| view_albedo(world, p, scale)).extend(0.0)
        });
        let emission = view.pixels.par_iter().zip(&view.background);
        let emission: Vec<Vec4> = emission.map(|(p, &sky)| p.as_ref().map_or(sky, |p| p.emission).extend(0.0)).collect();
        gpu.queue.write_buffer(&self.emission, 0, bytemuck::cast_slice(&emission));
        let reflected = reflected.par_iter();
        let reflected: Vec<_> = reflected.map(|r| GpuReflected { point: r.point.into(), material: r.material.into() }).collect();
        gpu.queue.write_buffer(&self.reflected, 0, bytemuck::cast_slice(&reflected));
    }

    /// The mirror hits.
    pub(super) fn read_reflected(&self, gpu: &Gpu) -> Result<Vec<Reflected>> {
        let read: Vec<GpuReflected> = gpu.read(&self.reflected)?;
        Ok(read.iter().map(|r| Reflected { point: Vec3::from(r.point), material: r.material as u16 }).collect())
    }
}

/// Writes a plane; `nothing` where the environment is seen.
fn plane<T: Pod + Send + Sync>(gpu: &Gpu, plane: &wgpu::Buffer, view: &GBuffer, nothing: T, of: impl Fn(&Pixel) -> T + Sync) {
    let values: Vec<T> = view.pixels.par_iter().map(|p| p.as_ref().map_or(nothing, &of)).collect();
    gpu.queue.write_buffer(plane, 0, bytemuck::cast_slice(&values));
}
