//! `reprobe render-path --method glossy-probes`.

use crate::common::{Common, Outcome};
use crate::render_path::{Args, describe, finish, is_finished, views_of};
use crate::set_params::apply;
use crate::timings::{FrameTimings, Timings, timed};
use crate::views::largest;
use anyhow::{Context, bail};
use reprobe::base::progress::Progress;
use reprobe::gpu;
use reprobe::io::provenance::hash_file;
use reprobe::io::{ExrImage, Provenance};
use reprobe::lightmap::LightMap;
use reprobe::method::glossy_probes::GlossyProbeParams;
use reprobe::method::glossy_probes::inspect::with_passes;
use reprobe::method::glossy_probes::renderer::{Frame, Renderer};
use reprobe::method::glossy_probes::wanted::Views;
use reprobe::probe::store::ProbeStore;
use reprobe::scene::Camera;
use reprobe::surface::curvature_file;
use reprobe::transport::World;
use reprobe::view::aov::with_first_hits;
use serde_json::json;

/// Probes kept in memory by default: the eight of one camera, and those of the cells around it.
const PROBE_CACHE: usize = 32;

pub fn params(args: &Args) -> anyhow::Result<GlossyProbeParams> {
    let base = if args.paper { GlossyProbeParams::paper() } else { GlossyProbeParams::default() };
    apply(&GlossyProbeParams { supersample: args.supersample, ..base }, &args.set)
}

pub fn run(args: &Args, common: &Common, mut timings: Timings) -> anyhow::Result<Outcome> {
    let params = params(args)?;
    let (world, load_ms) = timed(|| common.opaque_world(&args.scene));
    let world = world?;
    timings.load_ms = load_ms;
    let scene = &world.scene;
    let wanted = views_of(args, common, scene)?;
    let cameras: Vec<Camera> = wanted.iter().map(|v| v.camera.clone()).collect();
    let folder = args.probes.as_ref().context("--method glossy-probes needs --probes DIR, written by bake-probes")?;
    let file = args.curvature.as_ref().context("--method glossy-probes needs --curvature FILE, written by curvature")?;
    let mut probes = ProbeStore::open(folder, scene, PROBE_CACHE)?;
    let needed = Views::new(&cameras, params.supersample, &params.gather);
    let serves = |views: &Views| views.serve(&needed);
    if !probes.set.views.as_ref().is_none_or(serves) {
        let message = "its texels were baked for other views (another path, size, --supersample or gather parameters)";
        bail!("{}: {message}; run bake-probes again for these, or without --for-path", folder.display());
    }
    let curvature = curvature_file::read(file, scene.geometry.positions.len(), &scene.hash)?;
    let lightmap = args.lightmap.as_ref().map(|path| LightMap::load(path, scene)).transpose()?;
    if lightmap.is_none() {
        eprintln!("reprobe: warning: no --lightmap: the diffuse layer is black");
    }

    let mut base = Provenance::new("render-path", &scene.hash, common.seed, &json!({}))
        .with_input("probes", probes.hash.clone())
        .with_input("curvature", hash_file(file)?);
    if let Some(path) = &args.lightmap {
        base = base.with_input("lightmap", hash_file(path)?);
    }
    let frames: Vec<_> = wanted
        .iter()
        .map(|v| {
            let parameters = json!({
                "method": timings.method, "frame": v.frame, "glossy_probes": params, "aov": args.aov.is_some(),
                "camera": describe(&v.camera),
            });
            (args.output.join(format!("{:04}.exr", v.frame)), Provenance { parameters, ..base.clone() })
        })
        .collect();
    // A frame may borrow pixels from the one before it, so the path is rendered as a whole.
    let kept = frames.iter().all(|(path, provenance)| is_finished(path, provenance));

    let supersample = params.supersample;
    let inspect = args.aov.is_some();
    let mut engine = None;
    if !kept {
        let scale = probes.set.roughness_scale;
        let on_gpu = common.on_gpu(|gpu| {
            let memory = args.gpu_memory;
            let mut renderer = gpu::Renderer::new(gpu, &world, &curvature, lightmap.as_ref(), params.clone(), scale, memory)?;
            renderer.reserve(largest(&wanted), probes.set.size)?;
            Ok(renderer)
        })?;
        engine = Some(match on_gpu {
            Some(mut renderer) => {
                renderer.inspect = inspect;
                timings.on_gpu(renderer.device(), renderer.has_clock());
                Engine::Gpu(Box::new(renderer))
            }
            None => {
                let mut renderer = Renderer::new(&world, &curvature, lightmap.as_ref(), params, scale);
                renderer.inspect = inspect;
                Engine::Cpu(Box::new(renderer))
            }
        });
    }
    let bar = common.progress();
    bar.start("glossy-probes", frames.len() as u64);
    for (i, (camera, (path, provenance))) in cameras.iter().zip(frames).enumerate() {
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let mut times = FrameTimings { name, kept, ..FrameTimings::default() };
        if let Some(engine) = &mut engine {
            let frame = engine.frame(camera, cameras.get(i + 1), &mut probes)?;
            times.passes(&frame.passes);
            times.unserved(frame.unserved, camera.size, supersample);
            let image = image(&frame, camera, &world, supersample);
            times.pass("write", || image.with_provenance(provenance).write(&path))?;
        }
        let on_gpu = engine.as_ref().map_or(0, Engine::gpu_probe_bytes);
        timings.gpu_probe_memory_bytes = timings.gpu_probe_memory_bytes.max(on_gpu);
        timings.probe_memory_bytes = timings.probe_memory_bytes.max(probes.resident_bytes() as u64);
        timings.frames.push(times);
        bar.advance(1);
    }
    bar.finish();
    finish(timings, &args.output)
}

fn image(frame: &Frame, camera: &Camera, world: &World, supersample: u32) -> ExrImage {
    let full: Vec<_> = (0..frame.glossy.len()).map(|i| frame.emission[i] + frame.diffuse[i] + frame.glossy[i]).collect();
    let image = ExrImage::new(camera.size[0] as usize, camera.size[1] as usize)
        .with_rgb("", &full)
        .with_rgb("emission", &frame.emission)
        .with_rgb("diffuse", &frame.diffuse)
        .with_rgb("glossy", &frame.glossy);
    match &frame.buffers {
        Some(buffers) => with_passes(with_first_hits(image, world, camera), buffers, supersample),
        None => image,
    }
}

/// Where frames are rendered.
enum Engine<'a> {
    Cpu(Box<Renderer<'a>>),
    Gpu(Box<gpu::Renderer<'a>>),
}

impl Engine<'_> {
    fn frame(&mut self, camera: &Camera, next: Option<&Camera>, probes: &mut ProbeStore) -> reprobe::Result<Frame> {
        match self {
            Self::Cpu(renderer) => renderer.frame(camera, probes),
            Self::Gpu(renderer) => renderer.frame(camera, next, probes),
        }
    }

    /// Bytes of the probes on the GPU; 0 for the CPU.
    fn gpu_probe_bytes(&self) -> u64 {
        match self {
            Self::Cpu(_) => 0,
            Self::Gpu(renderer) => renderer.probe_bytes(),
        }
    }
}
