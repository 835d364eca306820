//! `reprobe evaluate`: methods and ablations against one reference.

mod costs;
mod measure;
mod plan;
mod variant;

use crate::common::{Common, Outcome, parse_size};
use crate::pipeline::{Preset, Settings};
use crate::views::{FrameList, parse_frames, views};
use anyhow::bail;
use costs::execute;
use measure::{Subjects, file, layers, measure};
use plan::{frames_folder, plan, reference_folder};
use reprobe::io::provenance::hash_file;
use reprobe::io::{Provenance, atomic};
use reprobe::metric::evaluation::{Costs, Evaluation, MethodErrors, html, markdown};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use std::time::Instant;
use variant::{Ablations, Given, Variant, WHOLE, parse_bake};

/// Evaluate methods and ablations against references
///
/// Bakes what the methods need, renders their frames and the reference, measures all of them, and writes evaluation.json (errors),
/// timings.json (times), evaluation.md (the tables) and index.html (one file to look at). Every stage is a command of its own, printed
/// before it runs; what an earlier run has finished is kept.
#[derive(clap::Args)]
#[command(after_help = "Examples:
  reprobe evaluate room/scene.xml --path room/path.json -o report/ --methods glossy-probes,path-trace
  reprobe evaluate room/scene.xml --path room/path.json -o report/ --ablations paper --preset medium --reference mitsuba/
  reprobe evaluate room/scene.xml --path room/path.json -o report/ --probes probes/ --lightmap lightmap.exr \\
      --variant one=glossy-probes,gather.probes=1 --variant fast=path-trace,--spp=4
  reprobe evaluate room/scene.xml --path room/path.json -o report/ --methods glossy-probes,ulr,image-space-gather \\
      --variant rt=lightmap-rt,--match-time=report/frames/glossy-probes
  reprobe evaluate room/scene.xml --path room/path.json -o report/ --variant lat-long=glossy-probes,qhmap:--lat-long")]
pub struct Args {
    /// Mitsuba XML or JSON scene
    scene: PathBuf,
    /// Camera path
    #[arg(long, value_name = "PATH.json")]
    path: PathBuf,
    /// Folder for the report, frames and bakes
    #[arg(short, long, value_name = "DIR")]
    output: PathBuf,
    /// Methods of render-path [default: glossy-probes, where there is no --variant]
    #[arg(long, value_name = "LIST", value_delimiter = ',', value_parser = Variant::plain)]
    methods: Vec<Variant>,
    /// A method with options of render-path (--spp=4), parameters of its passes (gather.probes=1), or bakes of its own
    /// (bake-probes:--spp=64); may be repeated
    #[arg(long = "variant", value_name = "NAME=METHOD,...", value_parser = Variant::parse)]
    variants: Vec<Variant>,
    /// Variants of glossy-probes that leave one thing out each
    #[arg(long, value_enum, value_name = "WHICH")]
    ablations: Option<Ablations>,
    /// Only these of the ablations
    #[arg(long, value_name = "LIST", value_delimiter = ',', requires = "ablations")]
    only: Vec<String>,
    /// Frames to compare with, NNNN.exr; without it, the path is path-traced
    #[arg(long, value_name = "DIR")]
    reference: Option<PathBuf>,
    /// Defaults of all stages, as for run
    #[arg(long, value_enum, default_value_t = Preset::Draft)]
    preset: Preset,
    /// Baked probes to use
    #[arg(long, value_name = "DIR")]
    probes: Option<PathBuf>,
    /// Light map to use
    #[arg(long, value_name = "FILE")]
    lightmap: Option<PathBuf>,
    /// Curvatures to use
    #[arg(long, value_name = "FILE")]
    curvature: Option<PathBuf>,
    /// Folder of bakes, which evaluations may share; laid out as run's output [default: bakes/ in the output]
    #[arg(long, value_name = "DIR")]
    bakes: Option<PathBuf>,
    /// Option of a stage that bakes, for all methods: bake-probes:--spp=64; may be repeated
    #[arg(long, value_name = "STAGE:--OPTION=VALUE", value_parser = parse_bake)]
    bake: Vec<(String, Given)>,
    /// Size of the frames
    #[arg(long, value_name = "WxH", value_parser = parse_size)]
    size: Option<[u32; 2]>,
    /// Only these frames of the path
    #[arg(long, value_name = "LIST", value_parser = parse_frames)]
    frames: Option<FrameList>,
    /// Rays a pixel along one side, of methods that read bakes
    #[arg(long, value_name = "N")]
    supersample: Option<u32>,
    /// Paths a pixel of the path-traced reference
    #[arg(long, value_name = "N", conflicts_with = "reference")]
    reference_spp: Option<u32>,
    /// Bake all texels of all probes, so that the sets serve any view and any method
    #[arg(long)]
    all_texels: bool,
    /// Stops by which radiance is brightened for the display metrics and the pictures
    #[arg(long, value_name = "E", default_value_t = 0.0, allow_negative_numbers = true)]
    exposure: f32,
    /// About how large index.html may be, megabytes; it shows pictures of fewer frames where they would take more
    #[arg(long, value_name = "MB", default_value_t = 30, value_parser = clap::value_parser!(u32).range(1..=1000))]
    page_mb: u32,
    /// Print the stages' commands and stop
    #[arg(long)]
    dry_run: bool,
}

