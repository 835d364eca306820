//! Radiance probes in the table of methods.

use super::gpu::RadianceProbesOnGpu;
use super::light::Lighting;
use super::lit::Lit;
use super::params::RadianceProbeParams;
use crate::base::clock::Clock;
use crate::base::named::{apply, tree};
use crate::base::progress::Progress;
use crate::gpu::Gpu;
use crate::method::diffuse::DiffuseLight;
use crate::method::{Frame, Method, Need, Options, Probes, Reads, Renderer, Setup, as_given};
use crate::view::View;
use crate::view::baseline::Baseline;
use crate::{Error, Result};
use serde_json::Value;
use std::sync::Arc;

/// The row.
pub const METHOD: Method = Method {
    name: "radiance-probes",
    about: "Sparse radiance probes: diffuse light under lights that move",
    reads: Reads { probes: Some(Probes { stage: "bake-transport", any_texel: false }), lightmap: Need::No, curvature: Need::No },
    layers: &["diffuse", "glossy"],
    options: &["probes", "supersample", "lights", "set"],
    samples: None,
    transmissive: false,
    orthographic: true,
    sequential: false,
    variants: &[],
    parameters,
    for_scene: as_given,
    cpu,
    gpu: Some(gpu),
    diffuse: Some(diffuse),
};

fn parameters(options: &Options) -> Result<Value> {
    let base = RadianceProbeParams::default();
    let base = RadianceProbeParams { supersample: options.supersample.unwrap_or(base.supersample), ..base };
    tree(&apply(&base, &options.set)?)
}

struct OnCpu<'a> {
    setup: Setup<'a>,
    lit: Lit<'a>,
}

fn cpu<'a>(setup: &Setup<'a>) -> Result<Box<dyn Renderer + 'a>> {
    let params: RadianceProbeParams = setup.parameters()?;
    Ok(Box::new(OnCpu { setup: *setup, lit: Lit::new(setup, params.gloss_samples > 0)? }))
}

fn diffuse<'a>(setup: &Setup<'a>) -> Result<Box<dyn DiffuseLight + 'a>> {
    Ok(Box::new(Lit::new(setup, true)?))
}

impl Renderer for OnCpu<'_> {
    fn frame(&mut self, view: &View, _: Option<&View>, _: u32, progress: &dyn Progress) -> Result<Frame> {
        let mut clock = Clock::start();
        let of_frame = self.setup.world_at(view);
        if of_frame.is_some() {
            clock.lap("world");
        }
        let world = of_frame.as_ref().unwrap_or(self.setup.world);
        self.lit.relight(view, world, &mut clock);
        let baseline = Baseline::new(world, None, self.lit.params.supersample);
        let g = baseline.gbuffer(&view.camera, &mut clock);
        let diffuse = self.lit.layer(world, &g);
        clock.lap("diffuse");
        let glossy = self.lit.shading(world).map_or_else(Vec::new, |shading| shading.glossy(&g));
        clock.lap("glossy");
        let layers = baseline.both_layers(&g, &diffuse, &glossy, &mut clock);
        progress.advance(view.camera.size[1].into());
        Ok(Frame::of(layers, clock.laps))
    }

    fn probe_bytes(&self) -> [u64; 2] {
        [self.lit.bytes() as u64, 0]
    }
}

struct OnGpu<'a> {
    setup: Setup<'a>,
    /// Where lights or colours change.
    lighting: Option<Lighting>,
    probes: RadianceProbesOnGpu,
    /// Whether light goes on from frame to frame.
    feedback: bool,
    /// The frame that was lit last.
    last: Option<u32>,
}

fn gpu<'a>(gpu: Arc<Gpu>, setup: &Setup<'a>) -> Result<Box<dyn Renderer + 'a>> {
    let lighting = Lighting::load(setup)?;
    let params: RadianceProbeParams = setup.parameters()?;
    if params.gloss_samples > 0 {
        return Err(Error::Request("the GPU's radiance probes have no gloss_samples; use --device cpu".into()));
    }
    let piece = gpu.adapter.max_binding;
    let mut probes = RadianceProbesOnGpu::new(gpu, setup.world, &lighting, &params, piece)?;
    // What the GPU lacks shows in any frame.
    if let Some(world) = setup.views.first().and_then(|view| setup.world_at(view)) {
        probes.relight(&world, &lighting)?;
    }
    let lighting = setup.animation.map(|_| lighting);
    Ok(Box::new(OnGpu { setup: *setup, lighting, probes, feedback: params.feedback, last: None }))
}

impl OnGpu<'_> {
    fn relight(&mut self, view: &View) -> Result<()> {
        match self.setup.world_at(view).zip(self.lighting.as_ref()) {
            Some((world, lighting)) => self.probes.relight(&world, lighting),
            None => Ok(()),
        }
    }
}

impl Renderer for OnGpu<'_> {
    fn frame(&mut self, view: &View, _: Option<&View>, _: u32, progress: &dyn Progress) -> Result<Frame> {
        let seed = self.setup.seed;
        if self.feedback {
            let first = self.last.filter(|&last| last < view.frame).map_or(0, |last| last + 1);
            for frame in first..view.frame {
                self.relight(&View { frame, camera: view.camera.clone() })?;
                self.probes.light(seed, frame > 0)?;
            }
        }
        self.last = Some(view.frame);
        let mut clock = Clock::start();
        self.relight(view)?;
        if self.lighting.is_some() {
            clock.lap("world");
        }
        let frame = self.probes.frame(&view.camera, [seed, view.frame], self.feedback && view.frame > 0)?;
        progress.advance(view.camera.size[1].into());
        Ok(Frame::of(frame.layers, [clock.laps, frame.passes].concat()))
    }

    fn gpu(&self) -> Option<(&str, bool)> {
        Some((self.probes.device(), self.probes.has_clock()))
    }

    fn probe_bytes(&self) -> [u64; 2] {
        let host = self.lighting.as_ref().map_or(0, |lighting| lighting.transport.bytes());
        [host as u64, self.probes.probe_bytes()]
    }
}
