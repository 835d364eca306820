//! `reprobe render-path` by the methods that the paper compares itself with: `ulr`, `image-space-gather`, `lightmap-rt`.

use crate::common::{Common, Outcome};
use crate::frames::{self, with_layers};
use crate::render_path::{Args, views_of};
use crate::set_params::apply;
use crate::timings::{FrameTimings, Timings, timed};
use crate::views::{View, largest};
use anyhow::{Context, bail};
use reprobe::base::math::Rgb;
use reprobe::base::progress::Progress;
use reprobe::gpu::view::frame::BaselineFrame;
use reprobe::io::provenance::hash_file;
use reprobe::io::{ExrImage, Provenance};
use reprobe::lightmap::LightMap;
use reprobe::method::glossy_probes::renderer::Frame;
use reprobe::method::image_space_gather::gpu::ImageSpaceGather;
use reprobe::method::image_space_gather::{ImageSpaceGatherParams, gather_image, mirror_image};
use reprobe::method::lightmap_rt::gpu::LightmapRt;
use reprobe::method::lightmap_rt::{LightmapRtParams, lightmap_rt};
use reprobe::method::ulr::gpu::Ulr;
use reprobe::method::ulr::{UlrParams, nearest, ulr};
use reprobe::probe::store::ProbeStore;
use reprobe::scene::Camera;
use reprobe::surface::CurvatureMap;
use reprobe::transport::World;
use reprobe::view::composite::{diffuse_layer, downsample, emission_layer};
use reprobe::view::gbuffer::{GBuffer, gbuffer};
use reprobe::view::layers::LayerImages;
use serde_json::json;
use std::sync::Arc;

/// What all three share: the scene, its diffuse light and the views.
struct Setup {
    world: Arc<World>,
    lightmap: Option<LightMap>,
    flat: CurvatureMap,
    views: Vec<View>,
    provenance: Provenance,
}

impl Setup {
    fn new(args: &Args, common: &Common, timings: &mut Timings, supersample: u32) -> anyhow::Result<Self> {
        if !(1..=8).contains(&supersample) {
            bail!("--set supersample={supersample}: expected 1 to 8");
        }
        let (world, load_ms) = timed(|| common.opaque_world(&args.scene));
        let world = world?;
        timings.load_ms = load_ms;
        let scene = &world.scene;
        let views = views_of(args, common, scene)?;
        let lightmap = args.lightmap.as_ref().map(|path| LightMap::load(path, scene)).transpose()?;
        let mut provenance = Provenance::new("render-path", &scene.hash, common.seed, &json!({}));
        if let Some(path) = &args.lightmap {
            provenance = provenance.with_input("lightmap", hash_file(path)?);
        }
        let flat = CurvatureMap::flat(scene.geometry.positions.len());
        Ok(Self { lightmap, flat, views, provenance, world: world.clone() })
    }

    fn lightmap(&self, method: &str) -> anyhow::Result<&LightMap> {
        self.lightmap.as_ref().with_context(|| format!("--method {method} needs --lightmap FILE, written by bake-lightmap"))
    }

    /// The G-buffer of a view at `n` x `n` rays a pixel.
    fn gbuffer(&self, view: &View, n: u32, times: &mut FrameTimings) -> GBuffer {
        let fine = Camera { size: view.camera.size.map(|s| s * n), ..view.camera.clone() };
        times.pass("gbuffer", || gbuffer(&self.world, &self.flat, &fine))
    }

    /// The image of a view with its other layers, `glossy` being at the G-buffer's size.
    fn compose(&self, image: ExrImage, view: &GBuffer, glossy: &[Rgb], n: u32, times: &mut FrameTimings) -> ExrImage {
        let layers = times.pass("composite", || {
            let small = |fine: &[Rgb]| downsample(fine, view.size(), n as usize);
            let diffuse = match &self.lightmap {
                Some(map) => diffuse_layer(&self.world.scene, view, map),
                None => vec![Rgb::ZERO; glossy.len()],
            };
            LayerImages { emission: small(&emission_layer(view)), diffuse: small(&diffuse), glossy: small(glossy) }
        });
        with_layers(image, &layers)
    }
}

/// The image of a frame from the GPU.
fn from_gpu(frame: &BaselineFrame, image: ExrImage, times: &mut FrameTimings) -> ExrImage {
    times.passes(&frame.passes);
    with_layers(image, &frame.layers)
}

pub fn run_ulr(args: &Args, common: &Common, mut timings: Timings) -> anyhow::Result<Outcome> {
    let params = apply(&UlrParams { supersample: args.supersample, ..UlrParams::default() }, &args.set)?;
    let setup = Setup::new(args, common, &mut timings, params.supersample)?;
    let folder = args.probes.as_ref().context("--method ulr needs --probes DIR, written by bake-probes")?;
    let mut store = ProbeStore::open(folder, &setup.world.scene, params.probes as usize)?;
    if store.set.views.is_some() {
        eprintln!(
            "reprobe: warning: {}: baked for the views of glossy-probes: ulr wants other texels, and goes without those that are \
             missing; bake without --for-path to be fair to it",
            folder.display()
        );
    }
    let provenance = setup.provenance.clone().with_input("probes", store.hash.clone());
    let mut on_gpu = ulr_on_gpu(args, common, &setup, &params, store.set.size, &mut timings)?;
    let mut render = |view: &View, _: u32, image: ExrImage, times: &mut FrameTimings, bar: &dyn Progress| {
        if let Some(ulr) = &mut on_gpu {
            let frame = ulr.frame(&view.camera, &mut store)?;
            times.passes(&frame.passes);
            times.unserved(frame.unserved, view.camera.size, params.supersample);
            bar.advance(u64::from(view.camera.size[1]));
            let Frame { emission, diffuse, glossy, .. } = frame;
            return Ok(with_layers(image, &LayerImages { emission, diffuse, glossy }));
        }
        let probes: Vec<_> = times.pass("load", || {
            let set = &store.set;
            let is_baked = |i: usize| !set.files[i].is_empty();
            let near = nearest(&set.grid, view.camera.position(), params.probes as usize, is_baked);
            near.into_iter().map(|i| store.probe(i)).collect::<Result<_, _>>()
        })?;
        let g = setup.gbuffer(view, params.supersample, times);
        let found = times.pass("gather", || ulr(&setup.world, &g, &probes, &params));
        times.unserved_fraction = Some(found.unserved as f64 / found.glossy.len() as f64);
        bar.advance(u64::from(view.camera.size[1]));
        Ok(setup.compose(image, &g, &found.glossy, params.supersample, times))
    };
    let parameters = |_| json!({ "ulr": params });
    let method = frames::Method { world: &setup.world, provenance, samples: None, parameters: &parameters, render: &mut render };
    frames::render(args, common, timings, &setup.views, method)
}

