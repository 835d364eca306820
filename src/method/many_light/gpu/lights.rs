//! The light of a frame's lights on a device: the twin of [`super::super::bounce::light`].

use super::{PARAMS, Params, constants};
use crate::Result;
use crate::gpu::Gpu;
use crate::gpu::camera::CAMERA;
use crate::gpu::commands::Commands;
use crate::gpu::kernel::Kernel;
use crate::gpu::scene::GpuScene;
use crate::gpu::spec::Access::{Read, ReadWrite, Uniform};
use crate::gpu::spec::{KernelSpec, StructLayout, layout};
use crate::gpu::view::pixel_run::runs;
use crate::method::many_light::ManyLightParams;
use crate::method::many_light::bounce::Structure;
use crate::method::many_light::disc;
use crate::method::many_light::emit::{Emission, Site};
use crate::method::many_light::gather::{Gather, Node};
use crate::method::many_light::tree::Tree;
use bytemuck::{Pod, Zeroable, cast_slice};

/// Paths as long as a gather takes: what runs of them are counted by.
pub(super) const GATHER_PATHS: u32 = 16;

/// `Site` of site.wgsl.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
pub(super) struct GpuSite {
    p: [f32; 3],
    number: u32,
    triangle: u32,
    u: f32,
    v: f32,
    side: f32,
}

/// `Cluster` of add_up.wgsl.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct GpuCluster {
    children: [u32; 2],
    area: f32,
    padding: u32,
}

/// `Origin` of filter_nodes.wgsl.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct Origin {
    cluster: u32,
    is_last: u32,
}

/// `Emission` of lobe.wgsl.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct GpuEmission {
    diffuse: [f32; 3],
    count: f32,
    directions: [f32; 3],
    exponents: f32,
    magnitudes: [f32; 3],
    weight: f32,
}

/// `Node` of node.wgsl.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
pub(super) struct GpuNode {
    p: [f32; 3],
    reach: f32,
    n: [f32; 3],
    area: f32,
    diffuse: [f32; 3],
    skip: u32,
    direction: [f32; 3],
    exponent: f32,
    magnitude: [f32; 3],
    horizon: f32,
    in_lobe: f32,
    first: u32,
    count: u32,
    padding: u32,
}

pub(super) const SITE: StructLayout = layout!(GpuSite as "Site" { p, number, triangle, u, v, side });
const CLUSTER: StructLayout = layout!(GpuCluster as "Cluster" { children, area });
const ORIGIN: StructLayout = layout!(Origin as "Origin" { cluster, is_last });
const EMISSION: StructLayout = layout!(GpuEmission as "Emission" { diffuse, count, directions, exponents, magnitudes, weight });
pub(super) const NODE: StructLayout = layout!(GpuNode as "Node" { p, reach, n, area, diffuse, skip, direction, exponent, magnitude, horizon, in_lobe, first, count });

/// Light straight from emitters that lights send on.
pub(crate) const SAMPLE_LIGHTS: KernelSpec = KernelSpec {
    file: "many_light/sample_lights.wgsl",
    twin: "src/method/many_light/emit.rs: direct",
    workgroup: [64, 1],
    scene: true,
    bindings: &[("params", Uniform), ("sites", Read), ("emissions", ReadWrite)],
    structs: &[&PARAMS, &CAMERA, &SITE, &EMISSION],
};
/// Light of clusters.
pub(crate) const ADD_UP: KernelSpec = KernelSpec {
    file: "many_light/add_up.wgsl",
    twin: "src/method/many_light/gather.rs: new",
    workgroup: [64, 1],
    scene: false,
    bindings: &[("params", Uniform), ("clusters", Read), ("emissions", Read), ("sums", ReadWrite)],
    structs: &[&PARAMS, &CAMERA, &CLUSTER, &EMISSION],
};
/// Lobes of nodes.
pub(crate) const FILTER_NODES: KernelSpec = KernelSpec {
    file: "many_light/filter_nodes.wgsl",
    twin: "src/method/many_light/descend.rs: new",
    workgroup: [64, 1],
    scene: false,
    bindings: &[("params", Uniform), ("origins", Read), ("sums", Read), ("nodes", ReadWrite)],
    structs: &[&PARAMS, &CAMERA, &ORIGIN, &EMISSION, &NODE],
};
/// Light that lights send on of one another's.
pub(crate) const BOUNCE: KernelSpec = KernelSpec {
    file: "many_light/bounce.wgsl",
    twin: "src/method/many_light/bounce.rs: light",
    workgroup: [64, 1],
    scene: true,
    bindings: &[("params", Uniform), ("disc", Uniform), ("sites", Read), ("nodes", Read), ("emissions", ReadWrite)],
    structs: &[&PARAMS, &CAMERA, &SITE, &NODE, &EMISSION],
};

