//! `reprobe render-path`.

use crate::common::{Common, Outcome, parse_size};
use crate::render_glossy;
use crate::timings::{FrameTimings, Timings, timed};
use crate::views::{FrameList, View, parse_frames, views};
use anyhow::bail;
use clap::ValueEnum;
use reprobe::io::{ExrImage, Provenance, atomic};
use reprobe::progress::Progress;
use reprobe::render::aov::with_first_hits;
use reprobe::render::path_trace::{PathTraceParams, path_trace, path_trace_full};
use reprobe::scene::{Camera, Scene};
use reprobe::transport::World;
use reprobe::transport::path::PathParams;
use serde_json::json;
use std::path::{Path, PathBuf};

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
    /// Most scattering vertices of a path [default: unbounded]
    #[arg(long, value_name = "N")]
    max_depth: Option<u32>,
    /// Auxiliary layers: the first hit's, and the buffers of glossy-probes' passes
    #[arg(long, value_enum, value_name = "LAYERS")]
    pub aov: Option<Aov>,
    /// path-trace: what to write
    #[arg(long, value_enum, default_value = "all")]
    layers: LayerChoice,
    /// Only these frames of the path
    #[arg(long, value_name = "LIST", value_parser = parse_frames)]
    frames: Option<FrameList>,
    /// glossy-probes: the baked probes
    #[arg(long, value_name = "DIR")]
    pub probes: Option<PathBuf>,
    /// glossy-probes: the diffuse light
    #[arg(long, value_name = "FILE.exr")]
    pub lightmap: Option<PathBuf>,
    /// glossy-probes: curvatures of the scene
    #[arg(long, value_name = "FILE.exr")]
    pub curvature: Option<PathBuf>,
    /// glossy-probes: N x N rays a pixel through all passes
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=8))]
    pub supersample: u32,
    /// glossy-probes: the paper's text in every choice
    #[arg(long)]
    pub paper: bool,
    /// glossy-probes: set a parameter of a pass, like gather.falloff=4; a wrong name lists them all
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
}

impl Method {
    /// Whether it reads what other stages have baked.
    pub fn needs_bakes(self) -> bool {
        self != Self::PathTrace
    }

    /// Whether it may read other texels of the probes than a bake for a path has.
    pub fn reads_any_texel(self) -> bool {
        !matches!(self, Self::GlossyProbes | Self::PathTrace)
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
        ..Timings::default()
    };
    match args.method {
        Method::GlossyProbes => render_glossy::run(args, common, timings),
        Method::PathTrace => {
            common.refuse_gpu()?;
            run_path_trace(args, common, timings)
        }
    }
}

/// The views that the command line asks for.
pub fn views_of(args: &Args, common: &Common, scene: &Scene) -> anyhow::Result<Vec<View>> {
    views(common, scene, args.path.as_deref(), args.size, args.frames.as_ref())
}

fn run_path_trace(args: &Args, common: &Common, mut timings: Timings) -> anyhow::Result<Outcome> {
    let params = PathTraceParams {
        spp: args.spp,
        path: PathParams { max_depth: args.max_depth.unwrap_or(u32::MAX), ..PathParams::default() },
    };
    let (scene, load_ms) = timed(|| common.load_scene(&args.scene));
    let scene = scene?;
    if scene.emitters.is_empty() {
        bail!("{}: has no emitter; every frame would be black", args.scene.display());
    }
    let views = views_of(args, common, &scene)?;
    let (world, build_ms) = timed(|| World::new(scene));
    (timings.load_ms, timings.build_ms) = (load_ms, build_ms);

    let bar = common.progress();
    bar.start("path-trace", views.iter().map(|v| u64::from(v.camera.size[1])).sum());
    for View { frame, camera } in &views {
        let mut times = FrameTimings { name: format!("{frame:04}.exr"), ..FrameTimings::default() };
        let path = args.output.join(&times.name);
        let parameters = json!({
            "method": timings.method, "frame": frame, "path_trace": params, "layers": args.layers, "aov": args.aov.is_some(), "camera": describe(camera),
        });
        let provenance = Provenance::new("render-path", &world.scene.hash, common.seed, &parameters);
        if is_finished(&path, &provenance) {
            times.kept = true;
            bar.advance(u64::from(camera.size[1]));
        } else {
            let image = ExrImage::new(camera.size[0] as usize, camera.size[1] as usize).with_provenance(provenance);
            let mut image = times.pass("path_trace", || match args.layers {
                LayerChoice::Full => image.with_rgb("", &path_trace_full(&world, camera, &params, common.seed, *frame, &bar)),
                LayerChoice::All => {
                    let layers = path_trace(&world, camera, &params, common.seed, *frame, &bar);
                    image
                        .with_rgb("", &layers.full())
                        .with_rgb("emission", &layers.emission)
                        .with_rgb("diffuse", &layers.diffuse)
                        .with_rgb("glossy", &layers.glossy)
                }
            });
            if args.aov.is_some() {
                image = times.pass("aov", || with_first_hits(image, &world, camera));
            }
            times.pass("write", || image.write(&path))?;
        }
        timings.frames.push(times);
    }
    bar.finish();
    finish(timings, &args.output)
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
