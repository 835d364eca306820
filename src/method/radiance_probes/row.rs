//! Radiance probes in the table of methods.

use super::light::{Light, as_light_map, light, reflectances};
use super::operator::Transport;
use super::params::RadianceProbeParams;
use crate::Result;
use crate::base::clock::Clock;
use crate::base::math::{Rgb, hash_words};
use crate::base::named::{apply, tree};
use crate::base::progress::Progress;
use crate::lightmap::LightMap;
use crate::material::bsdf::{Lobes, Query};
use crate::method::{Frame, Method, Need, Options, Probes, Reads, Renderer, Setup, as_given};
use crate::transport::World;
use crate::view::View;
use crate::view::baseline::Baseline;
use crate::view::direct::direct;
use crate::view::gbuffer::{GBuffer, Pixel};
use rayon::prelude::*;
use serde_json::Value;

/// The row.
pub const METHOD: Method = Method {
    name: "radiance-probes",
    about: "Sparse radiance probes: diffuse light under lights that move",
    reads: Reads { probes: Some(Probes { stage: "bake-transport", any_texel: false }), lightmap: Need::No, curvature: Need::No },
    layers: &["diffuse"],
    options: &["probes", "supersample", "set"],
    samples: None,
    transmissive: false,
    orthographic: true,
    sequential: false,
    parameters,
    for_scene: as_given,
    cpu,
    gpu: None,
};

fn parameters(options: &Options) -> Result<Value> {
    let base = RadianceProbeParams::default();
    let base = RadianceProbeParams { supersample: options.supersample.unwrap_or(base.supersample), ..base };
    tree(&apply(&base, &options.set)?)
}

struct OnCpu<'a> {
    world: &'a World,
    baseline: Baseline<'a>,
    transport: Transport,
    reflectance: Vec<Rgb>,
    params: RadianceProbeParams,
    seed: u32,
}

fn cpu<'a>(setup: &Setup<'a>) -> Result<Box<dyn Renderer + 'a>> {
    let params: RadianceProbeParams = setup.parameters()?;
    let transport = Transport::load(&setup.required_probes()?, &setup.world.scene)?;
    let reflectance = reflectances(setup.world, &transport.receivers);
    let baseline = Baseline::new(setup.world, None, params.supersample);
    Ok(Box::new(OnCpu { world: setup.world, baseline, transport, reflectance, params, seed: setup.seed }))
}

impl OnCpu<'_> {
    /// Direct light by rays, the rest from the receivers.
    fn diffuse(&self, view: &GBuffer, indirect: &LightMap, frame: u32) -> Vec<Rgb> {
        let query = Query { lobes: Lobes::DIFFUSE, ..Query::default() };
        let of = |(i, p): (usize, &Option<Pixel>)| {
            let Some(p) = p else { return Rgb::ZERO };
            let stream = hash_words(&[self.seed, frame, i as u32]);
            direct(self.world, p, query, self.params.direct_samples, stream)
                + indirect.diffuse_radiance(&self.world.scene, &p.surface, p.wo)
        };
        view.pixels.par_iter().enumerate().with_min_len(view.size()[0]).map(of).collect()
    }
}

impl Renderer for OnCpu<'_> {
    fn frame(&mut self, view: &View, _: Option<&View>, _: u32, progress: &dyn Progress) -> Result<Frame> {
        let mut clock = Clock::start();
        let Light { indirect, .. } = light(&self.transport, self.world, &self.reflectance, &self.params, self.seed, &mut clock);
        let map = as_light_map(&self.transport, self.world, &indirect);
        clock.lap("light map");
        let g = self.baseline.gbuffer(&view.camera, &mut clock);
        let diffuse = self.diffuse(&g, &map, view.frame);
        clock.lap("diffuse");
        let glossy = vec![Rgb::ZERO; diffuse.len()];
        let layers = self.baseline.both_layers(&g, &diffuse, &glossy, &mut clock);
        progress.advance(view.camera.size[1].into());
        Ok(Frame::of(layers, clock.laps))
    }

    fn probe_bytes(&self) -> [u64; 2] {
        [self.transport.bytes() as u64, 0]
    }
}
