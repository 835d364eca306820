//! The denoiser of path-traced frames: the twin of [`crate::view::denoise`].

use crate::Result;
use crate::base::math::Rgb;
use crate::gpu::Gpu;
use crate::gpu::camera::{CAMERA, GpuCamera};
use crate::gpu::kernel::{Kernel, area};
use crate::gpu::scene::GpuScene;
use crate::gpu::spec::Access::{Read, ReadWrite, Uniform};
use crate::gpu::spec::{Access, KernelSpec, StructLayout, layout};
use crate::scene::Camera;
use crate::view::denoise::{DenoiseParams, GUIDE_SAMPLES, Guide, MOST_LEVELS, NEIGHBOURS};
use crate::view::layers::LayerImages;
use bytemuck::{Pod, Zeroable};
use glam::{Vec2, Vec3, Vec4, Vec4Swizzles};
use std::sync::Arc;

/// `GuideParams` of guides.wgsl.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct GuideParams {
    camera: GpuCamera,
    seed: u32,
    frame: u32,
    index: u32,
    count: u32,
    mirror_alpha: f32,
    padding: [u32; 3],
}

/// `Params` of denoise.wgsl.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct Params {
    width: u32,
    height: u32,
    step: i32,
    despeckle: u32,
    luminance_sigma: f32,
    normal_power: f32,
    depth_sigma: f32,
    albedo_sigma: f32,
}

/// `Guide` of guide.wgsl.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct GpuGuide {
    normal: [f32; 3],
    depth: f32,
    albedo: [f32; 3],
    padding0: u32,
    factor: [f32; 3],
    padding1: u32,
}

impl From<&Guide> for GpuGuide {
    fn from(guide: &Guide) -> Self {
        let Guide { normal, depth, albedo, factor } = *guide;
        let [normal, albedo, factor] = [normal, albedo, factor].map(|v| v.to_array());
        Self { normal, depth, albedo, padding0: 0, factor, padding1: 0 }
    }
}

impl From<&GpuGuide> for Guide {
    fn from(guide: &GpuGuide) -> Self {
        let [normal, albedo, factor] = [guide.normal, guide.albedo, guide.factor].map(Vec3::from_array);
        Self { normal, depth: guide.depth, albedo, factor }
    }
}

/// The guides' kernel.
pub(crate) const ADD_GUIDES: KernelSpec = KernelSpec {
    file: "path_trace/add_guides.wgsl",
    twin: "src/view/denoise.rs: guides",
    workgroup: [8, 8],
    scene: true,
    bindings: &[("guide_params", Uniform), ("diffuse_guides", ReadWrite), ("glossy_guides", ReadWrite)],
    structs: &[&GUIDE_PARAMS, &CAMERA, &GUIDE],
};
const GUIDE_PARAMS: StructLayout = layout!(GuideParams as "GuideParams" { camera, seed, frame, index, count, mirror_alpha });
const GUIDE: StructLayout = layout!(GpuGuide as "Guide" { normal, depth, albedo, factor });
const PARAMS: StructLayout = layout!(Params as "Params" {
    width, height, step, despeckle, luminance_sigma, normal_power, depth_sigma, albedo_sigma
});

/// A kernel of the filter: it reads the layer `source` and writes `result`.
const fn filter_kernel(file: &'static str, twin: &'static str, bindings: &'static [(&'static str, Access)]) -> KernelSpec {
    KernelSpec { file, twin, workgroup: [16, 4], scene: false, bindings, structs: &[&PARAMS, &GUIDE] }
}

/// Divides a layer by its albedo, and finds how depth changes.
pub(crate) const DENOISE_START: KernelSpec = filter_kernel(
    "path_trace/denoise_start.wgsl",
    "src/view/denoise.rs: slopes",
    &[("denoise_params", Uniform), ("guides", Read), ("source", Read), ("result", ReadWrite), ("slopes", ReadWrite)],
);
/// Cuts rare paths.
pub(crate) const DESPECKLE: KernelSpec = filter_kernel(
    "path_trace/despeckle.wgsl",
    "src/view/denoise.rs: despeckled",
    &[("denoise_params", Uniform), ("guides", Read), ("source", Read), ("result", ReadWrite)],
);
/// Finds the noise.
pub(crate) const WITH_VARIANCE: KernelSpec = filter_kernel(
    "path_trace/with_variance.wgsl",
    "src/view/denoise.rs: with_variance",
    &[("denoise_params", Uniform), ("guides", Read), ("source", Read), ("result", ReadWrite), ("slopes", Read)],
);
/// A level of the wavelet.
pub(crate) const SMOOTH_LEVEL: KernelSpec = filter_kernel(
    "path_trace/smooth_level.wgsl",
    "src/view/denoise.rs: smoothed",
    &[("denoise_params", Uniform), ("guides", Read), ("source", Read), ("result", ReadWrite), ("slopes", Read)],
);
/// Multiplies the albedo in again.
pub(crate) const DENOISE_END: KernelSpec = filter_kernel(
    "path_trace/denoise_end.wgsl",
    "src/view/denoise.rs: filter_layer",
    &[("denoise_params", Uniform), ("guides", Read), ("source", Read), ("result", ReadWrite)],
);

/// Guides of the diffuse and of the glossy layer, on a device.
pub struct GpuGuides {
    size: [u32; 2],
    layers: [wgpu::Buffer; 2],
}

impl GpuGuides {
    /// Uploads guides of frames so many pixels wide.
    pub fn upload(gpu: &Gpu, guides: &[Vec<Guide>; 2], width: usize) -> Result<Self> {
        let size = [width as u32, (guides[0].len() / width.max(1)) as u32];
        let upload = |guides: &[Guide]| {
            let guides: Vec<GpuGuide> = guides.iter().map(GpuGuide::from).collect();
            gpu.upload("the denoiser's guides", bytemuck::cast_slice(&guides))
        };
        Ok(Self { size, layers: [upload(&guides[0])?, upload(&guides[1])?] })
    }
}

