//! `reprobe render-path`.

use crate::common::{Common, Outcome, parse_bytes, parse_size};
use crate::frames::{self, with_layers};
use crate::set_params::apply;
use crate::timings::{FrameTimings, Timings, timed};
use crate::views::{FrameList, View, parse_frames, views};
use crate::{render_baseline, render_glossy};
use anyhow::bail;
use clap::ValueEnum;
use reprobe::base::progress::Progress;
use reprobe::gpu::GpuScene;
use reprobe::io::{ExrImage, Provenance, atomic};
use reprobe::method::path_trace::denoise::{DenoiseParams, denoise, guides};
use reprobe::method::path_trace::denoise_gpu::Denoiser;
use reprobe::method::path_trace::gpu::PathTracer;
use reprobe::method::path_trace::{PathTraceParams, path_trace, path_trace_full};
use reprobe::scene::{Camera, Scene};
use reprobe::transport::World;
use reprobe::transport::path::PathParams;
use serde_json::json;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Renders the frames of a camera path
#[derive(clap::Args)]
pub struct Args {
    /// Mitsuba scene, XML or JSON
    #[arg(value_name = "SCENE")]
    pub scene: PathBuf,
    /// Camera path [default: one frame from the scene's own sensor]
    #[arg(long, value_name = "PATH.json")]
    path: Option<PathBuf>,
    /// Folder for NNNN.exr and timings.json; finished frames in it are kept
    #[arg(long, short, value_name = "FOLDER")]
    pub output: PathBuf,
    /// How to render
    #[arg(long, value_enum, default_value = "glossy-probes")]
    method: Method,
    /// Image size [default: the path's, or the sensor's]
    #[arg(long, value_name = "WxH", value_parser = parse_size)]
    size: Option<[u32; 2]>,
    /// Samples a pixel of path-trace
    #[arg(long, value_name = "N", default_value_t = 64, value_parser = clap::value_parser!(u32).range(1..=1 << 24))]
    spp: u32,
    /// Samples a pixel of lightmap-rt (glossy rays at the first vertex, default 4) or image-space-gather (taps, default 64)
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1 << 24))]
    pub samples: Option<u32>,
    /// Most scattering vertices of a path [default: unbounded; lightmap-rt: 3]
    #[arg(long, value_name = "N")]
    pub max_depth: Option<u32>,
    /// path-trace: filter the layers, guided by albedo, normal and depth
    #[arg(long)]
    denoise: bool,
    /// Choose the samples (--spp, --samples) with which a frame takes about so long, milliseconds
    #[arg(long, value_name = "MS", conflicts_with_all = ["spp", "samples"])]
    pub budget_ms: Option<f64>,
    /// Choose the samples with which a frame takes about as long as those in this folder, by its timings.json
    #[arg(long, value_name = "FRAMES", conflicts_with_all = ["spp", "samples", "budget_ms"])]
    pub match_time: Option<PathBuf>,
    /// Auxiliary layers: the first hit's, and the buffers of glossy-probes' passes
    #[arg(long, value_enum, value_name = "LAYERS")]
    pub aov: Option<Aov>,
    /// path-trace: what to write
    #[arg(long, value_enum, default_value = "all")]
    layers: LayerChoice,
    /// Only these frames of the path
    #[arg(long, value_name = "LIST", value_parser = parse_frames)]
    frames: Option<FrameList>,
    /// glossy-probes, ulr: the baked probes
    #[arg(long, value_name = "DIR")]
    pub probes: Option<PathBuf>,
    /// The diffuse light, for all methods but path-trace
    #[arg(long, value_name = "FILE.exr")]
    pub lightmap: Option<PathBuf>,
    /// glossy-probes: curvatures of the scene
    #[arg(long, value_name = "FILE.exr")]
    pub curvature: Option<PathBuf>,
    /// N x N rays a pixel through all passes, for all methods but path-trace
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=8))]
    pub supersample: u32,
    /// glossy-probes, ulr: memory that a GPU may be filled with, like 512M or 2G; probes past it are uploaded again
    #[arg(long, value_name = "SIZE", default_value = "2G", value_parser = parse_bytes)]
    pub gpu_memory: u64,
    /// glossy-probes: the paper's text in every choice
    #[arg(long)]
    pub paper: bool,
    /// Set a parameter of the method (path-trace: of its denoiser), like gather.falloff=4; a wrong name lists them all
    #[arg(long = "set", value_name = "NAME=VALUE")]
    pub set: Vec<String>,
}

