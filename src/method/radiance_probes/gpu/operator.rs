//! The operator on a device: the twin of [`super::super::operator`] and [`super::super::relight`].

use crate::base::math::Rgb;
use crate::gpu::Gpu;
use crate::gpu::commands::Commands;
use crate::gpu::kernel::Kernel;
use crate::gpu::spec::Access::{Read, ReadWrite, Uniform};
use crate::gpu::spec::{KernelSpec, StructLayout, layout};
use crate::method::radiance_probes::compress::Cluster;
use crate::method::radiance_probes::operator::Transport;
use crate::{Error, Result};
use bytemuck::{Pod, Zeroable, cast_slice};
use glam::{Vec3, Vec4};
use half::f16;
use std::ops::Range;

/// WebGPU's most workgroups along a line.
const MOST_GROUPS: usize = 65_535;
/// Terms that a workgroup of probe_relight.wgsl sums up.
const TERMS: u32 = 64;

/// `Params` of probe_relight.wgsl.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct RelightParams {
    rays: u32,
    terms: u32,
}

/// `Params` of cluster_projection.wgsl.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct ProjectionParams {
    terms: u32,
}

/// `Row` of cluster_projection.wgsl.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct Row {
    first: u32,
    probes: u32,
    width: u32,
    space: u32,
}

/// `Member` of reconstruct.wgsl.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct Member {
    receiver: u32,
    first: u32,
    space: u32,
    rank: u32,
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
/// The light of clusters' spaces.
pub(crate) const CLUSTER_PROJECTION: KernelSpec = KernelSpec {
    file: "radiance_probes/cluster_projection.wgsl",
    twin: "src/method/radiance_probes/clusters.rs: project",
    workgroup: [64, 1],
    scene: false,
    bindings: &[
        ("params", Uniform),
        ("rows", Read),
        ("probes", Read),
        ("projection", Read),
        ("lambda", Read),
        ("spaces", ReadWrite),
    ],
    structs: &[&PROJECTION_PARAMS, &ROW],
};
/// The light of receivers.
pub(crate) const RECONSTRUCT: KernelSpec = KernelSpec {
    file: "radiance_probes/reconstruct.wgsl",
    twin: "src/method/radiance_probes/clusters.rs: reconstruct",
    workgroup: [64, 1],
    scene: false,
    bindings: &[("members", Read), ("reconstruction", Read), ("spaces", Read), ("indirect", ReadWrite)],
    structs: &[&MEMBER],
};
const RELIGHT_PARAMS: StructLayout = layout!(RelightParams as "Params" { rays, terms });
const PROJECTION_PARAMS: StructLayout = layout!(ProjectionParams as "Params" { terms });
const ROW: StructLayout = layout!(Row as "Row" { first, probes, width, space });
const MEMBER: StructLayout = layout!(Member as "Member" { receiver, first, space, rank });

/// Clusters whose tables a kernel can bind.
struct Part {
    rows: wgpu::Buffer,
    row_count: usize,
    probes: wgpu::Buffer,
    projection: wgpu::Buffer,
    members: wgpu::Buffer,
    member_count: usize,
    reconstruction: wgpu::Buffer,
}

