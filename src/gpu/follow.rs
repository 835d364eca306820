//! Samples of paths that begin at given points: the twin of [`crate::transport::path`]'s entry points.

use super::kernel::Kernel;
use super::pace::Pace;
use super::scene::{GpuScene, MATERIALS, PATHS, RAYS};
use crate::Result;
use crate::math::Rgb;
use crate::transport::bsdf::{Lobes, Query};
use crate::transport::path::PathParams;
use bytemuck::{Pod, Zeroable};
use glam::Vec3;
use std::ops::Range;
use std::sync::Arc;

pub(super) const WORKGROUP: usize = 64;

/// Most starts a dispatch: WebGPU's most workgroups along a line.
pub(super) const MOST_STARTS: usize = 65_535 * WORKGROUP;

/// `PathStart` of start.wgsl.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub struct PathStart {
    /// Triangle.
    pub triangle: u32,
    /// Barycentric weights of its second and third vertex.
    pub barycentric: [f32; 2],
    /// Random stream.
    pub stream: u32,
    /// Unit direction towards the viewer, world.
    pub wo: [f32; 3],
    /// Number of the first sample.
    pub index: u32,
}

/// What paths are followed for.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum Purpose {
    /// A half of the first vertex, or with a scale of 1 and all lobes the whole.
    Scattering(Query),
    /// Light for a light map. The x of a start's `wo` says on which side of the normal.
    Irradiance,
}

/// `Params` of follow.wgsl.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct Params {
    max_depth: u32,
    rr_depth: u32,
    lobes: u32,
    roughness_scale: f32,
    split: u32,
    starts: u32,
    first_sample: u32,
    samples: u32,
    branch: u32,
    first_set: u32,
}

/// Sums over a start's samples.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
pub struct SampleSum {
    /// Of radiance.
    pub color: [f32; 3],
    /// Of the squares of its luminance.
    pub squares: f32,
}

impl SampleSum {
    /// The sum of radiance.
    pub fn color(&self) -> Rgb {
        Vec3::from_array(self.color)
    }
}

/// Where in its random stream a path begins.
#[derive(Clone, Copy)]
pub(super) struct Place {
    /// A branch of the stream.
    pub branch: Option<u32>,
    /// Sets of dimensions drawn before.
    pub first_set: u32,
}

/// Follows paths through a scene.
#[derive(Clone)]
pub(super) struct Follow {
    scene: Arc<GpuScene>,
    kernel: Kernel,
    params: Params,
}

impl Follow {
    /// Compiles it. Where the scene has a light map, paths read diffuse light from it.
    pub fn new(scene: Arc<GpuScene>, path: &PathParams, purpose: Purpose, place: Place) -> Result<Self> {
        let own = [include_str!("../../shaders/start.wgsl"), include_str!("../../shaders/follow.wgsl")];
        let source = [RAYS, MATERIALS, PATHS, own[0], own[1]].concat();
        let constants = [
            ("IRRADIANCE", f64::from(u8::from(purpose == Purpose::Irradiance))),
            ("HAS_LIGHTMAP", f64::from(u8::from(scene.has_lightmap()))),
        ];
        let kernel = Kernel::in_scene(&scene, &source, "follow", [2, 1], &constants)?;
        let query = match purpose {
            Purpose::Scattering(query) => query,
            Purpose::Irradiance => Query::default(),
        };
        let params = Params {
            max_depth: path.max_depth,
            rr_depth: path.rr_depth,
            lobes: u32::from(query.lobes.bits()),
            roughness_scale: query.roughness_scale,
            split: u32::from(query.lobes != Lobes::ALL || purpose == Purpose::Irradiance),
            starts: 0,
            first_sample: 0,
            samples: 0,
            branch: place.branch.unwrap_or(u32::MAX),
            first_set: place.first_set,
        };
        Ok(Self { scene, kernel, params })
    }

    /// The same for half of the first vertex, without compiling it again.
    pub fn half(&self, lobes: Lobes, place: Place) -> Self {
        let place = (place.branch.unwrap_or(u32::MAX), place.first_set);
        let params = Params { lobes: u32::from(lobes.bits()), branch: place.0, first_set: place.1, split: 1, ..self.params };
        Self { params, ..self.clone() }
    }

    /// Adds these samples of the first `count` of `starts` to `sums`, in one dispatch.
    pub fn dispatch(&self, starts: &wgpu::Buffer, sums: &wgpu::Buffer, count: usize, samples: Range<u32>) -> Result<()> {
        let gpu = &self.scene.gpu;
        let params =
            Params { starts: count as u32, first_sample: samples.start, samples: samples.end - samples.start, ..self.params };
        let params = gpu.upload("parameters of paths", bytemuck::bytes_of(&params))?;
        gpu.dispatch(&self.kernel, &[&params, starts, sums], [count.div_ceil(WORKGROUP) as u32, 1])
    }

    /// Sums over these samples of every start, in dispatches of a length that `pace` has learnt. `done` hears of the samples of each.
    pub fn sums(
        &self,
        starts: &[PathStart],
        samples: Range<u32>,
        pace: &mut Pace,
        done: &dyn Fn(usize),
    ) -> Result<Vec<SampleSum>> {
        let gpu = &self.scene.gpu;
        let mut all = Vec::with_capacity(starts.len());
        let mut rest = starts;
        while !rest.is_empty() {
            let (now, later) = rest.split_at(rest.len().min(pace.pieces()).min(MOST_STARTS));
            let uploaded = gpu.upload("starts of paths", bytemuck::cast_slice(now))?;
            let sums = gpu.output("sums over paths", size_of_val(now) as u64 / 2)?;
            let mut next = samples.start;
            while next < samples.end {
                let count = ((pace.pieces() / now.len()).max(1) as u32).min(samples.end - next);
                let pieces = now.len() * count as usize;
                pace.run(pieces, || self.dispatch(&uploaded, &sums, now.len(), next..next + count))?;
                next += count;
                done(pieces);
            }
            all.extend(gpu.read::<SampleSum>(&sums)?);
            rest = later;
        }
        Ok(all)
    }
}
