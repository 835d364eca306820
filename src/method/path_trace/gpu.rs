//! Path-traced frames: the twin of [`crate::method::path_trace`].

use crate::Result;
use crate::base::math::Rgb;
use crate::base::progress::Progress;
use crate::gpu::camera::{CAMERA, GpuCamera};
use crate::gpu::follow::{PATH_START, Place, Purpose, SampleSum, Samples, most_starts};
use crate::gpu::kernel::Kernel;
use crate::gpu::pace::Pace;
use crate::gpu::scene::GpuScene;
use crate::gpu::spec::{Access, KernelSpec, StructLayout, layout};
use crate::material::bsdf::{Lobes, Query};
use crate::scene::Camera;
use crate::transport::World;
use crate::transport::follow::PathStart;
use crate::transport::path::PathParams;
use crate::view::layers::LayerImages;
use bytemuck::{Pod, Zeroable};
use std::sync::Arc;

/// `Params` of camera_hits.wgsl.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct HitParams {
    camera: GpuCamera,
    seed: u32,
    frame: u32,
    first_pixel: u32,
    pixels: u32,
    first_sample: u32,
    samples: u32,
    padding: [u32; 2],
}

/// `Params` of add_samples.wgsl.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct AddParams {
    quantities: u32,
    quantity: u32,
    first_pixel: u32,
    pixels: u32,
    samples: u32,
}

/// The camera's rays.
pub(crate) const CAMERA_HITS: KernelSpec = KernelSpec {
    file: "path_trace/camera_hits.wgsl",
    twin: "src/transport/path.rs: trace_layers",
    workgroup: [64, 1],
    scene: true,
    bindings: &[("params", Access::Uniform), ("starts", Access::ReadWrite), ("emission", Access::ReadWrite)],
    structs: &[&HIT_PARAMS, &CAMERA, &PATH_START],
};
/// The sums over a pixel's samples.
pub(crate) const ADD_SAMPLES: KernelSpec = KernelSpec {
    file: "path_trace/add_samples.wgsl",
    twin: "src/method/path_trace/mod.rs: means",
    workgroup: [64, 1],
    scene: false,
    bindings: &[("params", Access::Uniform), ("values", Access::ReadWrite), ("frame", Access::ReadWrite)],
    structs: &[&ADD_PARAMS],
};
const HIT_PARAMS: StructLayout =
    layout!(HitParams as "Params" { camera, seed, frame, first_pixel, pixels, first_sample, samples });
const ADD_PARAMS: StructLayout = layout!(AddParams as "Params" { quantities, quantity, first_pixel, pixels, samples });

/// A path tracer on a device.
pub struct PathTracer {
    scene: Arc<GpuScene>,
    hits: Kernel,
    add: Kernel,
    /// One for each quantity but the emission: the halves of the first vertex, or the whole.
    paths: Vec<Samples>,
}

impl PathTracer {
    /// Compiles it, for the layers or for the full image alone.
    pub fn new(scene: Arc<GpuScene>, path: &PathParams, layers: bool) -> Result<Self> {
        let hits = Kernel::in_scene(&scene, &CAMERA_HITS, &[])?;
        let add = Kernel::new(&scene.gpu, &ADD_SAMPLES)?;
        // After the set that the camera ray has drawn.
        let place = Place { branch: None, first_set: 1 };
        let whole = Samples::new(scene.clone(), path, Purpose::Scattering(Query::default()), place)?;
        let half = |lobes, k| whole.half(lobes, Place { branch: Some(k), first_set: 0 });
        let paths = if layers { vec![half(Lobes::DIFFUSE, 0), half(Lobes::NON_DIFFUSE, 1)] } else { vec![whole] };
        Ok(Self { scene, hits, add, paths })
    }

    /// The device's name.
    pub fn device(&self) -> &str {
        self.scene.device()
    }

