//! Light field probes in the table of methods.

use super::LightFieldParams;
use super::field::LightField;
use super::gpu::LightFieldOnGpu;
use super::shade::Shading;
use crate::base::clock::Clock;
use crate::base::named::{apply, tree};
use crate::base::progress::Progress;
use crate::gpu::Gpu;
use crate::method::{Frame, Method, Need, Options, Probes, Reads, Renderer, Samples, Setup, as_given};
use crate::transport::World;
use crate::view::View;
use crate::view::baseline::Baseline;
use crate::{Error, Result};
use serde_json::Value;
use std::sync::Arc;

/// The row.
pub const METHOD: Method = Method {
    name: "light-field-probes",
    about: "Light field probes: rays followed through octahedral maps of distance and radiance",
    reads: Reads { probes: Some(Probes { stage: "bake-lightfield", any_texel: false }), lightmap: Need::No, curvature: Need::No },
    layers: &["diffuse", "glossy"],
    options: &["probes", "supersample", "samples", "trace", "budget-ms", "match-time", "set"],
    samples: Some(Samples { option: "samples", pointer: "/samples" }),
    transmissive: false,
    orthographic: false,
    sequential: false,
    parameters,
    for_scene: as_given,
    cpu,
    gpu: Some(gpu),
};

fn parameters(options: &Options) -> Result<Value> {
    let base = LightFieldParams::default();
    let named = |name: &String| name.parse().map_err(|e| Error::Request(format!("--trace {name}: {e}")));
    let search = options.trace.as_ref().map_or(Ok(base.search), named)?;
    let base = LightFieldParams {
        supersample: options.supersample.unwrap_or(base.supersample),
        samples: options.samples.unwrap_or(base.samples),
        search,
        ..base
    };
    tree(&apply(&base, &options.set)?)
}

struct OnCpu<'a> {
    world: &'a World,
    baseline: Baseline<'a>,
    field: LightField,
    params: LightFieldParams,
    seed: u32,
    far: f32,
}

fn cpu<'a>(setup: &Setup<'a>) -> Result<Box<dyn Renderer + 'a>> {
    let params: LightFieldParams = setup.parameters()?;
    let field = LightField::load(&setup.required_probes()?, &setup.world.scene)?;
    let baseline = Baseline::new(setup.world, None, params.supersample);
    Ok(Box::new(OnCpu { world: setup.world, baseline, field, params, seed: setup.seed, far: Shading::far(setup.world) }))
}

impl Renderer for OnCpu<'_> {
    fn frame(&mut self, view: &View, _: Option<&View>, samples: u32, progress: &dyn Progress) -> Result<Frame> {
        let params = LightFieldParams { samples, ..self.params };
        let mut clock = Clock::start();
        let g = self.baseline.gbuffer(&view.camera, &mut clock);
        let shading =
            Shading { world: self.world, field: &self.field, params, seed: self.seed, frame: view.frame, far: self.far };
        let glossy = shading.glossy(&g);
        clock.lap("rays");
        let diffuse = shading.diffuse(&g);
        clock.lap("diffuse");
        let layers = self.baseline.both_layers(&g, &diffuse, &glossy, &mut clock);
        progress.advance(view.camera.size[1].into());
        Ok(Frame::of(layers, clock.laps))
    }

    fn probe_bytes(&self) -> [u64; 2] {
        [self.field.bytes() as u64, 0]
    }
}

struct OnGpu {
    probes: LightFieldOnGpu,
    seed: u32,
}

fn gpu<'a>(gpu: Arc<Gpu>, setup: &Setup<'a>) -> Result<Box<dyn Renderer + 'a>> {
    let field = LightField::load(&setup.required_probes()?, &setup.world.scene)?;
    let probes = LightFieldOnGpu::new(gpu, setup.world, &field, &setup.parameters()?)?;
    Ok(Box::new(OnGpu { probes, seed: setup.seed }))
}

impl Renderer for OnGpu {
    fn frame(&mut self, view: &View, _: Option<&View>, samples: u32, progress: &dyn Progress) -> Result<Frame> {
        let frame = self.probes.frame(&view.camera, samples, self.seed, view.frame)?;
        progress.advance(view.camera.size[1].into());
        Ok(Frame::of(frame.layers, frame.passes))
    }

    /// Its passes are as long as their pace says, so that the host times them.
    fn gpu(&self) -> Option<(&str, bool)> {
        Some((self.probes.device(), false))
    }

    fn probe_bytes(&self) -> [u64; 2] {
        [0, self.probes.probe_bytes()]
    }
}
