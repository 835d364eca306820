//! The operator on a device: the twin of [`super::super::operator`] and [`super::super::relight`].

use super::added::{GpuBlockers, GpuVolume};
use super::clusters::{ClusterKernels, GpuClusters, MOST_GROUPS};
use crate::base::math::Rgb;
use crate::gpu::Gpu;
use crate::gpu::commands::Commands;
use crate::gpu::kernel::Kernel;
use crate::gpu::spec::Access::{Read, ReadWrite, Uniform};
use crate::gpu::spec::{KernelSpec, StructLayout, layout};
use crate::method::radiance_probes::operator::Transport;
use crate::{Error, Result};
use bytemuck::{Pod, Zeroable, cast_slice};
use glam::{Vec3, Vec4};

/// Terms that a workgroup of probe_relight.wgsl sums up.
const TERMS: u32 = 64;

/// `Params` of probe_relight.wgsl.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct RelightParams {
    rays: u32,
    terms: u32,
}

/// What receivers send on.
pub(crate) const RECEIVER_RADIANCE: KernelSpec = KernelSpec {
    file: "radiance_probes/receiver_radiance.wgsl",
    twin: "src/method/radiance_probes/light.rs: radiance",
    workgroup: [64, 1],
    scene: false,
    bindings: &[("direct", Read), ("indirect", Read), ("reflectance", Read), ("normals", Read), ("radiance", ReadWrite)],
    structs: &[],
};
/// What probes see of it.
pub(crate) const PROBE_RELIGHT: KernelSpec = KernelSpec {
    file: "radiance_probes/probe_relight.wgsl",
    twin: "src/method/radiance_probes/relight.rs: project",
    workgroup: [256, 1],
    scene: false,
    bindings: &[("params", Uniform), ("hits", Read), ("radiance", Read), ("weighted", Read), ("lambda", ReadWrite)],
    structs: &[&RELIGHT_PARAMS],
};
const RELIGHT_PARAMS: StructLayout = layout!(RelightParams as "Params" { rays, terms });

/// The operator, and a frame's light on its way through it. Colours take four floats.
pub(super) struct GpuOperator {
    radiance_kernel: Kernel,
    relight_kernel: Kernel,
    cluster_kernels: ClusterKernels,
    receivers: u32,
    probes: u32,
    terms: u32,
    relight_params: wgpu::Buffer,
    /// What relight rays meet in the frame.
    hits: wgpu::Buffer,
    /// Whether some of them meet what the frame adds.
    is_blocked: bool,
    weighted: wgpu::Buffer,
    pub(super) direct: wgpu::Buffer,
    pub(super) lambda: wgpu::Buffer,
    pub(super) clusters: GpuClusters,
    /// Receivers in free space.
    pub(super) volume: Option<GpuVolume>,
    /// Of the receivers, and behind them of what stands in the way of relight rays.
    radiance: wgpu::Buffer,
    reflectance: wgpu::Buffer,
    normals: wgpu::Buffer,
}

