//! `reprobe evaluate`: methods and ablations against one reference.

use crate::preset::Preset;
use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use reprobe::method::METHODS;
use reprobe::plan::evaluation::{Evaluate, all_variants};
use reprobe::plan::option::Size;
use reprobe::plan::settings::Settings;
use reprobe::plan::variant::{ALL, Given, Named, Variant, chosen, parse_bake};
use reprobe::plan::views::FrameList;
use reprobe::plan::{Context, Outcome};
use serde_json::json;
use std::path::PathBuf;

/// Experiments that are known by name
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub enum Ablations {
    /// Figures 12 to 15 of Rodriguez et al. 2020
    Paper,
}

/// Evaluate methods and ablations against references
///
/// Bakes what the methods need, renders their frames and the reference, measures all of them, and writes evaluation.json (errors),
/// timings.json (times), evaluation.md (the tables) and index.html (one file to look at). Every stage is a command of its own, printed
/// before it runs; what an earlier run has finished is kept.
#[derive(clap::Args)]
#[command(after_help = "Examples:
  reprobe evaluate room/scene.xml --path room/path.json -o report/ --methods glossy-probes,path-trace
  reprobe evaluate room/scene.xml --path room/path.json -o report/ --methods all --reference-pair --reference-spp 256
  reprobe evaluate room/scene.xml --path room/path.json -o report/ --methods glossy-probes,glossy-probes-rays,path-trace-oidn \\
      --reference mitsuba/ --second-reference mitsuba_seed_1/
  reprobe evaluate room/scene.xml --path room/path.json -o report/ --ablations paper --preset medium --reference mitsuba/
  reprobe evaluate room/scene.xml --path room/path.json -o report/ --probes probes/ --lightmap lightmap.exr \\
      --variant one=glossy-probes,gather.probes=1 --variant fast=path-trace,--spp=4
  reprobe evaluate room/scene.xml --path room/path.json -o report/ --methods glossy-probes,ulr,image-space-gather \\
      --variant rt=lightmap-rt,--match-time=report/frames/glossy-probes
  reprobe evaluate room/scene.xml --path room/path.json -o report/ --variant lat-long=glossy-probes,qhmap:--lat-long")]
pub struct Args {
    /// Scene: Mitsuba XML or JSON, or glTF
    scene: PathBuf,
    /// Camera path
    #[arg(long, value_name = "PATH.json")]
    path: PathBuf,
    /// Folder for the report, frames and bakes
    #[arg(short, long, value_name = "DIR")]
    output: PathBuf,
    /// Methods of render-path, and variants of them that are known by name [default: glossy-probes, where there is no --variant]
    #[arg(long, value_name = "LIST", value_delimiter = ',', value_parser = named())]
    methods: Vec<Named>,
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
    /// Those frames rendered with another seed: RMSE, DSSIM and the change from frame to frame are told without the
    /// references' own noise, too, and the verdict goes by that
    #[arg(long, value_name = "DIR", requires = "reference")]
    second_reference: Option<PathBuf>,
    /// Path-trace the reference twice, with two seeds, for the same
    #[arg(long, conflicts_with = "reference")]
    reference_pair: bool,
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
    #[arg(long, value_name = "WxH")]
    size: Option<Size>,
    /// Only these frames of the path
    #[arg(long, value_name = "LIST")]
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
    /// About how large index.html may be, megabytes; where its pictures would take more they are coarser, then smaller, then of
    /// fewer frames
    #[arg(long, value_name = "MB", default_value_t = 30, value_parser = clap::value_parser!(u32).range(1..=1000))]
    page_mb: u32,
    /// Print the stages' commands and stop
    #[arg(long)]
    dry_run: bool,
}

/// The table's methods, each before its variants.
fn named() -> impl TypedValueParser<Value = Named> {
    let all = PossibleValue::new(ALL).help("all of these; variants with OIDN where the library is found");
    let table = METHODS.iter().flat_map(|m| {
        let variants = m.variants.iter().map(|(name, what)| PossibleValue::new(*name).help(*what));
        std::iter::once(PossibleValue::new(m.name).help(m.about)).chain(variants)
    });
    PossibleValuesParser::new(table.chain([all])).try_map(|name| Named::parse(&name))
}

impl Args {
    fn settings(&self) -> Settings {
        let preset = reprobe::plan::settings::Preset::from(self.preset).settings(true);
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
}

pub fn run(args: &Args, cx: &Context) -> anyhow::Result<Outcome> {
    let settings = args.settings();
    let methods = chosen(&args.methods, cx)?;
    let variants = all_variants(&methods, &args.variants, args.ablations.is_some(), &args.only, settings.probes)?;
    let evaluate = Evaluate {
        scene: args.scene.clone(),
        path: args.path.clone(),
        output: args.output.clone(),
        variants,
        reference: args.reference.clone(),
        second_reference: args.second_reference.clone(),
        reference_pair: args.reference_pair,
        probes: args.probes.clone(),
        lightmap: args.lightmap.clone(),
        curvature: args.curvature.clone(),
        bakes: args.bakes.clone(),
        bake_options: args.bake.clone(),
        frames: args.frames.clone(),
        settings,
        exposure: args.exposure,
        page_bytes: args.page_mb as usize * 1_000_000,
    };
    if args.dry_run {
        let plan = evaluate.plan(cx)?;
        let lines: Vec<String> = plan.stages().map(|p| p.stage.command_line(&cx.with_seed(p.seed))).collect();
        return Ok(Outcome { summary: lines.join("\n"), figures: json!({ "commands": lines }), ..Outcome::default() });
    }
    Ok(evaluate.run(cx)?)
}
