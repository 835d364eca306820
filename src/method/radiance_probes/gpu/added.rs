//! What frames add, on a device: its light by way of the probes, and what it sends to probes whose relight rays it blocks. The twin of
//! [`super::super::volume`] and of what [`super::super::light`] and [`super::super::shade`] make of it.

use super::clusters::GpuClusters;
use crate::Result;
use crate::gpu::Gpu;
use crate::gpu::camera::CAMERA;
use crate::gpu::commands::Commands;
use crate::gpu::kernel::Kernel;
use crate::gpu::scene::GpuScene;
use crate::gpu::spec::Access::{Read, ReadWrite, Uniform};
use crate::gpu::spec::{KernelSpec, StructLayout, layout};
use crate::gpu::view::frame::Target;
use crate::gpu::view::pixel_run::{PIXEL_RUN, PixelPass, runs};
use crate::gpu::view::{PIXEL, REFLECTED, SHADING};
use crate::material::Surface;
use crate::method::radiance_probes::volume::{NUMBERS, Volume};
use crate::scene::Camera;
use bytemuck::{Pod, Zeroable, cast_slice};
use glam::Vec3;

/// Rays of a surface that takes light from receivers in free space: to those around it, and for its direct light.
const RAYS: u32 = 10;

/// `Volume` of volume.wgsl.
#[repr(C)]
#[derive(Clone, Copy, Default, Pod, Zeroable)]
struct VolumeParams {
    low: [f32; 3],
    spacing: f32,
    counts: [u32; 3],
    receivers: u32,
}

/// `Taps` of taps.wgsl.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct Taps {
    points: [u32; 8],
    weights: [f32; 8],
    factors: [f32; NUMBERS],
}

/// `Blocker` of blocker.wgsl.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct Blocker {
    sent: [f32; 3],
    padding0: u32,
    direct: [f32; 3],
    taps: Taps,
}

/// `Blocked` of blockers.wgsl.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct Blocked {
    triangle: u32,
    u: f32,
    v: f32,
    padding0: u32,
    wo: [f32; 3],
    padding1: u32,
}

/// `Params` of blockers.wgsl.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct BlockersParams {
    first: u32,
    blockers: u32,
    seed: u32,
}

/// `Params` of blocker_radiance.wgsl.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct RadianceParams {
    receivers: u32,
    blockers: u32,
}

/// What is in the way of relight rays.
pub(crate) const BLOCKERS: KernelSpec = KernelSpec {
    file: "radiance_probes/blockers.wgsl",
    twin: "src/method/radiance_probes/light.rs: all",
    workgroup: [64, 1],
    scene: true,
    bindings: &[("params", Uniform), ("volume", Uniform), ("cells", Read), ("blocked", Read), ("list", ReadWrite)],
    structs: &[&BLOCKERS_PARAMS, &VOLUME, &BLOCKED, &BLOCKER, &TAPS],
};
/// What it sends to probes.
pub(crate) const BLOCKER_RADIANCE: KernelSpec = KernelSpec {
    file: "radiance_probes/blocker_radiance.wgsl",
    twin: "src/method/radiance_probes/light.rs: radiance",
    workgroup: [64, 1],
    scene: false,
    bindings: &[("params", Uniform), ("list", Read), ("volume_light", Read), ("radiance", ReadWrite)],
    structs: &[&RADIANCE_PARAMS, &BLOCKER, &TAPS],
};
/// What views see of it.
pub(crate) const ADDED_LIGHT: KernelSpec = KernelSpec {
    file: "radiance_probes/added_light.wgsl",
    twin: "src/method/radiance_probes/shade.rs: of_added",
    workgroup: [64, 1],
    scene: true,
    bindings: &[
        ("params", Uniform),
        ("volume", Uniform),
        ("cells", Read),
        ("view", Read),
        ("volume_light", Read),
        ("shading", ReadWrite),
    ],
    structs: &[&PIXEL_RUN, &CAMERA, &VOLUME, &PIXEL, &REFLECTED, &SHADING],
};
const VOLUME: StructLayout = layout!(VolumeParams as "Volume" { low, spacing, counts, receivers });
const TAPS: StructLayout = layout!(Taps as "Taps" { points, weights, factors });
const BLOCKER: StructLayout = layout!(Blocker as "Blocker" { sent, direct, taps });
const BLOCKED: StructLayout = layout!(Blocked as "Blocked" { triangle, u, v, wo });
const BLOCKERS_PARAMS: StructLayout = layout!(BlockersParams as "Params" { first, blockers, seed });
const RADIANCE_PARAMS: StructLayout = layout!(RadianceParams as "Params" { receivers, blockers });

/// Receivers in free space.
pub(super) struct GpuVolume {
    pub(super) clusters: GpuClusters,
    places: Places,
}

/// Where they are.
#[derive(Clone)]
struct Places {
    params: wgpu::Buffer,
    cells: wgpu::Buffer,
}

