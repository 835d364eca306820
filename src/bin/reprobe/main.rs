//! The command line: arguments become a stage, which the library runs; its result is reported. Exit codes: 0 done, 1 a check failed, 2 bad
//! usage or input.

mod bake_lightfield;
mod bake_lightmap;
mod bake_probes;
mod bake_transport;
mod common;
mod compare;
mod completions;
mod curvature;
mod devices;
mod evaluate;
mod export_gltf;
mod export_probes;
mod info;
mod inspect_lightfield;
mod inspect_transport;
mod man;
mod place_probes;
mod preset;
mod qhmap;
mod relight;
mod render_path;
mod resmap;
mod run;
mod terminal;
mod video;
mod view;

use clap::{CommandFactory, FromArgMatches, Parser};
use common::Common;
use reprobe::base::clock::seconds;
use reprobe::gpu::Choice;
use reprobe::plan::timings::peak_memory;
use reprobe::plan::{Context, Outcome, Stage};
use reprobe::view::denoiser::Kind;
use std::ffi::OsString;
use std::process::ExitCode;

/// Bakes glossy global illumination into light probes and reprojects it into new views.
#[derive(Parser)]
#[command(
    version,
    about,
    propagate_version = true,
    after_help = "Exit codes: 0 done; 1 a check failed (compare past a --max-*); 2 bad usage or input.

Start with:
  reprobe run scene.xml -o out/                        everything, with a report to look at
  reprobe run scene.xml -o out/ --dry-run              the commands that it consists of
  reprobe COMMAND --help                               what a command reads and writes, with examples"
)]
struct Cli {
    #[command(flatten)]
    common: Common,
    #[command(subcommand)]
    command: Command,
}

#[derive(clap::Subcommand)]
enum Command {
    PlaceProbes(place_probes::Args),
    Resmap(resmap::Args),
    Qhmap(qhmap::Args),
    Curvature(curvature::Args),
    BakeProbes(bake_probes::Args),
    BakeLightmap(bake_lightmap::Args),
    BakeLightfield(bake_lightfield::Args),
    BakeTransport(bake_transport::Args),
    Relight(relight::Args),
    RenderPath(render_path::Args),
    Compare(compare::Args),
    ExportGltf(export_gltf::Args),
    ExportProbes(export_probes::Args),
    InspectLightfield(inspect_lightfield::Args),
    InspectTransport(inspect_transport::Args),
    Devices(devices::Args),
    Info(info::Args),
    View(view::Args),
    Video(video::Args),
    Run(run::Args),
    Evaluate(evaluate::Args),
    Completions(completions::Args),
    Man(man::Args),
}

fn main() -> ExitCode {
    let Cli { common, command } = parse();
    if common.device == Choice::Auto && !matches!(command, Command::Devices(_)) {
        leave_out_software();
    }
    let run = || {
        common.start()?;
        let (cx, clock) = (common.context()?, seconds());
        let outcome = dispatch(command, &cx)?;
        let memory = peak_memory().map_or_else(String::new, |bytes| format!(", at most {} MiB of memory", bytes >> 20));
        cx.listener.detail(&format!("{:.2} s in all{memory}", clock()));
        common.report(&outcome)?;
        anyhow::Ok(outcome)
    };
    match run() {
        Ok(outcome) if outcome.check_failed => ExitCode::from(1),
        Ok(_) => ExitCode::SUCCESS,
        Err(error) => {
            terminal::put(&format!("reprobe: error: {error:#}"));
            ExitCode::from(2)
        }
    }
}

/// What was typed; usage errors end the process.
fn parse() -> Cli {
    let matches = typed().get_matches_from(joined(std::env::args_os()));
    Cli::from_arg_matches(&matches).unwrap_or_else(|e| e.exit())
}

/// The commands and their options, as they can be typed.
fn typed() -> clap::Command {
    common::hide_idle(Cli::command())
}

/// Words with `--denoise` and what may follow it as one: it stands alone too, and then the next word is not its value, but the scene, say.
fn joined(words: impl Iterator<Item = OsString>) -> Vec<OsString> {
    let mut list: Vec<OsString> = Vec::new();
    for word in words {
        let is_value = word.to_str().is_some_and(|w| w.parse::<Kind>().is_ok());
        match list.last_mut().filter(|last| is_value && *last == "--denoise") {
            Some(last) => last.push(format!("={}", word.display())),
            None => list.push(word),
        }
    }
    list
}

