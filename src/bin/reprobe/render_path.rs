//! `reprobe render-path`.

use crate::common::{Common, Outcome, parse_size};
use crate::timings::{FrameTimings, Timings, timed};
use anyhow::{Context, bail};
use clap::ValueEnum;
use reprobe::io::{ExrImage, Provenance, atomic};
use reprobe::progress::Progress;
use reprobe::render::aov::with_first_hits;
use reprobe::render::path_trace::{PathTraceParams, path_trace};
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
    scene: PathBuf,
    /// Camera path [default: one frame from the scene's own sensor]
    #[arg(long, value_name = "PATH.json")]
    path: Option<PathBuf>,
    /// Folder for NNNN.exr and timings.json; finished frames in it are kept
    #[arg(long, short, value_name = "FOLDER")]
    output: PathBuf,
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
    /// Auxiliary layers of the first hit
    #[arg(long, value_enum, value_name = "LAYERS")]
    aov: Option<Aov>,
}

#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Method {
    /// Glossy probes, reprojected
    GlossyProbes,
    /// The reference: path tracing
    PathTrace,
}

#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Aov {
    /// depth, normal, position, material, albedo, alpha
    All,
}

/// What all methods need, checked.
struct Resolved<'a> {
    args: &'a Args,
    common: &'a Common,
    scene: Scene,
    cameras: Vec<Camera>,
    timings: Timings,
}

pub fn run(args: &Args, common: &Common) -> anyhow::Result<Outcome> {
    let resolved = Resolved::from_args(args, common)?;
    match args.method {
        Method::GlossyProbes => bail!("--method glossy-probes: not yet"),
        Method::PathTrace => run_path_trace(resolved),
    }
}

impl<'a> Resolved<'a> {
    fn from_args(args: &'a Args, common: &'a Common) -> anyhow::Result<Self> {
        let (scene, load_ms) = timed(|| common.load_scene(&args.scene));
        let scene = scene?;
        let mut cameras = match &args.path {
            Some(path) => bail!("{}: camera paths: not yet", path.display()),
            None => {
                let sensor = scene.sensor.clone();
                vec![sensor.with_context(|| format!("{}: has no sensor; give a camera path with --path", args.scene.display()))?]
            }
        };
        if let Some(size) = args.size {
            cameras.iter_mut().for_each(|c| c.size = size);
        }
        let timings = Timings {
            method: args.method.to_possible_value().map_or_else(String::new, |v| v.get_name().into()),
            threads: rayon::current_num_threads(),
            load_ms,
            ..Timings::default()
        };
        Ok(Self { args, common, scene, cameras, timings })
    }
}

fn run_path_trace(r: Resolved) -> anyhow::Result<Outcome> {
    let Resolved { args, common, scene, cameras, mut timings } = r;
    let params = PathTraceParams {
        spp: args.spp,
        path: PathParams { max_depth: args.max_depth.unwrap_or(u32::MAX), ..PathParams::default() },
    };
    if scene.emitters.is_empty() {
        bail!("{}: has no emitter; every frame would be black", args.scene.display());
    }
    let (world, build_ms) = timed(|| World::new(scene));
    timings.build_ms = build_ms;

    let bar = common.progress();
    bar.start("path-trace", cameras.iter().map(|c| u64::from(c.size[1])).sum());
    for (frame, camera) in (0u32..).zip(&cameras) {
        let mut times = FrameTimings { name: format!("{frame:04}.exr"), ..FrameTimings::default() };
        let path = args.output.join(&times.name);
        let parameters = json!({
            "method": timings.method, "frame": frame, "path_trace": params, "aov": args.aov.is_some(), "camera": describe(camera),
        });
        let provenance = Provenance::new("render-path", &world.scene.hash, common.seed, &parameters);
        if is_finished(&path, &provenance) {
            times.kept = true;
            bar.advance(u64::from(camera.size[1]));
        } else {
            let layers = times.pass("path_trace", || path_trace(&world, camera, &params, common.seed, frame, &bar));
            let mut image = ExrImage::new(camera.size[0] as usize, camera.size[1] as usize)
                .with_rgb("", &layers.full())
                .with_rgb("emission", &layers.emission)
                .with_rgb("diffuse", &layers.diffuse)
                .with_rgb("glossy", &layers.glossy)
                .with_provenance(provenance);
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
fn finish(mut timings: Timings, output: &Path) -> anyhow::Result<Outcome> {
    timings.finish();
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
fn is_finished(path: &Path, provenance: &Provenance) -> bool {
    path.exists() && ExrImage::read(path).is_ok_and(|image| image.provenance.as_ref() == Some(provenance))
}

/// The camera, as provenance keeps it.
fn describe(camera: &Camera) -> serde_json::Value {
    json!({
        "to_world": camera.to_world.to_cols_array(), "fov_x_rad": camera.fov_x, "size": camera.size,
        "aperture_radius": camera.aperture_radius, "focus_distance": camera.focus_distance,
    })
}
