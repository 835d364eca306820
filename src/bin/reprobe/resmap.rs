//! `reprobe resmap`.

use crate::common::{Common, Outcome, parse_size};
use crate::probe_set;
use reprobe::gpu::{GpuScene, RayTracer};
use reprobe::io::Provenance;
use reprobe::io::provenance::hash_file;
use reprobe::method::glossy_probes::resmap::{ALPHA_HALF, ResmapParams, Smoothness, resolution_map};
use reprobe::method::glossy_probes::seen::SeenBuffers;
use reprobe::probe::placement::ProbeGrid;
use reprobe::probe::set::{ProbeSet, numbered};
use serde_json::json;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Instant;

/// Measure how much resolution each direction of each probe deserves
///
/// Smooth materials, large or slanted surfaces and fine geometry get more; diffuse surfaces get nothing. Writes NNNN.exr with
/// the channels m, m_mat, m_size, m_complexity, depth, normal.X, normal.Y, normal.Z, facing. Finished files are kept.
#[derive(clap::Args)]
#[command(after_help = "Examples:
  reprobe resmap room/scene.xml --probes probes.json -o resmap/
  reprobe resmap room/scene.xml --probes probes.json -o resmap/ --size 128x64")]
pub struct Args {
    /// Mitsuba scene, XML or JSON
    #[arg(value_name = "SCENE")]
    scene: PathBuf,
    /// Where the probes stand, from place-probes
    #[arg(long, value_name = "FILE")]
    probes: PathBuf,
    /// Folder for NNNN.exr and set.json
    #[arg(short, long, value_name = "FOLDER")]
    output: PathBuf,
    /// Size of the maps, texels
    #[arg(long, value_name = "WxH", value_parser = parse_size, default_value = "256x128")]
    size: [u32; 2],
    /// Edge of the DCT's window, texels: 8, 16 or 32
    #[arg(long, value_name = "N", default_value_t = ResmapParams::default().dct_size)]
    dct_size: u32,
    /// Exponent of the DCT's frequency weights
    #[arg(long, value_name = "K", default_value_t = ResmapParams::default().frequency_exponent)]
    frequency_exponent: f32,
    /// Sigma of the blur of m, texels
    #[arg(long, value_name = "SIGMA", default_value_t = ResmapParams::default().blur_sigma)]
    blur_sigma: f32,
    /// Smallest facing cosine that counts
    #[arg(long, value_name = "COS", default_value_t = ResmapParams::default().facing_min)]
    facing_min: f32,
    /// Roughness alpha that deserves half of a mirror's texels
    #[arg(long, value_name = "ALPHA", default_value_t = ALPHA_HALF)]
    alpha_half: f32,
    /// The paper's text in every choice
    #[arg(long, conflicts_with = "alpha_half")]
    paper: bool,
}

pub fn run(args: &Args, common: &Common) -> anyhow::Result<Outcome> {
    let params = ResmapParams {
        size: args.size,
        dct_size: args.dct_size,
        frequency_exponent: args.frequency_exponent,
        blur_sigma: args.blur_sigma,
        facing_min: args.facing_min,
        smoothness: if args.paper { Smoothness::Linear } else { Smoothness::Lobe { alpha_half: args.alpha_half } },
    };
    params.validate()?;
    let grid = ProbeGrid::read(&args.probes)?;
    let world = common.opaque_world(&args.scene)?;
    grid.provenance.check_scene(&args.probes, &world.scene.hash)?;
    let start = Instant::now();
    let tracer = common.on_gpu(|gpu| RayTracer::new(Arc::new(GpuScene::new(gpu, &world)?)))?;
    let provenance =
        Provenance::new("resmap", &world.scene.hash, common.seed, &params).with_input("probes", hash_file(&args.probes)?);
    let set = ProbeSet { count: grid.len(), size: params.size, provenance };
    let (texels, glossy) = (AtomicU64::new(0), AtomicU64::new(0));
    let kept = probe_set::fill(
        &args.output,
        &set,
        common,
        || Ok(()),
        |(), i| {
            let seen = match &tracer {
                None => SeenBuffers::cast(&world, grid.position(i), params.size),
                Some(tracer) => {
                    let rays = SeenBuffers::rays(grid.position(i), params.size);
                    SeenBuffers::from_hits(&world, params.size, &rays, &tracer.closest(&rays)?)
                }
            };
            let map = resolution_map(&params, &seen);
            texels.fetch_add(map.m_mat.len() as u64, Ordering::Relaxed);
            glossy.fetch_add(map.m_mat.iter().filter(|m| **m > 0.0).count() as u64, Ordering::Relaxed);
            map.image(&seen).with_provenance(set.provenance.clone()).write_uncompressed(&numbered(&args.output, i))
        },
    )?;
    let seconds = start.elapsed().as_secs_f64();
    let device = tracer.as_ref().map_or("cpu", |t| t.device());
    // None where all maps were kept from before.
    let (texels, glossy) = (texels.into_inner(), glossy.into_inner());
    let share = (texels > 0).then(|| glossy as f64 / texels as f64);
    let [w, h] = params.size;
    let seen = share.map_or_else(String::new, |s| format!(", {:.0} % of their texels glossy", s * 100.0));
    Ok(Outcome {
        summary: format!(
            "{}: {} maps of {w} x {h}, {kept} kept from before{seen}, {seconds:.1} s on {device}",
            args.output.display(),
            set.count
        ),
        figures: json!({"count": set.count, "kept": kept, "size": params.size, "glossy_share": share, "device": device, "seconds": seconds}),
        ..Outcome::default()
    })
}
