//! Many lights in the table of methods.

use super::adaptive::{Filled, Sampler};
use super::arrival::Received;
use super::bounce::{Structure, light, sites};
use super::gather::Gather;
use super::gpu::ManyLightOnGpu;
use super::params::ManyLightParams;
use super::points::{Places, place};
use super::shade::{Light, Shading};
use super::tally::Tally;
use crate::Result;
use crate::base::clock::Clock;
use crate::base::math::{Rgb, hash_words};
use crate::base::named::{apply, tree};
use crate::base::progress::Progress;
use crate::gpu::Gpu;
use crate::material::bsdf::{Lobes, Query};
use crate::method::{Frame, Method, Options, Reads, Renderer, Setup, as_given};
use crate::transport::World;
use crate::view::View;
use crate::view::baseline::Baseline;
use crate::view::denoise::GUIDE_SAMPLES;
use crate::view::denoiser::Denoiser;
use crate::view::direct::{GLOSSY_BRANCH, direct};
use crate::view::gbuffer::{GBuffer, GLOSSY};
use crate::view::layers::LayerImages;
use serde_json::Value as Json;
use std::sync::Arc;

/// The row.
pub const METHOD: Method = Method {
    name: "many-light",
    about: "Virtual point lights with filtered lobes (Maletz 2009), mirrors by rays: glossy light without a bake",
    reads: Reads::NOTHING,
    layers: &["diffuse", "glossy"],
    options: &["supersample", "denoise", "lights", "set"],
    samples: None,
    transmissive: false,
    orthographic: true,
    sequential: false,
    variants: &[],
    parameters,
    for_scene: as_given,
    cpu,
    gpu: Some(gpu),
    diffuse: None,
};

fn parameters(options: &Options) -> Result<Json> {
    let base = ManyLightParams::default();
    let supersample = options.supersample.unwrap_or(base.supersample);
    let denoise = options.denoise.map(|wanted| Denoiser::choose(wanted, &[])).transpose()?;
    let base = ManyLightParams { supersample, denoise, ..base };
    tree(&apply(&base, &options.set)?)
}

/// What a pixel has, and how many nodes were visited for it.
#[derive(Debug, Clone, Copy, Default)]
struct Sample {
    light: Light,
    visited: u32,
}

impl Received for Sample {
    fn add(&mut self, other: &Self, scale: f32) {
        self.light.add(&other.light, scale);
    }

    fn weight(&self) -> f32 {
        self.light.weight()
    }
}

struct OnCpu<'a> {
    setup: Setup<'a>,
    params: ManyLightParams,
    places: Places,
    /// The tree, where no light moves.
    structure: Option<Structure>,
    /// Its light, where nothing changes.
    gather: Option<Gather>,
}

/// The world of an animation's first frame, and where lights lie in it or, where nothing moves, in the scene's.
fn placed(setup: &Setup, params: &ManyLightParams) -> (Option<World>, Places) {
    let first = setup.animation.map(|animation| setup.world.at(animation, 0));
    let places = place(first.as_ref().unwrap_or(setup.world), params.vpls, params.repulsion, setup.seed);
    (first, places)
}

fn cpu<'a>(setup: &Setup<'a>) -> Result<Box<dyn Renderer + 'a>> {
    let params: ManyLightParams = setup.parameters()?;
    let places = placed(setup, &params).1;
    Ok(Box::new(OnCpu { setup: *setup, params, places, structure: None, gather: None }))
}

impl OnCpu<'_> {
    /// The layers that this method computes, and what came of it.
    fn layers(&self, shading: &Shading, view: &GBuffer, frame: u32, clock: &mut Clock) -> ([Vec<Rgb>; 2], Tally) {
        let world = shading.world;
        let (lower, upper) = world.scene.geometry.bounds();
        let sample = |i: usize, p: &_| {
            let (light, visited) = shading.light(i, p);
            Sample { light, visited }
        };
        let sampler = Sampler { view, params: &self.params, diagonal: lower.distance(upper), sample: &sample };
        let filled = sampler.fill();
        clock.lap("gather");
        let lights: Vec<Light> = filled.values.iter().map(|s| s.light).collect();
        let [mut diffuse, mut glossy] = shading.layers(view, &lights);
        let (followed, mirrors) = shading.followed(view);
        glossy.iter_mut().zip(followed).for_each(|(sum, c)| *sum += c);
        clock.lap("mirrors");
        let (seed, count) = (self.setup.seed, self.params.direct_samples);
        let lambert = Query { lobes: Lobes::DIFFUSE, ..Query::default() };
        let straight = view.shade([seed, frame], |p, stream| direct(world, p, lambert, count, stream));
        diffuse.iter_mut().zip(straight).for_each(|(sum, c)| *sum += c);
        let straight = view.shade([seed, frame], |p, stream| match p.alpha {
            Some(_) => direct(world, p, GLOSSY, count, hash_words(&[stream, GLOSSY_BRANCH])),
            None => Rgb::ZERO,
        });
        glossy.iter_mut().zip(straight).for_each(|(sum, c)| *sum += c);
        clock.lap("direct");
        ([diffuse, glossy], counts(&filled, mirrors))
    }
}

