//! `reprobe bake-probes`.

use crate::common::{Common, Outcome, Shard, parse_shard, parse_size};
use crate::set_params::{apply, split};
use crate::views::{FrameList, parse_frames, views};
use anyhow::{Context, bail};
use reprobe::base::progress::Progress;
use reprobe::gpu::GpuScene;
use reprobe::io::provenance::hash_file;
use reprobe::io::{ExrImage, Provenance};
use reprobe::lightmap::LightMap;
use reprobe::method::glossy_probes::GlossyProbeParams;
use reprobe::method::glossy_probes::bake::{Bake, BakeParams, PAPER_ROUGHNESS_SCALE, Traced, bake_glossy, probe_geometry};
use reprobe::method::glossy_probes::gpu::paths::ProbePaths;
use reprobe::method::glossy_probes::wanted::{Views, Wanted, wanted_texels};
use reprobe::probe::file::{BakedSet, MAX_MATERIALS};
use reprobe::probe::parameter_map::{ParameterMap, map_paths};
use reprobe::probe::placement::ProbeGrid;
use reprobe::probe::set::{ProbeSet, numbered};
use reprobe::probe::store::{ProbeStore, write_set};
use reprobe::surface::curvature_file;
use serde_json::json;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Instant;

/// Bake the glossy light probes
///
/// Each probe becomes NNNN.exr: its glossy colour at reduced roughness, the reflector (triangle and barycentrics), and what a
/// mirror there would show. Finished probes are kept when the command runs again; set.json is written when all are there.
#[derive(clap::Args)]
#[command(after_help = "Examples:
  reprobe bake-probes room/scene.xml --probes probes.json --qhmap qhmap/ -o probes/ --spp 256
  reprobe bake-probes room/scene.xml --probes probes.json --qhmap qhmap/ -o probes/ --shard 0/4
  reprobe bake-probes room/scene.xml --probes probes.json --qhmap qhmap/ -o probes/ --lightmap lightmap.exr --error 0.05 --spp 512
  reprobe bake-probes room/scene.xml --probes probes.json --qhmap qhmap/ -o probes/ --spp 128 \\
      --for-path path.json --curvature curvature.exr --size 480x270 --supersample 2")]
pub struct Args {
    /// Mitsuba XML or JSON scene
    scene: PathBuf,
    /// Probe positions, from place-probes
    #[arg(long, value_name = "FILE")]
    probes: PathBuf,
    /// Parameterisations, from qhmap
    #[arg(long, value_name = "DIR")]
    qhmap: PathBuf,
    /// Folder of baked probes to write
    #[arg(short, long, value_name = "DIR")]
    output: PathBuf,
    /// Paths a texel; the most of them with --error
    #[arg(long, value_name = "N", default_value_t = BakeParams::default().spp)]
    spp: u32,
    /// Trace a texel until its standard error is this fraction of its luminance, by the variance of its first 8 paths and its neighbours'
    #[arg(long, value_name = "E")]
    error: Option<f32>,
    /// Factor on roughness at the first glossy vertex [default: 1; with --paper 0.5]
    #[arg(long, value_name = "S")]
    roughness_scale: Option<f32>,
    /// Spread a texel's paths over its solid angle, in place of sending all through its centre
    #[arg(long)]
    spread: bool,
    /// Read diffuse light from this light map, in place of tracing on from diffuse surfaces: faster, less noise, slightly biased
    #[arg(long, value_name = "FILE")]
    lightmap: Option<PathBuf>,
    /// Bake probes I, I+N, I+2N, ... only
    #[arg(long, value_name = "I/N", value_parser = parse_shard)]
    shard: Option<Shard>,
    /// Bake only the texels that the views of this camera path use
    #[arg(long, value_name = "PATH.json", requires = "curvature")]
    for_path: Option<PathBuf>,
    /// Curvatures, for --for-path
    #[arg(long, value_name = "FILE")]
    curvature: Option<PathBuf>,
    /// Size of the views, for --for-path [default: the path's]
    #[arg(long, value_name = "WxH", value_parser = parse_size)]
    size: Option<[u32; 2]>,
    /// Frames of the path, for --for-path [default: all]
    #[arg(long, value_name = "LIST", value_parser = parse_frames)]
    frames: Option<FrameList>,
    /// Rays a pixel along one side, for --for-path
    #[arg(long, value_name = "N", default_value_t = 1)]
    supersample: u32,
    /// The paper's roughness factor, and its choice of texels with --for-path
    #[arg(long)]
    paper: bool,
    /// Choose texels with this parameter of the gather, as render-path's --set, for --for-path
    #[arg(long = "set", value_name = "NAME=VALUE")]
    set: Vec<String>,
    /// Also bake the texels of another choice, with these parameters of the gather, for --for-path; `paper` for those of
    /// --paper; may be repeated
    #[arg(long, value_name = "[paper,]NAME=VALUE,...", requires = "for_path")]
    alternative: Vec<String>,
}

