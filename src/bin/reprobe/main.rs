//! The command line: parses, calls the library, reports. Exit codes: 0 done, 1 a check failed, 2 bad usage or input.

mod bake_lightmap;
mod bake_probes;
mod budget;
mod common;
mod compare;
mod curvature;
mod devices;
mod evaluate;
mod frames;
mod info;
mod pipeline;
mod place_probes;
mod probe_set;
mod qhmap;
mod render_baseline;
mod render_glossy;
mod render_path;
mod resmap;
mod run;

mod timings;
mod views;

use clap::Parser;
use common::{Common, Outcome};
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
    let cli = Cli::parse();
    let common = &cli.common;
    let result = common.start().and_then(|()| dispatch(&cli.command, common));
    match result {
        Ok(outcome) => {
            common.report(&outcome);
            if outcome.check_failed { ExitCode::from(1) } else { ExitCode::SUCCESS }
        }
        Err(error) => {
            eprintln!("reprobe: error: {error:#}");
            ExitCode::from(2)
        }
    }
}

fn dispatch(command: &Command, common: &Common) -> anyhow::Result<Outcome> {
    use Command::{BakeLightmap, BakeProbes, Devices, Evaluate, RenderPath, Resmap, Run};
    if !matches!(command, Resmap(_) | BakeProbes(_) | BakeLightmap(_) | RenderPath(_) | Devices(_) | Run(_) | Evaluate(_)) {
        common.refuse_gpu()?;
    }
    match command {
        Command::PlaceProbes(args) => place_probes::run(args, common),
        Command::Resmap(args) => resmap::run(args, common),
        Command::Qhmap(args) => qhmap::run(args, common),
        Command::Curvature(args) => curvature::run(args, common),
        Command::BakeProbes(args) => bake_probes::run(args, common),
        Command::BakeLightmap(args) => bake_lightmap::run(args, common),
        Command::RenderPath(args) => render_path::run(args, common),
        Command::Compare(args) => compare::run(args, common),
        Command::Devices(args) => devices::run(args, common),
        Command::Info(args) => info::run(args, common),
        Command::Run(args) => run::run(args, common),
        Command::Evaluate(args) => evaluate::run(args, common),
    }
}
