//! Glossy probe reprojection in the table of methods.

use super::GlossyProbeParams;
use super::gpu::Renderer as OnGpu;
use super::inspect::with_passes;
use super::rays::{RaysParams, Shot, filter, joined};
use super::renderer::{Renderer as OnCpu, Reprojected};
use super::wanted::Served;
use crate::base::clock::Clock;
use crate::base::named::{apply, tree};
use crate::base::progress::Progress;
use crate::gpu::Gpu;
use crate::io::ExrImage;
use crate::lightmap::LightMap;
use crate::method::{Frame, Method, Need, Options, Picture, Probes, Reads, Renderer, Setup, as_given};
use crate::probe::store::ProbeStore;
use crate::scene::Camera;
use crate::surface::CurvatureMap;
use crate::transport::World;
use crate::view::View;
use crate::view::denoiser::Denoiser;
use crate::view::layers::LayerImages;
use crate::view::oidn::Quality;
use crate::{Error, Result};
use serde_json::Value;
use std::path::Path;
use std::sync::Arc;

/// Probes kept in memory: the eight of one camera, and those of the cells around it.
const PROBE_CACHE: usize = 32;

/// The row.
pub const METHOD: Method = Method {
    name: "glossy-probes",
    about: "Glossy probes, reprojected",
    reads: Reads {
        probes: Some(Probes { stage: "bake-probes", any_texel: false }),
        lightmap: Need::Wanted,
        curvature: Need::Required,
    },
    layers: &["glossy"],
    options: &["probes", "lightmap", "curvature", "supersample", "denoise", "gpu-memory", "paper", "set"],
    samples: None,
    transmissive: false,
    orthographic: false,
    sequential: true,
    variants: &[("glossy-probes-rays", "rays.per_pixel=24,--denoise")],
    parameters,
    for_scene: as_given,
    cpu,
    gpu: Some(gpu),
    diffuse: None,
};

/// What the options come to.
pub fn resolve(options: &Options) -> Result<GlossyProbeParams> {
    let mut base = if options.paper { GlossyProbeParams::paper() } else { GlossyProbeParams::default() };
    let supersample = options.supersample.unwrap_or(base.supersample);
    // Half of the time of each half's denoising is better spent on rays.
    let choose = |wanted| Denoiser::choose(wanted, &[]).map(|denoiser| denoiser.at(Quality::Balanced));
    let denoise = options.denoise.map(choose).transpose()?;
    // What the network leaves of the rays' noise is little enough to tell more of the place.
    if matches!(denoise, Some(Denoiser::Oidn { .. })) {
        base.rays.window /= 2.0;
    }
    let own_filter = matches!(denoise, Some(Denoiser::Filter(_)));
    let with = |denoise| apply(&GlossyProbeParams { supersample, denoise, ..base.clone() }, &options.set);
    let mut params = with(denoise)?;
    if own_filter {
        params = with(Some(Denoiser::Filter(filter(params.rays.per_pixel))))?;
    }
    if params.denoise.is_some() && params.rays.per_pixel == 0 {
        return Err(Error::Request("--denoise: glossy-probes have no noise without rays: --set rays.per_pixel=24".into()));
    }
    Ok(params)
}

fn parameters(options: &Options) -> Result<Value> {
    tree(&resolve(options)?)
}

/// The curvatures, and the probes of a set that serves the views.
fn inputs<'a>(setup: &Setup<'a>, params: &GlossyProbeParams) -> Result<(&'a CurvatureMap, ProbeStore<Served>)> {
    let curvature =
        setup.curvature.ok_or_else(|| Error::Request("curvatures are needed: --curvature FILE, written by curvature".into()))?;
    let folder = setup.required_probes()?;
    let probes = ProbeStore::<Served>::open(&folder, &setup.world.scene, PROBE_CACHE)?;
    check_serves(&folder, &probes, setup.views, params)?;
    Ok((curvature, probes))
}

/// An error where a set lacks texels that the views ask for.
fn check_serves(folder: &Path, probes: &ProbeStore<Served>, views: &[View], params: &GlossyProbeParams) -> Result<()> {
    let cameras: Vec<Camera> = views.iter().map(|v| v.camera.clone()).collect();
    let needed = Served::new(&cameras, params.supersample, &params.gather);
    if probes.set.views.as_ref().is_none_or(|views| views.serve(&needed)) {
        return Ok(());
    }
    let message = "its texels were baked for other views (another path, size, --supersample or gather parameters); \
                   run bake-probes again for these, or without --for-path";
    Err(Error::input(folder, message))
}

