//! Frames by radiance probes on a device: the twin of [`super::light`] and of what `render-path` makes of it.

pub(crate) mod added;
pub(crate) mod clusters;
pub(crate) mod first_order;
pub(crate) mod light_map;
pub(crate) mod operator;

use super::frame_map::FrameMap;
use super::light::Lighting;
use super::params::RadianceProbeParams;
use super::transport::Kept;
use crate::Result;
use crate::base::math::Rgb;
use crate::gpu::Gpu;
use crate::gpu::commands::Commands;
use crate::gpu::kernel::Kernel;
use crate::gpu::scene::GpuScene;
use crate::gpu::spec::Access::{Read, ReadWrite, Uniform};
use crate::gpu::spec::{KernelSpec, StructLayout, layout};
use crate::gpu::view::direct::DirectLight;
use crate::gpu::view::frame::{Baseline, BaselineFrame, Target};
use crate::gpu::view::pixel_run::{PixelPass, runs};
use crate::lightmap::LightMap;
use crate::lightmap::receivers::{POINTS, Receiver};
use crate::scene::Camera;
use crate::transport::World;
use added::{ADDED_LIGHT, GpuBlockers, light_added};
use bytemuck::{Pod, Zeroable, cast_slice};
use first_order::FIRST_ORDER;
use glam::Vec4;
use light_map::MapLight;
use operator::GpuOperator;
use std::sync::Arc;

/// Words of a receiver, as receiver_light.wgsl has them: pixel and side, then triangle and weights of each point.
pub(crate) const RECEIVER_WORDS: usize = 1 + 3 * POINTS;

/// `Params` of receiver_light.wgsl.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct Params {
    first: u32,
    receivers: u32,
    samples: u32,
    seed: u32,
}

/// Light straight from emitters at receivers.
pub(crate) const RECEIVER_LIGHT: KernelSpec = KernelSpec {
    file: "radiance_probes/receiver_light.wgsl",
    twin: "src/method/radiance_probes/light.rs: direct",
    workgroup: [64, 1],
    scene: true,
    bindings: &[("params", Uniform), ("receivers", Read), ("direct", ReadWrite)],
    structs: &[&PARAMS],
};
const PARAMS: StructLayout = layout!(Params as "Params" { first, receivers, samples, seed });

/// Renders frames on a device.
pub struct RadianceProbesOnGpu {
    baseline: Baseline,
    receiver_light: Kernel,
    receivers: wgpu::Buffer,
    count: u32,
    operator: GpuOperator,
    blockers: GpuBlockers,
    map: MapLight,
    direct: DirectLight,
    /// Where there are receivers in free space.
    added_light: Option<PixelPass>,
    /// Whether the frame adds shapes.
    has_added: bool,
    /// Where receivers keep sh1.
    first_order: Option<PixelPass>,
    params: RadianceProbeParams,
}

/// What the passes of the last frame have left on the device.
pub struct Passes {
    /// E_T straight from emitters, of each receiver.
    pub direct: Vec<Rgb>,
    /// λ of the last bounce, probe by probe.
    pub lambda: Vec<Rgb>,
    /// Light of the clusters' spaces, one after the other.
    pub spaces: Vec<Rgb>,
    /// What comes to each receiver by way of the probes, as many numbers as it keeps.
    pub indirect: Vec<Rgb>,
    /// The same in free space; empty without a volume.
    pub volume: Vec<Rgb>,
}

