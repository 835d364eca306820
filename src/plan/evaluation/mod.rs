//! Methods and ablations against one reference (§7.2, §7.3): what is baked, rendered and measured for each, and the tables and the page.

mod costs;
mod measure;
mod plan;

use super::option::Size;
use super::settings::Settings;
use super::variant::{self, Given, Variant, WHOLE};
use super::views::{FrameList, views};
use super::{Context, Outcome, Stage};
use crate::base::clock::seconds;
use crate::base::named::within;
use crate::io::provenance::hash_file;
use crate::io::{Provenance, atomic, json};
use crate::method::path_trace;
use crate::metric::evaluation::{Costs, Evaluation, LayerErrors, MethodErrors, html, markdown};
use crate::scene::camera_path;
use crate::{Error, Result};
use costs::execute;
use measure::{Subjects, file, layers, measure};
pub use plan::{Plan, Planned};
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// What to evaluate.
#[derive(Clone)]
pub struct Evaluate {
    /// The scene.
    pub scene: PathBuf,
    /// The camera path.
    pub path: PathBuf,
    /// Folder for the report, frames and bakes.
    pub output: PathBuf,
    /// Methods, in order; their names differ.
    pub variants: Vec<Variant>,
    /// Frames to compare with; without them, the path is path-traced.
    pub reference: Option<PathBuf>,
    /// The same frames of another seed, by which the reference's noise is taken out of the errors.
    pub second_reference: Option<PathBuf>,
    /// Whether the path is path-traced twice for that.
    pub reference_pair: bool,
    /// Baked probes to use.
    pub probes: Option<PathBuf>,
    /// Light map to use.
    pub lightmap: Option<PathBuf>,
    /// Curvatures to use.
    pub curvature: Option<PathBuf>,
    /// Folder of bakes, in place of one in the output.
    pub bakes: Option<PathBuf>,
    /// Options of stages that bake, for all methods.
    pub bake_options: Vec<(String, Given)>,
    /// Only these frames of the path.
    pub frames: Option<FrameList>,
    /// Numbers of all stages.
    pub settings: Settings,
    /// Stops by which radiance is brightened for the display metrics and the pictures.
    pub exposure: f32,
    /// About how large the page may be, bytes.
    pub page_bytes: usize,
}

/// The variants that are asked for, in order: `methods` as they are, `variants`, and the paper's ablations where `ablations` holds
/// (those of `only`, where it names some), with what they are compared with. `probes` is the number of probes of the whole method.
pub fn all_variants(
    methods: &[Variant],
    variants: &[Variant],
    ablations: bool,
    only: &[String],
    probes: u32,
) -> Result<Vec<Variant>> {
    let mut all = methods.to_vec();
    let wants_whole = ablations || variants.is_empty() && all.is_empty();
    if wants_whole && !methods.iter().chain(variants).any(|v| v.name == WHOLE) {
        all.insert(0, Variant::plain(WHOLE).map_err(Error::Request)?);
    }
    all.extend(variants.iter().cloned());
    if ablations {
        let known = variant::paper_ablations(probes).map_err(Error::Request)?;
        let named = |name: &String| known.iter().any(|v| v.name == *name);
        if let Some(wrong) = only.iter().find(|name| !named(name)) {
            let names: Vec<&str> = known.iter().map(|v| v.name.as_str()).collect();
            return Err(Error::Request(format!("--only {wrong}: no such ablation; there are {}", names.join(", "))));
        }
        let asked = |v: &Variant| only.is_empty() || only.contains(&v.name);
        let base = |v: &Variant| known.iter().any(|w| asked(w) && w.ablation.as_ref().is_some_and(|a| a.against == v.name));
        all.extend(known.iter().filter(|v| asked(v) || base(v)).cloned());
    }
    if let Some(twice) = all.iter().enumerate().find(|(i, v)| all[..*i].iter().any(|w| w.name == v.name)) {
        let name = &twice.1.name;
        return Err(Error::Request(format!(
            "{name}: two methods have this name; give one of them another with --variant NAME=METHOD"
        )));
    }
    Ok(all)
}

impl Evaluate {
    /// Plans all stages and checks each of them; reads nothing.
    pub fn plan(&self, cx: &Context) -> Result<Plan> {
        within("--exposure", self.exposure, -32.0..=32.0)?;
        if self.reference.is_none() && self.second_reference.is_some() {
            let message = "--second-reference: the first one is missing: --reference DIR; --reference-pair renders both";
            return Err(Error::Request(message.into()));
        }
        if self.reference.is_some() && self.reference_pair {
            let message = "--reference-pair: the reference is given: expected another of its frames with --second-reference DIR";
            return Err(Error::Request(message.into()));
        }
        let plan = plan::plan(self, cx)?;
        for planned in plan.stages() {
            planned.stage.check().map_err(|e| Error::Request(format!("{}: {e}", planned.stage.command_line(cx))))?;
        }
        Ok(plan)
    }

    /// The folder of the reference, and that of a second render of it where there is one.
    fn reference_folders(&self) -> Vec<PathBuf> {
        let first = self.reference.clone().unwrap_or_else(|| self.output.join("reference"));
        let second = self.reference_pair.then(|| self.output.join("second-reference"));
        std::iter::once(first).chain(self.second_reference.clone().or(second)).collect()
    }

    fn frames_folder(&self, variant: &Variant) -> PathBuf {
        self.output.join("frames").join(&variant.name)
    }

    fn reference_in_words(&self) -> String {
        let name = |folder: &Path| folder.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let first = self.reference.as_ref().map_or_else(
            || format!("path-trace, {} samples a pixel", self.settings.reference_spp),
            |folder| format!("the frames of {}", name(folder)),
        );
        let second = self.second_reference.as_ref().map(|folder| format!(" and of {}", name(folder)));
        first + &second.unwrap_or_else(|| if self.reference_pair { ", with two seeds".into() } else { String::new() })
    }

