//! `reprobe bake-lightmap`.

use crate::common::{Common, Outcome, Shard, parse_shard};
use anyhow::bail;
use reprobe::gpu::{GpuScene, LightPaths};
use reprobe::io::{ExrImage, Provenance};
use reprobe::lightmap::parts::Folder;
use reprobe::lightmap::{AtlasParams, BakeParams, Plan, lookup};
use reprobe::transport::World;
use serde_json::json;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;

/// Bake the diffuse light map
///
/// Each texel becomes the light that enters the diffuse layer there; albedo stays out of it, so that textures keep their full
/// resolution. Finished blocks are kept in OUTPUT.parts until the map is whole: a killed bake goes on from them.
#[derive(clap::Args)]
#[command(after_help = "Examples:
  reprobe bake-lightmap room/scene.xml -o lightmap.exr --spp 512
  reprobe bake-lightmap room/scene.xml -o lightmap.exr --spp 512 --shard 0/4")]
pub struct Args {
    /// Mitsuba scene, XML or JSON
    #[arg(value_name = "SCENE")]
    scene: PathBuf,
    /// The light map to write
    #[arg(short, long, value_name = "FILE")]
    output: PathBuf,
    /// Samples a texel
    #[arg(long, value_name = "N", default_value_t = BakeParams::default().spp, value_parser = clap::value_parser!(u32).range(1..=1 << 24))]
    spp: u32,
    /// Edge of a texel, metres, in place of --texels
    #[arg(long, value_name = "M")]
    texel: Option<f32>,
    /// About how many texels the surfaces get in all
    #[arg(long, value_name = "N", default_value_t = AtlasParams::default().budget, conflicts_with = "texel", value_parser = clap::value_parser!(u32).range(1..=1 << 26))]
    texels: u32,
    /// Samples a texel of a first pass, from whose map the paths of the second read diffuse light; 0: trace every path in full
    #[arg(long, value_name = "N", default_value_t = BakeParams::default().first_spp, value_parser = clap::value_parser!(u32).range(0..=1 << 24))]
    first_spp: u32,
    /// Bake blocks I, I+N, I+2N, ... only; the shard that completes them writes the map
    #[arg(long, value_name = "I/N", value_parser = parse_shard)]
    shard: Option<Shard>,
}

pub fn run(args: &Args, common: &Common) -> anyhow::Result<Outcome> {
    let began = Instant::now();
    if args.output.extension().is_none_or(|e| !e.eq_ignore_ascii_case("exr")) {
        bail!("-o {}: expected a file name that ends in .exr", args.output.display());
    }
    let world = common.opaque_world(&args.scene)?;
    let loaded = began.elapsed().as_secs_f64();
    let atlas = AtlasParams { texel: args.texel, budget: args.texels };
    let params = BakeParams { spp: args.spp, atlas, first_spp: args.first_spp, ..Default::default() };
    let provenance = Provenance::new("bake-lightmap", &world.scene.hash, common.seed, &params);
    if ExrImage::read_provenance(&args.output).is_ok_and(|found| found.as_ref() == Some(&provenance)) {
        let summary = format!("{}: up to date", args.output.display());
        return Ok(Outcome { summary, figures: json!({ "up_to_date": true }), ..Outcome::default() });
    }
    let plan = Plan::new(&world, &params, common.seed)?;
    let atlas = &plan.atlas;
    let key = serde_json::to_string(&provenance)?;
    let [first_store, store] = [".first.parts", ".parts"].map(|ending| Folder::new(&beside(&args.output, ending), &key));

    let planned = began.elapsed().as_secs_f64() - loaded;
    let scene = common.on_gpu(|gpu| GpuScene::new(gpu, &world))?;
    let on_gpu = |scene: GpuScene| LightPaths::new(Arc::new(scene), &params.path);
    let first = match plan.first_pass() {
        // Every shard needs all of it.
        Some(pass) => {
            let gpu = scene.clone().map(on_gpu).transpose()?;
            plan.run(&pass.on_gpu(gpu.as_ref()), &first_store, &|_| true, &common.progress())?;
            Some(plan.map(&first_store)?)
        }
        None => None,
    };
    let mine = |b: u32| args.shard.is_none_or(|s| s.has(b));
    let scene = match (scene, &first) {
        (Some(scene), Some(map)) => Some(scene.with_lightmap(map)?),
        (scene, _) => scene,
    };
    let gpu = scene.map(on_gpu).transpose()?;
    let kept = plan.run(&plan.second_pass(first.as_ref()).on_gpu(gpu.as_ref()), &store, &mine, &common.progress())?;
    let missing = (0..plan.blocks()).filter(|&b| !mine(b) && !plan.has(&store, b)).count();
    if missing == 0 {
        write(&plan, &world, &store, provenance, &args.output)?;
        first_store.remove()?;
    }
    let seconds = began.elapsed().as_secs_f64();
    let device = gpu.as_ref().map_or("cpu", |g| g.device());
    let [width, height] = atlas.size;
    let state = if missing > 0 { format!("; {missing} blocks are still missing: run the other shards") } else { String::new() };
    Ok(Outcome {
        summary: format!(
            "{}: {width} x {height}, {} charts, texels of {} m, {} of them baked ({} behind) at {} samples, {} of {} blocks kept from before, {seconds:.1} s on {device}{state}",
            args.output.display(),
            atlas.charts.len(),
            atlas.texel,
            plan.len(),
            plan.backs(),
            args.spp,
            kept,
            plan.blocks(),
        ),
        figures: json!({
            "size": atlas.size, "charts": atlas.charts.len(), "texel": atlas.texel, "texels": plan.len(), "backs": plan.backs(),
            "spp": args.spp, "blocks": plan.blocks(), "blocks_kept": kept, "blocks_missing": missing,
            "device": device, "seconds_load": loaded, "seconds_plan": planned, "seconds": seconds,
        }),
        ..Outcome::default()
    })
}

/// The output's path with an ending more.
fn beside(output: &Path, ending: &str) -> PathBuf {
    let mut name = output.as_os_str().to_owned();
    name.push(ending);
    name.into()
}

/// Puts the blocks together, writes the map and then deletes them.
fn write(plan: &Plan, world: &World, store: &Folder, provenance: Provenance, output: &Path) -> anyhow::Result<()> {
    let baked = match plan.assemble(store) {
        Ok(baked) => baked,
        // Another shard was faster and has deleted the blocks.
        Err(_) if ExrImage::read(output).is_ok_and(|i| i.provenance.as_ref() == Some(&provenance)) => return Ok(()),
        Err(e) => return Err(e.into()),
    };
    lookup::encode(&world.scene.geometry, &plan.atlas, &baked.front, baked.back.as_deref(), provenance).write(output)?;
    store.remove()?;
    Ok(())
}