impl Args {
    fn settings(&self) -> Settings {
        let preset = self.preset.settings(true);
        let stage = |stage: &str, option: &str| self.bake.iter().find(|(s, (o, _))| s == stage && o == option);
        let count = stage("place-probes", "--count").and_then(|(_, (_, value))| value.as_ref()?.parse().ok());
        Settings {
            probes: count.unwrap_or(preset.probes),
            size: self.size.or(preset.size),
            supersample: self.supersample.unwrap_or(preset.supersample),
            reference_spp: self.reference_spp.unwrap_or(preset.reference_spp),
            all_texels: self.all_texels || preset.all_texels,
            ..preset
        }
    }

    /// All that is asked for, in order.
    fn all_variants(&self, probes: u32) -> anyhow::Result<Vec<Variant>> {
        let mut all = self.methods.clone();
        let whole = || Variant::plain(WHOLE).map_err(anyhow::Error::msg);
        let wants_whole = self.ablations.is_some() || self.variants.is_empty() && all.is_empty();
        if wants_whole && !self.methods.iter().chain(&self.variants).any(|v| v.name == WHOLE) {
            all.insert(0, whole()?);
        }
        all.extend(self.variants.iter().cloned());
        if self.ablations.is_some() {
            let known = variant::paper(probes).map_err(anyhow::Error::msg)?;
            let named = |name: &String| known.iter().any(|v| v.name == *name);
            if let Some(wrong) = self.only.iter().find(|name| !named(name)) {
                let names: Vec<&str> = known.iter().map(|v| v.name.as_str()).collect();
                bail!("--only {wrong}: no such ablation; there are {}", names.join(", "));
            }
            // With what they are compared with.
            let asked = |v: &Variant| self.only.is_empty() || self.only.contains(&v.name);
            let base = |v: &Variant| known.iter().any(|w| asked(w) && w.ablation.as_ref().is_some_and(|a| a.against == v.name));
            all.extend(known.iter().filter(|v| asked(v) || base(v)).cloned());
        }
        if let Some(twice) = all.iter().enumerate().find(|(i, v)| all[..*i].iter().any(|w| w.name == v.name)) {
            bail!("{}: two methods have this name; give one of them another with --variant NAME=METHOD", twice.1.name);
        }
        Ok(all)
    }
}

