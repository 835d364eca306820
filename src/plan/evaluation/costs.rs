//! Runs the commands of an evaluation, and notes what they took.

use super::Evaluate;
use super::plan::{Plan, Planned};
use crate::Result;
use crate::base::clock::seconds;
use crate::io::json;
use crate::method::glossy_probes::wanted::Served;
use crate::method::light_field_probes::store::{LightFieldSet, probe_bytes};
use crate::metric::evaluation::{Costs, MethodCost, ProbeCost, StageCost};
use crate::plan::timings::{Timings, frame_ms, is_rendering};
use crate::plan::{Context, pipeline};
use crate::probe::store::ProbeStore;
use crate::scene::Scene;
use serde_json::Value;
use std::path::Path;

/// Runs all stages; what they took is added to what earlier runs have noted in `timings.json`.
pub fn execute(of: &Evaluate, cx: &Context, plan: &Plan, scene: &Scene) -> Result<Costs> {
    let file = of.output.join("timings.json");
    let earlier: Costs = std::fs::read_to_string(&file).ok().and_then(|t| json::parse(&file, &t).ok()).unwrap_or_default();
    let total = plan.stages().count();
    let mut costs = Costs::default();
    for (i, Planned { stage, seed, users }) in plan.stages().enumerate() {
        let clock = seconds();
        let cx = cx.with_seed(*seed);
        let outcome = pipeline::execute(stage, &cx, &format!("[{} of {total}] ", i + 1))?;
        let (took, command) = (clock(), stage.command_line(&cx));
        let before = earlier.stages.iter().find(|s| s.command == command).and_then(|s| s.seconds);
        let seconds = if was_there(&outcome.figures) { before } else { Some(before.unwrap_or(0.0).max(took)) };
        if i < plan.bakes.len() {
            let methods = users.iter().map(|&u| of.variants[u].name.clone()).collect();
            costs.stages.push(StageCost { command, stage: stage.command().into(), methods, seconds });
            // Noted at once, as the next stage may take hours.
            let mut noted = Costs { methods: earlier.methods.clone(), ..costs.clone() };
            let is_new = |s: &&StageCost| costs.stages.iter().all(|c| c.command != s.command);
            noted.stages.extend(earlier.stages.iter().filter(is_new).cloned());
            json::write(&file, &noted)?;
        }
    }
    for (i, (variant, planned)) in of.variants.iter().zip(&plan.frames).enumerate() {
        let probes = plan.probes(i).map(std::path::PathBuf::as_path);
        let cost = method_cost(planned.stage.output(), probes, &variant.name, &costs, scene);
        costs.methods.insert(variant.name.clone(), cost);
    }
    json::write(&file, &costs)?;
    Ok(costs)
}

/// Whether a stage's figures say that it had nothing to do.
fn was_there(figures: &Value) -> bool {
    let is_whole = figures["kept"].is_u64() && figures["kept"] == figures["count"];
    figures["up_to_date"] == true || figures["baked"] == 0 || is_whole
}

fn method_cost(frames: &Path, probes: Option<&Path>, name: &str, costs: &Costs, scene: &Scene) -> MethodCost {
    let Some(timings) = Timings::read(&frames.join("timings.json")) else { return MethodCost::default() };
    let frame_ms = frame_ms(&timings.mean_ms);
    let mut passes_ms = timings.mean_ms;
    passes_ms.retain(|pass, _| is_rendering(pass));
    let mine = costs.stages.iter().filter(|s| s.methods.iter().any(|m| m == name));
    let precompute_seconds = mine.map(|s| s.seconds).sum::<Option<f64>>().filter(|&s| s > 0.0);
    let probes = probes.and_then(|folder| probe_cost(folder, scene));
    MethodCost { frame_ms, passes_ms, precompute_seconds, probes, denoiser: timings.denoiser }
}

/// What a set of probes holds; `None` for a folder of something else.
fn probe_cost(folder: &Path, scene: &Scene) -> Option<ProbeCost> {
    light_field_cost(folder).or_else(|| glossy_cost(folder, scene))
}

fn light_field_cost(folder: &Path) -> Option<ProbeCost> {
    let set = LightFieldSet::read(folder).ok()?;
    let baked = set.files.iter().filter(|files| files.iter().all(|hash| !hash.is_empty())).count();
    let bytes = (baked * probe_bytes(&set.bake)) as u64;
    Some(ProbeCost { count: set.places.used().len(), baked, size: [set.bake.size; 2], bytes })
}

fn glossy_cost(folder: &Path, scene: &Scene) -> Option<ProbeCost> {
    let mut store = ProbeStore::<Served>::open(folder, scene, 8).ok()?;
    let baked: Vec<usize> = (0..store.set.files.len()).filter(|&i| !store.set.files[i].is_empty()).collect();
    let one = store.probe(*baked.first()?).ok()?.bytes();
    let count = store.set.places.used().len();
    Some(ProbeCost { count, baked: baked.len(), size: store.set.size, bytes: (baked.len() * one) as u64 })
}
