//! The stages of an evaluation: bakes that its methods share, bakes of their own, frames, reference.

use super::Evaluate;
use crate::base::named::split;
use crate::plan::pipeline::{Bakes, Pipeline, needed};
use crate::plan::stage::BAKES;
use crate::plan::stages::{BakeProbes, RenderPath};
use crate::plan::variant::{Variant, configure};
use crate::plan::{Context, Stage};
use crate::scene::Camera;
use crate::view::View;
use crate::{Error, Result};
use std::collections::BTreeMap;
use std::path::PathBuf;

/// A stage, and the variants (by index) that use its output.
#[derive(Clone)]
pub struct Planned {
    /// The stage.
    pub stage: Stage,
    /// Its seed.
    pub seed: u32,
    /// Who reads its output; empty for references.
    pub users: Vec<usize>,
}

/// What an evaluation does before it measures.
#[derive(Default)]
pub struct Plan {
    /// Bakes in order.
    pub bakes: Vec<Planned>,
    /// The frames of each variant.
    pub frames: Vec<Planned>,
    /// One or two, unless they were given.
    pub references: Vec<Planned>,
}

impl Plan {
    /// The stages in order.
    pub fn stages(&self) -> impl Iterator<Item = &Planned> {
        self.bakes.iter().chain(&self.frames).chain(&self.references)
    }

    /// The probes that a variant reads, where it does.
    pub fn probes(&self, variant: usize) -> Option<&PathBuf> {
        match &self.frames[variant].stage {
            Stage::RenderPath(render) => render.probes.as_ref(),
            _ => None,
        }
    }

    /// Refuses frames that want other texels than their probes will have.
    pub fn check_views(&self, views: &[View]) -> Result<()> {
        let cameras: Vec<Camera> = views.iter().map(|v| v.camera.clone()).collect();
        let bake_of = |probes: &PathBuf| {
            self.bakes.iter().find_map(|p| match &p.stage {
                Stage::BakeProbes(bake) if bake.output == *probes => Some(bake),
                _ => None,
            })
        };
        for planned in &self.frames {
            let Stage::RenderPath(render) = &planned.stage else { continue };
            let Some(bake) = render.probes.as_ref().and_then(bake_of).filter(|bake| bake.for_path.is_some()) else { continue };
            if let Some(wanted) = render.served(&cameras)?
                && !bake.served(&cameras)?.serve(&wanted)
            {
                let message = "these frames want texels that its probes are not baked with";
                return Err(Error::Request(format!("{}: {message}", render.output.display())));
            }
        }
        Ok(())
    }
}

/// Plans all stages.
pub fn plan(of: &Evaluate, cx: &Context) -> Result<Plan> {
    let any_texel = of.variants.iter().any(|v| v.method.reads.probes.is_some_and(|p| p.any_texel));
    let mut settings = of.settings.clone();
    settings.all_texels |= any_texel;
    let pipeline = Pipeline { scene: of.scene.clone(), path: Some(of.path.clone()), frames: of.frames.clone(), settings };
    let mut plan = Plan::default();
    // What each set of probes is asked for.
    let mut choices: BTreeMap<PathBuf, Vec<String>> = BTreeMap::new();
    for (index, variant) in of.variants.iter().enumerate() {
        let bakes = folders(of, variant);
        let render = render(&pipeline, of, variant, &bakes)?;
        let mut stages = pipeline.bakes(&bakes);
        for stage in &mut stages {
            configure(stage, &of.bake_options)?;
            variant.configure(stage)?;
        }
        let is_given =
            |stage: &Stage| [&of.probes, &of.lightmap, &of.curvature].into_iter().flatten().any(|p| p == stage.output());
        for stage in needed(stages.into_iter().filter(|s| !is_given(s)), &render.clone().into()) {
            match plan.bakes.iter_mut().find(|p| p.stage.output() == stage.output()) {
                Some(planned) => planned.users.push(index),
                None => plan.bakes.push(Planned { stage, seed: cx.seed, users: vec![index] }),
            }
        }
        if let Some(probes) = &render.probes {
            let (choice, known) = (choice(variant), choices.entry(probes.clone()).or_default());
            if !known.contains(&choice) {
                known.push(choice);
            }
        }
        plan.frames.push(Planned { stage: render.into(), seed: cx.seed, users: vec![index] });
    }
    for planned in &mut plan.bakes {
        if let Stage::BakeProbes(bake) = &mut planned.stage
            && bake.for_path.is_some()
        {
            choose(bake, choices.get(&bake.output).map_or(&[], Vec::as_slice));
        }
    }
    // A stage follows what it reads: those that several variants share were planned with the first.
    plan.bakes.sort_by_key(|p| BAKES.iter().position(|command| *command == p.stage.command()));
    if of.reference.is_none() {
        let lights = common_lights(&plan.frames)?;
        for (folder, offset) in of.reference_folders().iter().zip(1..) {
            let stage = RenderPath { lights: lights.clone(), ..pipeline.reference(folder) }.into();
            // Not the samples of a path-traced method, whose errors would be the reference's, and of two not the same.
            plan.references.push(Planned { stage, seed: cx.seed.wrapping_add(offset), users: Vec::new() });
        }
    }
    Ok(plan)
}