/// How frames are rendered.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Method {
    /// Glossy probes, reprojected
    GlossyProbes,
    /// The reference: path tracing
    PathTrace,
    /// Baseline: unstructured lumigraph of the same probes
    Ulr,
    /// Baseline: mirror reflections of the light map, blurred in image space
    ImageSpaceGather,
    /// Baseline: light map, and rays along the glossy lobes
    LightmapRt,
}

impl Method {
    /// Whether it reads what other stages have baked.
    pub fn needs_bakes(self) -> bool {
        self != Self::PathTrace
    }

    /// Whether probes are among them.
    pub fn reads_probes(self) -> bool {
        matches!(self, Self::GlossyProbes | Self::Ulr)
    }

    /// Whether it reads other texels of them than `bake-probes --for-path` chooses.
    pub fn reads_any_texel(self) -> bool {
        self == Self::Ulr
    }
}

#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Aov {
    /// depth, normal, position, material, albedo, alpha
    All,
}

#[derive(Clone, Copy, PartialEq, Eq, ValueEnum, serde::Serialize)]
#[serde(rename_all = "lowercase")]
enum LayerChoice {
    /// The image and its layers: emission, diffuse, glossy; a path each for the latter two
    All,
    /// The image alone, one path a sample
    Full,
}

pub fn run(args: &Args, common: &Common) -> anyhow::Result<Outcome> {
    let timings = Timings {
        method: args.method.to_possible_value().map_or_else(String::new, |v| v.get_name().into()),
        threads: rayon::current_num_threads(),
        clock: "cpu".into(),
        ..Timings::default()
    };
    if args.denoise && args.method != Method::PathTrace {
        bail!("--denoise filters the frames of --method path-trace alone");
    }
    if args.method == Method::GlossyProbes && (args.budget_ms.is_some() || args.match_time.is_some()) {
        bail!("--method glossy-probes has no sample count that a budget could choose");
    }
    match args.method {
        Method::GlossyProbes => render_glossy::run(args, common, timings),
        Method::PathTrace => run_path_trace(args, common, timings),
        Method::Ulr => render_baseline::run_ulr(args, common, timings),
        Method::ImageSpaceGather => render_baseline::run_image_space_gather(args, common, timings),
        Method::LightmapRt => render_baseline::run_lightmap_rt(args, common, timings),
    }
}

/// The views that the command line asks for.
pub fn views_of(args: &Args, common: &Common, scene: &Scene) -> anyhow::Result<Vec<View>> {
    views(common, scene, args.path.as_deref(), args.size, args.frames.as_ref())
}

