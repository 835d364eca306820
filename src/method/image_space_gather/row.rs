//! Image-space gathering in the table of methods.

use super::gpu::ImageSpaceGather;
use super::{ImageSpaceGatherParams, gather_image, mirror_image};
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
use serde_json::Value;
use std::sync::Arc;

/// The row.
pub const METHOD: Method = Method {
    name: "image-space-gather",
    about: "Baseline: mirror reflections of the light map, blurred in image space",
    reads: Reads { probes: None, lightmap: Need::Required, curvature: Need::No },
    layers: &["glossy"],
    options: &["lightmap", "supersample", "samples", "budget-ms", "match-time", "set"],
    samples: Some(Samples { option: "samples", pointer: "/samples" }),
    transmissive: false,
    orthographic: false,
    sequential: false,
    variants: &[],
    parameters,
    for_scene: as_given,
    cpu,
    gpu: Some(gpu),
    diffuse: None,
};

fn parameters(options: &Options) -> Result<Value> {
    let base = ImageSpaceGatherParams::default();
    let supersample = options.supersample.unwrap_or(base.supersample);
    tree(&apply(&ImageSpaceGatherParams { supersample, samples: options.samples.unwrap_or(base.samples), ..base }, &options.set)?)
}

struct OnCpu<'a> {
    world: &'a World,
    lightmap: &'a LightMap,
    baseline: Baseline<'a>,
    params: ImageSpaceGatherParams,
}

fn cpu<'a>(setup: &Setup<'a>) -> Result<Box<dyn Renderer + 'a>> {
    let params: ImageSpaceGatherParams = setup.parameters()?;
    let lightmap = setup.required_lightmap()?;
    let baseline = Baseline::new(setup.world, Some(lightmap), params.supersample);
    Ok(Box::new(OnCpu { world: setup.world, lightmap, baseline, params }))
}

impl Renderer for OnCpu<'_> {
    fn frame(&mut self, view: &View, _: Option<&View>, samples: u32, progress: &dyn Progress) -> Result<Frame> {
        let params = ImageSpaceGatherParams { samples, ..self.params };
        let mut clock = Clock::start();
        let g = self.baseline.gbuffer(&view.camera, &mut clock);
        let mirror = mirror_image(self.world, self.lightmap, &g, &params);
        clock.lap("mirror");
        let glossy = gather_image(self.world, &g, &mirror, &params);
        clock.lap("gather");
        let layers = self.baseline.layers(&g, &glossy, &mut clock);
        progress.advance(view.camera.size[1].into());
        Ok(Frame::of(layers, clock.laps))
    }
}

struct OnGpu {
    gather: ImageSpaceGather,
    params: ImageSpaceGatherParams,
}

fn gpu<'a>(gpu: Arc<Gpu>, setup: &Setup<'a>) -> Result<Box<dyn Renderer + 'a>> {
    let params: ImageSpaceGatherParams = setup.parameters()?;
    let gather = ImageSpaceGather::new(gpu, setup.world, setup.required_lightmap()?, params.supersample)?;
    Ok(Box::new(OnGpu { gather, params }))
}

impl Renderer for OnGpu {
    fn frame(&mut self, view: &View, _: Option<&View>, samples: u32, progress: &dyn Progress) -> Result<Frame> {
        let frame = self.gather.frame(&view.camera, &ImageSpaceGatherParams { samples, ..self.params })?;
        progress.advance(view.camera.size[1].into());
        Ok(Frame::of(frame.layers, frame.passes))
    }

    fn gpu(&self) -> Option<(&str, bool)> {
        Some((self.gather.device(), self.gather.has_clock()))
    }
}