pub fn run(args: &Args, common: &Common) -> anyhow::Result<Outcome> {
    let began = Instant::now();
    let by_choice = if args.paper { PAPER_ROUGHNESS_SCALE } else { BakeParams::default().roughness_scale };
    let roughness_scale = args.roughness_scale.unwrap_or(by_choice);
    if args.spp == 0 || !(roughness_scale > 0.0 && roughness_scale <= 1.0) {
        bail!("--spp {} --roughness-scale {roughness_scale}: expected at least 1, and a factor in (0, 1]", args.spp);
    }
    if let Some(error) = args.error.filter(|e| !(*e > 0.0 && *e < f32::INFINITY)) {
        bail!("--error {error}: expected a positive number, such as 0.05 for 5 %");
    }
    let world = common.opaque_world(&args.scene)?;
    let scene = &world.scene;
    if scene.materials.len() > MAX_MATERIALS {
        bail!(
            "{}: {} materials, but a probe file tells at most {MAX_MATERIALS} apart",
            args.scene.display(),
            scene.materials.len()
        );
    }
    let grid = ProbeGrid::read(&args.probes)?;
    grid.provenance.check_scene(&args.probes, &scene.hash)?;
    let maps = ProbeSet::read(&args.qhmap, "qhmap")?;
    maps.provenance.check_scene(&args.qhmap, &scene.hash)?;
    maps.provenance.check_input(&args.qhmap, "probes", &hash_file(&args.probes)?)?;

    let params = BakeParams { spp: args.spp, error: args.error, roughness_scale, spread: args.spread };
    let progress = common.progress();
    let passes = |paper: bool| if paper { GlossyProbeParams::paper() } else { GlossyProbeParams::default() };
    let gather = apply(&passes(args.paper), &args.set)?.gather;
    let for_path = match &args.for_path {
        Some(path) => {
            let views = views(common, scene, Some(path), args.size, args.frames.as_ref())?;
            let cameras: Vec<_> = views.into_iter().map(|v| v.camera).collect();
            let mut views = Views::new(&cameras, args.supersample, &gather);
            for alternative in &args.alternative {
                let (mut parts, all) = (split(alternative), split(alternative).len());
                parts.retain(|part| part != "paper");
                views = views.or(&apply(&passes(args.paper || parts.len() < all), &parts)?.gather);
            }
            Some((views, cameras))
        }
        None => None,
    };
    let views = for_path.as_ref().map(|(views, _)| views.clone());
    let mut provenance = Provenance::new("bake-probes", &scene.hash, common.seed, &json!({ "bake": params, "views": views }))
        .with_input("probes", hash_file(&args.probes)?)
        .with_input("qhmap", hash_file(&ProbeSet::path(&args.qhmap))?);
    if let Some(file) = &args.lightmap {
        provenance = provenance.with_input("lightmap", hash_file(file)?);
    }
    if ProbeStore::open(&args.output, scene, 0).is_ok_and(|found| found.set.provenance == provenance) {
        let summary = format!("{}: up to date", args.output.display());
        return Ok(Outcome { summary, figures: json!({ "baked": 0, "up_to_date": true }), ..Outcome::default() });
    }
    let wanted = match &for_path {
        Some((views, cameras)) => {
            let file = args.curvature.as_ref().context("--for-path needs --curvature")?;
            let curvature = curvature_file::read(file, scene.geometry.positions.len(), &scene.hash)?;
            let map = |i| Ok(ParameterMap::load(&args.qhmap, i)?.0);
            Some(wanted_texels(&world, &curvature, &grid, &map, cameras, views, &progress)?)
        }
        None => None,
    };
    let needed: Vec<usize> = match &wanted {
        Some(w) => w.keys().copied().collect(),
        None => (0..grid.len()).collect(),
    };
    let finished =
        |index: usize| ExrImage::read_provenance(&numbered(&args.output, index)).is_ok_and(|p| p.as_ref() == Some(&provenance));
    let mine = needed.iter().copied().filter(|i| args.shard.is_none_or(|s| s.has(*i as u32)));
    let todo: Vec<usize> = mine.filter(|&i| !finished(i)).collect();
    let baked = todo.len();
    let lightmap = args.lightmap.as_ref().map(|file| LightMap::load(file, scene)).transpose()?;
    let on_gpu = |gpu| ProbePaths::new(Arc::new(GpuScene::lit(gpu, &world, lightmap.as_ref())?), &params);
    let gpu = if todo.is_empty() { None } else { common.on_gpu(on_gpu)? };
    let shared = Bake { world: &world, params: &params, seed: common.seed, lightmap: lightmap.as_ref(), gpu: gpu.as_ref() };
    let traced = bake(args, &shared, &maps, &grid, &provenance, todo, wanted.as_ref(), &progress)?;

    let missing = needed.iter().filter(|&&i| !finished(i)).count();
    if missing == 0 {
        let files = (0..grid.len())
            .map(|i| if needed.binary_search(&i).is_ok() { hash_file(&numbered(&args.output, i)) } else { Ok(String::new()) });
        let set = BakedSet {
            size: maps.size,
            roughness_scale: params.roughness_scale,
            mirrored: shared.tells_mirrored(),
            views,
            files: files.collect::<Result<_, _>>()?,
            provenance,
            grid,
        };
        write_set(&args.output, &set)?;
    }
    let device = gpu.as_ref().map_or("cpu", |g| g.device());
    let seconds = began.elapsed().as_secs_f64();
    let rest = if missing > 0 { format!("; {missing} are still missing: run the other shards") } else { String::new() };
    Ok(Outcome {
        summary: format!(
            "{}: {baked} probes baked, {} kept, {} glossy texels at {:.0} paths, {seconds:.1} s on {device}{rest}",
            args.output.display(),
            needed.len() - baked - missing,
            traced.texels,
            traced.paths as f64 / traced.texels.max(1) as f64
        ),
        figures: json!({ "probes": needed.len(), "baked": baked, "missing": missing, "texels": traced.texels, "paths": traced.paths, "spp": args.spp, "device": device, "seconds": seconds }),
        ..Outcome::default()
    })
}

