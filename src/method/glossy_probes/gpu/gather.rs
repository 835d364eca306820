//! The gather (§5.1, §5.2), a dispatch or two a probe: the twin of [`crate::method::glossy_probes::gather`].

use super::probes::GpuProbe;
use crate::gpu::Gpu;
use crate::gpu::commands::Commands;
use crate::gpu::kernel::{Kernel, area};
use crate::gpu::resident::{PLACE, Place};
use crate::gpu::spec::Access::{Read, ReadWrite, Uniform};
use crate::gpu::spec::{KernelSpec, StructLayout, layout};
use crate::gpu::view::{PIXEL, REFLECTED, SHADING, ViewBuffers};
use crate::method::glossy_probes::candidates::{Directions, Light, ReflectedTexel};
use crate::method::glossy_probes::gather_params::{BilinearRule, GatherParams, MAX_RADIUS, TILE};
use crate::method::glossy_probes::perturb::{Order, PerturbParams};
use crate::{Error, Result};
use bytemuck::{Pod, Zeroable};
use glam::Vec3;
use std::mem::offset_of;

/// Most levels of a search.
const LEVELS: usize = 8;
/// Orders of the perturbation, as the shader numbers them.
pub(crate) const PLANE: u32 = 0;
pub(crate) const FIRST: u32 = 1;
pub(crate) const SECOND: u32 = 2;
/// Rules of the fetch, likewise.
pub(crate) const NEAREST: u32 = 0;
pub(crate) const SAME_REFLECTOR: u32 = 1;
const SAME_REFLECTOR_AND_REFLECTED: u32 = 2;

/// What the shader's `PerturbParams` holds.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct Perturb {
    order: u32,
    exact_plane: u32,
    second_order_limit: f32,
    min_focus: f32,
    newton: u32,
    padding: [u32; 3],
}

impl Perturb {
    fn new(params: &PerturbParams) -> Self {
        let order = match params.order {
            Order::Plane => PLANE,
            Order::First => FIRST,
            Order::Second => SECOND,
        };
        let PerturbParams { second_order_limit, min_focus, newton, .. } = *params;
        Self { order, exact_plane: params.exact_plane.into(), second_order_limit, min_focus, newton, padding: [0; 3] }
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
    search: [[f32; 4]; LEVELS],
}

/// `Anchor` of search.wgsl: what the search leaves for an anchor.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct Anchor {
    texel: [f32; 2],
    end: [f32; 2],
    energy: f32,
    padding: [u32; 3],
}

/// `Gathered` of gathered.wgsl.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
pub(crate) struct GpuGathered {
    pub(crate) sum: [f32; 4],
    /// Energy and texel as bits, and the probe.
    pub(crate) best: [u32; 4],
}

/// The search of anchors.
pub(crate) const FIND_ANCHORS: KernelSpec = KernelSpec {
    file: "glossy_probes/find_anchors.wgsl",
    twin: "src/method/glossy_probes/search.rs: best_samples",
    workgroup: [8, 8],
    scene: false,
    bindings: &[
        ("gather_params", Uniform),
        ("probe_params", Uniform),
        ("view", Read),
        ("shading", Read),
        ("map", Read),
        ("seen", Read),
        ("directions", Read),
        ("anchors", ReadWrite),
    ],
    structs: &[&PARAMS, &PERTURB, &PLACE, &PIXEL, &REFLECTED, &SHADING, &SEEN, &DIRECTIONS, &ANCHOR],
};
/// The gather.
pub(crate) const GATHER: KernelSpec = KernelSpec {
    file: "glossy_probes/gather.wgsl",
    twin: "src/method/glossy_probes/gather.rs: gather",
    workgroup: [8, 8],
    scene: false,
    bindings: &[
        ("gather_params", Uniform),
        ("probe_params", Uniform),
        ("view", Read),
        ("shading", Read),
        ("map", Read),
        ("seen", Read),
        ("directions", Read),
        ("anchors", Read),
        ("light", Read),
        ("sums", ReadWrite),
    ],
    structs: &[&PARAMS, &PERTURB, &PLACE, &PIXEL, &REFLECTED, &SHADING, &SEEN, &DIRECTIONS, &ANCHOR, &LIGHT, &GATHERED],
};
const PERTURB: StructLayout = layout!(Perturb as "PerturbParams" { order, exact_plane, second_order_limit, min_focus, newton });
const PARAMS: StructLayout = layout!(Params as "Params" {
    eye, width, perturb, height, anchors, levels, bilinear, material_penalty, falloff, albedo_ratio, roughness_penalty, search
});
/// Two halves of a word are one member to the shader.
const SEEN: StructLayout = StructLayout {
    name: "ReflectedTexel",
    size: size_of::<ReflectedTexel>(),
    fields: &[
        ("reflected_point", offset_of!(ReflectedTexel, reflected_point)),
        ("materials", offset_of!(ReflectedTexel, reflected_material)),
    ],
};
const DIRECTIONS: StructLayout = layout!(Directions as "Directions" { normal, reflected, alpha });
const LIGHT: StructLayout = layout!(Light as "Light" { glossy, object, albedo, reflected_material });
const ANCHOR: StructLayout = layout!(Anchor as "Anchor" { texel, end, energy });
pub(crate) const GATHERED: StructLayout = layout!(GpuGathered as "Gathered" { sum, best });

