//! Radiance probes in the table of methods.

use super::frame_map::FrameMap;
use super::gpu::RadianceProbesOnGpu;
use super::light::{Light, Lighting};
use super::operator::Transport;
use super::params::RadianceProbeParams;
use super::shade::{Indirect, Shading};
use super::transport::Kept;
use crate::base::clock::Clock;
use crate::base::math::Rgb;
use crate::base::named::{apply, tree};
use crate::base::progress::Progress;
use crate::gpu::Gpu;
use crate::method::{Frame, Method, Need, Options, Probes, Reads, Renderer, Setup, as_given};
use crate::transport::World;
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
    parameters,
    for_scene: as_given,
    cpu,
    gpu: Some(gpu),
};

fn parameters(options: &Options) -> Result<Value> {
    let base = RadianceProbeParams::default();
    let base = RadianceProbeParams { supersample: options.supersample.unwrap_or(base.supersample), ..base };
    tree(&apply(&base, &options.set)?)
}

struct OnCpu<'a> {
    setup: Setup<'a>,
    lighting: Lighting,
    map: FrameMap,
    params: RadianceProbeParams,
    /// The last frame that was lit, and its indirect light, where the next goes on from that.
    last: Option<(u32, Vec<Rgb>)>,
}

fn cpu<'a>(setup: &Setup<'a>) -> Result<Box<dyn Renderer + 'a>> {
    let lighting = lighting(setup)?;
    let map = FrameMap::new(&setup.world.scene.geometry, &lighting.transport);
    Ok(Box::new(OnCpu { setup: *setup, lighting, map, params: setup.parameters()?, last: None }))
}

impl OnCpu<'_> {
    /// The light of a frame; with feedback, that of all frames before it comes first, whichever of them are asked for.
    fn light(&mut self, view: &View, world: &World, clock: &mut Clock) -> Light {
        let seed = self.setup.seed;
        if !self.params.feedback {
            return self.lighting.light(world, &self.params, (None, seed), clock);
        }
        let (from, mut before) = match self.last.take() {
            Some((frame, light)) if frame < view.frame => (frame + 1, Some(light)),
            _ => (0, None),
        };
        for frame in from..view.frame {
            let earlier = View { frame, camera: view.camera.clone() };
            let of_frame = self.setup.world_at(&earlier);
            let world = of_frame.as_ref().unwrap_or(self.setup.world);
            before = Some(self.lighting.light(world, &self.params, (before, seed), &mut Clock::start()).indirect);
        }
        clock.restart();
        let light = self.lighting.light(world, &self.params, (before, seed), clock);
        self.last = Some((view.frame, light.indirect.clone()));
        light
    }
}

impl Renderer for OnCpu<'_> {
    fn frame(&mut self, view: &View, _: Option<&View>, _: u32, progress: &dyn Progress) -> Result<Frame> {
        let (mut clock, setup) = (Clock::start(), self.setup);
        let of_frame = setup.world_at(view);
        if of_frame.is_some() {
            clock.lap("world");
        }
        let world = of_frame.as_ref().unwrap_or(setup.world);
        let light = self.light(view, world, &mut clock);
        let indirect = Indirect::new(&self.map, self.lighting.transport.params.receiver, &light);
        let all = (self.params.gloss_samples > 0).then(|| self.map.lit(&self.lighting.total(&light)));
        clock.lap("light map");
        let baseline = Baseline::new(world, None, self.params.supersample);
        let g = baseline.gbuffer(&view.camera, &mut clock);
        let shading = Shading {
            world,
            indirect: &indirect,
            total: all.as_ref(),
            params: &self.params,
            seed: setup.seed,
            frame: view.frame,
        };
        let diffuse = shading.diffuse(&g);
        clock.lap("diffuse");
        let glossy = shading.glossy(&g);
        clock.lap("glossy");
        let layers = baseline.both_layers(&g, &diffuse, &glossy, &mut clock);
        progress.advance(view.camera.size[1].into());
        Ok(Frame::of(layers, clock.laps))
    }

    fn probe_bytes(&self) -> [u64; 2] {
        [self.lighting.transport.bytes() as u64, 0]
    }
}

struct OnGpu<'a> {
    setup: Setup<'a>,
    /// Where lights or colours change.
    lighting: Option<Lighting>,
    probes: RadianceProbesOnGpu,
}

/// The lighting of a setup's frames.
fn lighting(setup: &Setup) -> Result<Lighting> {
    let transport = Transport::load(&setup.required_probes()?, &setup.world.scene)?;
    Ok(Lighting::new(setup.world, transport, setup.animation))
}

fn gpu<'a>(gpu: Arc<Gpu>, setup: &Setup<'a>) -> Result<Box<dyn Renderer + 'a>> {
    let lighting = lighting(setup)?;
    if lighting.transport.params.receiver != Kept::Irradiance {
        let message =
            "the GPU's radiance probes have receivers of irradiance alone (bake-transport --receiver); use --device cpu";
        return Err(Error::Request(message.into()));
    }
    let params: RadianceProbeParams = setup.parameters()?;
    if params.gloss_samples > 0 || params.feedback {
        let message = "the GPU's radiance probes have neither gloss_samples nor feedback; use --device cpu";
        return Err(Error::Request(message.into()));
    }
    let piece = gpu.adapter.max_binding;
    let mut probes = RadianceProbesOnGpu::new(gpu, setup.world, &lighting, &params, piece)?;
    // What the GPU lacks shows in any frame.
    if let Some(world) = setup.views.first().and_then(|view| setup.world_at(view)) {
        probes.relight(&world, &lighting)?;
    }
    Ok(Box::new(OnGpu { setup: *setup, lighting: setup.animation.map(|_| lighting), probes }))
}

impl Renderer for OnGpu<'_> {
    fn frame(&mut self, view: &View, _: Option<&View>, _: u32, progress: &dyn Progress) -> Result<Frame> {
        let mut clock = Clock::start();
        if let Some((world, lighting)) = self.setup.world_at(view).zip(self.lighting.as_ref()) {
            self.probes.relight(&world, lighting)?;
            clock.lap("world");
        }
        let frame = self.probes.frame(&view.camera, self.setup.seed, view.frame)?;
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
