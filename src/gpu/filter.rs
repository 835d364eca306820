//! The glossy filter's one-dimensional passes (§6.3): the twin of [`crate::render::filter::four_pass`].

use super::Gpu;
use super::kernel::Kernel;
use crate::math::Rgb;
use crate::render::filter::four_pass::{self, Axes, MIN_SIGMA, STEPS, Tap};
use crate::render::filter::{FilterInput, FilterParams, Method};
use crate::{Error, Result};
use bytemuck::{Pod, Zeroable};
use glam::Vec4;
use std::sync::Arc;

/// Edges of a workgroup, pixels.
const WORKGROUP: [u32; 2] = [16, 4];

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
}

/// The filter on a device.
pub struct Filter {
    gpu: Arc<Gpu>,
    kernel: Kernel,
}

impl Filter {
    /// Compiles it, for frames of at most so many pixels. `params` are those that frames will be filtered with.
    pub fn new(gpu: Arc<Gpu>, params: &FilterParams, pixels: usize) -> Result<Self> {
        if params.method == Method::Full {
            return Err(Error::Request("filter.method full: the GPU has the passes alone; use --device cpu".into()));
        }
        gpu.fits("the filter's pixels", (pixels * size_of::<Vec4>()) as u64)?;
        let kernel = Kernel::new(&gpu, include_str!("../../shaders/filter.wgsl"), "filter_pass")?;
        Ok(Self { gpu, kernel })
    }

    /// The device's name.
    pub fn device(&self) -> &str {
        &self.gpu.adapter.name
    }

    /// The filtered frame, as [`crate::render::filter::filter`] has it.
    pub fn filter(&self, input: &FilterInput, params: &FilterParams) -> Result<Vec<Rgb>> {
        four_pass::filter_by(input, params, &|axes, taps, passes| self.passes(input, params, axes, taps, passes))
    }

    fn passes(
        &self,
        input: &FilterInput,
        params: &FilterParams,
        axes: &[Axes],
        taps: &[Tap],
        passes: &[(bool, f32)],
    ) -> Result<Vec<Vec4>> {
        let gpu = &self.gpu;
        if taps.is_empty() {
            return Ok(Vec::new());
        }
        let values: Vec<Vec4> = taps.iter().map(|t| t.value).collect();
        let lines: Vec<[f32; 4]> = axes.iter().map(|a| [a.major.x, a.major.y, a.sigma.x, a.sigma.y]).collect();
        let guides: Vec<[f32; 4]> = taps.iter().map(|t| t.normal.extend(t.depth).to_array()).collect();
        let lines = gpu.upload("the filter's axes", bytemuck::cast_slice(&lines))?;
        let guides = gpu.upload("the filter's guides", bytemuck::cast_slice(&guides))?;
        let materials = gpu.upload("the pixels' materials", bytemuck::cast_slice(input.material))?;
        let mut from = gpu.upload("the pixels", bytemuck::cast_slice(&values))?;
        let size = from.size();
        let [width, height] = [input.width, input.height].map(|n| n as u32);
        for &(along_major, scale) in passes {
            let uniform = Params {
                width,
                height,
                along_major: u32::from(along_major),
                scale,
                depth_threshold: params.depth_threshold,
                min_normal_cos: params.min_normal_cos,
                radius_sigmas: params.radius_sigmas,
                max_radius: params.max_radius,
                steps: STEPS,
                min_sigma: MIN_SIGMA,
            };
            let uniform = gpu.upload("the filter's parameters", bytemuck::bytes_of(&uniform))?;
            let to = gpu.output("the filtered pixels", size)?;
            let groups = [width.div_ceil(WORKGROUP[0]), height.div_ceil(WORKGROUP[1])];
            gpu.dispatch(&self.kernel, &[&uniform, &lines, &guides, &materials, &from, &to], groups)?;
            from = to;
        }
        gpu.read(&from)
    }
}
