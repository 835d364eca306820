//! Samples of paths that begin at given points: the twin of [`crate::transport::path`]'s entry points.

use super::commands::Commands;
use super::kernel::Kernel;
use super::pace::Pace;
use super::scene::GpuScene;
use super::spec::{Access, KernelSpec, StructLayout, layout};
use crate::Result;
use crate::base::math::Rgb;
use crate::material::bsdf::{Lobes, Query};
use crate::transport::follow::PathStart;
use crate::transport::path::PathParams;
use bytemuck::{Pod, Zeroable};
use glam::Vec3;
use std::sync::Arc;

/// What paths are followed for.
#[derive(Clone, Copy, PartialEq)]
pub(crate) enum Purpose {
    /// A half of the first vertex, or with a scale of 1 and all lobes the whole.
    Scattering(Query),
    /// The same by rays that follow the lobes alone: no emitter is sampled, and the last vertex sends none.
    Rays(Query),
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
    skipped: u32,
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
    fn add(&mut self, more: &Self) {
        self.color = (self.color() + more.color()).to_array();
        self.squares += more.squares;
    }

    /// The sum of radiance.
    pub fn color(&self) -> Rgb {
        Vec3::from_array(self.color)
    }
}

/// Where in its random stream a path begins.
#[derive(Clone, Copy)]
pub(crate) struct Place {
    /// A branch of the stream.
    pub branch: Option<u32>,
    /// Sets of dimensions drawn before.
    pub first_set: u32,
}

/// The kernel.
pub(crate) const FOLLOW: KernelSpec = KernelSpec {
    file: "shared/follow.wgsl",
    twin: "src/transport/path.rs: scattered",
    workgroup: [64, 1],
    scene: true,
    bindings: &[("params", Access::Uniform), ("starts", Access::Read), ("sums", Access::ReadWrite)],
    structs: &[&PARAMS, &PATH_START],
};
const PARAMS: StructLayout = layout!(Params as "Params" {
    max_depth, rr_depth, lobes, roughness_scale, split, starts, skipped, samples, branch, first_set
});
pub(crate) const PATH_START: StructLayout = layout!(PathStart as "PathStart" { triangle, u, v, stream, wo, first, end });

/// Follows paths through a scene.
#[derive(Clone)]
pub(crate) struct Samples {
    scene: Arc<GpuScene>,
    kernel: Kernel,
    params: Params,
}

impl Samples {
    /// Compiles it. Where the scene has a light map, paths read diffuse light from it.
    pub fn new(scene: Arc<GpuScene>, path: &PathParams, purpose: Purpose, place: Place) -> Result<Self> {
        let constants = [
            ("IRRADIANCE", f64::from(u8::from(purpose == Purpose::Irradiance))),
            ("NEXT_EVENT", f64::from(u8::from(!matches!(purpose, Purpose::Rays(_))))),
            ("HAS_LIGHTMAP", f64::from(u8::from(scene.has_lightmap()))),
        ];
        let kernel = Kernel::in_scene(&scene, &FOLLOW, &constants)?;
        let query = match purpose {
            Purpose::Scattering(query) | Purpose::Rays(query) => query,
            Purpose::Irradiance => Query::default(),
        };
        let params = Params {
            max_depth: path.max_depth,
            rr_depth: path.rr_depth,
            lobes: u32::from(query.lobes.bits()),
            roughness_scale: query.roughness_scale,
            split: u32::from(query.lobes != Lobes::ALL || purpose == Purpose::Irradiance),
            starts: 0,
            skipped: 0,
            samples: 0,
            branch: place.branch.unwrap_or(u32::MAX),
            first_set: place.first_set,
        };
        Ok(Self { scene, kernel, params })
    }

    /// Takes a frame of the scene.
    pub fn rebind(&mut self, scene: Arc<GpuScene>) {
        self.kernel.rebind(&scene);
        self.scene = scene;
    }

    /// The same for half of the first vertex, without compiling it again.
    pub fn half(&self, lobes: Lobes, place: Place) -> Self {
        let place = (place.branch.unwrap_or(u32::MAX), place.first_set);
        let params = Params { lobes: u32::from(lobes.bits()), branch: place.0, first_set: place.1, split: 1, ..self.params };
        Self { params, ..self.clone() }
    }

