//! The glossy filter's one-dimensional passes (§6.3): the twin of [`crate::method::glossy_probes::filter`].

use crate::base::math::Rgb;
use crate::gpu::Gpu;
use crate::gpu::commands::Commands;
use crate::gpu::kernel::{Kernel, groups, shader};
use crate::gpu::view::{FAR, Guides, WORKGROUP};
use crate::method::glossy_probes::filter::four_pass::{MIN_SIGMA, STEPS, gaussians};
use crate::method::glossy_probes::filter::{FilterInput, FilterParams, Method};
use crate::{Error, Result};
use bytemuck::{Pod, Zeroable};
use glam::{Vec3, Vec4, Vec4Swizzles};
use std::sync::Arc;

/// What the shader's `Params` holds.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct Params {
    width: u32,
    height: u32,
    along_major: u32,
    scale: f32,
    depth_threshold: f32,
    min_normal_cos: f32,
    radius_sigmas: f32,
    max_radius: f32,
    steps: f32,
    min_sigma: f32,
    min_energy: f32,
    split: f32,
    share: f32,
    is_first: u32,
}

/// What the filter reads, and writes.
pub(crate) struct Planes<'a> {
    pub(crate) size: [u32; 2],
    pub(crate) guides: &'a Guides,
    /// Colour and energy.
    pub(crate) gathered: &'a wgpu::Buffer,
    pub(crate) covariances: &'a wgpu::Buffer,
    pub(crate) scratch: &'a Scratch,
    /// The filtered colours.
    pub(crate) glossy: &'a wgpu::Buffer,
}

/// What the passes hand on.
pub(crate) struct Scratch {
    axes: wgpu::Buffer,
    values: [wgpu::Buffer; 2],
}

impl Scratch {
    pub(crate) fn new(gpu: &Gpu, pixels: u64) -> Result<Self> {
        let plane = |label| gpu.output(label, 16 * pixels);
        Ok(Self { axes: plane("the filter's axes")?, values: [plane("the filter's values")?, plane("the filter's values")?] })
    }
}

/// The filter on a device.
pub struct Filter {
    gpu: Arc<Gpu>,
    params: FilterParams,
    start: Kernel,
    pass: Kernel,
    end: Kernel,
}

impl Filter {
    /// Compiles it. Errors for [`Method::Full`], which the GPU lacks.
    pub fn new(gpu: Arc<Gpu>, params: &FilterParams) -> Result<Self> {
        if params.method == Method::Full {
            return Err(Error::Request("filter.method full: the GPU has the passes alone; use --device cpu".into()));
        }
        let kernel = |entry| Kernel::new(&gpu, shader!("math", "perturb", "view", "filter"), entry);
        let (start, pass, end) = (kernel("filter_start")?, kernel("filter_pass")?, kernel("filter_end")?);
        Ok(Self { gpu, params: *params, start, pass, end })
    }

    /// The filtered frame, as [`crate::method::glossy_probes::filter::filter`] has it.
    pub fn filter(&self, input: &FilterInput) -> Result<Vec<Rgb>> {
        if input.color.is_empty() {
            return Ok(Vec::new());
        }
        let gpu = &self.gpu;
        let with = |v: &[Vec3], w: &[f32]| v.iter().zip(w).map(|(v, w)| v.extend(w.min(FAR))).collect::<Vec<Vec4>>();
        let covariances: Vec<[f32; 4]> = input.covariance.iter().map(|&[xx, xy, yy]| [xx, xy, yy, 0.0]).collect();
        let guides = Guides {
            normals: gpu.upload("normals", bytemuck::cast_slice(&with(input.normal, input.depth)))?,
            materials: gpu.upload("materials", bytemuck::cast_slice(input.material))?,
        };
        let pixels = input.color.len() as u64;
        let planes = Planes {
            size: [input.width as u32, input.height as u32],
            guides: &guides,
            gathered: &gpu.upload("colours", bytemuck::cast_slice(&with(input.color, input.energy)))?,
            covariances: &gpu.upload("covariances", bytemuck::cast_slice(&covariances))?,
            scratch: &Scratch::new(gpu, pixels)?,
            glossy: &gpu.output("the filtered pixels", 16 * pixels)?,
        };
        gpu.checked(|| self.run(&mut Commands::new(gpu), &planes))??;
        Ok(gpu.read::<Vec4>(planes.glossy)?.iter().map(|c| c.xyz()).collect())
    }

    /// Filters a frame.
    pub(crate) fn run(&self, commands: &mut Commands, planes: &Planes) -> Result<()> {
        let Planes { size, guides, gathered, covariances, scratch, glossy } = planes;
        let groups = groups(*size, WORKGROUP);
        let passes = if self.params.method == Method::TwoPass { 2 } else { 4 };
        for (number, &(share, variance)) in gaussians(self.params.kernel).iter().enumerate() {
            let params = |pass: usize| {
                let params = Params {
                    width: size[0],
                    height: size[1],
                    along_major: u32::from(pass.is_multiple_of(2)),
                    scale: variance.sqrt(),
                    depth_threshold: self.params.depth_threshold,
                    min_normal_cos: self.params.min_normal_cos,
                    radius_sigmas: self.params.radius_sigmas,
                    max_radius: self.params.max_radius,
                    steps: STEPS,
                    min_sigma: MIN_SIGMA,
                    min_energy: self.params.min_energy.min(FAR),
                    split: 2.0 / passes as f32,
                    share,
                    is_first: u32::from(number == 0),
                };
                self.gpu.upload("the filter's parameters", bytemuck::bytes_of(&params))
            };
            let Guides { normals, materials } = guides;
            let (major, minor) = (params(0)?, params(1)?);
            let [mut from, mut to] = [&scratch.values[0], &scratch.values[1]];
            commands.run("filter", &self.start, &[&major, materials, covariances, gathered, &scratch.axes, from], groups);
            for pass in 0..passes {
                let params = if pass % 2 == 0 { &major } else { &minor };
                commands.run("filter", &self.pass, &[params, &scratch.axes, normals, materials, from, to], groups);
                std::mem::swap(&mut from, &mut to);
            }
            commands.run("filter", &self.end, &[&major, &scratch.axes, materials, gathered, from, glossy], groups);
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
        let source = shader!("math", "perturb", "view", "filter");
        check!(source, Params as "Params" {
            width, height, along_major, scale, depth_threshold, min_normal_cos, radius_sigmas, max_radius, steps, min_sigma,
            min_energy, split, share, is_first
        });
    }
}