/// The lights under which all frames are rendered: those of a reference that they can be measured by.
fn common_lights(frames: &[Planned]) -> Result<Option<PathBuf>> {
    let of = |planned: &Planned| match &planned.stage {
        Stage::RenderPath(render) => render.lights.clone(),
        _ => None,
    };
    let first = frames.first().and_then(of);
    match frames.iter().all(|planned| of(planned) == first) {
        true => Ok(first),
        false => Err(Error::Request(
            "--lights: one reference serves frames of the same lights alone; give all variants the same".into(),
        )),
    }
}

/// The frames of a variant.
fn render(pipeline: &Pipeline, of: &Evaluate, variant: &Variant, bakes: &Bakes) -> Result<RenderPath> {
    let mut stage = pipeline.render(variant.method, bakes, &of.frames_folder(variant));
    let named = |e: Error| Error::Request(format!("{}: {e}", variant.name));
    for (option, value) in &variant.options {
        stage.set(option, value.as_deref()).map_err(named)?;
    }
    stage.set.extend(variant.sets.iter().cloned());
    stage.check().map_err(named)?;
    Ok(stage)
}

/// Asks the bake for what all `choices` ask for. The default is the first of them, or that which differs from it the least; the paper's choice
/// is never the first, as it would change the probes' roughness with it.
fn choose(bake: &mut BakeProbes, choices: &[String]) {
    let is_paper = |choice: &String| split(choice).iter().any(|part| part == "paper");
    let base = choices.iter().position(String::is_empty).or_else(|| choices.iter().position(|c| !is_paper(c)));
    for (i, choice) in choices.iter().enumerate() {
        if Some(i) == base {
            bake.set.extend(split(choice));
        } else {
            bake.alternative.push(choice.clone());
        }
    }
}

/// What a variant changes of the choice of texels; empty for nothing.
fn choice(variant: &Variant) -> String {
    let paper = variant.options.iter().any(|(name, _)| name == "--paper").then_some("paper");
    let sets = variant.sets.iter().map(String::as_str).filter(|s| s.starts_with("gather."));
    paper.into_iter().chain(sets).collect::<Vec<_>>().join(",")
}

