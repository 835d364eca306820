//! Clusters of compressed rows on a device: the twin of [`super::super::clusters`].

use crate::Result;
use crate::gpu::Gpu;
use crate::gpu::commands::Commands;
use crate::gpu::kernel::Kernel;
use crate::gpu::spec::Access::{Read, ReadWrite, Uniform};
use crate::gpu::spec::{KernelSpec, StructLayout, layout};
use crate::method::radiance_probes::compress::Cluster;
use bytemuck::{Pod, Zeroable, cast_slice};
use half::f16;
use std::ops::Range;

/// WebGPU's most workgroups along a line.
pub(super) const MOST_GROUPS: usize = 65_535;

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

/// The kernels that all clusters share.
pub(super) struct ClusterKernels {
    project: Kernel,
    reconstruct: Kernel,
    params: wgpu::Buffer,
}

impl ClusterKernels {
    /// For probes of so many harmonics.
    pub(super) fn new(gpu: &Gpu, terms: u32) -> Result<Self> {
        Ok(Self {
            project: Kernel::new(gpu, &CLUSTER_PROJECTION)?,
            reconstruct: Kernel::new(gpu, &RECONSTRUCT)?,
            params: gpu.uniform("parameters of projection", &ProjectionParams { terms })?,
        })
    }
}

/// Clusters, and light on its way through them. Colours take four floats.
pub(super) struct GpuClusters {
    parts: Vec<Part>,
    /// Light of the clusters' spaces.
    pub(super) spaces: wgpu::Buffer,
    /// Light of the receivers, as many numbers as each keeps.
    pub(super) light: wgpu::Buffer,
}

impl GpuClusters {
    /// Uploads clusters of `receivers`, in pieces of so many bytes at the most. [terms, numbers]: harmonics of a probe and numbers of a receiver.
    pub(super) fn new(gpu: &Gpu, clusters: &[Cluster], sizes: [usize; 2], receivers: usize, piece: u64) -> Result<Self> {
        let colors = |what, count: usize| gpu.output(what, 16 * count.max(1) as u64);
        let mut first_space = 0;
        let upload = |range: Range<usize>| Part::new(gpu, &clusters[range], sizes, &mut first_space);
        Ok(Self {
            parts: pieces(clusters, sizes, piece).into_iter().map(upload).collect::<Result<_>>()?,
            spaces: colors("light of clusters", clusters.iter().map(|c| c.rank).sum())?,
            light: colors("indirect light of receivers", receivers * sizes[1])?,
        })
    }

    /// Makes the receivers' light of the probes' `lambda`, as parts of these two passes.
    pub(super) fn run(
        &self,
        kernels: &ClusterKernels,
        commands: &mut Commands,
        lambda: &wgpu::Buffer,
        passes: [&'static str; 2],
    ) {
        let Self { parts, spaces, light } = self;
        for part in parts.iter().filter(|part| part.row_count > 0) {
            let buffers = [&kernels.params, &part.rows, &part.probes, &part.projection, lambda, spaces];
            let groups = part.row_count.min(MOST_GROUPS);
            let size = [groups as u32 * CLUSTER_PROJECTION.workgroup[0], part.row_count.div_ceil(groups) as u32];
            commands.run(passes[0], &kernels.project, &buffers, size);
        }
        for part in parts.iter().filter(|part| part.member_count > 0) {
            let buffers = [&part.members, &part.reconstruction, spaces, light];
            commands.run(passes[1], &kernels.reconstruct, &buffers, [part.member_count as u32, 1]);
        }
    }

    /// How many pieces they lie in.
    pub(super) fn pieces(&self) -> usize {
        self.parts.len()
    }

    /// Bytes of the clusters.
    pub(super) fn bytes(&self) -> u64 {
        let part = |p: &Part| [&p.rows, &p.probes, &p.projection, &p.members, &p.reconstruction].map(wgpu::Buffer::size);
        self.parts.iter().flat_map(part).sum()
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
    fn new(gpu: &Gpu, clusters: &[Cluster], [terms, numbers]: [usize; 2], space: &mut u32) -> Result<Self> {
        let (mut rows, mut probes, mut projection) = (Vec::new(), Vec::<u32>::new(), Vec::new());
        let (mut members, mut reconstruction) = (Vec::new(), Vec::new());
        let numbers = numbers as u32;
        for c in clusters {
            let (rank, width) = (c.rank as u32, c.probes.len() * terms);
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
