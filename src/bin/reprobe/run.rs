//! `reprobe run`: the whole pipeline, stage by stage, as the commands that a person would type.

use crate::preset::Preset;
use anyhow::ensure;
use reprobe::base::clock::seconds;
use reprobe::io::ExrImage;
use reprobe::method::METHODS;
use reprobe::plan::option::Size;
use reprobe::plan::pipeline::{Bakes, Pipeline, execute, needed};
use reprobe::plan::settings::Settings;
use reprobe::plan::stages::{Compare, frame_names};
use reprobe::plan::views::FrameList;
use reprobe::plan::{Context, Outcome, Stage};
use serde_json::json;
use std::path::PathBuf;

/// Run the whole pipeline: place, map, bake, render, compare
///
/// Every stage is a command of its own, printed before it runs; stages whose outputs are up to date are left out or do only what
/// is missing, so an interrupted run goes on where it stopped. Single options override the preset's.
#[derive(clap::Args)]
#[command(after_help = "Examples:
  reprobe run scenes/room/scene.xml --path scenes/room/path.json -o out/ --preset draft
  reprobe run bathroom/scene.xml --path bathroom.json -o out/ --preset medium --reference mitsuba/
  reprobe run bathroom/scene.xml --path bathroom.json -o out/ --preset paper --dry-run")]
pub struct Args {
    /// Scene: Mitsuba XML or JSON, or glTF
    scene: PathBuf,
    /// Camera path [default: the scene's sensor is the one frame]
    #[arg(long, value_name = "PATH.json")]
    path: Option<PathBuf>,
    /// Folder for all outputs
    #[arg(short, long, value_name = "DIR")]
    output: PathBuf,
    /// Defaults of all stages: a look, a judgement, or the paper's numbers
    #[arg(long, value_enum, default_value_t = Preset::Draft)]
    preset: Preset,
    /// Frames to compare with, NNNN.exr; without it, the path is also path-traced
    #[arg(long, value_name = "DIR")]
    reference: Option<PathBuf>,
    /// No reference and no comparison
    #[arg(long, conflicts_with = "reference")]
    no_reference: bool,
    /// Number of probes to aim at
    #[arg(long, value_name = "N")]
    probes: Option<u32>,
    /// Size of a probe, texels
    #[arg(long, value_name = "WxH")]
    probe_size: Option<Size>,
    /// Paths a probe texel, of every one; without it, as many as its noise asks for
    #[arg(long, value_name = "N")]
    spp: Option<u32>,
    /// Paths a light map texel, of every one; without it, as many as its noise asks for
    #[arg(long, value_name = "N")]
    lightmap_spp: Option<u32>,
    /// Size of a light map texel, metres
    #[arg(long, value_name = "M")]
    texel: Option<f32>,
    /// Size of the frames
    #[arg(long, value_name = "WxH")]
    size: Option<Size>,
    /// Only these frames of the path
    #[arg(long, value_name = "LIST")]
    frames: Option<FrameList>,
    /// Rays a pixel along one side
    #[arg(long, value_name = "N")]
    supersample: Option<u32>,
    /// Paths a pixel of the path-traced reference
    #[arg(long, value_name = "N")]
    reference_spp: Option<u32>,
    /// Bake all texels of all probes, so that the set serves any view
    #[arg(long)]
    all_texels: bool,
    /// The paper's text in every choice
    #[arg(long)]
    paper: bool,
    /// Set a parameter of a pass, as render-path's --set
    #[arg(long = "set", value_name = "NAME=VALUE")]
    set: Vec<String>,
    /// Print the stages' commands and stop
    #[arg(long)]
    dry_run: bool,
}

