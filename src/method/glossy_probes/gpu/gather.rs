//! The gather (§5.1, §5.2), a dispatch or two a probe: the twin of [`crate::method::glossy_probes::gather`].

use super::probes::GpuProbe;
use crate::gpu::Gpu;
use crate::gpu::commands::Commands;
use crate::gpu::kernel::{Kernel, area, shader};
use crate::gpu::resident::Place;
use crate::gpu::view::View;
use crate::method::glossy_probes::gather::{BilinearRule, GatherParams, MAX_RADIUS, TILE};
use crate::method::glossy_probes::perturb::{Order, PerturbParams};
use crate::{Error, Result};
use bytemuck::{Pod, Zeroable};
use glam::Vec3;

/// Most levels of a search.
const LEVELS: usize = 8;
/// Edge of a workgroup.
const WORKGROUP: u32 = 8;
/// Bytes of what the search leaves for an anchor.
const ANCHOR: u64 = 32;

/// What the shader's `PerturbParams` holds.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct Perturb {
    order: u32,
    exact_plane: u32,
    second_order_limit: f32,
    min_focus: f32,
    newton: u32,
}

impl Perturb {
    fn new(params: &PerturbParams) -> Self {
        let order = match params.order {
            Order::Plane => 0,
            Order::First => 1,
            Order::Second => 2,
        };
        let PerturbParams { second_order_limit, min_focus, newton, .. } = *params;
        Self { order, exact_plane: params.exact_plane.into(), second_order_limit, min_focus, newton }
    }
}

/// What the shader's `Params` holds.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct Params {
    eye: [f32; 3],
    width: u32,
    perturb: Perturb,
    height: u32,
    anchors: u32,
    levels: u32,
    bilinear: u32,
    material_penalty: f32,
    falloff: f32,
    albedo_ratio: u32,
    roughness_penalty: f32,
    padding: [u32; 3],
    search: [[f32; 2]; LEVELS],
}

impl Params {
    fn new(params: &GatherParams, eye: Vec3, size: [u32; 2]) -> Self {
        let mut search = [[0.0; 2]; LEVELS];
        for (level, to) in params.search.iter().zip(&mut search) {
            *to = [level.radius.min(MAX_RADIUS) as f32, level.step];
        }
        Self {
            eye: eye.to_array(),
            width: size[0],
            perturb: Perturb::new(&params.perturb),
            height: size[1],
            anchors: anchor_step(params),
            levels: params.search.len() as u32,
            bilinear: match params.bilinear {
                BilinearRule::Nearest => 0,
                BilinearRule::SameReflector => 1,
                BilinearRule::SameReflectorAndReflected => 2,
            },
            material_penalty: params.material_penalty,
            roughness_penalty: params.roughness_penalty,
            padding: [0; 3],
            falloff: params.falloff,
            albedo_ratio: params.albedo_ratio.into(),
            search,
        }
    }
}

/// Pixels from one anchor to the next; a tile has one at least.
fn anchor_step(params: &GatherParams) -> u32 {
    params.anchors.clamp(1, TILE) as u32
}

/// What the gather leaves of a frame.
pub(crate) struct Sums {
    /// Colour times weight, and the weight; 0 where no probe had a sample.
    pub(crate) sums: wgpu::Buffer,
    /// Energy and texel (as bits) of the best sample, and its probe.
    pub(crate) best: wgpu::Buffer,
    anchors: wgpu::Buffer,
}

impl Sums {
    pub(crate) fn new(gpu: &Gpu, size: [u32; 2], params: &GatherParams) -> Result<Self> {
        let pixels = area(size);
        Ok(Self {
            sums: gpu.output("gathered sums", 16 * pixels)?,
            best: gpu.output("best samples", 16 * pixels)?,
            anchors: gpu.output("anchors", ANCHOR * if anchor_step(params) > 1 { area(anchor_grid(size, params)) } else { 1 })?,
        })
    }
}

/// Anchors each way.
fn anchor_grid(size: [u32; 2], params: &GatherParams) -> [u32; 2] {
    let tile = TILE as u32;
    size.map(|n| n.div_ceil(tile) * tile.div_ceil(anchor_step(params)))
}

/// The kernels.
pub(crate) struct Gather {
    params: GatherParams,
    find_anchors: Kernel,
    gather: Kernel,
}

impl Gather {
    pub(crate) fn new(gpu: &Gpu, params: &GatherParams) -> Result<Self> {
        let levels = params.search.len();
        if !(1..=LEVELS).contains(&levels) {
            return Err(Error::Request(format!(
                "gather.search: {levels} levels, but the GPU takes 1 to {LEVELS}; use --device cpu"
            )));
        }
        let source = shader!("math", "perturb", "view", "probe", "gather");
        Ok(Self {
            params: params.clone(),
            find_anchors: Kernel::new(gpu, source, "find_anchors")?,
            gather: Kernel::new(gpu, source, "gather")?,
        })
    }

    /// Adds what one probe has for a view, as `eye` sees it.
    pub(crate) fn run(
        &self,
        gpu: &Gpu,
        commands: &mut Commands,
        (view, eye): (&View, Vec3),
        (probe, place): (&GpuProbe, &Place),
        out: &Sums,
    ) -> Result<()> {
        let params = gpu.upload("the gather's parameters", bytemuck::bytes_of(&Params::new(&self.params, eye, view.size)))?;
        let place = gpu.upload("a probe's place", bytemuck::bytes_of(place))?;
        let buffers = [
            &params,
            &place,
            &probe.forward,
            &view.positions,
            &view.guides.normals,
            &view.curvatures,
            &view.guides.materials,
            &view.reflected,
            &probe.derivative,
            &probe.seen,
            &probe.directions,
            &out.anchors,
            &probe.light,
            &view.albedos,
            &out.sums,
            &out.best,
        ];
        if anchor_step(&self.params) > 1 {
            let groups = anchor_grid(view.size, &self.params).map(|n| n.div_ceil(WORKGROUP));
            commands.run("gather", &self.find_anchors, &buffers[..12], groups);
        }
        commands.run("gather", &self.gather, &buffers, view.size.map(|n| n.div_ceil(WORKGROUP)));
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gpu::layout::check;

    #[test]
    fn structs_are_laid_out_as_in_the_shader() {
        let source = shader!("math", "perturb", "view", "probe", "gather");
        check!(source, Perturb as "PerturbParams" { order, exact_plane, second_order_limit, min_focus, newton });
        check!(source, Params as "Params" {
            eye, width, perturb, height, anchors, levels, bilinear, material_penalty, falloff, albedo_ratio,
            roughness_penalty, search
        });
    }
}
