//! The commands of an evaluation: bakes that its methods share, bakes of their own, frames, reference.

use super::Args;
use super::variant::{Given, STAGES, Variant};
use crate::common::Common;
use crate::pipeline::{Bakes, Pipeline, Settings, Stage};
use crate::set_params::split;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// A command, and the variants (by index) that use its output.
pub struct Planned {
    /// The command.
    pub stage: Stage,
    /// What it writes.
    pub output: PathBuf,
    /// Who reads it; empty for the reference.
    pub users: Vec<usize>,
}

/// What an evaluation does before it measures.
pub struct Plan {
    /// Bakes in order.
    pub bakes: Vec<Planned>,
    /// A command a variant.
    pub frames: Vec<Planned>,
    /// Unless it was given.
    pub reference: Option<Planned>,
    /// Probes of each variant, where it reads such.
    pub probes: Vec<Option<PathBuf>>,
}

impl Plan {
    /// The commands in order.
    pub fn commands(&self) -> impl Iterator<Item = &Planned> {
        self.bakes.iter().chain(&self.frames).chain(&self.reference)
    }
}

/// Where frames of a variant go.
pub fn frames_folder(args: &Args, variant: &Variant) -> PathBuf {
    args.output.join("frames").join(&variant.name)
}

/// Where the reference is, or goes.
pub fn reference_folder(args: &Args) -> PathBuf {
    args.reference.clone().unwrap_or_else(|| args.output.join("reference"))
}

/// Plans all commands.
pub fn plan(args: &Args, common: &Common, settings: Settings, variants: &[Variant]) -> Plan {
    let pipeline = Pipeline { common, scene: &args.scene, path: Some(&args.path), frames: args.frames.as_ref(), settings };
    let mut plan = Plan { bakes: Vec::new(), frames: Vec::new(), reference: None, probes: Vec::new() };
    // What each set of probes is asked for.
    let mut choices: BTreeMap<PathBuf, Vec<String>> = BTreeMap::new();
    for (index, variant) in variants.iter().enumerate() {
        let output = frames_folder(args, variant);
        let mut render = pipeline.render(&output);
        let mut probes = None;
        if variant.method.needs_bakes() {
            let bakes = folders(args, variant);
            for (stage, output) in pipeline.bakes(&bakes).into_iter().zip(outputs(&bakes)) {
                if is_left_out(args, variant, &bakes, stage.command()) {
                    continue;
                }
                match plan.bakes.iter_mut().find(|p| p.output == output) {
                    Some(planned) => planned.users.push(index),
                    None => plan.bakes.push(Planned { stage: configure(stage, args, variant), output, users: vec![index] }),
                }
            }
            let (choice, known) = (choice(variant), choices.entry(bakes.probes.clone()).or_default());
            if variant.method.reads_probes() && !known.contains(&choice) {
                known.push(choice);
            }
            render = pipeline.render_from(&bakes, &output);
            let read = variant.option("--probes").map_or(bakes.probes, PathBuf::from);
            probes = variant.method.reads_probes().then_some(read);
        }
        render = render.option("--method", variant.method_name());
        render = variant.options.iter().fold(render, |s, (name, value)| s.replace(name, value.as_deref()));
        let stage = variant.sets.iter().fold(render, |s, set| s.option("--set", set));
        plan.frames.push(Planned { stage, output, users: vec![index] });
        plan.probes.push(probes);
    }
    if !pipeline.settings.all_texels {
        for planned in plan.bakes.iter_mut().filter(|p| p.stage.command() == "bake-probes") {
            planned.stage = choose(planned.stage.clone(), choices.get(&planned.output).map_or(&[], Vec::as_slice));
        }
    }
    if args.reference.is_none() {
        let output = reference_folder(args);
        // Not the samples of a path-traced method, whose errors would be the reference's.
        let seed = common.seed.wrapping_add(1).to_string();
        plan.reference =
            Some(Planned { stage: pipeline.reference(&output).replace("--seed", Some(&seed)), output, users: Vec::new() });
    }
    plan
}

