//! Pixels that are chosen and lit on a device: the twin of [`super::super::adaptive`] and of [`super::super::shade`].

use super::lights::{GATHER_PATHS, GpuLights, NODE, SITE};
use super::{PARAMS, Params, constants};
use crate::Result;
use crate::gpu::Gpu;
use crate::gpu::camera::CAMERA;
use crate::gpu::commands::Commands;
use crate::gpu::kernel::{Kernel, area};
use crate::gpu::scene::GpuScene;
use crate::gpu::spec::Access::{Read, ReadWrite, Uniform};
use crate::gpu::spec::{KernelSpec, StructLayout, layout};
use crate::gpu::view::frame::Target;
use crate::gpu::view::pixel_run::{PIXEL_RUN, PixelPass, runs};
use crate::gpu::view::{PIXEL, REFLECTED, SHADING};
use crate::method::many_light::adaptive::coarsest;
use crate::method::many_light::tally::Tally;
use crate::method::many_light::{ManyLightParams, Sampling};
use crate::scene::Camera;
use crate::transport::World;
use bytemuck::{Pod, Zeroable};

/// Most grids.
const GRIDS: usize = 5;
/// Lanes of tally.wgsl.
const LANES: u64 = 256;

/// `LitPixel` of lit_pixel.wgsl.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct LitPixel {
    irradiance: [f32; 3],
    visited: u32,
    glossy: [f32; 3],
    listed: u32,
}

/// `Grids` of grid.wgsl.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct Grids {
    exposure: f32,
    counts: [u32; GRIDS],
}

/// `Part` of tally.wgsl.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct Part {
    points: u32,
    least: u32,
    most: u32,
    sum: u32,
    mirrors: u32,
}

const PART: StructLayout = layout!(Part as "Part" { points, least, most, sum, mirrors });
const LIT_PIXEL: StructLayout = layout!(LitPixel as "LitPixel" { irradiance, visited, glossy, listed });
const GRIDS_LAYOUT: StructLayout = layout!(Grids as "Grids" { exposure, counts });

/// Interpolates pixels, and lists those that are to be lit.
pub(crate) const CHOOSE_PIXELS: KernelSpec = KernelSpec {
    file: "many_light/choose_pixels.wgsl",
    twin: "src/method/many_light/adaptive.rs: fill",
    workgroup: [64, 1],
    scene: true,
    bindings: &[("params", Uniform), ("view", Read), ("lit", ReadWrite), ("grids", ReadWrite)],
    structs: &[&PARAMS, &CAMERA, &PIXEL, &REFLECTED, &LIT_PIXEL, &GRIDS_LAYOUT],
};
/// What light counts for.
pub(crate) const EXPOSE: KernelSpec = KernelSpec {
    file: "many_light/expose.wgsl",
    twin: "src/method/many_light/adaptive.rs: exposure",
    workgroup: [256, 1],
    scene: false,
    bindings: &[("params", Uniform), ("view", Read), ("lit", ReadWrite), ("grids", ReadWrite)],
    structs: &[&PARAMS, &CAMERA, &PIXEL, &REFLECTED, &LIT_PIXEL, &GRIDS_LAYOUT],
};
/// Lights the pixels of the list.
pub(crate) const LIGHT_PIXELS: KernelSpec = KernelSpec {
    file: "many_light/light_pixels.wgsl",
    twin: "src/method/many_light/shade.rs: light",
    workgroup: [64, 1],
    scene: true,
    bindings: &[("params", Uniform), ("disc", Uniform), ("sites", Read), ("nodes", Read), ("view", Read), ("lit", ReadWrite)],
    structs: &[&PARAMS, &CAMERA, &SITE, &NODE, &PIXEL, &REFLECTED, &LIT_PIXEL],
};
/// The layers.
pub(crate) const VIEW_LAYERS: KernelSpec = KernelSpec {
    file: "many_light/view_layers.wgsl",
    twin: "src/method/many_light/shade.rs: layers",
    workgroup: [64, 1],
    scene: true,
    bindings: &[("params", Uniform), ("view", Read), ("shading", ReadWrite), ("glossy", ReadWrite), ("lit", Read)],
    structs: &[&PIXEL_RUN, &CAMERA, &PIXEL, &REFLECTED, &SHADING, &LIT_PIXEL],
};
/// Rays along lobes.
pub(crate) const FOLLOW_LOBES: KernelSpec = KernelSpec {
    file: "many_light/follow_lobes.wgsl",
    twin: "src/method/many_light/follow.rs: followed",
    workgroup: [64, 1],
    scene: true,
    bindings: &[("params", Uniform), ("disc", Uniform), ("sites", Read), ("nodes", Read), ("view", Read), ("glossy", ReadWrite)],
    structs: &[&PARAMS, &CAMERA, &SITE, &NODE, &PIXEL, &REFLECTED],
};
/// Points and nodes.
pub(crate) const TALLY: KernelSpec = KernelSpec {
    file: "many_light/tally.wgsl",
    twin: "src/method/many_light/row.rs: counts",
    workgroup: [256, 1],
    scene: false,
    bindings: &[("params", Uniform), ("view", Read), ("lit", Read), ("parts", ReadWrite)],
    structs: &[&PARAMS, &CAMERA, &PIXEL, &REFLECTED, &LIT_PIXEL, &PART],
};