fn run_path_trace(args: &Args, common: &Common, mut timings: Timings) -> anyhow::Result<Outcome> {
    let path = PathParams { max_depth: args.max_depth.unwrap_or(u32::MAX), ..PathParams::default() };
    let denoiser = args.denoise.then(|| apply(&DenoiseParams::default(), &args.set)).transpose()?;
    if args.denoise && args.layers == LayerChoice::Full {
        bail!("--denoise filters layer by layer: leave --layers full out");
    }
    let (scene, load_ms) = timed(|| common.load_scene(&args.scene));
    let scene = scene?;
    if scene.emitters.is_empty() {
        bail!("{}: has no emitter; every frame would be black", args.scene.display());
    }
    let views = views_of(args, common, &scene)?;
    let (world, build_ms) = timed(|| World::new(scene));
    (timings.load_ms, timings.build_ms) = (load_ms, build_ms);

    let on_gpu = common.on_gpu(|gpu| {
        let scene = Arc::new(GpuScene::new(gpu, &world)?);
        let denoiser = denoiser.map(|d| Denoiser::new(scene.clone(), &d)).transpose()?;
        Ok((PathTracer::new(scene, &path, args.layers == LayerChoice::All)?, denoiser))
    })?;
    let (tracer, gpu_denoiser) = on_gpu.map_or((None, None), |(tracer, denoiser)| (Some(tracer), denoiser));
    timings.device = tracer.as_ref().map(|t| t.device().to_owned());
    let parameters = |spp| match &denoiser {
        None => json!({ "path_trace": PathTraceParams { spp, path }, "layers": args.layers }),
        Some(d) => json!({ "path_trace": PathTraceParams { spp, path }, "layers": args.layers, "denoise": d }),
    };
    let seed = common.seed;
    let mut render = |view: &View, spp: u32, image: ExrImage, times: &mut FrameTimings, bar: &dyn Progress| {
        let View { frame, camera } = view;
        let params = PathTraceParams { spp, path };
        if args.layers == LayerChoice::Full {
            let full = times.pass("path_trace", || match &tracer {
                Some(tracer) => tracer.full(camera, spp, seed, *frame, bar),
                None => Ok(path_trace_full(&world, camera, &params, seed, *frame, bar)),
            })?;
            return Ok(image.with_rgb("", &full));
        }
        let mut layers = times.pass("path_trace", || match &tracer {
            Some(tracer) => tracer.layers(camera, spp, seed, *frame, bar),
            None => Ok(path_trace(&world, camera, &params, seed, *frame, bar)),
        })?;
        if let Some(d) = &gpu_denoiser {
            let guides = times.pass("guides", || d.guides(camera, spp, seed, *frame))?;
            layers = times.pass("denoise", || d.denoise(&layers, &guides))?;
        } else if let Some(d) = &denoiser {
            let guides = times.pass("guides", || guides(&world, camera, d, spp, seed, *frame));
            layers = times.pass("denoise", || denoise(&layers, &guides, camera.size[0] as usize, d));
        }
        Ok(with_layers(image, &layers))
    };
    let provenance = Provenance::new("render-path", &world.scene.hash, seed, &json!({}));
    let method =
        frames::Method { world: &world, provenance, samples: Some(args.spp), parameters: &parameters, render: &mut render };
    frames::render(args, common, timings, &views, method)
}

/// Writes `timings.json` and sums up the run.
pub fn finish(mut timings: Timings, output: &Path) -> anyhow::Result<Outcome> {
    timings.finish(&output.join("timings.json"));
    atomic::write_json(&output.join("timings.json"), &timings)?;
    let kept = timings.frames.iter().filter(|f| f.kept).count();
    let count = timings.frames.len();
    let mean: f64 = timings.mean_ms.values().sum();
    let summary = match kept {
        k if k == count => format!("{count} frames in {} were finished already", output.display()),
        0 => format!("{count} frames in {}, {mean:.0} ms a frame", output.display()),
        _ => format!("{count} frames in {}, {kept} of them finished already, {mean:.0} ms a frame", output.display()),
    };
    Ok(Outcome { summary, figures: serde_json::to_value(&timings)?, check_failed: false })
}

/// Whether an earlier run with the same inputs and parameters wrote this frame.
pub fn is_finished(path: &Path, provenance: &Provenance) -> bool {
    ExrImage::read_provenance(path).is_ok_and(|found| found.as_ref() == Some(provenance))
}

/// The camera, as provenance keeps it.
pub fn describe(camera: &Camera) -> serde_json::Value {
    json!({
        "to_world": camera.to_world.to_cols_array(), "fov_x_rad": camera.fov_x, "size": camera.size,
        "aperture_radius": camera.aperture_radius, "focus_distance": camera.focus_distance,
    })
}
