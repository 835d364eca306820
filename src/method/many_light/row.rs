//! Many lights in the table of methods.

use super::adaptive::{Filled, Sampler};
use super::arrival::Received;
use super::bounce::{Structure, light, sites};
use super::gather::Gather;
use super::params::ManyLightParams;
use super::points::{Places, place};
use super::shade::{Light, Shading};
use crate::Result;
use crate::base::clock::Clock;
use crate::base::math::{Rgb, hash_words};
use crate::base::named::{apply, tree};
use crate::base::progress::Progress;
use crate::material::bsdf::{Lobes, Query};
use crate::method::{Frame, Method, Options, Reads, Renderer, Setup, as_given};
use crate::view::View;
use crate::view::baseline::Baseline;
use crate::view::denoise::{DenoiseParams, GUIDE_SAMPLES, denoise, guides};
use crate::view::direct::direct;
use crate::view::gbuffer::{GBuffer, GLOSSY};
use serde_json::Value as Json;

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
    parameters,
    for_scene: as_given,
    cpu,
    gpu: None,
    diffuse: None,
};

/// Branch of a pixel's random stream: direct light of the glossy layer.
const GLOSSY_BRANCH: u32 = 1;

fn parameters(options: &Options) -> Result<Json> {
    let base = ManyLightParams::default();
    let supersample = options.supersample.unwrap_or(base.supersample);
    let base = ManyLightParams { supersample, denoise: options.denoise.then(DenoiseParams::default), ..base };
    tree(&apply(&base, &options.set)?)
}

/// Figures of a frame.
type Counts = Vec<(&'static str, f64)>;

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
}

fn cpu<'a>(setup: &Setup<'a>) -> Result<Box<dyn Renderer + 'a>> {
    let params: ManyLightParams = setup.parameters()?;
    let first = setup.animation.map(|animation| setup.world.at(animation, 0));
    let places = place(first.as_ref().unwrap_or(setup.world), params.vpls, params.repulsion, setup.seed);
    Ok(Box::new(OnCpu { setup: *setup, params, places, structure: None }))
}

impl OnCpu<'_> {
    /// The layers that this method computes, and what came of it.
    fn layers(&self, shading: &Shading, view: &GBuffer, frame: u32, clock: &mut Clock) -> ([Vec<Rgb>; 2], Counts) {
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
        let gather: Gather = light(world, (&sites, &structure), &params, setup.seed, &mut clock);
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
        let mut layers = baseline.both_layers(&g, &diffuse, &glossy, &mut clock);
        if let Some(of) = &params.denoise {
            let guides = guides(world, &view.camera, of, GUIDE_SAMPLES, setup.seed, view.frame);
            layers = denoise(&layers, &guides, view.camera.size[0] as usize, of);
            clock.lap("denoise");
        }
        self.structure = Some(structure);
        progress.advance(view.camera.size[1].into());
        Ok(Frame { counts, ..Frame::of(layers, clock.laps) })
    }
}

/// Shading points, the nodes that were visited a point, and pixels whose lobes rays follow.
fn counts(filled: &Filled<Sample>, mirrors: usize) -> Counts {
    let visited = || filled.values.iter().zip(&filled.sampled).filter(|(_, sampled)| **sampled).map(|(s, _)| s.visited);
    let points = visited().count();
    let mean = visited().map(f64::from).sum::<f64>() / points.max(1) as f64;
    vec![
        ("shading points", points as f64),
        ("least nodes", visited().min().unwrap_or(0).into()),
        ("most nodes", visited().max().unwrap_or(0).into()),
        ("mean nodes", mean),
        ("mirror pixels", mirrors as f64),
    ]
}