impl RadianceProbesOnGpu {
    /// Uploads an operator in pieces of `piece` bytes at the most, and compiles the passes.
    pub fn new(gpu: Arc<Gpu>, world: &World, lighting: &Lighting, params: &RadianceProbeParams, piece: u64) -> Result<Self> {
        let transport = &lighting.transport;
        // The operator first: where it does not fit, nothing else need be made.
        let operator = GpuOperator::new(&gpu, transport, lighting.normals(), piece)?;
        let numbers = transport.params.receiver.rows();
        operator.set_reflectance(&gpu, &lighting.reflectances(world))?;
        let map = FrameMap::new(&world.scene.geometry, transport);
        // A light map of each number.
        let dark = |side: &Vec<Rgb>| vec![Rgb::ZERO; side.len() * numbers];
        let maps = LightMap { front: dark(&map.dark.front), back: map.dark.back.as_ref().map(dark), ..map.dark.clone() };
        let baseline = Baseline::new(gpu.clone(), world, Some(&maps), params.supersample)?;
        let scene = &*baseline.scene;
        let words: Vec<u32> = transport.receivers.iter().flat_map(words_of).collect();
        Ok(Self {
            receiver_light: Kernel::in_scene(scene, &RECEIVER_LIGHT, &[("IRRADIANCE", 1.0)])?,
            receivers: gpu.upload("receivers", cast_slice(&words))?,
            count: transport.receivers.len() as u32,
            blockers: GpuBlockers::new(scene, operator.volume.as_ref())?,
            added_light: operator.volume.as_ref().map(|_| PixelPass::new(scene, &ADDED_LIGHT)).transpose()?,
            has_added: false,
            operator,
            map: MapLight::new(scene, &map, numbers as u32)?,
            first_order: (transport.params.receiver == Kept::Sh1).then(|| PixelPass::new(scene, &FIRST_ORDER)).transpose()?,
            direct: DirectLight::new(scene)?,
            params: *params,
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

    /// Bytes of receivers and operator on the device.
    pub fn probe_bytes(&self) -> u64 {
        self.operator.bytes() + self.receivers.size()
    }

    /// How many pieces the operator lies in.
    pub fn pieces(&self) -> usize {
        self.operator.pieces()
    }

    /// Takes the lights, colours and shapes of a frame's world. What relight rays meet of the latter the host finds: they are few, and each ray
    /// asks their tree alone whether it is blocked.
    pub fn relight(&mut self, world: &World, lighting: &Lighting) -> Result<()> {
        let scene = self.baseline.scene.at(world)?;
        self.receiver_light.rebind(&scene);
        self.direct.rebind(&scene);
        if let Some(first_order) = &mut self.first_order {
            first_order.rebind(&scene);
        }
        if let Some(added_light) = &mut self.added_light {
            added_light.rebind(&scene);
        }
        let (hits, blockers) = lighting.transport.hits_in(world);
        self.operator.set_hits(&scene.gpu, &hits, blockers.len())?;
        self.blockers.set(&scene, &blockers, self.count)?;
        self.has_added = world.has_added();
        if lighting.changes() {
            self.operator.set_reflectance(&scene.gpu, &lighting.reflectances(world))?;
        }
        self.baseline.rebind(scene);
        Ok(())
    }

    /// The light of the frame whose world [`Self::relight`] took; it goes on from that of the last one, or from darkness.
    pub fn light(&mut self, seed: u32, goes_on: bool) -> Result<()> {
        let scene = self.baseline.scene.clone();
        let mut commands = Commands::new(&scene.gpu);
        self.light_with(&scene, &mut commands, (seed, goes_on))?;
        commands.finish().map(|_| ())
    }

    fn light_with(&self, scene: &GpuScene, commands: &mut Commands, (seed, goes_on): (u32, bool)) -> Result<()> {
        let gpu = &*scene.gpu;
        gpu.checked(|| {
            self.light_receivers(scene, commands, seed)?;
            self.blockers.light(scene, commands, seed)?;
            self.operator.run(gpu, commands, (self.params.bounces, goes_on), &self.blockers);
            Ok(())
        })
        .flatten()
    }

    /// A frame; its light's passes are those of Table 2.
    pub fn frame(&mut self, camera: &Camera, [seed, frame]: [u32; 2], goes_on: bool) -> Result<BaselineFrame> {
        let scene = self.baseline.scene.clone();
        let gpu = &*scene.gpu;
        let mut commands = Commands::new(gpu);
        self.light_with(&scene, &mut commands, (seed, goes_on))?;
        gpu.checked(|| self.map.run(&scene, &mut commands, &self.operator.clusters.light))?;
        let (direct, first_order, samples) = (&self.direct, &self.first_order, self.params.direct_samples);
        let added_light = self.added_light.as_ref().zip(self.operator.volume.as_ref()).filter(|_| self.has_added);
        self.baseline.frame(camera, false, commands, |commands, camera: &Camera, target: &Target| {
            match first_order {
                Some(first_order) => {
                    let buffers = [&target.view.pixels, &target.view.shading, &target.glossy];
                    first_order.run(gpu, (commands, "glossy"), camera, (samples, [seed, frame]), samples, &buffers)?;
                }
                None => gpu.clear(&target.glossy),
            }
            if let Some((added_light, volume)) = added_light {
                light_added(added_light, gpu, commands, (camera, target), volume)?;
            }
            direct.run(&scene, (commands, "diffuse"), (camera, &target.view), samples, [seed, frame])
        })
    }

    fn light_receivers(&self, scene: &GpuScene, commands: &mut Commands, seed: u32) -> Result<()> {
        let samples = self.params.map_samples;
        for (first, receivers) in runs(self.count, samples) {
            let params = Params { first, receivers, samples, seed };
            let params = scene.gpu.uniform("parameters of receivers", &params)?;
            let buffers = [&params, &self.receivers, &self.operator.direct];
            commands.run("scene relight", &self.receiver_light, &buffers, [receivers, 1]);
        }
        Ok(())
    }

    /// Reads back what passes have left.
    pub fn passes(&self) -> Result<Passes> {
        let gpu = &self.baseline.scene.gpu;
        let read = |buffer: &wgpu::Buffer| {
            Ok::<Vec<Rgb>, crate::Error>(gpu.read::<Vec4>(buffer)?.iter().map(|v| v.truncate()).collect())
        };
        let GpuOperator { direct, lambda, clusters, volume, .. } = &self.operator;
        Ok(Passes {
            direct: read(direct)?,
            lambda: read(lambda)?,
            spaces: read(&clusters.spaces)?,
            indirect: read(&clusters.light)?,
            volume: volume.as_ref().map_or_else(|| Ok(Vec::new()), |volume| read(&volume.clusters.light))?,
        })
    }
}

fn words_of(receiver: &Receiver) -> [u32; RECEIVER_WORDS] {
    let mut words = [receiver.word(); RECEIVER_WORDS];
    for (words, p) in words[1..].chunks_exact_mut(3).zip(&receiver.points) {
        words.copy_from_slice(&[p.triangle, p.barycentric.x.to_bits(), p.barycentric.y.to_bits()]);
    }
    words
}
