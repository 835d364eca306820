//! Frames by many lights on a device: the twin of what [`super::row`] does on the CPU.
//!
//! Lights are placed and the tree is built on the CPU. On the device are the light that they send ([`lights`]), and the pixels that are chosen
//! and lit ([`pixels`]).

pub(crate) mod lights;
pub(crate) mod pixels;

use super::ManyLightParams;
use super::bounce::Structure;
use super::emit::Site;
use super::gather;
use super::params::{Kernel as LobeShape, Traversal};
use super::tally::Tally;
use crate::gpu::Gpu;
use crate::gpu::camera::GpuCamera;
use crate::gpu::commands::Commands;
use crate::gpu::scene::GpuScene;
use crate::gpu::spec::{StructLayout, layout};
use crate::gpu::view::direct::DirectLight;
use crate::gpu::view::frame::{Baseline, BaselineFrame, Target};
use crate::scene::Camera;
use crate::transport::World;
use crate::{Error, Result};
use bytemuck::{Pod, Zeroable};
use lights::GpuLights;
use pixels::GpuPixels;
use std::sync::Arc;

/// `Params` of params.wgsl.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct Params {
    camera: GpuCamera,
    seed: u32,
    frame: u32,
    first: u32,
    count: u32,
    lights: u32,
    nodes: u32,
    samples: u32,
    bounce: u32,
    sphere: f32,
    clamp: f32,
    min_exponent: f32,
    max_exponent: f32,
    lobes: u32,
    clusters: u32,
    area: f32,
    solid_angle: f32,
    near: f32,
    horizon: f32,
    fill: f32,
    mirror_alpha: f32,
    mirror_rays: u32,
    direct_samples: u32,
    step: u32,
    level: u32,
    bilateral: u32,
    lambda: f32,
    threshold: f32,
    diagonal: f32,
}
pub(crate) const PARAMS: StructLayout = layout!(Params as "Params" {
    camera, seed, frame, first, count, lights, nodes, samples, bounce, sphere, clamp, min_exponent, max_exponent, lobes, clusters,
    area, solid_angle, near, horizon, fill, mirror_alpha, mirror_rays, direct_samples, step, level, bilateral, lambda, threshold,
    diagonal
});

impl Params {
    /// What all passes of a frame are told.
    fn new(camera: &Camera, [seed, frame]: [u32; 2], params: &ManyLightParams) -> Self {
        Self {
            camera: camera.into(),
            seed,
            frame,
            samples: params.light_samples,
            sphere: params.sphere,
            clamp: params.clamp,
            min_exponent: params.min_exponent,
            max_exponent: params.max_exponent,
            lobes: params.lobes,
            solid_angle: params.solid_angle,
            near: params.near,
            horizon: params.horizon,
            fill: params.fill,
            mirror_alpha: params.mirror_alpha,
            mirror_rays: params.mirror_rays,
            direct_samples: params.direct_samples,
            lambda: params.lambda,
            ..Self::zeroed()
        }
    }
}

/// Values of gather.wgsl's constants.
fn constants(params: &ManyLightParams) -> [(&'static str, f64); 2] {
    let is_gaussian = params.kernel == LobeShape::Gaussian;
    [("GAUSSIAN", f64::from(u8::from(is_gaussian))), ("SHADOW_RAYS", params.shadow_rays.into())]
}

/// An error where a gather may take more rounds of its loops than a software device makes: Mesa's llvmpipe leaves all loops of an invocation
/// after 65,535 rounds, and says nothing.
fn check_rounds(gpu: &Gpu, nodes: usize, params: &ManyLightParams) -> Result<()> {
    const MOST: usize = 65_535;
    // More than any traversal has been seen to visit.
    let visited = match params.traversal {
        Traversal::Leaves => nodes,
        Traversal::Full => nodes.min(6144),
        Traversal::Cuts => nodes.min(1536),
    };
    // A node's own round, and those of the walks down a receiver's material: at lights there are two of these.
    let rounds = if params.bounces > 1 { 20 } else { 6 };
    let directions = if params.sphere > 0.0 { gather::CONE as usize } else { 1 };
    if gpu.adapter.name.contains("llvmpipe") && rounds * visited * directions > MOST {
        return Err(Error::Request(format!(
            "GPU \"{}\" ends loops after {MOST} rounds, and gathers from so many lights may take more: ask for fewer vpls, or use --device cpu",
            gpu.adapter.name
        )));
    }
    Ok(())
}

/// Renders frames on a device.
pub struct ManyLightOnGpu {
    baseline: Baseline,
    lights: GpuLights,
    pixels: GpuPixels,
    direct: DirectLight,
    params: ManyLightParams,
    /// Whether the lights' light is that of the scene.
    is_lit: bool,
}

impl ManyLightOnGpu {
    /// Uploads lights and compiles the passes.
    pub fn new(gpu: Arc<Gpu>, world: &World, of: (&[Site], &Structure), params: &ManyLightParams) -> Result<Self> {
        if params.lobes > 1 {
            return Err(Error::Request("the GPU's many lights have one lobe a node; use --device cpu for more".into()));
        }
        check_rounds(&gpu, of.1.forest.nodes.len(), params)?;
        let baseline = Baseline::new(gpu, world, None, params.supersample)?;
        let scene = &*baseline.scene;
        Ok(Self {
            lights: GpuLights::new(scene, of, params)?,
            pixels: GpuPixels::new(scene, world, params)?,
            direct: DirectLight::new(scene)?,
            params: *params,
            is_lit: false,
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

    /// Bytes of the lights on the device.
    pub fn bytes(&self) -> u64 {
        self.lights.bytes()
    }

    /// Takes a frame's world, and its lights where they lie elsewhere.
    pub fn relight(&mut self, world: &World, moved: Option<(&[Site], &Structure)>) -> Result<()> {
        let scene: GpuScene = self.baseline.scene.at(world)?;
        if let Some(of) = moved {
            self.lights.place(&scene.gpu, of, &self.params)?;
        }
        self.lights.rebind(&scene);
        self.pixels.rebind(&scene);
        self.direct.rebind(&scene);
        self.baseline.rebind(scene);
        self.is_lit = false;
        Ok(())
    }

    /// A frame.
    pub fn frame(&mut self, camera: &Camera, seeds: [u32; 2]) -> Result<(BaselineFrame, Tally)> {
        let Self { baseline, lights, pixels, direct, params, is_lit } = self;
        let scene = baseline.scene.clone();
        let gpu = &*scene.gpu;
        let mut commands = Commands::new(gpu);
        if !*is_lit {
            gpu.checked(|| lights.light(gpu, &mut commands, &Params::new(camera, seeds, params), params.bounces)).flatten()?;
            *is_lit = true;
        }
        let frame = baseline.frame(camera, true, commands, |commands, camera: &Camera, target: &Target| {
            let base = Params { nodes: lights.nodes(), ..Params::new(camera, seeds, params) };
            pixels.light(gpu, commands, (&base, params), (lights, target))?;
            pixels.layers(gpu, commands, camera, target, (params.direct_samples, seeds))?;
            pixels.follow(gpu, commands, &base, (lights, target))?;
            direct.run(&scene, (commands, "direct"), (camera, &target.view), params.direct_samples, seeds)
        })?;
        Ok((frame, pixels.tally(gpu)?))
    }
}