impl Renderer for OnCpu<'_> {
    fn frame(&mut self, view: &View, _: Option<&View>, _: u32, progress: &dyn Progress) -> Result<Frame> {
        let (mut clock, setup, params) = (Clock::start(), self.setup, self.params);
        let of_frame = setup.world_at(view);
        if of_frame.is_some() {
            clock.lap("world");
        }
        let world = of_frame.as_ref().unwrap_or(setup.world);
        let sites = sites(world, &self.places, &params);
        // Shapes of the scene stay where they are; those that an animation adds may move.
        let structure = match self.structure.take() {
            Some(kept) if !world.has_added() => kept,
            _ => Structure::new(&sites, &params, setup.seed),
        };
        clock.lap("tree");
        let gather = match self.gather.take() {
            Some(kept) if of_frame.is_none() => kept,
            _ => light(world, (&sites, &structure), &params, setup.seed, &mut clock),
        };
        let baseline = Baseline::new(world, None, params.supersample);
        let g = baseline.gbuffer(&view.camera, &mut clock);
        let shading = Shading {
            world,
            sites: &sites,
            structure: &structure,
            gather: &gather,
            params: &params,
            seeds: [setup.seed, view.frame],
        };
        let ([diffuse, glossy], counts) = self.layers(&shading, &g, view.frame, &mut clock);
        let layers = baseline.both_layers(&g, &diffuse, &glossy, &mut clock);
        let layers = finished(layers, world, view, (&params, setup.seed), &mut clock)?;
        (self.structure, self.gather) = (Some(structure), Some(gather));
        progress.advance(view.camera.size[1].into());
        Ok(Frame { counts: counts.listed(), ..Frame::of(layers, clock.laps) })
    }
}

/// Layers after the last pass, on the CPU whichever device has made them: denoised, where that is asked for.
fn finished(
    layers: LayerImages,
    world: &World,
    view: &View,
    (params, seed): (&ManyLightParams, u32),
    clock: &mut Clock,
) -> Result<LayerImages> {
    let Some(denoiser) = &params.denoise else { return Ok(layers) };
    let guides = denoiser.guides(world, &view.camera, GUIDE_SAMPLES, [seed, view.frame]);
    clock.lap("guides");
    let layers = denoiser.denoise(&layers, &guides, view.camera.size[0] as usize)?;
    clock.lap("denoise");
    Ok(layers)
}

/// Shading points, the nodes that were visited a point, and pixels whose lobes rays follow.
fn counts(filled: &Filled<Sample>, mirrors: usize) -> Tally {
    let visited =
        || filled.values.iter().zip(&filled.sampled).filter(|(_, sampled)| **sampled).map(|(s, _)| u64::from(s.visited));
    let ends = [visited().min(), visited().max()].map(Option::unwrap_or_default);
    Tally { points: visited().count() as u32, nodes: [ends[0], ends[1], visited().sum()], mirrors: mirrors as u32 }
}

struct OnGpu<'a> {
    setup: Setup<'a>,
    params: ManyLightParams,
    places: Places,
    lights: ManyLightOnGpu,
}

fn gpu<'a>(gpu: Arc<Gpu>, setup: &Setup<'a>) -> Result<Box<dyn Renderer + 'a>> {
    let params: ManyLightParams = setup.parameters()?;
    let (first, places) = placed(setup, &params);
    let world = first.as_ref().unwrap_or(setup.world);
    let sites = sites(world, &places, &params);
    let structure = Structure::new(&sites, &params, setup.seed);
    let mut lights = ManyLightOnGpu::new(gpu, setup.world, (&sites, &structure), &params)?;
    // What the GPU lacks shows in any frame.
    if let Some(world) = &first {
        lights.relight(world, None)?;
    }
    Ok(Box::new(OnGpu { setup: *setup, params, places, lights }))
}

impl OnGpu<'_> {
    /// Takes a frame's world, and its lights where shapes that carry them move.
    fn relight(&mut self, world: &World) -> Result<()> {
        if !world.has_added() {
            return self.lights.relight(world, None);
        }
        let sites = sites(world, &self.places, &self.params);
        let structure = Structure::new(&sites, &self.params, self.setup.seed);
        self.lights.relight(world, Some((&sites, &structure)))
    }
}

impl Renderer for OnGpu<'_> {
    fn frame(&mut self, view: &View, _: Option<&View>, _: u32, progress: &dyn Progress) -> Result<Frame> {
        let mut clock = Clock::start();
        let of_frame = self.setup.world_at(view);
        if let Some(world) = &of_frame {
            self.relight(world)?;
            clock.lap("world");
        }
        let world = of_frame.as_ref().unwrap_or(self.setup.world);
        let (frame, tally) = self.lights.frame(&view.camera, [self.setup.seed, view.frame])?;
        clock.laps.extend(frame.passes);
        clock.restart();
        let layers = finished(frame.layers, world, view, (&self.params, self.setup.seed), &mut clock)?;
        progress.advance(view.camera.size[1].into());
        Ok(Frame { counts: tally.listed(), ..Frame::of(layers, clock.laps) })
    }

    fn gpu(&self) -> Option<(&str, bool)> {
        Some((self.lights.device(), self.lights.has_clock()))
    }

    fn probe_bytes(&self) -> [u64; 2] {
        [0, self.lights.bytes()]
    }
}
