//! The command line: arguments become a stage, which the library runs; its result is reported. Exit codes: 0 done, 1 a check failed, 2 bad
//! usage or input.

mod bake_lightmap;
mod bake_probes;
mod common;
mod compare;
mod curvature;
mod devices;
mod evaluate;
mod info;
mod place_probes;
mod preset;
mod qhmap;
mod render_path;
mod resmap;
mod run;

use clap::Parser;
use common::Common;
use reprobe::plan::{Context, Outcome, Stage};
use std::process::ExitCode;

/// Bakes glossy global illumination into light probes and reprojects it into new views.
#[derive(Parser)]
#[command(version, about, propagate_version = true)]
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
    RenderPath(render_path::Args),
    Compare(compare::Args),
    Devices(devices::Args),
    Info(info::Args),
    Run(run::Args),
    Evaluate(evaluate::Args),
}

fn main() -> ExitCode {
    let Cli { common, command } = Cli::parse();
    let run = || {
        common.start()?;
        let outcome = dispatch(command, &common.context()?)?;
        common.report(&outcome)?;
        anyhow::Ok(outcome)
    };
    match run() {
        Ok(outcome) if outcome.check_failed => ExitCode::from(1),
        Ok(_) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("reprobe: error: {error:#}");
            ExitCode::from(2)
        }
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
        Command::RenderPath(args) => args.stage().into(),
        Command::Compare(args) => args.stage().into(),
        Command::Devices(args) => return devices::run(&args),
        Command::Info(args) => {
            cx.refuse_gpu("info")?;
            return info::run(&args);
        }
        Command::Run(args) => return run::run(&args, cx),
        Command::Evaluate(args) => return evaluate::run(&args, cx),
    };
    if !stage.uses_gpu() {
        cx.refuse_gpu(stage.command())?;
    }
    Ok(stage.run(cx)?)
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;
    use reprobe::plan::stages::{BakeLightmap, BakeProbes, Compare, Curvature, PlaceProbes, Qhmap, RenderPath, Resmap};

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
            (BakeProbes::COMMAND, BakeProbes::OPTIONS),
            (RenderPath::COMMAND, RenderPath::OPTIONS),
            (Compare::COMMAND, Compare::OPTIONS),
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
        Cli::command().debug_assert();
    }
}