/// Where a variant's bakes lie: in the common folder, and from the first stage with options of its own in one named after those.
fn folders(of: &Evaluate, variant: &Variant) -> Bakes {
    let root = of.bakes.clone().unwrap_or_else(|| of.output.join("bakes"));
    let common = Bakes::within(&root);
    let within = |stages: &[&str]| own(variant, stages).map(|name| Bakes::within(&root.join(name)));
    let given = |own: Option<PathBuf>, given: &Option<PathBuf>, common: PathBuf| own.or(given.clone()).unwrap_or(common);
    let [place, resmap, qhmap, curvature, lightmap, probes, lightfield, transport] = BAKES;
    Bakes {
        grid: within(&[place]).map_or(common.grid, |b| b.grid),
        resmap: within(&[place, resmap]).map_or(common.resmap, |b| b.resmap),
        qhmap: within(&[place, resmap, qhmap]).map_or(common.qhmap, |b| b.qhmap),
        curvature: given(within(&[curvature]).map(|b| b.curvature), &of.curvature, common.curvature),
        lightmap: given(within(&[lightmap]).map(|b| b.lightmap), &of.lightmap, common.lightmap),
        probes: given(within(&[place, resmap, qhmap, curvature, lightmap, probes]).map(|b| b.probes), &of.probes, common.probes),
        lightfield: within(&[place, lightfield]).map_or(common.lightfield, |b| b.lightfield),
        transport: within(&[place, transport]).map_or(common.transport, |b| b.transport),
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::progress::Silent;
    use crate::exchange::LoadOptions;
    use crate::gpu::Choice;
    use crate::plan::settings::Preset;
    use crate::plan::variant::parse_bake;
    use glam::Vec3;
    use std::sync::Arc;

    fn context() -> Context {
        Context::new(3, Choice::Cpu, LoadOptions::default(), Arc::new(Silent)).unwrap()
    }

    fn evaluate(variants: &[&str], bake: &[&str]) -> Evaluate {
        Evaluate {
            scene: "scene.xml".into(),
            path: "path.json".into(),
            output: "out".into(),
            variants: variants.iter().map(|v| Variant::parse(v).unwrap()).collect(),
            reference: None,
            second_reference: None,
            reference_pair: false,
            probes: None,
            lightmap: None,
            curvature: None,
            bakes: None,
            bake_options: bake.iter().map(|b| parse_bake(b).unwrap()).collect(),
            frames: None,
            settings: Preset::Draft.settings(true),
            exposure: 0.0,
            page_bytes: 1 << 20,
        }
    }

    fn views() -> Vec<View> {
        vec![View { frame: 0, camera: Camera::look_at(Vec3::ZERO, Vec3::Z, Vec3::Y, 1.0, [32, 18]) }]
    }

    fn bake_of(plan: &Plan) -> &BakeProbes {
        let bakes = plan.bakes.iter().filter_map(|p| match &p.stage {
            Stage::BakeProbes(bake) => Some(bake),
            _ => None,
        });
        let bakes: Vec<_> = bakes.collect();
        assert_eq!(bakes.len(), 1);
        bakes[0]
    }

    #[test]
    fn one_bake_has_the_texels_of_every_variant_in_any_order() {
        let (paper, other, whole) =
            ("paper=glossy-probes,--paper", "level=glossy-probes,gather.anchors=1", "whole=glossy-probes");
        for variants in [[paper, other].as_slice(), &[other, paper], &[paper], &[paper, whole], &[paper, other, whole]] {
            let evaluate = evaluate(variants, &[]);
            let plan = evaluate.plan(&context()).unwrap();
            plan.check_views(&views()).unwrap_or_else(|e| panic!("{variants:?}: {e}"));
            assert!(!bake_of(&plan).paper, "the paper's choice of texels is not its roughness");
        }
    }

    #[test]
    fn frames_that_want_other_texels_are_refused_before_anything_is_baked() {
        let evaluate = evaluate(&["whole=glossy-probes"], &["bake-probes:--set=gather.anchors=1"]);
        let message = evaluate.plan(&context()).unwrap().check_views(&views()).unwrap_err().to_string();
        assert!(message.contains("frames/whole") && message.contains("texels"), "{message}");
    }

    #[test]
    fn options_for_a_stage_add_up() {
        let bake = ["bake-probes:--alternative=gather.probes=1", "bake-probes:--alternative=paper", "bake-probes:--spp=8"];
        let evaluate = evaluate(&["whole=glossy-probes"], &bake);
        let plan = evaluate.plan(&context()).unwrap();
        assert_eq!(bake_of(&plan).alternative, ["gather.probes=1", "paper"]);
        assert_eq!(bake_of(&plan).spp, Some(8));
    }

    #[test]
    fn only_what_is_read_is_planned_and_charged() {
        let evaluate = evaluate(&["rt=lightmap-rt", "pt=path-trace", "mine=glossy-probes,--probes=mine"], &[]);
        let plan = evaluate.plan(&context()).unwrap();
        let planned: Vec<_> = plan.bakes.iter().map(|p| (p.stage.command(), p.users.clone())).collect();
        assert_eq!(planned, [("curvature", vec![2]), ("bake-lightmap", vec![0, 2])]);
        assert_eq!(plan.probes(2), Some(&"mine".into()));
    }

    #[test]
    fn a_wrong_option_names_its_variant_before_anything_runs() {
        for (variant, expected) in [
            (
                "x=path-trace,--samples=4",
                "x: --samples: --method path-trace has no use for it; image-space-gather, lightmap-rt, light-field-probes has",
            ),
            ("x=glossy-probes,gather.foo=3", "x: --set gather.foo=3: no such parameter"),
            ("x=ulr,blend=0", "x: blend=0: expected 1 to 64"),
            ("x=glossy-probes,--magic", "x: render-path: no option --magic"),
            ("x=lightmap-rt,bake-lightmap:--spp=many", "bake-lightmap:--spp: --spp=many: invalid digit"),
        ] {
            let message = evaluate(&[variant], &[]).plan(&context()).err().unwrap().to_string();
            assert!(message.starts_with(expected), "{message}");
        }
    }

    #[test]
    fn the_reference_has_the_frames_lights() {
        let lit = ["a=path-trace,--spp=4,--lights=l.json", "b=many-light,--lights=l.json"];
        let pair = Evaluate { reference_pair: true, ..evaluate(&lit, &[]) };
        let references = plan(&pair, &context()).unwrap().references;
        assert_eq!(references.len(), 2);
        for reference in &references {
            assert!(matches!(&reference.stage, Stage::RenderPath(stage) if stage.lights == Some("l.json".into())));
        }
        let message = plan(&evaluate(&[lit[0], "b=path-trace,--spp=8"], &[]), &context()).err().unwrap().to_string();
        assert!(message.contains("the same"), "{message}");
    }

    #[test]
    fn the_references_samples_are_their_own() {
        let one = evaluate(&["pt=path-trace"], &[]);
        let pair = Evaluate { reference_pair: true, ..one.clone() };
        let seeds = |of: &Evaluate| of.plan(&context()).unwrap().stages().map(|p| p.seed).collect::<Vec<_>>();
        assert_eq!((seeds(&one), seeds(&pair)), (vec![3, 4], vec![3, 4, 5]));
    }

    #[test]
    fn a_second_reference_needs_a_first() {
        let alone = Evaluate { second_reference: Some("b".into()), ..evaluate(&["pt=path-trace"], &[]) };
        let message = alone.plan(&context()).err().unwrap().to_string();
        assert!(message.contains("--reference DIR") && message.contains("--reference-pair"), "{message}");
        let given = Evaluate { reference: Some("a".into()), ..alone };
        assert!(given.plan(&context()).unwrap().references.is_empty());
        let both = Evaluate { reference_pair: true, second_reference: None, ..given };
        assert!(both.plan(&context()).err().unwrap().to_string().contains("--reference-pair"));
    }
}