    /// A reference that is as noisy as what it judges measures its own noise, unless that is taken out.
    fn warn_of_noise(&self, cx: &Context, plan: &Plan) -> Result<()> {
        let spp = self.settings.reference_spp;
        if self.reference.is_some() || self.reference_pair {
            return Ok(());
        }
        for (variant, planned) in self.variants.iter().zip(&plan.frames) {
            let Stage::RenderPath(frames) = &planned.stage else { continue };
            if let (method, Some(samples)) = frames.samples()?
                && method == path_trace::METHOD.name
                && samples >= spp
            {
                cx.listener.warn(&format!(
                    "{} has {samples} samples a pixel, its reference {spp}: most of what is measured is the reference's noise; \
                     give --reference-spp some {}, or --reference-pair, which takes it out",
                    variant.name,
                    samples.saturating_mul(8)
                ));
            }
        }
        Ok(())
    }

    /// Bakes and renders what is missing, measures all, and writes tables and page.
    pub fn run(&self, cx: &Context) -> Result<Outcome> {
        let clock = seconds();
        let plan = self.plan(cx)?;
        self.warn_of_noise(cx, &plan)?;
        atomic::sweep(&self.output);
        let world = cx.opaque_world(&self.scene)?;
        let views = views(&world.scene, Some(&self.path), self.settings.size.map(|s| s.0), self.frames.as_ref())?;
        // Before hours of work.
        plan.check_views(&views)?;
        let frames: Vec<u32> = views.iter().map(|v| v.frame).collect();
        let size = views[0].camera.size;
        let folders: Vec<PathBuf> = self.variants.iter().map(|v| self.frames_folder(v)).collect();
        let references = self.reference_folders();
        let subjects = Subjects {
            methods: &folders,
            references: &references,
            frames: &frames,
            size,
            exposure: self.exposure,
            page_bytes: self.page_bytes,
        };
        if self.reference.is_some() {
            layers(&subjects)?;
        }
        let costs = execute(self, cx, &plan, &world.scene)?;
        let layers = layers(&subjects)?;
        let measured = measure(&subjects, &layers, cx.progress())?;
        let evaluation = self.evaluation(cx, &world.scene.hash, &frames, size, &layers, measured.errors)?;
        json::write(&self.output.join("evaluation.json"), &evaluation)?;
        atomic::write(&self.output.join("evaluation.md"), markdown(&evaluation, &costs).as_bytes())?;
        let page = self.output.join("index.html");
        atomic::write(&page, html(&evaluation, &costs, &measured.gallery)?.as_bytes())?;
        Ok(outcome(&evaluation, &costs, &page, clock()))
    }

    fn evaluation(
        &self,
        cx: &Context,
        scene_hash: &str,
        frames: &[u32],
        size: [u32; 2],
        layers: &[&str],
        errors: Vec<BTreeMap<String, LayerErrors>>,
    ) -> Result<Evaluation> {
        let mut provenance = Provenance::new("evaluate", scene_hash, cx.seed, &json!({ "exposure": self.exposure }));
        for variant in &self.variants {
            let hash = hash_frames(&self.frames_folder(variant), frames)?;
            provenance = provenance.with_input(&format!("frames/{}", variant.name), hash);
        }
        for (role, folder) in ["reference", "second-reference"].into_iter().zip(self.reference_folders()) {
            provenance = provenance.with_input(role, hash_frames(&folder, frames)?);
        }
        let methods = self.variants.iter().zip(errors).map(|(v, layers)| MethodErrors {
            name: v.name.clone(),
            method: v.method.name.into(),
            options: v.differences(),
            ablation: v.ablation.clone(),
            layers,
        });
        Ok(Evaluation {
            scene: scene_name(&self.scene),
            path: stem(&self.path),
            size: size.map(|n| n as usize),
            reference: self.reference_in_words(),
            exposure: self.exposure,
            frames: frames.iter().map(|f| format!("{f:04}")).collect(),
            fps: camera_path::fps(&self.path)?,
            layers: layers.iter().map(|l| (*l).to_owned()).collect(),
            methods: methods.collect(),
            provenance,
        })
    }
}

fn outcome(evaluation: &Evaluation, costs: &Costs, page: &Path, seconds: f64) -> Outcome {
    let means =
        |m: &MethodErrors| -> Value { m.layers.iter().map(|(layer, errors)| (layer.clone(), json!(errors.mean))).collect() };
    let methods: Value = evaluation.methods.iter().map(|m| (m.name.clone(), means(m))).collect();
    Outcome {
        summary: format!("{}see {}\nDone in {seconds:.0} s.", evaluation.table(), page.display()),
        figures: json!({ "methods": methods, "costs": costs, "seconds": seconds }),
        ..Outcome::default()
    }
}

fn hash_frames(folder: &Path, frames: &[u32]) -> Result<String> {
    let hashes: String = frames.iter().map(|&f| hash_file(&folder.join(file(f)))).collect::<Result<_>>()?;
    Ok(blake3::hash(hashes.as_bytes()).to_hex().to_string())
}

fn stem(path: &Path) -> String {
    path.file_stem().unwrap_or_default().to_string_lossy().into_owned()
}

/// `staircase2` of staircase2/scene.xml.
fn scene_name(path: &Path) -> String {
    let folder = path.parent().and_then(Path::file_name).map(|n| n.to_string_lossy().into_owned());
    match folder {
        Some(folder) if stem(path).starts_with("scene") => folder,
        _ => stem(path),
    }
}

/// The size that all frames have, for the line that says it.
impl From<Size> for [u32; 2] {
    fn from(size: Size) -> Self {
        size.0
    }
}