/// The renderer on the GPU that `--device` asks for, with room for the largest of the views.
fn ulr_on_gpu(
    args: &Args,
    common: &Common,
    setup: &Setup,
    params: &UlrParams,
    probe: [u32; 2],
    timings: &mut Timings,
) -> anyhow::Result<Option<Ulr>> {
    let ulr = common.on_gpu(|gpu| {
        let mut ulr = Ulr::new(gpu, &setup.world, setup.lightmap.as_ref(), params, args.gpu_memory)?;
        ulr.reserve(largest(&setup.views), probe)?;
        Ok(ulr)
    })?;
    if let Some(ulr) = &ulr {
        timings.on_gpu(ulr.device(), ulr.has_clock());
    }
    Ok(ulr)
}

pub fn run_image_space_gather(args: &Args, common: &Common, mut timings: Timings) -> anyhow::Result<Outcome> {
    let base = ImageSpaceGatherParams { supersample: args.supersample, ..ImageSpaceGatherParams::default() };
    let base = apply(&ImageSpaceGatherParams { samples: args.samples.unwrap_or(base.samples), ..base }, &args.set)?;
    let setup = Setup::new(args, common, &mut timings, base.supersample)?;
    let lightmap = setup.lightmap(&timings.method)?;
    let mut gpu = common.on_gpu(|gpu| ImageSpaceGather::new(gpu, &setup.world, lightmap, base.supersample))?;
    if let Some(gpu) = &gpu {
        timings.on_gpu(gpu.device(), gpu.has_clock());
    }
    let with = |samples| ImageSpaceGatherParams { samples, ..base };
    let mut render = |view: &View, samples: u32, image: ExrImage, times: &mut FrameTimings, bar: &dyn Progress| {
        let params = with(samples);
        if let Some(gpu) = &mut gpu {
            let frame = gpu.frame(&view.camera, &params)?;
            bar.advance(u64::from(view.camera.size[1]));
            return Ok(from_gpu(&frame, image, times));
        }
        let g = setup.gbuffer(view, params.supersample, times);
        let mirror = times.pass("mirror", || mirror_image(&setup.world, lightmap, &g, &params));
        let glossy = times.pass("gather", || gather_image(&setup.world, &g, &mirror, &params));
        bar.advance(u64::from(view.camera.size[1]));
        Ok(setup.compose(image, &g, &glossy, params.supersample, times))
    };
    let method = frames::Method {
        world: &setup.world,
        provenance: setup.provenance.clone(),
        samples: Some(base.samples),
        parameters: &|samples| json!({ "image_space_gather": with(samples) }),
        render: &mut render,
    };
    frames::render(args, common, timings, &setup.views, method)
}

pub fn run_lightmap_rt(args: &Args, common: &Common, mut timings: Timings) -> anyhow::Result<Outcome> {
    let base = LightmapRtParams { supersample: args.supersample, ..LightmapRtParams::default() };
    let bounces = args.max_depth.unwrap_or(base.bounces);
    let base = apply(&LightmapRtParams { samples: args.samples.unwrap_or(base.samples), bounces, ..base }, &args.set)?;
    let setup = Setup::new(args, common, &mut timings, base.supersample)?;
    let lightmap = setup.lightmap(&timings.method)?;
    let mut gpu = common.on_gpu(|gpu| LightmapRt::new(gpu, &setup.world, lightmap, &base))?;
    timings.device = gpu.as_ref().map(|g| g.device().to_owned());
    let with = |samples| LightmapRtParams { samples, ..base };
    let mut render = |view: &View, samples: u32, image: ExrImage, times: &mut FrameTimings, bar: &dyn Progress| {
        if let Some(gpu) = &mut gpu {
            let frame = gpu.frame(&view.camera, samples, common.seed, view.frame)?;
            bar.advance(u64::from(view.camera.size[1]));
            return Ok(from_gpu(&frame, image, times));
        }
        let params = with(samples);
        let g = setup.gbuffer(view, params.supersample, times);
        let glossy = times.pass("rays", || lightmap_rt(&setup.world, lightmap, &g, &params, common.seed, view.frame));
        bar.advance(u64::from(view.camera.size[1]));
        Ok(setup.compose(image, &g, &glossy, params.supersample, times))
    };
    let method = frames::Method {
        world: &setup.world,
        provenance: setup.provenance.clone(),
        samples: Some(base.samples),
        parameters: &|samples| json!({ "lightmap_rt": with(samples) }),
        render: &mut render,
    };
    frames::render(args, common, timings, &setup.views, method)
}