/// Keeps Vulkan's loader from software adapters where the choice is ours, as they are only taken by name: starting one costs time, and
/// some print to stderr.
fn leave_out_software() {
    const VARIABLE: &str = "VK_LOADER_DRIVERS_DISABLE";
    if std::env::var_os(VARIABLE).is_none() {
        // SAFETY: no other thread runs yet that could read the environment meanwhile.
        unsafe { std::env::set_var(VARIABLE, "*lvp*,*swrast*,*swiftshader*") };
    }
}

fn dispatch(command: Command, cx: &Context) -> anyhow::Result<Outcome> {
    let stage: Stage = match command {
        Command::PlaceProbes(args) => args.stage().into(),
        Command::Resmap(args) => args.stage().into(),
        Command::Qhmap(args) => args.stage().into(),
        Command::Curvature(args) => args.stage().into(),
        Command::BakeProbes(args) => args.stage().into(),
        Command::BakeLightmap(args) => args.stage().into(),
        Command::BakeLightfield(args) => args.stage().into(),
        Command::BakeTransport(args) => args.stage().into(),
        Command::Relight(args) => args.stage().into(),
        Command::RenderPath(args) => args.stage().into(),
        Command::Compare(args) => args.stage().into(),
        Command::ExportGltf(args) => args.stage().into(),
        Command::ExportProbes(args) => args.stage().into(),
        Command::InspectLightfield(args) => args.stage().into(),
        Command::InspectTransport(args) => args.stage().into(),
        Command::View(args) => args.stage().into(),
        Command::Video(args) => args.stage().into(),
        Command::Devices(args) => return devices::run(&args),
        Command::Info(args) => {
            cx.refuse_gpu("info")?;
            return info::run(&args, cx);
        }
        Command::Run(args) => return run::run(&args, cx),
        Command::Evaluate(args) => return evaluate::run(&args, cx),
        Command::Completions(args) => {
            cx.refuse_gpu("completions")?;
            return completions::run(&args, typed());
        }
        Command::Man(args) => {
            cx.refuse_gpu("man")?;
            return man::run(&args, typed());
        }
    };
    if !stage.uses_gpu() {
        cx.refuse_gpu(stage.command())?;
    }
    Ok(stage.run(cx)?)
}

#[cfg(test)]
mod tests {
    use super::*;
    use reprobe::plan::stages::{
        BakeLightfield, BakeLightmap, BakeProbes, BakeTransport, Compare, Curvature, ExportGltf, ExportProbes, InspectLightfield,
        InspectTransport, PlaceProbes, Qhmap, Relight, RenderPath, Resmap, Video, View,
    };

    /// Every option of a stage can be typed, and what can be typed reaches the stage.
    #[test]
    fn stages_and_subcommands_have_the_same_options() {
        let cli = Cli::command();
        for (command, options) in [
            (PlaceProbes::COMMAND, PlaceProbes::OPTIONS),
            (Resmap::COMMAND, Resmap::OPTIONS),
            (Qhmap::COMMAND, Qhmap::OPTIONS),
            (Curvature::COMMAND, Curvature::OPTIONS),
            (BakeLightmap::COMMAND, BakeLightmap::OPTIONS),
            (BakeLightfield::COMMAND, BakeLightfield::OPTIONS),
            (BakeTransport::COMMAND, BakeTransport::OPTIONS),
            (BakeProbes::COMMAND, BakeProbes::OPTIONS),
            (Relight::COMMAND, Relight::OPTIONS),
            (RenderPath::COMMAND, RenderPath::OPTIONS),
            (Compare::COMMAND, Compare::OPTIONS),
            (ExportGltf::COMMAND, ExportGltf::OPTIONS),
            (ExportProbes::COMMAND, ExportProbes::OPTIONS),
            (InspectLightfield::COMMAND, InspectLightfield::OPTIONS),
            (InspectTransport::COMMAND, InspectTransport::OPTIONS),
            (View::COMMAND, View::OPTIONS),
            (Video::COMMAND, Video::OPTIONS),
        ] {
            let sub = cli.find_subcommand(command).unwrap_or_else(|| panic!("no subcommand {command}"));
            let mut typed: Vec<String> = sub.get_arguments().filter_map(|a| Some(format!("--{}", a.get_long()?))).collect();
            typed.retain(|option| option != "--help" && option != "--version");
            typed.sort();
            let mut known: Vec<&str> = options.to_vec();
            known.sort_unstable();
            assert_eq!(typed, known, "{command}");
        }
    }