/// What lights a view.
pub(super) struct GpuPixels {
    choose: Kernel,
    expose: Kernel,
    light: Kernel,
    layers: PixelPass,
    /// Where rays follow lobes.
    follow: Option<Kernel>,
    mirror_samples: u32,
    tally: Kernel,
    grids: wgpu::Buffer,
    parts: wgpu::Buffer,
    /// Of the last view.
    lit: Option<wgpu::Buffer>,
    diagonal: f32,
}

impl GpuPixels {
    pub(super) fn new(scene: &GpuScene, world: &World, params: &ManyLightParams) -> Result<Self> {
        let gpu = &scene.gpu;
        let [kernel, shadows] = constants(params);
        let of_gather = [kernel, shadows];
        let of_rays = [kernel, shadows, ("MIRROR_SAMPLES", params.mirror_samples.into())];
        let (lower, upper) = world.scene.geometry.bounds();
        Ok(Self {
            choose: Kernel::in_scene(scene, &CHOOSE_PIXELS, &[])?,
            expose: Kernel::new(gpu, &EXPOSE)?,
            light: Kernel::in_scene(scene, &LIGHT_PIXELS, &of_gather)?,
            layers: PixelPass::new(scene, &VIEW_LAYERS)?,
            follow: (params.mirror_rays > 0).then(|| Kernel::in_scene(scene, &FOLLOW_LOBES, &of_rays)).transpose()?,
            mirror_samples: params.mirror_samples,
            tally: Kernel::new(gpu, &TALLY)?,
            grids: gpu.output("grids of pixels", size_of::<Grids>() as u64)?,
            parts: gpu.output("counts", LANES * size_of::<Part>() as u64)?,
            lit: None,
            diagonal: lower.distance(upper),
        })
    }

    pub(super) fn rebind(&mut self, scene: &GpuScene) {
        self.choose.rebind(scene);
        self.light.rebind(scene);
        self.layers.rebind(scene);
        if let Some(follow) = &mut self.follow {
            follow.rebind(scene);
        }
    }