/// Lights in the tree's order, and the tree.
struct Placed {
    sites: wgpu::Buffer,
    /// Those of one height after the other, leaves first.
    clusters: wgpu::Buffer,
    /// The first of each height, and how many.
    heights: Vec<(u32, u32)>,
    sums: wgpu::Buffer,
    /// Which cluster each node is.
    origins: wgpu::Buffer,
    nodes: wgpu::Buffer,
    /// Of light straight from emitters, and then of all light.
    emissions: wgpu::Buffer,
    /// How many lights, clusters and nodes.
    counts: [u32; 3],
    /// Of all lights.
    area: f32,
}

/// Lights and what they send.
pub(super) struct GpuLights {
    placed: Placed,
    disc: wgpu::Buffer,
    sample: Kernel,
    add_up: Kernel,
    filter: Kernel,
    bounce: Kernel,
}

impl GpuLights {
    pub(super) fn new(scene: &GpuScene, of: (&[Site], &Structure), params: &ManyLightParams) -> Result<Self> {
        let gpu = &scene.gpu;
        let disc: [f32; disc::SIZE * disc::SIZE] = std::array::from_fn(|i| disc::table()[i]);
        Ok(Self {
            placed: Placed::new(gpu, of, params)?,
            disc: gpu.uniform("solid angles of discs", &disc)?,
            sample: Kernel::in_scene(scene, &SAMPLE_LIGHTS, &[])?,
            add_up: Kernel::new(gpu, &ADD_UP)?,
            filter: Kernel::new(gpu, &FILTER_NODES)?,
            bounce: Kernel::in_scene(scene, &BOUNCE, &constants(params))?,
        })
    }

    /// Takes lights at other places.
    pub(super) fn place(&mut self, gpu: &Gpu, of: (&[Site], &Structure), params: &ManyLightParams) -> Result<()> {
        self.placed = Placed::new(gpu, of, params)?;
        Ok(())
    }

    pub(super) fn rebind(&mut self, scene: &GpuScene) {
        self.sample.rebind(scene);
        self.bounce.rebind(scene);
    }

    pub(super) fn bytes(&self) -> u64 {
        let Placed { sites, clusters, sums, origins, nodes, emissions, .. } = &self.placed;
        [sites, clusters, sums, origins, nodes, emissions].map(wgpu::Buffer::size).iter().sum()
    }

    /// How many nodes traversals see.
    pub(super) fn nodes(&self) -> u32 {
        self.placed.counts[2]
    }

    /// What kernels that gather bind after their parameters.
    pub(super) fn gathered(&self) -> [&wgpu::Buffer; 3] {
        [&self.disc, &self.placed.sites, &self.placed.nodes]
    }

    /// All light after so many bounces, ready to be gathered.
    pub(super) fn light(&self, gpu: &Gpu, commands: &mut Commands, base: &Params, bounces: u32) -> Result<()> {
        let Placed { sites, emissions, counts: [lights, clusters, nodes], area, .. } = &self.placed;
        let base = Params { lights: *lights, clusters: *clusters, nodes: *nodes, area: *area, ..*base };
        for (first, count) in runs(*lights, base.samples) {
            let params = gpu.uniform("parameters of lights", &Params { first, count, ..base })?;
            commands.run("light sampling", &self.sample, &[&params, sites, emissions], [count, 1]);
        }
        self.filter(gpu, commands, &base)?;
        for bounce in 1..bounces {
            for (first, count) in runs(*lights, GATHER_PATHS) {
                let params = gpu.uniform("parameters of lights", &Params { first, count, bounce, ..base })?;
                let [disc, sites, nodes] = self.gathered();
                commands.run("bounces", &self.bounce, &[&params, disc, sites, nodes, emissions], [count, 1]);
            }
            self.filter(gpu, commands, &base)?;
        }
        Ok(())
    }

    /// Light of clusters, from the leaves up, and then of nodes.
    fn filter(&self, gpu: &Gpu, commands: &mut Commands, base: &Params) -> Result<()> {
        let Placed { clusters, heights, sums, origins, nodes, emissions, .. } = &self.placed;
        for &(first, count) in heights {
            let params = gpu.uniform("parameters of clusters", &Params { first, count, ..*base })?;
            commands.run("filtering", &self.add_up, &[&params, clusters, emissions, sums], [count, 1]);
        }
        for (first, count) in runs(base.nodes, 1) {
            let params = gpu.uniform("parameters of nodes", &Params { first, count, ..*base })?;
            commands.run("filtering", &self.filter, &[&params, origins, sums, nodes], [count, 1]);
        }
        Ok(())
    }
}

