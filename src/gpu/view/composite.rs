//! The last passes: the twin of [`crate::view::composite`].

use super::{Guides, View, WORKGROUP};
use crate::base::math::Rgb;
use crate::gpu::Gpu;
use crate::gpu::camera::GpuCamera;
use crate::gpu::commands::Commands;
use crate::gpu::kernel::{Kernel, groups, shader};
use crate::method::glossy_probes::gpu::gather::Sums;
use crate::{Result, scene};
use bytemuck::{Pod, Zeroable};
use glam::{Vec4, Vec4Swizzles};

/// What the shader's `Params` holds.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct Params {
    previous: GpuCamera,
    width: u32,
    height: u32,
    has_previous: u32,
    supersample: u32,
    mirrors: u32,
    padding: [u32; 3],
}

/// A frame's layers on the device.
pub(crate) struct Layers {
    /// Emission, diffuse and glossy.
    pub(crate) planes: [wgpu::Buffer; 3],
    /// How many sub-pixels nothing served.
    pub(crate) unserved: wgpu::Buffer,
}

impl Layers {
    /// Bytes a pixel.
    pub(crate) const BYTES: u64 = 3 * 16;

    pub(crate) fn new(gpu: &Gpu, pixels: u64) -> Result<Self> {
        let plane = |label| gpu.output(label, 16 * pixels);
        Ok(Self {
            planes: [plane("the emission layer")?, plane("the diffuse layer")?, plane("the glossy layer")?],
            unserved: gpu.output("unserved pixels", 4)?,
        })
    }

    /// Emission, diffuse and glossy; and how many sub-pixels nothing served.
    pub(crate) fn read(&self, gpu: &Gpu) -> Result<([Vec<Rgb>; 3], usize)> {
        let [a, b, c] = &self.planes;
        let read = |plane| Ok::<_, crate::Error>(gpu.read::<Vec4>(plane)?.iter().map(|c| c.xyz()).collect());
        Ok(([read(a)?, read(b)?, read(c)?], gpu.read::<u32>(&self.unserved)?[0] as usize))
    }
}

/// The kernels.
pub(crate) struct Composite {
    fill: Kernel,
    layers: Kernel,
    supersample: u32,
}

impl Composite {
    pub(crate) fn new(gpu: &Gpu, supersample: u32) -> Result<Self> {
        let source = shader!("math", "camera", "perturb", "view", "composite");
        Ok(Self { fill: Kernel::new(gpu, source, "fill")?, layers: Kernel::new(gpu, source, "layers")?, supersample })
    }

    fn params(
        &self,
        gpu: &Gpu,
        size: [u32; 2],
        camera: &scene::Camera,
        [has_previous, mirrors]: [bool; 2],
    ) -> Result<wgpu::Buffer> {
        let params = Params {
            previous: camera.into(),
            width: size[0],
            height: size[1],
            has_previous: has_previous.into(),
            supersample: self.supersample,
            mirrors: mirrors.into(),
            padding: [0; 3],
        };
        gpu.upload("the composite's parameters", bytemuck::bytes_of(&params))
    }

    /// Divides the gathered sums by their weights, and fills pixels that no probe served from the last frame's `glossy` layer.
    /// `previous` is that frame's view, where there is one.
    pub(crate) fn fill(
        &self,
        gpu: &Gpu,
        commands: &mut Commands,
        (view, camera, gathered): (&View, &scene::Camera, &wgpu::Buffer),
        sums: &Sums,
        (previous, guides, glossy): (Option<&scene::Camera>, &Guides, &wgpu::Buffer),
        layers: &Layers,
    ) -> Result<()> {
        let params = self.params(gpu, view.size, previous.unwrap_or(camera), [previous.is_some(), false])?;
        gpu.clear(&layers.unserved);
        let buffers = [
            &params,
            &view.positions,
            &view.guides.materials,
            &sums.sums,
            &sums.best,
            &guides.normals,
            &guides.materials,
            glossy,
            gathered,
            &layers.unserved,
        ];
        commands.run("gather", &self.fill, &buffers, groups(view.size, WORKGROUP));
        Ok(())
    }

    /// Averages sub-pixels into the frame's layers. `mirrored` is what perfect mirrors show ([`crate::gpu::view::mirror_light`]), where `glossy` lacks
    /// it.
    pub(crate) fn layers(
        &self,
        gpu: &Gpu,
        commands: &mut Commands,
        (view, camera): (&View, &scene::Camera),
        (glossy, mirrored): (&wgpu::Buffer, Option<&wgpu::Buffer>),
        layers: &Layers,
    ) -> Result<()> {
        let params = self.params(gpu, view.size, camera, [false, mirrored.is_some()])?;
        let [emission, diffuse, out] = &layers.planes;
        let (mirrored, albedos) = (mirrored.unwrap_or(glossy), &view.albedos);
        let buffers = [&params, &view.emission, &view.diffuse, glossy, mirrored, albedos, emission, diffuse, out];
        commands.run("composite", &self.layers, &buffers, groups(view.size.map(|n| n / self.supersample), WORKGROUP));
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gpu::layout::check;

    #[test]
    fn structs_are_laid_out_as_in_the_shader() {
        let source = shader!("math", "camera", "perturb", "view", "composite");
        check!(source, Params as "Params" { previous, width, height, has_previous, supersample, mirrors });
    }
}
