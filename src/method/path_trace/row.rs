//! Path tracing in the table of methods.

use super::denoise_gpu::Denoiser as OnDevice;
use super::gpu::PathTracer;
use super::{PathTraceParams, path_trace, path_trace_full};
use crate::base::clock::Clock;
use crate::base::named::{Parameters, apply, tree, within};
use crate::base::progress::Progress;
use crate::gpu::{Gpu, GpuScene};
use crate::method::{FilterChoice, ForScene, Frame, LayerChoice, Method, Options, Picture, Reads, Renderer, Samples, Setup};
use crate::scene::Scene;
use crate::scene::film::Filter;
use crate::transport::path::PathParams;
use crate::view::View;
use crate::view::denoise::DenoiseParams;
use crate::view::denoiser::Denoiser;
use crate::{Error, Result};
use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::sync::Arc;

/// The row.
pub const METHOD: Method = Method {
    name: "path-trace",
    about: "The reference: path tracing",
    reads: Reads::NOTHING,
    layers: &["emission", "diffuse", "glossy"],
    options: &["spp", "max-depth", "denoise", "layers", "rfilter", "lights", "budget-ms", "match-time", "set"],
    samples: Some(Samples { option: "spp", pointer: "/path_trace/spp" }),
    transmissive: true,
    orthographic: true,
    sequential: false,
    variants: &[("path-trace-filter", "--spp=4,--denoise=filter"), ("path-trace-oidn", "--spp=4,--denoise=oidn")],
    parameters,
    for_scene,
    cpu,
    gpu: Some(gpu),
    diffuse: None,
};

/// All parameters.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Params {
    path_trace: PathTraceParams,
    layers: LayerChoice,
    /// Most vertices, where the options say so; the scene does otherwise.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    max_depth: Option<u32>,
    /// Reconstruction filter, until the scene is known.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    rfilter: Option<FilterChoice>,
    /// `None` for none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    denoise: Option<Denoiser>,
}

fn parameters(options: &Options) -> Result<Value> {
    let (own, of_denoiser): (Vec<_>, Vec<_>) = options.set.iter().cloned().partition(|set| set.starts_with("efficiency="));
    if options.denoise.is_none() && !of_denoiser.is_empty() {
        let why = "--set: of path-trace, efficiency and the denoiser's parameters can be set; give --denoise for the latter";
        return Err(Error::Request(why.into()));
    }
    if options.denoise.is_some() && options.layers == Some(LayerChoice::Full) {
        return Err(Error::Request("--denoise works layer by layer: leave --layers full out".into()));
    }
    let base = PathTraceParams::default();
    let path_trace = apply(&PathTraceParams { spp: options.spp.unwrap_or(base.spp), ..base }, &own)?;
    let denoise = options.denoise.map(|wanted| Denoiser::choose(wanted, &of_denoiser)).transpose()?;
    let Options { layers, max_depth, rfilter, .. } = *options;
    tree(&Params { path_trace, layers: layers.unwrap_or_default(), max_depth, rfilter, denoise })
}

/// Depth, roulette and filter: the options', or else the scene's; a box where nobody has chosen.
fn for_scene(parameters: Value, scene: &Scene) -> Result<ForScene> {
    let mut params: Params = serde_json::from_value(parameters).map_err(|e| Error::Request(e.to_string()))?;
    let path = PathParams::of(scene);
    params.path_trace.path = PathParams { max_depth: params.max_depth.take().unwrap_or(path.max_depth), ..path };
    let film = &scene.film_filter;
    let mut warnings = Vec::new();
    params.path_trace.filter = match (params.rfilter.take(), &film.named) {
        (Some(FilterChoice::Scene), _) => film.filter,
        (None, Some(named)) if film.filter != Filter::Box => {
            warnings.push(format!("the film's filter, {named}, is not used, but a box: see --rfilter"));
            Filter::Box
        }
        _ => Filter::Box,
    };
    Ok((tree(&params)?, warnings))
}

impl Parameters for PathTraceParams {
    fn validate(&self) -> Result<()> {
        within("--spp", self.spp, 1..=1 << 24)
    }
}

/// An error for a scene without light.
fn check_lit(setup: &Setup) -> Result<()> {
    let scene = &setup.world.scene;
    if scene.emitters.is_empty() && setup.animation.is_none() {
        return Err(Error::input(&scene.path, "has no emitter; every frame would be black"));
    }
    Ok(())
}

struct OnCpu<'a> {
    setup: Setup<'a>,
    params: Params,
}

fn cpu<'a>(setup: &Setup<'a>) -> Result<Box<dyn Renderer + 'a>> {
    check_lit(setup)?;
    Ok(Box::new(OnCpu { setup: *setup, params: setup.parameters()? }))
}

