//! `reprobe run`: the whole pipeline, stage by stage, as the commands that a person would type.

use crate::common::{Common, Outcome, parse_size};
use crate::views::{FrameList, parse_frames};
use crate::{Cli, compare, dispatch};
use anyhow::Context;
use clap::Parser;
use reprobe::io::ExrImage;
use serde_json::json;
use std::path::{Path, PathBuf};
use std::time::Instant;

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
    /// Mitsuba XML or JSON scene
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
    #[arg(long, value_name = "WxH", value_parser = parse_size)]
    probe_size: Option<[u32; 2]>,
    /// Paths a probe texel
    #[arg(long, value_name = "N")]
    spp: Option<u32>,
    /// Paths a light map texel
    #[arg(long, value_name = "N")]
    lightmap_spp: Option<u32>,
    /// Size of a light map texel, metres
    #[arg(long, value_name = "M")]
    texel: Option<f32>,
    /// Size of the frames
    #[arg(long, value_name = "WxH", value_parser = parse_size)]
    size: Option<[u32; 2]>,
    /// Only these frames of the path
    #[arg(long, value_name = "LIST", value_parser = parse_frames)]
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

/// What a preset stands for.
#[derive(Clone, Copy, PartialEq, clap::ValueEnum)]
enum Preset {
    /// A look in some 3 minutes on 2 cores
    Draft,
    /// A judgement in some 20 minutes on 2 cores
    Medium,
    /// 252 probes of 1024x512 at 2048 paths a texel, 1920x1080
    Paper,
}

struct Settings {
    probes: u32,
    probe_size: [u32; 2],
    spp: u32,
    lightmap_spp: u32,
    lightmap_first_spp: u32,
    lightmap_texels: u32,
    size: [u32; 2],
    supersample: u32,
    reference_spp: u32,
    all_texels: bool,
}

impl Preset {
    fn settings(self) -> Settings {
        match self {
            Self::Draft => Settings {
                probes: 12,
                probe_size: [256, 128],
                spp: 64,
                lightmap_spp: 96,
                lightmap_first_spp: 12,
                lightmap_texels: 150_000,
                size: [320, 180],
                supersample: 2,
                reference_spp: 32,
                all_texels: false,
            },
            Self::Medium => Settings {
                probes: 64,
                probe_size: [512, 256],
                spp: 128,
                lightmap_spp: 128,
                lightmap_first_spp: 16,
                lightmap_texels: 1_000_000,
                size: [480, 270],
                supersample: 2,
                reference_spp: 256,
                all_texels: false,
            },
            Self::Paper => Settings {
                probes: 252,
                probe_size: [1024, 512],
                spp: 2048,
                lightmap_spp: 2048,
                lightmap_first_spp: 0,
                lightmap_texels: 4_000_000,
                size: [1920, 1080],
                supersample: 1,
                reference_spp: 1024,
                all_texels: true,
            },
        }
    }
}

/// One command of the pipeline.
struct Stage(Vec<String>);

impl Stage {
    fn new(command: &str) -> Self {
        Self(vec![command.into()])
    }

    fn arg(mut self, value: impl std::fmt::Display) -> Self {
        self.0.push(value.to_string());
        self
    }

    fn path(self, value: &Path) -> Self {
        self.arg(value.display())
    }

    fn option(self, name: &str, value: impl std::fmt::Display) -> Self {
        self.arg(name).arg(value)
    }

    fn optional(self, name: &str, value: Option<impl std::fmt::Display>) -> Self {
        match value {
            Some(v) => self.option(name, v),
            None => self,
        }
    }

    fn flag(self, name: &str, on: bool) -> Self {
        if on { self.arg(name) } else { self }
    }

    fn command_line(&self) -> String {
        let quote =
            |a: &String| if a.contains([' ', '\'', '"', '$']) { format!("'{}'", a.replace('\'', r"'\''")) } else { a.clone() };
        format!("reprobe {}", self.0.iter().map(quote).collect::<Vec<_>>().join(" "))
    }
}

fn size_text(size: [u32; 2]) -> String {
    format!("{}x{}", size[0], size[1])
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
        let first = folder.join(&compare::frames(folder)?[0]);
        let frame = ExrImage::read(&first)?;
        list.retain(|(layer, ..)| frame.rgb(&first, layer.unwrap_or("")).is_ok());
        anyhow::ensure!(!list.is_empty(), "{}: found neither R, G, B nor glossy.R, glossy.G, glossy.B", first.display());
    }
    Ok(list)
}