    /// Adds the samples of the first `count` of `starts` to `sums`, in one dispatch: of each those from `skipped` on, so many at the most.
    pub fn dispatch(&self, starts: &wgpu::Buffer, sums: &wgpu::Buffer, count: usize, [skipped, samples]: [u32; 2]) -> Result<()> {
        let params = self.part(count, [skipped, samples])?;
        self.scene.gpu.dispatch(&self.kernel, &[&params, starts, sums], [count as u32, 1])
    }

    /// The same among the runs of `commands`, as part of `pass`.
    pub fn run(
        &self,
        (commands, pass): (&mut Commands, &'static str),
        starts: &wgpu::Buffer,
        sums: &wgpu::Buffer,
        count: usize,
        samples: [u32; 2],
    ) -> Result<()> {
        let params = self.part(count, samples)?;
        commands.run(pass, &self.kernel, &[&params, starts, sums], [count as u32, 1]);
        Ok(())
    }

    /// The parameters of a dispatch.
    fn part(&self, count: usize, [skipped, samples]: [u32; 2]) -> Result<wgpu::Buffer> {
        let params = Params { starts: count as u32, skipped, samples, ..self.params };
        self.scene.gpu.uniform("parameters of paths", &params)
    }

    /// Sums over all samples of every start, in dispatches of a length that `pace` has learnt. `done` hears how many more paths are done.
    pub fn sums(&self, starts: &[PathStart], pace: &mut Pace, done: &(dyn Fn(usize) + Sync)) -> Result<Vec<SampleSum>> {
        let mut sums = vec![SampleSum::default(); starts.len()];
        let samples = |i: &usize| starts[*i].end.saturating_sub(starts[*i].first);
        let mut todo: Vec<usize> = (0..starts.len()).collect();
        let mut skipped = 0;
        loop {
            todo.retain(|i| samples(i) > skipped);
            let Some(most) = todo.iter().map(samples).max() else { return Ok(sums) };
            let least = todo.iter().map(samples).min().unwrap_or(most);
            // Where they differ, those that are done make room for the others again and again.
            let until = if least == most { most } else { (2 * skipped).max(least).min(most) };
            for part in todo.chunks(most_starts(&self.scene)) {
                self.round(starts, part, [skipped, until], pace, &mut sums, done)?;
            }
            skipped = until;
        }
    }

    /// The samples of a round from those starts that are left.
    fn round(
        &self,
        starts: &[PathStart],
        mut part: &[usize],
        [from, until]: [u32; 2],
        pace: &mut Pace,
        sums: &mut [SampleSum],
        done: &(dyn Fn(usize) + Sync),
    ) -> Result<()> {
        let gpu = &self.scene.gpu;
        while !part.is_empty() {
            let (now, later) = part.split_at(part.len().min(pace.pieces()));
            let list: Vec<PathStart> = now.iter().map(|&i| starts[i]).collect();
            let uploaded = gpu.upload("starts of paths", bytemuck::cast_slice(&list))?;
            let output = gpu.output("sums over paths", (now.len() * size_of::<SampleSum>()) as u64)?;
            let mut skipped = from;
            while skipped < until {
                let samples = ((pace.pieces() / now.len()).max(1) as u32).min(until - skipped);
                let paths = now.len() * samples as usize;
                pace.run(paths, || self.dispatch(&uploaded, &output, now.len(), [skipped, samples]))?;
                skipped += samples;
                done(paths);
            }
            for (&i, more) in now.iter().zip(gpu.read::<SampleSum>(&output)?) {
                sums[i].add(&more);
            }
            part = later;
        }
        Ok(())
    }
}

/// Most starts a dispatch: WebGPU's most workgroups along a line, and what a kernel can bind.
pub(crate) fn most_starts(scene: &GpuScene) -> usize {
    (65_535 * FOLLOW.workgroup[0] as usize).min(scene.gpu.adapter.max_binding as usize / size_of::<PathStart>())
}