/// The operator, and a frame's light on its way through it. Colours take four floats.
pub(super) struct GpuOperator {
    kernels: [Kernel; 4],
    receivers: u32,
    probes: u32,
    terms: u32,
    relight_params: wgpu::Buffer,
    projection_params: wgpu::Buffer,
    hits: wgpu::Buffer,
    weighted: wgpu::Buffer,
    parts: Vec<Part>,
    pub(super) direct: wgpu::Buffer,
    pub(super) indirect: wgpu::Buffer,
    pub(super) lambda: wgpu::Buffer,
    pub(super) spaces: wgpu::Buffer,
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
        let space: usize = transport.clusters.iter().map(|c| c.rank).sum();
        let mut first_space = 0;
        let mut upload = |range| Part::new(gpu, transport, range, &mut first_space);
        let [b, c, d] = [&PROBE_RELIGHT, &CLUSTER_PROJECTION, &RECONSTRUCT].map(|spec| Kernel::new(gpu, spec));
        let numbers = transport.params.receiver.rows();
        let normals: Vec<Vec4> = normals.iter().map(|n| n.extend(0.0)).collect();
        Ok(Self {
            kernels: [Kernel::with(gpu, &RECEIVER_RADIANCE, &[("NUMBERS", numbers as f64)])?, b?, c?, d?],
            receivers: receivers as u32,
            probes: probes as u32,
            terms,
            relight_params: gpu.uniform("parameters of relighting", &RelightParams { rays, terms })?,
            projection_params: gpu.uniform("parameters of projection", &ProjectionParams { terms })?,
            hits: gpu.upload("what the relight rays of radiance probes meet", cast_slice(&transport.hits))?,
            weighted: gpu.upload("harmonics of relight rays", cast_slice(&transport.rays.by_ray()))?,
            parts: pieces(&transport.clusters, [transport.params.terms(), numbers], piece)
                .into_iter()
                .map(&mut upload)
                .collect::<Result<_>>()?,
            direct: colors("direct light of receivers", receivers)?,
            indirect: colors("indirect light of receivers", receivers * numbers)?,
            lambda: colors("light of radiance probes", probes * terms as usize)?,
            spaces: colors("light of clusters", space)?,
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

    /// Makes the indirect light of all receivers from their direct light, by so many bounces that go on from the light which is there, or from
    /// darkness.
    pub(super) fn run(&self, gpu: &Gpu, commands: &mut Commands, bounces: u32, goes_on: bool) {
        if !goes_on {
            gpu.clear(&self.indirect);
        }
        let [radiance, relight, project, reconstruct] = &self.kernels;
        let Self { direct, indirect, lambda, spaces, .. } = self;
        for _ in 0..bounces {
            let buffers = [direct, indirect, &self.reflectance, &self.normals, &self.radiance];
            commands.run("probe relight", radiance, &buffers, [self.receivers, 1]);
            let buffers = [&self.relight_params, &self.hits, &self.radiance, &self.weighted, lambda];
            let size = [self.probes * PROBE_RELIGHT.workgroup[0], self.terms.div_ceil(TERMS)];
            commands.run("probe relight", relight, &buffers, size);
            for part in self.parts.iter().filter(|part| part.row_count > 0) {
                let buffers = [&self.projection_params, &part.rows, &part.probes, &part.projection, lambda, spaces];
                let groups = part.row_count.min(MOST_GROUPS);
                let size = [groups as u32 * CLUSTER_PROJECTION.workgroup[0], part.row_count.div_ceil(groups) as u32];
                commands.run("cluster projection", project, &buffers, size);
            }
            for part in self.parts.iter().filter(|part| part.member_count > 0) {
                let buffers = [&part.members, &part.reconstruction, spaces, indirect];
                commands.run("receivers", reconstruct, &buffers, [part.member_count as u32, 1]);
            }
        }
    }

    /// How many pieces it lies in.
    pub(super) fn pieces(&self) -> usize {
        self.parts.len()
    }

    /// Bytes of the operator: what relight rays meet, and the clusters.
    pub(super) fn bytes(&self) -> u64 {
        let part = |p: &Part| [&p.rows, &p.probes, &p.projection, &p.members, &p.reconstruction].map(wgpu::Buffer::size);
        self.hits.size() + self.weighted.size() + self.parts.iter().flat_map(part).sum::<u64>()
    }
}

/// Words of `count` halves.
fn words(count: usize) -> usize {
    count.div_ceil(2)
}

/// Appends rows of so many halves, a whole number of words each.
fn pack(halves: &[f16], width: usize, out: &mut Vec<u32>) {
    let word = |pair: &[f16]| u32::from(pair[0].to_bits()) | pair.get(1).map_or(0, |h| u32::from(h.to_bits()) << 16);
    for row in halves.chunks(width.max(1)) {
        out.extend(row.chunks(2).map(word));
    }
}

/// Runs of clusters that have none of their tables larger than `most` bytes, but for clusters that are so alone.
/// [terms, numbers]: harmonics of a probe and numbers of a receiver.
fn pieces(clusters: &[Cluster], [terms, numbers]: [usize; 2], most: u64) -> Vec<Range<usize>> {
    let (mut done, mut first, mut sum) = (Vec::new(), 0, [0u64; 2]);
    for (i, c) in clusters.iter().enumerate() {
        let words = [c.rank * words(c.probes.len() * terms), c.receivers.len() * numbers * words(c.rank).max(4)];
        let next = [0, 1].map(|k| sum[k] + 4 * words[k] as u64);
        if next.iter().any(|&bytes| bytes > most) && i > first {
            done.push(first..i);
            first = i;
            sum = words.map(|n| 4 * n as u64);
        } else {
            sum = next;
        }
    }
    if first < clusters.len() {
        done.push(first..clusters.len());
    }
    done
}

impl Part {
    /// Uploads clusters, whose spaces begin at `space`.
    fn new(gpu: &Gpu, transport: &Transport, range: Range<usize>, space: &mut u32) -> Result<Self> {
        let (mut rows, mut probes, mut projection) = (Vec::new(), Vec::<u32>::new(), Vec::new());
        let (mut members, mut reconstruction) = (Vec::new(), Vec::new());
        let numbers = transport.params.receiver.rows() as u32;
        for c in &transport.clusters[range] {
            let (rank, width) = (c.rank as u32, c.probes.len() * transport.params.terms());
            let [row, member] = [projection.len(), reconstruction.len()].map(|n| n as u32);
            let list = probes.len() as u32;
            rows.extend((0..rank).map(|k| Row {
                first: row + k * words(width) as u32,
                probes: list,
                width: width as u32,
                space: *space + k,
            }));
            let kept = c.receivers.iter().flat_map(|&r| (0..numbers).map(move |k| r * numbers + k));
            members.extend(kept.zip(0..).map(|(receiver, k)| Member {
                receiver,
                first: member + k * words(c.rank) as u32,
                space: *space,
                rank,
            }));
            probes.extend(&c.probes);
            pack(&c.projection, width, &mut projection);
            pack(&c.reconstruction, c.rank, &mut reconstruction);
            *space += rank;
        }
        Ok(Self {
            row_count: rows.len(),
            member_count: members.len(),
            rows: gpu.upload("rows of clusters", cast_slice(&rows))?,
            probes: gpu.upload("probes of clusters", cast_slice(&probes))?,
            projection: gpu.upload("projections of clusters", cast_slice(&projection))?,
            members: gpu.upload("receivers of clusters", cast_slice(&members))?,
            reconstruction: gpu.upload("reconstructions of clusters", cast_slice(&reconstruction))?,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pieces_hold_all_clusters_in_order_and_are_no_larger_than_they_may_be() {
        let cluster = |receivers: u32| Cluster {
            receivers: (0..receivers).collect(),
            probes: vec![0, 1],
            rank: 3,
            projection: vec![f16::ONE; 54],
            reconstruction: vec![f16::ONE; 3 * receivers as usize],
        };
        let clusters = [10, 10, 10, 1000, 10].map(cluster);
        // Rows of 18 halves take 108 bytes a cluster; 10 members take 160.
        assert_eq!(pieces(&clusters, [9, 1], 320), [0..2, 2..3, 3..4, 4..5]);
        assert_eq!(pieces(&clusters, [9, 1], 1 << 20), vec![0..5]);
        assert!(pieces(&[], [9, 1], 100).is_empty());
    }

    #[test]
    fn rows_begin_words() {
        let halves: Vec<f16> = (1..=6).map(|i| f16::from_f32(i as f32)).collect();
        let mut out = Vec::new();
        pack(&halves, 3, &mut out);
        let [one, two, three, four] = [1.0, 2.0, 3.0, 4.0].map(|v| u32::from(f16::from_f32(v).to_bits()));
        assert_eq!((out.len(), &out[..2]), (4, &[one | two << 16, three][..]));
        assert_eq!(out[2] & 0xffff, four);
    }
}