    #[test]
    fn the_command_line_is_well_formed() {
        typed().debug_assert();
    }

    #[test]
    fn help_has_examples_and_the_options_that_do_something() {
        let mut cli = typed();
        cli.build();
        for sub in cli.get_subcommands_mut().filter(|sub| sub.get_name() != "help") {
            let (name, help) = (sub.get_name().to_owned(), sub.render_long_help().to_string());
            let shows = |option: &str| help.contains(&format!("  {option} ")) || help.contains(&format!(", {option} "));
            let runs_on_gpu = ["resmap", "bake-probes", "bake-lightmap", "render-path", "run", "evaluate"].contains(&&*name);
            assert_eq!(shows("--device"), runs_on_gpu, "{name}");
            let reads_no_scene =
                ["qhmap", "compare", "export-probes", "devices", "view", "video", "completions", "man"].contains(&&*name);
            assert_eq!(shows("--unit-scale"), !reads_no_scene, "{name}");
        }
    }

    /// The lines of a command's examples, those that go on put together, without what is said of them and where they write to.
    fn examples(after_help: &str) -> Vec<String> {
        let text = after_help.strip_prefix("Examples:\n").unwrap_or_default().replace("\\\n", " ");
        let lines = text.lines().filter_map(|line| line.strip_prefix("  "));
        let typed = |line: &str| line.replace(" > ", "     ").split("     ").next().map(str::to_owned);
        lines.filter(|line| line.starts_with("reprobe ")).filter_map(typed).collect()
    }

    #[test]
    fn every_command_has_two_examples_of_its_own_and_all_can_be_typed() {
        let mut shown = 0;
        for sub in typed().get_subcommands() {
            let name = sub.get_name();
            let lines = examples(&sub.get_after_help().map(ToString::to_string).unwrap_or_default());
            let own = lines.iter().filter(|line| line.split_whitespace().nth(1) == Some(name)).count();
            assert!(own >= 2, "{name}: {own} examples of its own in {lines:?}");
            shown += lines.len();
            for line in lines {
                let words = line.split_whitespace().map(OsString::from);
                let matches = typed().try_get_matches_from(joined(words)).unwrap_or_else(|e| panic!("{line}: {e}"));
                Cli::from_arg_matches(&matches).unwrap_or_else(|e| panic!("{line}: {e}"));
            }
        }
        assert!(shown > 60, "{shown}");
    }

    #[test]
    fn denoise_stands_alone_or_with_a_denoiser() {
        for (words, expected) in [
            ("--denoise scene.xml -o out", Some(None)),
            ("scene.xml -o out --denoise", Some(None)),
            ("scene.xml -o out --denoise oidn", Some(Some(Kind::Oidn))),
            ("--denoise filter scene.xml -o out", Some(Some(Kind::Filter))),
            ("scene.xml --denoise=filter -o out", Some(Some(Kind::Filter))),
            ("scene.xml -o out", None),
        ] {
            let words = ["reprobe", "render-path"].into_iter().chain(words.split(' ')).map(OsString::from);
            let matches = typed().try_get_matches_from(joined(words)).unwrap();
            let Command::RenderPath(args) = Cli::from_arg_matches(&matches).unwrap().command else { panic!("another command") };
            let stage = args.stage();
            assert_eq!((stage.denoise, stage.scene.to_str()), (expected, Some("scene.xml")));
        }
        let words = ["reprobe", "render-path", "scene.xml", "-o", "out", "--denoise=magic"].map(OsString::from);
        let refused = typed().try_get_matches_from(joined(words.into_iter())).err().unwrap();
        assert!(refused.to_string().contains("expected one of oidn, filter"), "{refused}");
    }

    #[test]
    fn an_option_that_does_nothing_for_a_command_is_taken_all_the_same() {
        let words = ["reprobe", "qhmap", "resmap", "-o", "qhmap", "--seed", "7", "--device", "cpu"];
        let matches = typed().try_get_matches_from(words).unwrap();
        let cli = Cli::from_arg_matches(&matches).unwrap();
        assert_eq!((cli.common.seed, cli.common.device), (7, Choice::Cpu));
    }
}
