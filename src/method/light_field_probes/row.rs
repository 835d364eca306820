//! Light field probes in the table of methods.

use super::LightFieldParams;
use super::field::LightField;
use super::gpu::LightFieldOnGpu;
use super::relight::relight;
use super::shade::Shading;
use crate::base::clock::Clock;
use crate::base::named::{apply, tree};
use crate::base::progress::Progress;
use crate::gpu::Gpu;
use crate::method::diffuse::DiffuseLight;
use crate::method::{Frame, Method, Need, Options, Probes, Reads, Renderer, Samples, Setup, as_given};
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
    options: &[
        "probes",
        "supersample",
        "samples",
        "trace",
        "diffuse",
        "diffuse-probes",
        "diffuse-set",
        "budget-ms",
        "match-time",
        "set",
    ],
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
    setup: Setup<'a>,
    field: LightField,
    params: LightFieldParams,
    /// Diffuse light of another method, which then lights the probes too.
    diffuse: Option<Box<dyn DiffuseLight + 'a>>,
}

fn cpu<'a>(setup: &Setup<'a>) -> Result<Box<dyn Renderer + 'a>> {
    let params: LightFieldParams = setup.parameters()?;
    let field = LightField::load(&setup.required_probes()?, &setup.world.scene)?;
    let diffuse = setup.diffuse.map(|joined| joined.light(setup)).transpose()?;
    Ok(Box::new(OnCpu { setup: *setup, field, params, diffuse }))
}

impl Renderer for OnCpu<'_> {
    fn frame(&mut self, view: &View, _: Option<&View>, samples: u32, progress: &dyn Progress) -> Result<Frame> {
        let params = LightFieldParams { samples, ..self.params };
        let (mut clock, seed) = (Clock::start(), self.setup.seed);
        let of_frame = self.setup.world_at(view);
        if of_frame.is_some() {
            clock.lap("world");
        }
        let world = of_frame.as_ref().unwrap_or(self.setup.world);
        if let Some(diffuse) = &mut self.diffuse {
            diffuse.relight(view, world, &mut clock);
            relight(&mut self.field, world, diffuse.as_ref(), seed);
            clock.lap("light field");
        }
        let baseline = Baseline::new(world, None, params.supersample);
        let g = baseline.gbuffer(&view.camera, &mut clock);
        let shading = Shading { world, field: &self.field, params, seed, frame: view.frame, far: Shading::far(world) };
        let glossy = shading.glossy(&g);
        clock.lap("rays");
        let diffuse = self.diffuse.as_ref().map_or_else(|| shading.diffuse(&g), |diffuse| diffuse.layer(world, &g));
        clock.lap("diffuse");
        let layers = baseline.both_layers(&g, &diffuse, &glossy, &mut clock);
        progress.advance(view.camera.size[1].into());
        Ok(Frame::of(layers, clock.laps))
    }

    fn probe_bytes(&self) -> [u64; 2] {
        let diffuse = self.diffuse.as_ref().map_or(0, |diffuse| diffuse.bytes());
        [(self.field.bytes() + diffuse) as u64, 0]
    }
}

struct OnGpu {
    probes: LightFieldOnGpu,
    seed: u32,
}

fn gpu<'a>(gpu: Arc<Gpu>, setup: &Setup<'a>) -> Result<Box<dyn Renderer + 'a>> {
    if setup.diffuse.is_some() {
        return Err(Error::Request(
            "--diffuse: the GPU's light field probes have their own diffuse light; use --device cpu".into(),
        ));
    }
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