/// The bake of what all `choices` ask for: the default or the first one, and the others besides.
fn choose(bake: Stage, choices: &[String]) -> Stage {
    let base = choices.iter().position(String::is_empty).unwrap_or(0);
    choices.iter().enumerate().fold(bake, |bake, (i, choice)| {
        if i != base {
            return bake.option("--alternative", choice);
        }
        split(choice)
            .into_iter()
            .fold(bake, |b, set| if set == "paper" { b.flag("--paper", true) } else { b.option("--set", set) })
    })
}

/// What a variant changes of the choice of texels; empty for nothing.
fn choice(variant: &Variant) -> String {
    let paper = variant.options.iter().any(|(name, _)| name == "--paper").then_some("paper");
    let sets = variant.sets.iter().map(String::as_str).filter(|s| s.starts_with("gather."));
    paper.into_iter().chain(sets).collect::<Vec<_>>().join(",")
}

/// The stage with the options that all its users want, and the variant's own.
fn configure(stage: Stage, args: &Args, variant: &Variant) -> Stage {
    let mine = args.bake.iter().chain(&variant.bakes).filter(|(name, _)| name == stage.command());
    let given: Vec<&Given> = mine.map(|(_, given)| given).collect();
    given.into_iter().fold(stage, |s, (name, value)| s.replace(name, value.as_deref()))
}

/// The outputs of [`Pipeline::bakes`]' stages.
fn outputs(bakes: &Bakes) -> [PathBuf; 6] {
    let Bakes { grid, resmap, qhmap, curvature, lightmap, probes } = bakes.clone();
    [grid, resmap, qhmap, curvature, lightmap, probes]
}

/// Whether a stage is left out, as its method does not need it or the user gave what it would lead to.
fn is_left_out(args: &Args, variant: &Variant, bakes: &Bakes, command: &str) -> bool {
    let is = |given: &Option<PathBuf>, used: &Path| given.as_deref() == Some(used);
    match command {
        "curvature" => is(&args.curvature, &bakes.curvature),
        "bake-lightmap" => is(&args.lightmap, &bakes.lightmap),
        // What only the probes need.
        _ => !variant.method.reads_probes() || is(&args.probes, &bakes.probes) || variant.option("--probes").is_some(),
    }
}

/// Where a variant's bakes lie: in the common folder, and from the first stage with options of its own in one named after those.
fn folders(args: &Args, variant: &Variant) -> Bakes {
    let root = args.bakes.clone().unwrap_or_else(|| args.output.join("bakes"));
    let common = Bakes::within(&root);
    let within = |stages: &[&str]| own(variant, stages).map(|name| Bakes::within(&root.join(name)));
    let given = |own: Option<PathBuf>, given: &Option<PathBuf>, common: PathBuf| own.or(given.clone()).unwrap_or(common);
    let all = STAGES;
    Bakes {
        grid: within(&all[..1]).map_or(common.grid, |b| b.grid),
        resmap: within(&all[..2]).map_or(common.resmap, |b| b.resmap),
        qhmap: within(&all[..3]).map_or(common.qhmap, |b| b.qhmap),
        curvature: given(within(&all[3..4]).map(|b| b.curvature), &args.curvature, common.curvature),
        lightmap: given(within(&all[4..5]).map(|b| b.lightmap), &args.lightmap, common.lightmap),
        probes: given(within(&all).map(|b| b.probes), &args.probes, common.probes),
    }
}

/// The variant's own options of some stages as a folder's name; `None` where it has none.
fn own(variant: &Variant, stages: &[&str]) -> Option<String> {
    let mine = variant.bakes.iter().filter(|(stage, _)| stages.contains(&stage.as_str()));
    let mut texts: Vec<String> = mine
        .map(|(stage, (name, value))| format!("{stage}{name}{}", value.as_ref().map_or(String::new(), |v| format!("={v}"))))
        .collect();
    texts.sort();
    let name = texts.join("+");
    let safe = |c: char| if c.is_ascii_alphanumeric() || "-_.+=".contains(c) { c } else { '_' };
    (!name.is_empty()).then(|| name.chars().map(safe).collect())
}