    /// Indirect light of all pixels.
    pub(super) fn light(
        &mut self,
        gpu: &Gpu,
        commands: &mut Commands,
        (base, params): (&Params, &ManyLightParams),
        (lights, target): (&GpuLights, &Target),
    ) -> Result<()> {
        let [width, height] = target.view.size;
        let bytes = area(target.view.size) * size_of::<LitPixel>() as u64;
        let lit = match self.lit.take().filter(|lit| lit.size() == bytes) {
            Some(lit) => lit,
            None => gpu.output("light of pixels", bytes)?,
        };
        gpu.clear(&self.grids);
        let base = Params { diagonal: self.diagonal, bilateral: u32::from(params.sampling == Sampling::Bilateral), ..*base };
        let (mut step, mut level, mut threshold) = (coarsest(params.sampling) as u32, 0, params.threshold);
        while step > 0 {
            let pixels = width.div_ceil(step) * height.div_ceil(step);
            let base = Params { step, level, threshold, ..base };
            for (first, count) in runs(pixels, 1) {
                let params = gpu.uniform("parameters of a grid", &Params { first, count, ..base })?;
                commands.run("gather", &self.choose, &[&params, &target.view.pixels, &lit, &self.grids], [count, 1]);
            }
            for (first, count) in runs(pixels, GATHER_PATHS) {
                let params = gpu.uniform("parameters of pixels", &Params { first, count, ..base })?;
                let [disc, sites, nodes] = lights.gathered();
                commands.run("gather", &self.light, &[&params, disc, sites, nodes, &target.view.pixels, &lit], [count, 1]);
            }
            if level == 0 {
                let params = gpu.uniform("parameters of exposure", &Params { count: pixels, ..base })?;
                commands.run("gather", &self.expose, &[&params, &target.view.pixels, &lit, &self.grids], [1, 1]);
            } else {
                threshold *= 2.0;
            }
            step /= 2;
            level += 1;
        }
        let params = gpu.uniform("parameters of counts", &Params { count: width * height, ..base })?;
        commands.run("gather", &self.tally, &[&params, &target.view.pixels, &lit, &self.parts], [1, 1]);
        self.lit = Some(lit);
        Ok(())
    }

    /// Both layers of the pixels that were lit last: all of the glossy one, and of the diffuse one indirect light.
    pub(super) fn layers(
        &self,
        gpu: &Gpu,
        commands: &mut Commands,
        camera: &Camera,
        target: &Target,
        (samples, seeds): (u32, [u32; 2]),
    ) -> Result<()> {
        let Some(lit) = &self.lit else { return Ok(()) };
        let buffers = [&target.view.pixels, &target.view.shading, &target.glossy, lit];
        self.layers.run(gpu, (commands, "direct"), camera, (samples, seeds), samples, &buffers)
    }

    /// Adds what rays along sharp lobes bring to the glossy layer.
    pub(super) fn follow(
        &self,
        gpu: &Gpu,
        commands: &mut Commands,
        base: &Params,
        (lights, target): (&GpuLights, &Target),
    ) -> Result<()> {
        let Some(follow) = &self.follow else { return Ok(()) };
        let rays = base.mirror_rays * self.mirror_samples.max(1);
        for (first, count) in runs(area(target.view.size) as u32, GATHER_PATHS.saturating_mul(rays)) {
            let params = gpu.uniform("parameters of lobes", &Params { first, count, ..*base })?;
            let [disc, sites, nodes] = lights.gathered();
            let buffers = [&params, disc, sites, nodes, &target.view.pixels, &target.glossy];
            commands.run("mirrors", follow, &buffers, [count, 1]);
        }
        Ok(())
    }

    /// What came of the sampling.
    pub(super) fn tally(&self, gpu: &Gpu) -> Result<Tally> {
        let parts: Vec<Part> = gpu.read(&self.parts)?;
        let points = parts.iter().map(|part| part.points).sum();
        let least = parts.iter().map(|part| part.least).min().filter(|_| points > 0);
        let most = parts.iter().map(|part| part.most).max();
        let sum = parts.iter().map(|part| u64::from(part.sum)).sum();
        let mirrors = parts.iter().map(|part| part.mirrors).sum();
        Ok(Tally { points, nodes: [least.unwrap_or(0).into(), most.unwrap_or(0).into(), sum], mirrors })
    }
}