impl Places {
    fn new(gpu: &Gpu, params: &VolumeParams, cells: &[u32]) -> Result<Self> {
        let cells = gpu.upload("receivers in free space", cast_slice(cells))?;
        Ok(Self { params: gpu.uniform("the grid of receivers in free space", params)?, cells })
    }
}

impl GpuVolume {
    /// Uploads a volume in pieces of so many bytes at the most; `terms`: harmonics of a probe.
    pub(super) fn new(gpu: &Gpu, volume: &Volume, terms: usize, piece: u64) -> Result<Self> {
        let Volume { grid, cells, clusters } = volume;
        let params =
            VolumeParams { low: grid.low.into(), spacing: grid.spacing, counts: grid.counts, receivers: cells.len() as u32 };
        Ok(Self {
            clusters: GpuClusters::new(gpu, clusters, [terms, NUMBERS], cells.len(), piece)?,
            places: Places::new(gpu, &params, cells)?,
        })
    }

    /// Bytes that it takes.
    pub(super) fn bytes(&self) -> u64 {
        self.clusters.bytes() + self.places.cells.size()
    }
}

/// A frame's surfaces in the way of relight rays.
pub(super) struct GpuBlockers {
    kernel: Kernel,
    radiance: Kernel,
    places: Places,
    /// Where rays end, what is there, and how many there are.
    frame: Option<(wgpu::Buffer, wgpu::Buffer, u32)>,
    /// How many receivers come before them, and themselves.
    params: wgpu::Buffer,
    /// Stands for the light of a volume where there is none.
    dark: wgpu::Buffer,
}

impl GpuBlockers {
    /// None yet.
    pub(super) fn new(scene: &GpuScene, volume: Option<&GpuVolume>) -> Result<Self> {
        let gpu = &scene.gpu;
        Ok(Self {
            kernel: Kernel::in_scene(scene, &BLOCKERS, &[("IRRADIANCE", 1.0)])?,
            radiance: Kernel::new(gpu, &BLOCKER_RADIANCE)?,
            places: match volume {
                Some(volume) => volume.places.clone(),
                None => Places::new(gpu, &VolumeParams::default(), &[])?,
            },
            frame: None,
            params: gpu.uniform("parameters of what blocks", &RadianceParams { receivers: 0, blockers: 0 })?,
            dark: gpu.output("no light", 16)?,
        })
    }

    /// Takes those of a frame, with the directions towards the probes, behind so many receivers.
    pub(super) fn set(&mut self, scene: &GpuScene, surfaces: &[(Surface, Vec3)], receivers: u32) -> Result<()> {
        let gpu = &scene.gpu;
        self.kernel.rebind(scene);
        self.frame = None;
        if surfaces.is_empty() {
            return Ok(());
        }
        let blocked = |(s, wo): &(Surface, Vec3)| {
            let [u, v] = s.barycentric.to_array();
            Blocked { triangle: s.triangle, u, v, padding0: 0, wo: wo.to_array(), padding1: 0 }
        };
        let blocked: Vec<Blocked> = surfaces.iter().map(blocked).collect();
        let count = blocked.len() as u32;
        let ends = gpu.upload("where relight rays are blocked", cast_slice(&blocked))?;
        let list = gpu.output("what blocks relight rays", (blocked.len() * size_of::<Blocker>()) as u64)?;
        self.params = gpu.uniform("parameters of what blocks", &RadianceParams { receivers, blockers: count })?;
        self.frame = Some((ends, list, count));
        Ok(())
    }

    /// Finds what it reflects, and its light straight from emitters.
    pub(super) fn light(&self, scene: &GpuScene, commands: &mut Commands, seed: u32) -> Result<()> {
        let Some((ends, list, count)) = &self.frame else { return Ok(()) };
        for (first, blockers) in runs(*count, RAYS) {
            let params = BlockersParams { first, blockers, seed };
            let params = scene.gpu.uniform("parameters of what blocks", &params)?;
            let buffers = [&params, &self.places.params, &self.places.cells, ends, list];
            commands.run("probe relight", &self.kernel, &buffers, [blockers, 1]);
        }
        Ok(())
    }

    /// Puts what it sends to probes behind the radiance of the receivers.
    pub(super) fn send(&self, commands: &mut Commands, volume_light: Option<&wgpu::Buffer>, radiance: &wgpu::Buffer) {
        if let Some((_, list, count)) = &self.frame {
            let buffers = [&self.params, list, volume_light.unwrap_or(&self.dark), radiance];
            commands.run("probe relight", &self.radiance, &buffers, [*count, 1]);
        }
    }
}

/// Puts the diffuse layer of what the frame adds into a view, without light straight from emitters.
pub(super) fn light_added(
    pass: &PixelPass,
    gpu: &Gpu,
    commands: &mut Commands,
    (camera, target): (&Camera, &Target),
    volume: &GpuVolume,
) -> Result<()> {
    let (view, Places { params: grid, cells }) = (&target.view, &volume.places);
    let buffers = [grid, cells, &view.pixels, &volume.clusters.light, &view.shading];
    pass.run(gpu, (commands, "diffuse"), camera, (0, [0; 2]), RAYS, &buffers)
}
