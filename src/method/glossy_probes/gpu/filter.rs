//! The glossy filter's one-dimensional passes (§6.3): the twin of [`crate::method::glossy_probes::filter`].

use crate::base::math::Rgb;
use crate::gpu::Gpu;
use crate::gpu::commands::Commands;
use crate::gpu::kernel::{FAR, Kernel};
use crate::gpu::spec::Access::{Read, ReadWrite, Uniform};
use crate::gpu::spec::{Access, KernelSpec, StructLayout, layout};
use crate::gpu::view::{GpuPixel, PIXEL, REFLECTED};
use crate::method::glossy_probes::filter::four_pass::{MIN_SIGMA, STEPS, gaussians};
use crate::method::glossy_probes::filter::{Convolution, FilterInput, FilterParams};
use crate::{Error, Result};
use bytemuck::{Pod, Zeroable};
use glam::{Vec4, Vec4Swizzles};
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

const PARAMS: StructLayout = layout!(Params as "Params" {
    width, height, along_major, scale, depth_threshold, min_normal_cos, radius_sigmas, max_radius, steps, min_sigma, min_energy, split,
    share, is_first
});

const fn kernel(file: &'static str, twin: &'static str, bindings: &'static [(&'static str, Access)]) -> KernelSpec {
    KernelSpec { file, twin, workgroup: [16, 4], scene: false, bindings, structs: &[&PARAMS, &PIXEL, &REFLECTED] }
}

/// Weighs the colours by their confidence, and finds each pixel's axes.
pub(crate) const FILTER_START: KernelSpec = kernel(
    "glossy_probes/filter_start.wgsl",
    "src/method/glossy_probes/filter/planes.rs: four_pass",
    &[
        ("filter_params", Uniform),
        ("view", Read),
        ("covariances", Read),
        ("gathered", Read),
        ("axes", ReadWrite),
        ("values", ReadWrite),
    ],
);
/// Makes of each value the mean over its line.
pub(crate) const FILTER_PASS: KernelSpec = kernel(
    "glossy_probes/filter_pass.wgsl",
    "src/method/glossy_probes/filter/four_pass.rs: line_mean",
    &[("filter_params", Uniform), ("view", Read), ("axes", Read), ("source", Read), ("target_values", ReadWrite)],
);
/// Divides the weights out, and adds one Gaussian's share.
pub(crate) const FILTER_END: KernelSpec = kernel(
    "glossy_probes/filter_end.wgsl",
    "src/method/glossy_probes/filter/planes.rs: four_pass",
    &[("filter_params", Uniform), ("view", Read), ("axes", Read), ("gathered", Read), ("values", Read), ("glossy", ReadWrite)],
);

/// What the filter reads, and writes.
pub(crate) struct Planes<'a> {
    pub(crate) size: [u32; 2],
    /// The view.
    pub(crate) pixels: &'a wgpu::Buffer,
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
    /// Bytes a pixel.
    pub(crate) const BYTES: u64 = 3 * size_of::<Vec4>() as u64;

    pub(crate) fn new(gpu: &Gpu, pixels: u64) -> Result<Self> {
        let plane = |label| gpu.output(label, size_of::<Vec4>() as u64 * pixels);
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
    /// Compiles it. Errors for [`Convolution::Full`], which the GPU lacks.
    pub fn new(gpu: Arc<Gpu>, params: &FilterParams) -> Result<Self> {
        if params.method == Convolution::Full {
            return Err(Error::Request("filter.method full: the GPU has the passes alone; use --device cpu".into()));
        }
        let kernel = |spec| Kernel::new(&gpu, spec);
        let (start, pass, end) = (kernel(&FILTER_START)?, kernel(&FILTER_PASS)?, kernel(&FILTER_END)?);
        Ok(Self { gpu, params: *params, start, pass, end })
    }

    /// The filtered frame, as [`crate::method::glossy_probes::filter::filter`] has it.
    pub fn filter(&self, input: &FilterInput) -> Result<Vec<Rgb>> {
        if input.color.is_empty() {
            return Ok(Vec::new());
        }
        let gpu = &self.gpu;
        let colors: Vec<Vec4> = input.color.iter().zip(input.energy).map(|(c, energy)| c.extend(energy.min(FAR))).collect();
        let covariances: Vec<[f32; 4]> = input.covariance.iter().map(|&[xx, xy, yy]| [xx, xy, yy, 0.0]).collect();
        let pixel = |i: usize| GpuPixel {
            n: input.normal[i].to_array(),
            depth: input.depth[i],
            material: input.material[i],
            ..GpuPixel::default()
        };
        let view: Vec<GpuPixel> = (0..input.color.len()).map(pixel).collect();
        let pixels = input.color.len() as u64;
        let planes = Planes {
            size: [input.width as u32, input.height as u32],
            pixels: &gpu.upload("the view", bytemuck::cast_slice(&view))?,
            gathered: &gpu.upload("colours", bytemuck::cast_slice(&colors))?,
            covariances: &gpu.upload("covariances", bytemuck::cast_slice(&covariances))?,
            scratch: &Scratch::new(gpu, pixels)?,
            glossy: &gpu.output("the filtered pixels", size_of::<Vec4>() as u64 * pixels)?,
        };
        gpu.checked(|| self.run(&mut Commands::new(gpu), &planes))??;
        Ok(gpu.read::<Vec4>(planes.glossy)?.iter().map(|c| c.xyz()).collect())
    }

    /// Filters a frame.
    pub(crate) fn run(&self, commands: &mut Commands, planes: &Planes) -> Result<()> {
        let Planes { size, pixels, gathered, covariances, scratch, glossy } = planes;
        let passes = if self.params.method == Convolution::TwoPass { 2 } else { 4 };
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
                self.gpu.uniform("the filter's parameters", &params)
            };
            let (major, minor) = (params(0)?, params(1)?);
            let [mut from, mut to] = [&scratch.values[0], &scratch.values[1]];
            commands.run("filter", &self.start, &[&major, pixels, covariances, gathered, &scratch.axes, from], *size);
            for pass in 0..passes {
                let params = if pass % 2 == 0 { &major } else { &minor };
                commands.run("filter", &self.pass, &[params, pixels, &scratch.axes, from, to], *size);
                std::mem::swap(&mut from, &mut to);
            }
            commands.run("filter", &self.end, &[&major, pixels, &scratch.axes, gathered, from, glossy], *size);
        }
        Ok(())
    }
}
