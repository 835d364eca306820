//! `reprobe devices`.

use reprobe::base::simd::Lanes;
use reprobe::gpu::{Adapter, adapters};
use reprobe::plan::Outcome;
use serde_json::json;

/// List the devices that this machine has
///
/// The CPU, and the adapters that Vulkan, Metal or DX12 offer. A command takes the one that its --device names; auto takes the first real GPU
/// where the command can use one. Software adapters (llvmpipe) are taken only by name. Of the CPU also the instruction set is said: the best
/// that it has, or what $REPROBE_SIMD asks for (avx512, avx2 or portable; results are the same, bit for bit).
#[derive(clap::Args)]
#[command(after_help = "Examples:
  reprobe devices
  reprobe devices --json
  reprobe resmap room/scene.xml --probes probes.json -o resmap/ --device gpu:llvmpipe")]
pub struct Args {}

pub fn run(_: &Args) -> anyhow::Result<Outcome> {
    let list = adapters();
    let threads = rayon::current_num_threads();
    let simd = Lanes::chosen().name();
    let mut lines = vec![format!("cpu: {threads} threads, {simd}; every command")];
    lines.extend(list.iter().map(line));
    if list.is_empty() {
        lines.push("No GPU: neither Vulkan, Metal nor DX12 offers an adapter.".into());
    }
    Ok(Outcome {
        summary: lines.join("\n"),
        figures: json!({ "cpu": { "threads": threads, "simd": simd }, "adapters": list }),
        ..Outcome::default()
    })
}

fn line(a: &Adapter) -> String {
    let kind = if a.is_gpu { "gpu" } else { "software adapter, by name only" };
    let clock = if a.timestamps { "timestamps" } else { "no timestamps" };
    format!(
        "gpu:\"{}\": {kind}; {}, {}; buffers of {} MiB, {clock}; resmap, bake-probes, bake-lightmap, render-path",
        a.name,
        a.backend,
        a.driver,
        a.max_binding >> 20
    )
}
