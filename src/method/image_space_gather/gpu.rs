//! Mirror reflections, blurred in image space: the twin of [`crate::method::image_space_gather`].

use super::{ImageSpaceGatherParams, spiral};
use crate::Result;
use crate::gpu::Gpu;
use crate::gpu::camera::{CAMERA, GpuCamera};
use crate::gpu::commands::Commands;
use crate::gpu::kernel::{FAR, Kernel, area, bands};
use crate::gpu::spec::Access::{Read, ReadWrite, Uniform};
use crate::gpu::spec::{KernelSpec, StructLayout, layout};
use crate::gpu::view::frame::{Baseline, BaselineFrame, Target};
use crate::gpu::view::mirror_light::MirrorLight;
use crate::gpu::view::{PIXEL, REFLECTED, SHADING};
use crate::lightmap::LightMap;
use crate::scene::Camera;
use crate::transport::World;
use crate::view::mirror_light::ChainParams;
use bytemuck::{Pod, Zeroable};
use glam::{Vec2, Vec4};
use std::sync::Arc;

/// Most taps of a dispatch: well below a second on a slow GPU.
const MOST_TAPS: u64 = 1 << 26;

/// `ImageSpaceGatherParams` of gather_image.wgsl.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct Params {
    camera: GpuCamera,
    first_row: u32,
    search_samples: u32,
    samples: u32,
    max_sigma: f32,
    min_normal_cos: f32,
    plane_sigma: f32,
    padding: [u32; 2],
}

/// The kernel.
pub(crate) const GATHER_IMAGE: KernelSpec = KernelSpec {
    file: "image_space_gather/gather_image.wgsl",
    twin: "src/method/image_space_gather/mod.rs: gather_image",
    workgroup: [16, 4],
    scene: false,
    bindings: &[
        ("gathering_params", Uniform),
        ("view", Read),
        ("shading", Read),
        ("mirrored_light", Read),
        ("pattern", Read),
        ("glossy", ReadWrite),
    ],
    structs: &[&PARAMS, &CAMERA, &PIXEL, &REFLECTED, &SHADING],
};
const PARAMS: StructLayout = layout!(Params as "ImageSpaceGatherParams" {
    camera, first_row, search_samples, samples, max_sigma, min_normal_cos, plane_sigma
});

/// Renders frames on a device.
pub struct ImageSpaceGather {
    baseline: Baseline,
    mirror_light: MirrorLight,
    gather_image: Kernel,
    /// What `mirror_light` fills.
    mirrored: Option<wgpu::Buffer>,
}

impl ImageSpaceGather {
    /// Compiles the passes, for N x N rays a pixel.
    pub fn new(gpu: Arc<Gpu>, world: &World, lightmap: &LightMap, supersample: u32) -> Result<Self> {
        let baseline = Baseline::new(gpu.clone(), world, Some(lightmap), supersample)?;
        Ok(Self {
            mirror_light: MirrorLight::new(&baseline.scene)?,
            gather_image: Kernel::new(&gpu, &GATHER_IMAGE)?,
            mirrored: None,
            baseline,
        })
    }

    /// The device's name.
    pub fn device(&self) -> &str {
        self.baseline.scene.device()
    }

    /// Whether passes are timed by the device's own clock.
    pub fn has_clock(&self) -> bool {
        self.baseline.scene.gpu.adapter.timestamps
    }

    /// A frame with the glossy layer of [`crate::method::image_space_gather`]. Of `params` all count but `supersample`.
    pub fn frame(&mut self, camera: &Camera, params: &ImageSpaceGatherParams) -> Result<BaselineFrame> {
        let Self { baseline, mirror_light, gather_image, mirrored } = self;
        let scene = baseline.scene.clone();
        let gpu = &*scene.gpu;
        let fill = |commands: &mut Commands, camera: &Camera, target: &Target| {
            let view = &target.view;
            let size = view.size;
            let bytes = size_of::<Vec4>() as u64 * area(size);
            let mirrored = match mirrored.take().filter(|m| m.size() == bytes) {
                Some(buffer) => mirrored.insert(buffer),
                None => mirrored.insert(gpu.output("the mirror picture", bytes)?),
            };
            let [search, gather] = [params.search_samples, params.samples].map(spiral);
            let pattern: Vec<Vec2> = [&*search, &gather].concat();
            let pattern = gpu.upload("the taps", bytemuck::cast_slice(&pattern))?;
            let of_band = |first_row| {
                let params = Params {
                    camera: camera.into(),
                    first_row,
                    search_samples: search.len() as u32,
                    samples: gather.len() as u32,
                    max_sigma: params.max_sigma(),
                    min_normal_cos: params.min_normal_cos,
                    plane_sigma: params.plane_sigma,
                    padding: [0; 2],
                };
                gpu.uniform("the gather's parameters", &params)
            };
            let chain = ChainParams { rays: params.rays(), max_alpha: params.max_mirror_alpha };
            mirror_light.run(&scene, commands, (camera, view), (&chain, FAR), mirrored)?;
            let taps = (search.len() + gather.len()) as u64;
            for (first, rows) in bands(size, MOST_TAPS, taps) {
                let params = &of_band(first)?;
                let buffers = [params, &view.pixels, &view.shading, mirrored, &pattern, &target.glossy];
                commands.run("gather", gather_image, &buffers, [size[0], rows]);
            }
            Ok(())
        };
        baseline.frame(camera, true, Commands::new(gpu), fill)
    }
}