pub fn run(args: &Args, common: &Common) -> anyhow::Result<Outcome> {
    let began = Instant::now();
    if !(-32.0..=32.0).contains(&args.exposure) {
        bail!("--exposure {}: expected -32 to 32 stops", args.exposure);
    }
    let mut settings = args.settings();
    let variants = args.all_variants(settings.probes)?;
    settings.all_texels |= variants.iter().any(|v| v.method.reads_any_texel());
    let (size, reference_spp) = (settings.size, settings.reference_spp);
    let plan = plan(args, common, settings, &variants);
    for planned in plan.commands() {
        planned.stage.check()?;
    }
    if args.dry_run {
        let lines: Vec<String> = plan.commands().map(|p| p.stage.command_line()).collect();
        return Ok(Outcome { summary: lines.join("\n"), figures: json!({ "commands": lines }), ..Outcome::default() });
    }
    let world = common.opaque_world(&args.scene)?;
    let views = views(common, &world.scene, Some(&args.path), size, args.frames.as_ref())?;
    let frames: Vec<u32> = views.iter().map(|v| v.frame).collect();
    let size = views[0].camera.size;
    let folders: Vec<PathBuf> = variants.iter().map(|v| frames_folder(args, v)).collect();
    let reference = reference_folder(args);
    let page_bytes = args.page_mb as usize * 1_000_000;
    let subjects =
        Subjects { methods: &folders, reference: &reference, frames: &frames, size, exposure: args.exposure, page_bytes };
    if args.reference.is_some() {
        // Before hours of work.
        layers(&subjects)?;
    }

    let costs = execute(args, common, &plan, &variants, &world.scene)?;
    let layers = layers(&subjects)?;
    let measured = measure(&subjects, &layers, common)?;
    let mut provenance = Provenance::new("evaluate", &world.scene.hash, common.seed, &json!({ "exposure": args.exposure }));
    for (variant, folder) in variants.iter().zip(&folders) {
        provenance = provenance.with_input(&format!("frames/{}", variant.name), hash_frames(folder, &frames)?);
    }
    provenance = provenance.with_input("reference", hash_frames(&reference, &frames)?);
    let methods = variants.iter().zip(measured.errors).map(|(v, layers)| MethodErrors {
        name: v.name.clone(),
        method: v.method_name(),
        options: v.differences(),
        ablation: v.ablation.clone(),
        layers,
    });
    let evaluation = Evaluation {
        scene: scene_name(&args.scene),
        path: stem(&args.path),
        size: size.map(|n| n as usize),
        reference: args.reference.as_ref().map_or_else(
            || format!("path-trace, {reference_spp} samples a pixel"),
            |folder| format!("the frames of {}", folder.file_name().unwrap_or_default().to_string_lossy()),
        ),
        exposure: args.exposure,
        frames: frames.iter().map(|f| format!("{f:04}")).collect(),
        layers: layers.iter().map(|l| (*l).to_owned()).collect(),
        methods: methods.collect(),
        provenance,
    };
    atomic::write_json(&args.output.join("evaluation.json"), &evaluation)?;
    atomic::write(&args.output.join("evaluation.md"), markdown(&evaluation, &costs).as_bytes())?;
    let page = args.output.join("index.html");
    atomic::write(&page, html(&evaluation, &costs, &measured.shown)?.as_bytes())?;
    Ok(outcome(&evaluation, &costs, &page, began.elapsed().as_secs_f64()))
}

fn outcome(evaluation: &Evaluation, costs: &Costs, page: &Path, seconds: f64) -> Outcome {
    let mut summary = String::new();
    for layer in &evaluation.layers {
        summary += &format!("{layer}: mean over {} frames\n", evaluation.frames.len());
        for (method, errors) in evaluation.methods.iter().filter_map(|m| Some((m, m.layers.get(layer)?))) {
            let m = errors.mean.metrics;
            summary += &format!("  {:28} RMSE {:.4}  DSSIM {:.4}  FLIP {:.4}\n", method.name, m.rmse_rgb, m.dssim_rgb, m.flip);
        }
    }
    let means =
        |m: &MethodErrors| -> Value { m.layers.iter().map(|(layer, errors)| (layer.clone(), json!(errors.mean))).collect() };
    let methods: Value = evaluation.methods.iter().map(|m| (m.name.clone(), means(m))).collect();
    Outcome {
        summary: format!("{summary}see {}\nDone in {seconds:.0} s.", page.display()),
        figures: json!({ "methods": methods, "costs": costs, "seconds": seconds }),
        ..Outcome::default()
    }
}

fn hash_frames(folder: &Path, frames: &[u32]) -> anyhow::Result<String> {
    let hashes: String = frames.iter().map(|&f| hash_file(&folder.join(file(f)))).collect::<Result<_, _>>()?;
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