/// A comparison: the layer, the folder of its report, and what a person calls it.
type Comparison = (Option<&'static str>, &'static str, &'static str);

/// The whole frame and the glossy layer, of which a given reference may have one alone.
fn comparisons(args: &Args) -> anyhow::Result<Vec<Comparison>> {
    if args.no_reference {
        return Ok(Vec::new());
    }
    let mut list = vec![(None, "report", "whole frame"), (Some("glossy"), "report-glossy", "glossy layer")];
    if let Some(folder) = &args.reference {
        let first = folder.join(&frame_names(folder)?[0]);
        let frame = ExrImage::read(&first)?;
        list.retain(|(layer, ..)| frame.rgb(&first, layer.unwrap_or("")).is_ok());
        ensure!(!list.is_empty(), "{}: found neither R, G, B nor glossy.R, glossy.G, glossy.B", first.display());
    }
    Ok(list)
}

fn settings(args: &Args) -> Settings {
    let preset = reprobe::plan::settings::Preset::from(args.preset).settings(args.path.is_some());
    Settings {
        probes: args.probes.unwrap_or(preset.probes),
        probe_size: args.probe_size.unwrap_or(preset.probe_size),
        spp: args.spp.unwrap_or(preset.spp),
        error: preset.error.filter(|_| args.spp.is_none()),
        lightmap_spp: args.lightmap_spp.unwrap_or(preset.lightmap_spp),
        lightmap_error: preset.lightmap_error.filter(|_| args.lightmap_spp.is_none()),
        texel: args.texel,
        size: args.size.or(preset.size),
        supersample: args.supersample.unwrap_or(preset.supersample),
        reference_spp: args.reference_spp.unwrap_or(preset.reference_spp),
        all_texels: args.all_texels || preset.all_texels,
        paper: args.paper,
        ..preset
    }
}

fn stages(args: &Args, comparisons: &[Comparison]) -> Vec<Stage> {
    let (scene, path, frames) = (args.scene.clone(), args.path.clone(), args.frames.clone());
    let pipeline = Pipeline { scene, path, frames, settings: settings(args) };
    let out = |name: &str| args.output.join(name);
    let bakes = Bakes::within(&args.output);
    let mut render = pipeline.render(METHODS[0], &bakes, &out("frames"));
    render.set.extend(args.set.iter().cloned());
    let render = Stage::from(render);
    let mut list = needed(pipeline.bakes(&bakes), &render);
    for stage in &mut list {
        if let Stage::BakeProbes(bake) = stage
            && bake.for_path.is_some()
        {
            bake.set.extend(args.set.iter().cloned());
        }
    }
    list.push(render);
    if args.no_reference {
        return list;
    }
    let reference = args.reference.clone().unwrap_or_else(|| out("reference"));
    if args.reference.is_none() {
        list.push(pipeline.reference(&reference).into());
    }
    for (layer, report, _) in comparisons {
        let layer = layer.map(str::to_owned);
        let (image, reference, output) = (out("frames"), reference.clone(), out(report));
        list.push(Compare { image, reference, layer, output, frames: args.frames.clone(), ..Compare::default() }.into());
    }
    list
}

/// The numbers of the frames that a run of `render-path` wrote or kept.
fn frames_of(rendered: &Outcome) -> Vec<u32> {
    let frames = rendered.figures["frames"].as_array();
    frames.into_iter().flatten().filter_map(|f| f["name"].as_str()?.strip_suffix(".exr")?.parse().ok()).collect()
}

/// Keeps frames that a run with other options left in a folder out of the comparison.
fn leave_out_others(compare: &mut Compare, rendered: &[u32]) -> anyhow::Result<()> {
    for folder in [&compare.image, &compare.reference] {
        if frame_names(folder)?.len() != rendered.len() {
            compare.frames = Some(FrameList::of(rendered.iter().copied()));
        }
    }
    Ok(())
}

pub fn run(args: &Args, cx: &Context) -> anyhow::Result<Outcome> {
    let clock = seconds();
    let comparisons = comparisons(args)?;
    let mut stages = stages(args, &comparisons);
    for stage in &stages {
        stage.check()?;
    }
    if args.dry_run {
        let lines: Vec<String> = stages.iter().map(|s| s.command_line(cx)).collect();
        return Ok(Outcome { summary: lines.join("\n"), figures: json!({ "commands": lines }), ..Outcome::default() });
    }
    let mut figures = Vec::new();
    let mut rendered = Vec::new();
    for stage in &mut stages {
        if let Stage::Compare(compare) = stage {
            leave_out_others(compare, &rendered)?;
        }
        let outcome = execute(stage, cx, "")?;
        if matches!(stage, Stage::RenderPath(_)) {
            rendered = frames_of(&outcome);
        }
        figures.push(json!({ "command": stage.command_line(cx), "figures": outcome.figures }));
    }
    let (out, seconds) = (|name: &str| args.output.join(name), clock());
    let page = |folder: &str| out(folder).join("index.html");
    let reports: Vec<String> =
        comparisons.iter().map(|(_, folder, what)| format!("{} ({what})", page(folder).display())).collect();
    let report = if reports.is_empty() { String::new() } else { format!("\nReport: {}", reports.join(", ")) };
    Ok(Outcome {
        summary: format!("Frames: {}{report}\nDone in {seconds:.0} s.", out("frames").join("NNNN.exr").display()),
        figures: json!({ "stages": figures, "seconds": seconds }),
        ..Outcome::default()
    })
}