impl Placed {
    fn new(gpu: &Gpu, (sites, structure): (&[Site], &Structure), params: &ManyLightParams) -> Result<Self> {
        let Structure { tree, forest } = structure;
        let words: Vec<GpuSite> = tree.order.iter().map(|&i| GpuSite::new(i, &sites[i as usize])).collect();
        let dark = vec![Emission::default(); sites.len()];
        let nodes: Vec<GpuNode> = Gather::new(tree, forest, &dark, params).nodes.iter().map(GpuNode::from).collect();
        let (clusters, heights, places) = by_height(tree);
        let origin = |(&i, &last): (&u32, &bool)| Origin { cluster: places[i as usize], is_last: last.into() };
        let origins: Vec<Origin> = forest.nodes.iter().zip(&forest.last).map(origin).collect();
        let emission = size_of::<GpuEmission>() as u64;
        Ok(Self {
            sites: gpu.upload("virtual point lights", cast_slice(&words))?,
            clusters: gpu.upload("clusters", cast_slice(&clusters))?,
            heights,
            sums: gpu.output("light of clusters", emission * clusters.len().max(1) as u64)?,
            origins: gpu.upload("clusters of nodes", cast_slice(&origins))?,
            nodes: gpu.upload("nodes", cast_slice(&nodes))?,
            emissions: gpu.output("light of lights", 2 * emission * sites.len().max(1) as u64)?,
            counts: [sites.len(), clusters.len(), nodes.len()].map(|n| n as u32),
            area: tree.clusters.first().map_or(0.0, |all| all.area),
        })
    }
}

/// Clusters by their height above the leaves; the first of each height and how many; and the place of each among them.
fn by_height(tree: &Tree) -> (Vec<GpuCluster>, Vec<(u32, u32)>, Vec<u32>) {
    let all = &tree.clusters;
    let mut heights = vec![0u32; all.len()];
    for i in (0..all.len()).rev().filter(|&i| !all[i].is_leaf()) {
        heights[i] = 1 + heights[i + 1].max(heights[all[i + 1].skip as usize]);
    }
    let mut order: Vec<usize> = (0..all.len()).collect();
    order.sort_by_key(|&i| heights[i]);
    let mut places = vec![0; all.len()];
    order.iter().zip(0..).for_each(|(&i, place)| places[i] = place);
    let cluster = |&i: &usize| GpuCluster {
        children: if all[i].is_leaf() { [all[i].first; 2] } else { [places[i + 1], places[all[i + 1].skip as usize]] },
        area: all[i].area,
        padding: 0,
    };
    let mut runs: Vec<(u32, u32)> = Vec::new();
    for (&i, place) in order.iter().zip(0..) {
        match runs.get_mut(heights[i] as usize) {
            Some((_, count)) => *count += 1,
            None => runs.push((place, 1)),
        }
    }
    (order.iter().map(cluster).collect(), runs, places)
}

impl GpuSite {
    fn new(number: u32, site: &Site) -> Self {
        let surface = &site.surface;
        let [u, v] = surface.barycentric.to_array();
        Self { p: surface.p.to_array(), number, triangle: surface.triangle, u, v, side: site.side }
    }
}

impl From<&Node> for GpuNode {
    fn from(node: &Node) -> Self {
        let [first, count] = node.lights;
        Self { p: node.p.to_array(), n: node.n.to_array(), area: node.area, skip: node.skip, first, count, ..Self::zeroed() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::method::many_light::tree::tests::room;

    #[test]
    fn clusters_come_after_their_children_and_have_their_lights() {
        let tree = Tree::new(&room(777), 1);
        let (clusters, heights, places) = by_height(&tree);
        assert_eq!(heights.iter().map(|h| h.1).sum::<u32>(), 2 * 777 - 1);
        assert_eq!(heights[0], (0, 777));
        let mut lights: Vec<Vec<u32>> = Vec::new();
        for (height, &(first, count)) in heights.iter().enumerate() {
            for c in &clusters[first as usize..(first + count) as usize] {
                let [a, b] = c.children;
                let all = if height == 0 { vec![a] } else { [lights[a as usize].clone(), lights[b as usize].clone()].concat() };
                assert!(height == 0 || (a < first && b < first));
                lights.push(all);
            }
        }
        let mut whole = lights.last().unwrap().clone();
        whole.sort_unstable();
        assert!(whole.into_iter().eq(0..777));
        for i in [0, 5, 9] {
            let cluster = &tree.clusters[i];
            assert!(lights[places[i] as usize].iter().copied().eq(cluster.first..cluster.first + cluster.count));
        }
    }
}
