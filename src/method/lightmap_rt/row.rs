//! Light map and rays in the table of methods.

use super::gpu::LightmapRt;
use super::{LightmapRtParams, lightmap_rt};
use crate::Result;
use crate::base::clock::Clock;
use crate::base::named::{apply, tree};
use crate::base::progress::Progress;
use crate::gpu::Gpu;
use crate::lightmap::LightMap;
use crate::method::{Frame, Method, Need, Options, Reads, Renderer, Samples, Setup, as_given};
use crate::transport::World;
use crate::view::View;
use crate::view::baseline::Baseline;
use crate::view::denoise::GUIDE_SAMPLES;
use crate::view::denoiser::Denoiser;
use crate::view::layers::LayerImages;
use serde_json::Value;
use std::sync::Arc;

/// The row.
pub const METHOD: Method = Method {
    name: "lightmap-rt",
    about: "Baseline: light map, and rays along the glossy lobes",
    reads: Reads { probes: None, lightmap: Need::Required, curvature: Need::No },
    layers: &["glossy"],
    options: &["lightmap", "supersample", "samples", "max-depth", "denoise", "budget-ms", "match-time", "set"],
    samples: Some(Samples { option: "samples", pointer: "/samples" }),
    transmissive: false,
    orthographic: false,
    sequential: false,
    variants: &[("lightmap-rt-oidn", "--samples=2,next_event=true,--denoise=oidn")],
    parameters,
    for_scene: as_given,
    cpu,
    gpu: Some(gpu),
    diffuse: None,
};

fn parameters(options: &Options) -> Result<Value> {
    let base = LightmapRtParams::default();
    let base = LightmapRtParams {
        supersample: options.supersample.unwrap_or(base.supersample),
        samples: options.samples.unwrap_or(base.samples),
        bounces: options.max_depth.unwrap_or(base.bounces),
        denoise: options.denoise.map(|wanted| Denoiser::choose(wanted, &[])).transpose()?,
        ..base
    };
    tree(&apply(&base, &options.set)?)
}

struct OnCpu<'a> {
    world: &'a World,
    lightmap: &'a LightMap,
    baseline: Baseline<'a>,
    params: LightmapRtParams,
    seed: u32,
}

fn cpu<'a>(setup: &Setup<'a>) -> Result<Box<dyn Renderer + 'a>> {
    let params: LightmapRtParams = setup.parameters()?;
    let lightmap = setup.required_lightmap()?;
    let baseline = Baseline::new(setup.world, Some(lightmap), params.supersample);
    Ok(Box::new(OnCpu { world: setup.world, lightmap, baseline, params, seed: setup.seed }))
}

impl Renderer for OnCpu<'_> {
    fn frame(&mut self, view: &View, _: Option<&View>, samples: u32, progress: &dyn Progress) -> Result<Frame> {
        let params = LightmapRtParams { samples, ..self.params };
        let mut clock = Clock::start();
        let g = self.baseline.gbuffer(&view.camera, &mut clock);
        let glossy = lightmap_rt(self.world, self.lightmap, &g, &params, self.seed, view.frame);
        clock.lap("rays");
        let layers = self.baseline.layers(&g, &glossy, &mut clock);
        let layers = finished(layers, self.world, view, (self.params.denoise, self.seed), &mut clock)?;
        progress.advance(view.camera.size[1].into());
        Ok(Frame::of(layers, clock.laps))
    }
}

/// Layers after the last pass, on the CPU whichever device has made them: the glossy one, the only one that rays make noisy, denoised where
/// that is asked for.
fn finished(
    layers: LayerImages,
    world: &World,
    view: &View,
    (denoise, seed): (Option<Denoiser>, u32),
    clock: &mut Clock,
) -> Result<LayerImages> {
    let Some(denoiser) = denoise else { return Ok(layers) };
    let [_, guides] = denoiser.guides(world, &view.camera, GUIDE_SAMPLES, [seed, view.frame]);
    clock.lap("guides");
    let [glossy] = denoiser.denoise_layers([&layers.glossy], &guides, view.camera.size[0] as usize)?;
    clock.lap("denoise");
    Ok(LayerImages { glossy, ..layers })
}

struct OnGpu<'a> {
    rays: LightmapRt,
    world: &'a World,
    denoise: Option<Denoiser>,
    seed: u32,
}

fn gpu<'a>(gpu: Arc<Gpu>, setup: &Setup<'a>) -> Result<Box<dyn Renderer + 'a>> {
    let params: LightmapRtParams = setup.parameters()?;
    let rays = LightmapRt::new(gpu, setup.world, setup.required_lightmap()?, &params)?;
    Ok(Box::new(OnGpu { rays, world: setup.world, denoise: params.denoise, seed: setup.seed }))
}

impl Renderer for OnGpu<'_> {
    fn frame(&mut self, view: &View, _: Option<&View>, samples: u32, progress: &dyn Progress) -> Result<Frame> {
        let frame = self.rays.frame(&view.camera, samples, self.seed, view.frame)?;
        let mut clock = Clock::start();
        clock.laps = frame.passes;
        let layers = finished(frame.layers, self.world, view, (self.denoise, self.seed), &mut clock)?;
        progress.advance(view.camera.size[1].into());
        Ok(Frame::of(layers, clock.laps))
    }

    /// Its passes are as long as their pace says, so that the host times them.
    fn gpu(&self) -> Option<(&str, bool)> {
        Some((self.rays.device(), false))
    }
}