impl GpuOperator {
    /// Uploads an operator in pieces of so many bytes at the most. `normals`: where receivers face that keep more than irradiance.
    pub(super) fn new(gpu: &Gpu, transport: &Transport, normals: &[Vec3], piece: u64) -> Result<Self> {
        let (receivers, probes) = (transport.receivers.len(), transport.probes.len());
        let (rays, terms) = (transport.rays.directions.len() as u32, transport.params.terms() as u32);
        for (what, count, most) in
            [("receivers", receivers * transport.params.receiver.rows(), 64 * MOST_GROUPS), ("probes", probes, MOST_GROUPS)]
        {
            if count > most {
                return Err(Error::Request(format!("{count} {what}: a GPU's kernels take {most} at the most; use --device cpu")));
            }
        }
        let colors = |what, count: usize| gpu.output(what, 16 * count.max(1) as u64);
        let numbers = transport.params.receiver.rows();
        let sizes = [transport.params.terms(), numbers];
        let normals: Vec<Vec4> = normals.iter().map(|n| n.extend(0.0)).collect();
        Ok(Self {
            radiance_kernel: Kernel::with(gpu, &RECEIVER_RADIANCE, &[("NUMBERS", numbers as f64)])?,
            relight_kernel: Kernel::new(gpu, &PROBE_RELIGHT)?,
            cluster_kernels: ClusterKernels::new(gpu, terms)?,
            receivers: receivers as u32,
            probes: probes as u32,
            terms,
            relight_params: gpu.uniform("parameters of relighting", &RelightParams { rays, terms })?,
            hits: gpu.upload("what the relight rays of radiance probes meet", cast_slice(&transport.hits))?,
            is_blocked: false,
            weighted: gpu.upload("harmonics of relight rays", cast_slice(&transport.rays.by_ray()))?,
            clusters: GpuClusters::new(gpu, &transport.clusters, sizes, receivers, piece)?,
            volume: transport.volume.as_ref().map(|v| GpuVolume::new(gpu, v, sizes[0], piece)).transpose()?,
            direct: colors("direct light of receivers", receivers)?,
            lambda: colors("light of radiance probes", probes * terms as usize)?,
            radiance: colors("radiance of receivers", receivers)?,
            reflectance: colors("reflectance of receivers", receivers)?,
            normals: gpu
                .upload("where receivers face", cast_slice(if normals.is_empty() { &[Vec4::ZERO] } else { &normals[..] }))?,
        })
    }

    /// Says what the receivers send on from now.
    pub(super) fn set_reflectance(&self, gpu: &Gpu, reflectance: &[Rgb]) -> Result<()> {
        let colors: Vec<[f32; 4]> = reflectance.iter().map(|r| r.extend(0.0).to_array()).collect();
        gpu.checked(|| gpu.queue.write_buffer(&self.reflectance, 0, cast_slice(&colors)))
    }

    /// Says what relight rays meet in a frame: receivers, and from their number on what stands in the way.
    pub(super) fn set_hits(&mut self, gpu: &Gpu, hits: &[u32], blockers: usize) -> Result<()> {
        let colors = 16 * (u64::from(self.receivers) + blockers as u64);
        if self.radiance.size() < colors {
            self.radiance = gpu.output("radiance of receivers and of what a frame adds", colors)?;
        }
        if self.is_blocked || blockers > 0 {
            gpu.checked(|| gpu.queue.write_buffer(&self.hits, 0, cast_slice(hits)))?;
        }
        self.is_blocked = blockers > 0;
        Ok(())
    }

    /// Makes the indirect light of all receivers from their direct light, by so many bounces that go on from the light which is there, or from
    /// darkness.
    pub(super) fn run(&self, gpu: &Gpu, commands: &mut Commands, (bounces, goes_on): (u32, bool), blockers: &GpuBlockers) {
        let Self { direct, lambda, clusters, volume, radiance, .. } = self;
        let volume_light = volume.as_ref().map(|volume| &volume.clusters.light);
        if !goes_on {
            [Some(&clusters.light), volume_light].into_iter().flatten().for_each(|light| gpu.clear(light));
        }
        for _ in 0..bounces {
            let buffers = [direct, &clusters.light, &self.reflectance, &self.normals, radiance];
            commands.run("probe relight", &self.radiance_kernel, &buffers, [self.receivers, 1]);
            blockers.send(commands, volume_light, radiance);
            let buffers = [&self.relight_params, &self.hits, radiance, &self.weighted, lambda];
            let size = [self.probes * PROBE_RELIGHT.workgroup[0], self.terms.div_ceil(TERMS)];
            commands.run("probe relight", &self.relight_kernel, &buffers, size);
            clusters.run(&self.cluster_kernels, commands, lambda, ["cluster projection", "receivers"]);
            if let Some(volume) = volume {
                volume.clusters.run(&self.cluster_kernels, commands, lambda, ["volume"; 2]);
            }
        }
    }

    /// How many pieces it lies in.
    pub(super) fn pieces(&self) -> usize {
        self.clusters.pieces()
    }

    /// Bytes of the operator: what relight rays meet, and the clusters.
    pub(super) fn bytes(&self) -> u64 {
        self.hits.size() + self.weighted.size() + self.clusters.bytes() + self.volume.as_ref().map_or(0, GpuVolume::bytes)
    }
}