impl Renderer for OnCpu<'_> {
    fn frame(&mut self, view: &View, _: Option<&View>, spp: u32, progress: &dyn Progress) -> Result<Frame> {
        let (View { frame, camera }, seed) = (view, self.setup.seed);
        let params = PathTraceParams { spp, ..self.params.path_trace };
        let mut clock = Clock::start();
        let of_frame = self.setup.world_at(view);
        if of_frame.is_some() {
            clock.lap("world");
        }
        let world = of_frame.as_ref().unwrap_or(self.setup.world);
        if self.params.layers == LayerChoice::Full {
            let full = path_trace_full(world, camera, &params, seed, *frame, progress);
            clock.lap("path_trace");
            return Ok(Frame {
                picture: Picture::Full(full),
                passes: clock.laps,
                unserved: None,
                counts: Vec::new(),
                inspected: None,
            });
        }
        let mut layers = path_trace(world, camera, &params, seed, *frame, progress);
        clock.lap("path_trace");
        if let Some(d) = &self.params.denoise {
            let guides = d.guides(world, camera, spp, [seed, *frame]);
            clock.lap("guides");
            layers = d.denoise(&layers, &guides, camera.size[0] as usize)?;
            clock.lap("denoise");
        }
        Ok(Frame::of(layers, clock.laps))
    }
}

struct OnGpu<'a> {
    setup: Setup<'a>,
    tracer: PathTracer,
    denoiser: Option<(Denoiser, OnDevice)>,
    layers: LayerChoice,
}

fn gpu<'a>(gpu: Arc<Gpu>, setup: &Setup<'a>) -> Result<Box<dyn Renderer + 'a>> {
    check_lit(setup)?;
    let Params { path_trace, layers, denoise, .. } = setup.parameters()?;
    if path_trace.filter != Filter::Box {
        return Err(Error::Request("the GPU's path tracer has a box filter alone; use --device cpu".into()));
    }
    let scene = Arc::new(GpuScene::new(gpu, setup.world)?);
    let on_device = |d: Denoiser| {
        let params = match d {
            Denoiser::Filter(params) => params,
            // Of the network, the device has the guides alone.
            Denoiser::Oidn { params, .. } => DenoiseParams { mirror_alpha: params.mirror_alpha, ..DenoiseParams::default() },
        };
        Ok::<_, Error>((d, OnDevice::new(scene.clone(), &params)?))
    };
    let denoiser = denoise.map(on_device).transpose()?;
    let tracer = PathTracer::new(scene, &path_trace.path, layers == LayerChoice::All)?;
    let mut frames = OnGpu { setup: *setup, tracer, denoiser, layers };
    // What the GPU lacks shows in any frame.
    if let Some(view) = setup.views.first() {
        frames.relight(view)?;
    }
    Ok(Box::new(frames))
}

impl OnGpu<'_> {
    /// Takes the frame's world; whether that is another one than the scene's.
    fn relight(&mut self, view: &View) -> Result<bool> {
        let Some(world) = self.setup.world_at(view) else { return Ok(false) };
        let scene = self.tracer.relight(&world)?;
        if let Some((_, denoiser)) = &mut self.denoiser {
            denoiser.rebind(scene);
        }
        Ok(true)
    }
}

impl Renderer for OnGpu<'_> {
    fn frame(&mut self, view: &View, _: Option<&View>, spp: u32, progress: &dyn Progress) -> Result<Frame> {
        let (View { frame, camera }, seed) = (view, self.setup.seed);
        let mut clock = Clock::start();
        if self.relight(view)? {
            clock.lap("world");
        }
        if self.layers == LayerChoice::Full {
            let full = self.tracer.full(camera, spp, seed, *frame, progress)?;
            clock.lap("path_trace");
            return Ok(Frame {
                picture: Picture::Full(full),
                passes: clock.laps,
                unserved: None,
                counts: Vec::new(),
                inspected: None,
            });
        }
        let mut layers = self.tracer.layers(camera, spp, seed, *frame, progress)?;
        clock.lap("path_trace");
        if let Some((d, device)) = &self.denoiser {
            let guides = device.guides(camera, d.guide_samples(spp), seed, *frame)?;
            clock.lap("guides");
            layers = match d {
                Denoiser::Filter(_) => device.denoise(&layers, &guides)?,
                Denoiser::Oidn { .. } => d.denoise(&layers, &device.read(&guides)?, camera.size[0] as usize)?,
            };
            clock.lap("denoise");
        }
        Ok(Frame::of(layers, clock.laps))
    }

    /// Its passes are as long as their pace says, so that the host times them.
    fn gpu(&self) -> Option<(&str, bool)> {
        Some((self.tracer.device(), false))
    }
}