/// The denoiser's own kernels.
struct Filter {
    start: Kernel,
    despeckle: Kernel,
    variance: Kernel,
    level: Kernel,
    end: Kernel,
}

/// The denoiser on a device.
pub struct Denoiser {
    scene: Arc<GpuScene>,
    params: DenoiseParams,
    guides: Kernel,
    filter: Filter,
}

impl Denoiser {
    /// Compiles it.
    pub fn new(scene: Arc<GpuScene>, params: &DenoiseParams) -> Result<Self> {
        let kernel = |spec| Kernel::new(&scene.gpu, spec);
        let filter = Filter {
            start: kernel(&DENOISE_START)?,
            despeckle: kernel(&DESPECKLE)?,
            variance: kernel(&WITH_VARIANCE)?,
            level: kernel(&SMOOTH_LEVEL)?,
            end: kernel(&DENOISE_END)?,
        };
        let guides = Kernel::in_scene(&scene, &ADD_GUIDES, &[])?;
        Ok(Self { guides, filter, params: *params, scene })
    }

    /// Takes a frame of the scene.
    pub fn rebind(&mut self, scene: Arc<GpuScene>) {
        self.guides.rebind(&scene);
        self.scene = scene;
    }

    /// The guides of a frame, as [`crate::view::denoise::guides`] has them; a dispatch for each of a pixel's rays.
    pub fn guides(&self, camera: &Camera, samples: u32, seed: u32, frame: u32) -> Result<GpuGuides> {
        let gpu = &self.scene.gpu;
        let bytes = area(camera.size) * size_of::<GpuGuide>() as u64;
        let guides = GpuGuides {
            size: camera.size,
            layers: [gpu.output("the diffuse layer's guides", bytes)?, gpu.output("the glossy layer's guides", bytes)?],
        };
        let count = samples.clamp(1, GUIDE_SAMPLES);
        for index in 0..count {
            let mirror_alpha = self.params.mirror_alpha;
            let params = GuideParams { camera: camera.into(), seed, frame, index, count, mirror_alpha, padding: [0; 3] };
            let params = gpu.uniform("the guides' parameters", &params)?;
            let [diffuse, glossy] = &guides.layers;
            gpu.dispatch(&self.guides, &[&params, diffuse, glossy], camera.size)?;
        }
        Ok(guides)
    }

    /// Brings guides back that were made here.
    pub fn read(&self, guides: &GpuGuides) -> Result<[Vec<Guide>; 2]> {
        let read = |layer| Ok::<_, crate::Error>(self.scene.gpu.read::<GpuGuide>(layer)?.iter().map(Guide::from).collect());
        Ok([read(&guides.layers[0])?, read(&guides.layers[1])?])
    }

    /// The filtered layers, as [`crate::view::denoise::filter_layer`] has them.
    pub fn denoise(&self, layers: &LayerImages, guides: &GpuGuides) -> Result<LayerImages> {
        let [diffuse, glossy] = &guides.layers;
        Ok(LayerImages {
            emission: layers.emission.clone(),
            diffuse: self.filter_layer(&layers.diffuse, diffuse, guides.size)?,
            glossy: self.filter_layer(&layers.glossy, glossy, guides.size)?,
        })
    }

    fn filter_layer(&self, layer: &[Rgb], guides: &wgpu::Buffer, size: [u32; 2]) -> Result<Vec<Rgb>> {
        if layer.is_empty() {
            return Ok(Vec::new());
        }
        let (gpu, filter) = (&self.scene.gpu, &self.filter);
        let pixels = layer.len() as u64;
        let plane = || gpu.output("a denoised layer", size_of::<Vec4>() as u64 * pixels);
        let (mut from, mut to) = (plane()?, plane()?);
        let slopes = gpu.output("slopes", size_of::<Vec2>() as u64 * pixels)?;
        let run = |kernel: &Kernel, step: i32, buffers: [&wgpu::Buffer; 2], slopes: Option<&wgpu::Buffer>| {
            let params = gpu.uniform("the denoiser's parameters", &self.kernel_params(size, step))?;
            let buffers: Vec<_> = [&params, guides].into_iter().chain(buffers).chain(slopes).collect();
            gpu.dispatch(kernel, &buffers, size)
        };
        let layer: Vec<Vec4> = layer.iter().map(|c| c.extend(0.0)).collect();
        let layer = gpu.upload("a layer", bytemuck::cast_slice(&layer))?;
        run(&filter.start, 1, [&layer, &from], Some(&slopes))?;
        if (1..=NEIGHBOURS).contains(&self.params.despeckle) {
            run(&filter.despeckle, 1, [&from, &to], None)?;
            std::mem::swap(&mut from, &mut to);
        }
        run(&filter.variance, 1, [&from, &to], Some(&slopes))?;
        for level in 0..self.params.levels.min(MOST_LEVELS) {
            std::mem::swap(&mut from, &mut to);
            run(&filter.level, 1 << level, [&from, &to], Some(&slopes))?;
        }
        run(&filter.end, 1, [&to, &from], None)?;
        Ok(gpu.read::<Vec4>(&from)?.iter().map(|c| c.xyz()).collect())
    }

    fn kernel_params(&self, [width, height]: [u32; 2], step: i32) -> Params {
        let DenoiseParams { luminance_sigma, normal_power, depth_sigma, albedo_sigma, despeckle, .. } = self.params;
        Params { width, height, step, despeckle, luminance_sigma, normal_power, depth_sigma, albedo_sigma }
    }
}