impl Params {
    fn new(params: &GatherParams, eye: Vec3, size: [u32; 2]) -> Self {
        let mut search = [[0.0; 4]; LEVELS];
        for (level, to) in params.search.iter().zip(&mut search) {
            *to = [level.radius.min(MAX_RADIUS) as f32, level.step, 0.0, 0.0];
        }
        Self {
            eye: eye.to_array(),
            width: size[0],
            perturb: Perturb::new(&params.perturb),
            height: size[1],
            anchors: anchor_step(params),
            levels: params.search.len() as u32,
            bilinear: match params.bilinear {
                BilinearRule::Nearest => NEAREST,
                BilinearRule::SameReflector => SAME_REFLECTOR,
                BilinearRule::SameReflectorAndReflected => SAME_REFLECTOR_AND_REFLECTED,
            },
            material_penalty: params.material_penalty,
            roughness_penalty: params.roughness_penalty,
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
    /// A [`GpuGathered`] a pixel.
    pub(crate) sums: wgpu::Buffer,
    anchors: wgpu::Buffer,
}

impl Sums {
    /// Bytes a pixel, but for the anchors.
    pub(crate) const BYTES: u64 = size_of::<GpuGathered>() as u64;

    pub(crate) fn new(gpu: &Gpu, size: [u32; 2], params: &GatherParams) -> Result<Self> {
        let anchors = if anchor_step(params) > 1 { area(anchor_grid(size, params)) } else { 1 };
        Ok(Self {
            sums: gpu.output("gathered sums", Self::BYTES * area(size))?,
            anchors: gpu.output("anchors", size_of::<Anchor>() as u64 * anchors)?,
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
        Ok(Self { params: params.clone(), find_anchors: Kernel::new(gpu, &FIND_ANCHORS)?, gather: Kernel::new(gpu, &GATHER)? })
    }

    /// Adds what one probe has for a view, as `eye` sees it.
    pub(crate) fn run(
        &self,
        gpu: &Gpu,
        commands: &mut Commands,
        (view, eye): (&ViewBuffers, Vec3),
        (probe, place): (&GpuProbe, &Place),
        out: &Sums,
    ) -> Result<()> {
        let params = gpu.uniform("the gather's parameters", &Params::new(&self.params, eye, view.size))?;
        let place = gpu.uniform("a probe's place", place)?;
        let buffers = [
            &params,
            &place,
            &view.pixels,
            &view.shading,
            &probe.map,
            &probe.seen,
            &probe.directions,
            &out.anchors,
            &probe.light,
            &out.sums,
        ];
        if anchor_step(&self.params) > 1 {
            commands.run("gather", &self.find_anchors, &buffers[..8], anchor_grid(view.size, &self.params));
        }
        commands.run("gather", &self.gather, &buffers, view.size);
        Ok(())
    }
}
