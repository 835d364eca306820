//! Unstructured lumigraph rendering in the table of methods.

use super::gpu::Ulr;
use super::{UlrParams, nearest, ulr};
use crate::Result;
use crate::base::clock::Clock;
use crate::base::named::{apply, tree};
use crate::base::progress::Progress;
use crate::gpu::Gpu;
use crate::method::{Frame, Method, Need, Options, Probes, Reads, Renderer, Setup, as_given};
use crate::probe::store::ProbeStore;
use crate::transport::World;
use crate::view::View;
use crate::view::baseline::Baseline;
use serde::de::IgnoredAny;
use serde_json::Value;
use std::sync::Arc;

/// The row.
pub const METHOD: Method = Method {
    name: "ulr",
    about: "Baseline: unstructured lumigraph of the same probes",
    reads: Reads { probes: Some(Probes { stage: "bake-probes", any_texel: true }), lightmap: Need::Wanted, curvature: Need::No },
    layers: &["glossy"],
    options: &["probes", "lightmap", "supersample", "gpu-memory", "set"],
    samples: None,
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
    let base = UlrParams::default();
    tree(&apply(&UlrParams { supersample: options.supersample.unwrap_or(base.supersample), ..base }, &options.set)?)
}

/// The parameters and the probes.
fn inputs(setup: &Setup) -> Result<(UlrParams, ProbeStore<IgnoredAny>)> {
    let params: UlrParams = setup.parameters()?;
    let probes = ProbeStore::open(&setup.required_probes()?, &setup.world.scene, params.probes as usize)?;
    Ok((params, probes))
}

struct OnCpu<'a> {
    world: &'a World,
    baseline: Baseline<'a>,
    params: UlrParams,
    probes: ProbeStore<IgnoredAny>,
}

fn cpu<'a>(setup: &Setup<'a>) -> Result<Box<dyn Renderer + 'a>> {
    let (params, probes) = inputs(setup)?;
    let baseline = Baseline::new(setup.world, setup.lightmap, params.supersample);
    Ok(Box::new(OnCpu { world: setup.world, baseline, params, probes }))
}

impl Renderer for OnCpu<'_> {
    fn frame(&mut self, view: &View, _: Option<&View>, _: u32, progress: &dyn Progress) -> Result<Frame> {
        let Self { world, baseline, params, probes: store } = self;
        let mut clock = Clock::start();
        let near = {
            let set = &store.set;
            nearest(&set.places, view.camera.position(), params.probes as usize, |i| !set.files[i].is_empty())
        };
        let probes: Vec<_> = near.into_iter().map(|i| store.probe(i)).collect::<Result<_>>()?;
        clock.lap("load");
        let g = baseline.gbuffer(&view.camera, &mut clock);
        let found = ulr(world, &g, &probes, params);
        clock.lap("gather");
        let layers = baseline.layers(&g, &found.glossy, &mut clock);
        progress.advance(view.camera.size[1].into());
        Ok(Frame { unserved: Some(found.unserved), ..Frame::of(layers, clock.laps) })
    }

    fn probe_bytes(&self) -> [u64; 2] {
        [self.probes.resident_bytes() as u64, 0]
    }
}

struct OnGpu {
    ulr: Ulr,
    probes: ProbeStore<IgnoredAny>,
}

fn gpu<'a>(gpu: Arc<Gpu>, setup: &Setup<'a>) -> Result<Box<dyn Renderer + 'a>> {
    let (params, probes) = inputs(setup)?;
    let mut ulr = Ulr::new(gpu, setup.world, setup.lightmap, &params, setup.gpu_memory)?;
    ulr.reserve(View::largest(setup.views), probes.set.size)?;
    Ok(Box::new(OnGpu { ulr, probes }))
}

impl Renderer for OnGpu {
    fn frame(&mut self, view: &View, _: Option<&View>, _: u32, progress: &dyn Progress) -> Result<Frame> {
        let frame = self.ulr.frame(&view.camera, &mut self.probes)?;
        progress.advance(view.camera.size[1].into());
        Ok(Frame { unserved: Some(frame.unserved), ..Frame::of(frame.layers, frame.passes) })
    }

    fn gpu(&self) -> Option<(&str, bool)> {
        Some((self.ulr.device(), self.ulr.has_clock()))
    }

    fn probe_bytes(&self) -> [u64; 2] {
        [self.probes.resident_bytes() as u64, self.ulr.probe_bytes()]
    }
}