/// Rays that are joined with the frames of either renderer, on the CPU.
struct Rays<'a> {
    lit: (&'a World, &'a LightMap),
    params: RaysParams,
    denoiser: Option<Denoiser>,
    seed: u32,
}

impl<'a> Rays<'a> {
    /// `None` where the parameters have none.
    fn of(setup: &Setup<'a>, params: &GlossyProbeParams) -> Result<Option<Self>> {
        if params.rays.per_pixel == 0 {
            return Ok(None);
        }
        let lit = (setup.world, setup.required_lightmap()?);
        Ok(Some(Self { lit, params: params.rays, denoiser: params.denoise, seed: setup.seed }))
    }
}

/// Either renderer, with its probes.
struct WithProbes<'a, R> {
    renderer: R,
    probes: ProbeStore<Served>,
    rays: Option<Rays<'a>>,
    supersample: u32,
}

impl<R> WithProbes<'_, R> {
    fn frame(&self, frame: Reprojected, view: &View) -> Result<Frame> {
        let Reprojected { emission, diffuse, mut glossy, passes, unserved, buffers } = frame;
        let mut clock = Clock::start();
        clock.laps = passes;
        if let Some(Rays { lit, params, denoiser, seed }) = &self.rays {
            let shot = Shot { camera: &view.camera, seeds: [*seed, view.frame] };
            glossy = joined(*lit, shot, &glossy, (params, denoiser.as_ref()), &mut clock)?;
        }
        let [width, height] = view.camera.size.map(|n| n as usize);
        let inspected = buffers.map(|buffers| with_passes(ExrImage::new(width, height), &buffers, self.supersample));
        let layers = LayerImages { emission, diffuse, glossy };
        Ok(Frame {
            picture: Picture::Layers(layers),
            passes: clock.laps,
            unserved: Some(unserved),
            counts: Vec::new(),
            inspected,
        })
    }
}

fn cpu<'a>(setup: &Setup<'a>) -> Result<Box<dyn Renderer + 'a>> {
    let params: GlossyProbeParams = setup.parameters()?;
    let (curvature, probes) = inputs(setup, &params)?;
    let rays = Rays::of(setup, &params)?;
    let supersample = params.supersample;
    let mut renderer = OnCpu::new(setup.world, curvature, setup.lightmap, params, probes.set.roughness_scale);
    renderer.inspect = setup.inspect;
    Ok(Box::new(WithProbes { renderer, probes, rays, supersample }))
}

impl Renderer for WithProbes<'_, OnCpu<'_>> {
    fn frame(&mut self, view: &View, _: Option<&View>, _: u32, progress: &dyn Progress) -> Result<Frame> {
        let frame = self.renderer.frame(&view.camera, &mut self.probes)?;
        progress.advance(view.camera.size[1].into());
        WithProbes::frame(self, frame, view)
    }

    fn forget(&mut self) {
        self.renderer.forget();
    }

    fn probe_bytes(&self) -> [u64; 2] {
        [self.probes.resident_bytes() as u64, 0]
    }
}

fn gpu<'a>(gpu: Arc<Gpu>, setup: &Setup<'a>) -> Result<Box<dyn Renderer + 'a>> {
    let params: GlossyProbeParams = setup.parameters()?;
    let (curvature, probes) = inputs(setup, &params)?;
    let rays = Rays::of(setup, &params)?;
    let (supersample, scale) = (params.supersample, probes.set.roughness_scale);
    let mut renderer = OnGpu::new(gpu, setup.world, curvature, setup.lightmap, params, scale, setup.gpu_memory)?;
    renderer.reserve(View::largest(setup.views), probes.set.size)?;
    renderer.inspect = setup.inspect;
    Ok(Box::new(WithProbes { renderer, probes, rays, supersample }))
}

impl Renderer for WithProbes<'_, OnGpu<'_>> {
    fn frame(&mut self, view: &View, next: Option<&View>, _: u32, progress: &dyn Progress) -> Result<Frame> {
        let frame = self.renderer.frame(&view.camera, next.map(|v| &v.camera), &mut self.probes)?;
        progress.advance(view.camera.size[1].into());
        WithProbes::frame(self, frame, view)
    }

    fn gpu(&self) -> Option<(&str, bool)> {
        Some((self.renderer.device(), self.renderer.has_clock()))
    }

    fn forget(&mut self) {
        self.renderer.forget();
    }

    fn probe_bytes(&self) -> [u64; 2] {
        [self.probes.resident_bytes() as u64, self.renderer.probe_bytes()]
    }
}