fn stages(args: &Args, common: &Common, comparisons: &[Comparison]) -> Vec<Stage> {
    let preset = args.preset.settings();
    let out = |name: &str| args.output.join(name);
    let path = args.path.as_ref().map(|p| p.display());
    let size = args.size.or((args.preset != Preset::Paper || args.path.is_none()).then_some(preset.size)).map(size_text);
    let supersample = args.supersample.unwrap_or(preset.supersample);
    let all_texels = args.all_texels || preset.all_texels || args.path.is_none();
    let stage = |command: &str| {
        let mut s = Stage::new(command).path(&args.scene).option("--seed", common.seed);
        s = s.optional("--threads", common.threads).flag("--quiet", common.quiet);
        s = s.optional("--unit-scale", (common.unit_scale != 1.0).then_some(common.unit_scale));
        common.defines.iter().fold(s, |s, d| s.option("--define", d))
    };
    let set = |s: Stage| args.set.iter().fold(s, |s, set| s.option("--set", set));
    let view = |s: Stage| {
        s.optional("--path", path.as_ref()).optional("--size", size.as_ref()).optional("--frames", args.frames.as_ref())
    };

    let place = stage("place-probes").option("--count", args.probes.unwrap_or(preset.probes));
    let mut bake = stage("bake-probes")
        .option("--probes", out("probes.json").display())
        .option("--qhmap", out("qhmap").display())
        .option("--output", out("probes").display())
        .option("--spp", args.spp.unwrap_or(preset.spp));
    if !args.paper {
        bake = bake.option("--lightmap", out("lightmap.exr").display());
    }
    if !all_texels {
        bake = set(bake)
            .optional("--for-path", path.as_ref())
            .option("--curvature", out("curvature.exr").display())
            .optional("--size", size.as_ref())
            .optional("--frames", args.frames.as_ref())
            .option("--supersample", supersample)
            .flag("--paper", args.paper);
    }
    let mut list = vec![
        place.optional("--path", path.as_ref()).option("--output", out("probes.json").display()),
        stage("resmap")
            .flag("--paper", args.paper)
            .option("--probes", out("probes.json").display())
            .option("--output", out("resmap").display()),
        Stage::new("qhmap")
            .path(&out("resmap"))
            .option("--size", size_text(args.probe_size.unwrap_or(preset.probe_size)))
            .option("--output", out("qhmap").display())
            .optional("--threads", common.threads)
            .flag("--quiet", common.quiet),
        stage("curvature").option("--output", out("curvature.exr").display()),
        stage("bake-lightmap")
            .option("--spp", args.lightmap_spp.unwrap_or(preset.lightmap_spp))
            .option("--first-spp", if args.paper { 0 } else { preset.lightmap_first_spp })
            .optional("--texels", args.texel.is_none().then_some(preset.lightmap_texels))
            .optional("--texel", args.texel)
            .option("--output", out("lightmap.exr").display()),
        bake,
        set(view(stage("render-path")))
            .option("--probes", out("probes").display())
            .option("--lightmap", out("lightmap.exr").display())
            .option("--curvature", out("curvature.exr").display())
            .option("--supersample", supersample)
            .flag("--paper", args.paper)
            .option("--output", out("frames").display()),
    ];
    if args.no_reference {
        return list;
    }
    let reference = args.reference.clone().unwrap_or_else(|| out("reference"));
    if args.reference.is_none() {
        let spp = args.reference_spp.unwrap_or(preset.reference_spp);
        list.push(
            view(stage("render-path"))
                .option("--method", "path-trace")
                .option("--spp", spp)
                .option("--output", reference.display()),
        );
    }
    for (layer, report, _) in comparisons {
        list.push(
            Stage::new("compare")
                .path(&out("frames"))
                .path(&reference)
                .optional("--layer", *layer)
                .option("--output", out(report).display())
                .flag("--quiet", common.quiet),
        );
    }
    list
}

pub fn run(args: &Args, common: &Common) -> anyhow::Result<Outcome> {
    let began = Instant::now();
    let comparisons = comparisons(args)?;
    let stages = stages(args, common, &comparisons);
    if args.dry_run {
        let lines: Vec<String> = stages.iter().map(Stage::command_line).collect();
        return Ok(Outcome { summary: lines.join("\n"), figures: json!({ "commands": lines }), ..Outcome::default() });
    }
    let mut figures = Vec::new();
    for stage in &stages {
        let command = stage.command_line();
        if !common.quiet {
            eprintln!("$ {command}");
        }
        let mut cli = Cli::try_parse_from(std::iter::once("reprobe".to_owned()).chain(stage.0.iter().cloned()))?;
        cli.common.share_scene(common);
        let outcome = dispatch(&cli.command, &cli.common).with_context(|| stage.0[0].clone())?;
        if !common.quiet {
            eprintln!("  {}", outcome.summary.trim_end().replace('\n', "\n  "));
        }
        figures.push(json!({ "command": command, "figures": outcome.figures }));
    }
    let out = args.output.display();
    let seconds = began.elapsed().as_secs_f64();
    let reports: Vec<String> =
        comparisons.iter().map(|(_, folder, what)| format!("{out}/{folder}/index.html ({what})")).collect();
    let report = if reports.is_empty() { String::new() } else { format!("\nReport: {}", reports.join(", ")) };
    Ok(Outcome {
        summary: format!("Frames: {out}/frames/NNNN.exr{report}\nDone in {seconds:.0} s."),
        figures: json!({ "stages": figures, "seconds": seconds }),
        ..Outcome::default()
    })
}