/// Bakes and writes the probes in `todo`; returns what was traced.
#[allow(clippy::too_many_arguments, reason = "called once; a struct would only rename its arguments")]
fn bake(
    args: &Args,
    shared: &Bake,
    maps: &ProbeSet,
    grid: &ProbeGrid,
    provenance: &Provenance,
    todo: Vec<usize>,
    wanted: Option<&Wanted>,
    progress: &dyn Progress,
) -> anyhow::Result<Traced> {
    let rows = maps.size[1] as u64;
    progress.start("probes", todo.len() as u64 * rows);
    let mut traced = Traced::default();
    for index in todo {
        let mut probe = probe_geometry(shared.world, grid.position(index), ParameterMap::load(&args.qhmap, index)?.0);
        let flags = wanted.as_ref().and_then(|w| w.get(&index));
        let want = |i: u32| flags.is_none_or(|f| f[i as usize]);
        let Traced { texels, paths } = bake_glossy(shared, &mut probe, index as u32, &want, progress)?;
        traced.texels += texels;
        traced.paths += paths;
        let [forward, inverse] = map_paths(&args.output, index);
        probe.map.forward_image().with_provenance(provenance.clone()).write(&forward)?;
        probe.to_image(provenance.clone()).write(&inverse)?;
    }
    progress.finish();
    Ok(traced)
}