    /// Takes a frame's world, which is what the next frames are of; its scene on the device.
    pub fn relight(&mut self, world: &World) -> Result<Arc<GpuScene>> {
        let scene = Arc::new(self.scene.at(world)?);
        self.hits.rebind(&scene);
        self.paths.iter_mut().for_each(|paths| paths.rebind(scene.clone()));
        self.scene = scene.clone();
        Ok(scene)
    }

    /// The full image, as [`crate::method::path_trace::path_trace_full`] renders it.
    pub fn full(&self, camera: &Camera, spp: u32, seed: u32, frame: u32, progress: &dyn Progress) -> Result<Vec<Rgb>> {
        let means = self.means(camera, spp, [seed, frame], progress)?;
        Ok(means.chunks_exact(2).map(|p| p[0] + p[1]).collect())
    }

    /// The layers, as [`crate::method::path_trace::path_trace`] renders them.
    pub fn layers(&self, camera: &Camera, spp: u32, seed: u32, frame: u32, progress: &dyn Progress) -> Result<LayerImages> {
        let means = self.means(camera, spp, [seed, frame], progress)?;
        let layer = |k: usize| means.iter().skip(k).step_by(3).copied().collect();
        Ok(LayerImages { emission: layer(0), diffuse: layer(1), glossy: layer(2) })
    }

    /// Emission and what each of the paths carries, one after the other for every pixel.
    fn means(&self, camera: &Camera, spp: u32, [seed, frame]: [u32; 2], progress: &dyn Progress) -> Result<Vec<Rgb>> {
        let gpu = &self.scene.gpu;
        let pixels = (camera.size[0] * camera.size[1]) as usize;
        let quantities = self.paths.len() + 1;
        let sums = gpu.output("the frame", (pixels * quantities * size_of::<SampleSum>()) as u64)?;
        let most = most_starts(&self.scene);
        let mut pace = Pace::new(4096);
        let (mut sample, mut rows) = (0, 0);
        while sample < spp {
            let samples = (pace.pieces().min(most) / pixels).clamp(1, (spp - sample) as usize) as u32;
            let mut pixel = 0;
            while pixel < pixels {
                let run = (pace.pieces().min(most) / samples as usize).max(1).min(pixels - pixel);
                let params = HitParams {
                    camera: camera.into(),
                    seed,
                    frame,
                    first_pixel: pixel as u32,
                    pixels: run as u32,
                    first_sample: sample,
                    samples,
                    padding: [0; 2],
                };
                pace.run(run * samples as usize, || self.add_run(&params, &sums))?;
                pixel += run;
            }
            sample += samples;
            let reached = u64::from(camera.size[1]) * u64::from(sample) / u64::from(spp);
            progress.advance(reached - rows);
            rows = reached;
        }
        let scale = 1.0 / spp.max(1) as f32;
        Ok(gpu.read::<SampleSum>(&sums)?.iter().map(|s| s.color() * scale).collect())
    }

    /// Adds samples of a run of pixels to their sums.
    fn add_run(&self, params: &HitParams, frame: &wgpu::Buffer) -> Result<()> {
        let gpu = &self.scene.gpu;
        let count = (params.pixels * params.samples) as usize;
        let starts = gpu.output("starts of paths", (count * size_of::<PathStart>()) as u64)?;
        let values = gpu.output("samples", (count * size_of::<SampleSum>()) as u64)?;
        let uniform = gpu.uniform("the camera", params)?;
        gpu.dispatch(&self.hits, &[&uniform, &starts, &values], [count as u32, 1])?;
        for quantity in 0..=self.paths.len() {
            if let Some(paths) = quantity.checked_sub(1).map(|k| &self.paths[k]) {
                paths.dispatch(&starts, &values, count, [0, 1])?;
            }
            let add = AddParams {
                quantities: self.paths.len() as u32 + 1,
                quantity: quantity as u32,
                first_pixel: params.first_pixel,
                pixels: params.pixels,
                samples: params.samples,
            };
            let add = gpu.uniform("the sums' parameters", &add)?;
            gpu.dispatch(&self.add, &[&add, &values, frame], [params.pixels, 1])?;
        }
        Ok(())
    }
}
