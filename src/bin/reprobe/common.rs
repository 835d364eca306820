//! Options that every subcommand has, and how results and progress are shown.

use crate::terminal::Terminal;
use anyhow::{Context as _, bail};
use reprobe::base::simd::Lanes;
use reprobe::exchange::LoadOptions;
use reprobe::gpu::Choice;
use reprobe::plan::{Context, Outcome};
use std::io::{ErrorKind, Write as _};
use std::sync::Arc;

/// Where these options stand in the help of a command.
const HEADING: &str = "Options of every command";

/// More threads than this are a slip of the hand.
const MOST_THREADS: usize = 1024;

/// Options of every subcommand.
#[derive(clap::Args)]
pub struct Common {
    /// Worker threads [default: all cores]
    #[arg(long, global = true, help_heading = HEADING, value_name = "N")]
    pub threads: Option<usize>,
    /// Seed of all random numbers
    #[arg(long, global = true, help_heading = HEADING, value_name = "N", default_value_t = 0)]
    pub seed: u32,
    /// Where to compute: auto, cpu, gpu or gpu:NAME
    #[arg(long, global = true, help_heading = HEADING, value_name = "DEVICE", default_value = "auto")]
    pub device: Choice,
    /// No progress bar and no summary
    #[arg(long, short, global = true, help_heading = HEADING)]
    pub quiet: bool,
    /// Print one JSON object with the run's figures in place of the summary
    #[arg(long, global = true, help_heading = HEADING)]
    pub json: bool,
    /// Say more
    #[arg(long, short, global = true, help_heading = HEADING)]
    pub verbose: bool,
    /// Multiplies all lengths of the scene, to make them metres [default: 1, or a power of ten where
    /// the scene is less than .1 or more than 10,000 across]
    #[arg(long, global = true, help_heading = HEADING, value_name = "S")]
    pub unit_scale: Option<f32>,
    /// Gives a scene parameter a value: NAME=VALUE for `$NAME`
    #[arg(long = "define", short = 'D', global = true, help_heading = HEADING, value_name = "NAME=VALUE")]
    pub defines: Vec<String>,
    /// Leave out what a scene asks for and is not supported, with a warning: a grey surface stands
    /// for an unknown scattering model
    #[arg(long, global = true, help_heading = HEADING)]
    pub skip_unsupported: bool,
    /// Take textures whose files end early as far as they go, with a warning
    #[arg(long, global = true, help_heading = HEADING)]
    pub allow_truncated: bool,
}

/// Takes those of the options out of a command's help that do nothing for it. They are taken all the same, so that a script may give
/// every command the same ones.
pub fn hide_idle(mut cli: clap::Command) -> clap::Command {
    const SCENE: [&str; 4] = ["unit_scale", "defines", "skip_unsupported", "allow_truncated"];
    for (command, idle) in [
        ("place-probes", &["device"][..]),
        ("resmap", &["seed"]),
        ("bake-lightfield", &["device"]),
        ("bake-transport", &["device", "seed"]),
        ("relight", &["device"]),
        ("qhmap", &[&["device", "seed"][..], &SCENE].concat()),
        ("curvature", &["device", "seed"]),
        ("compare", &[&["device", "seed"][..], &SCENE].concat()),
        ("export-gltf", &["device", "seed", "threads"]),
        ("export-probes", &[&["device", "seed"][..], &SCENE].concat()),
        ("devices", &[&["device", "seed", "threads"][..], &SCENE].concat()),
        ("inspect-lightfield", &["device", "seed"]),
        ("inspect-transport", &["device", "seed"]),
        ("info", &["device", "seed"]),
        ("view", &[&["device", "seed", "threads"][..], &SCENE].concat()),
        ("video", &[&["device", "seed"][..], &SCENE].concat()),
        ("completions", &[&["device", "seed", "threads"][..], &SCENE].concat()),
        ("man", &[&["device", "seed", "threads"][..], &SCENE].concat()),
    ] {
        let hidden: Vec<clap::Arg> =
            cli.get_arguments().filter(|a| idle.contains(&a.get_id().as_str())).map(|a| a.clone().hide(true)).collect();
        cli = cli.mut_subcommand(command, |sub| sub.args(hidden));
    }
    cli
}

impl Common {
    /// Sets up the thread pool. An error where the environment asks for an instruction set that is none.
    pub fn start(&self) -> anyhow::Result<()> {
        Lanes::asked()?;
        if let Some(n) = self.threads {
            if !(1..=MOST_THREADS).contains(&n) {
                bail!("--threads {n}: expected 1 to {MOST_THREADS}");
            }
            rayon::ThreadPoolBuilder::new().num_threads(n).build_global().context("--threads")?;
        }
        Ok(())
    }

    /// What stages share.
    pub fn context(&self) -> anyhow::Result<Context> {
        let define = |d: &String| {
            let (name, value) = d.split_once('=').with_context(|| format!("--define {d}: expected NAME=VALUE"))?;
            anyhow::Ok((name.to_owned(), value.to_owned()))
        };
        let load = LoadOptions {
            unit_scale: self.unit_scale,
            defines: self.defines.iter().map(define).collect::<Result<_, _>>()?,
            skip_unsupported: self.skip_unsupported,
            allow_truncated: self.allow_truncated,
        };
        let terminal = Arc::new(Terminal::new(self.quiet, self.verbose));
        Ok(Context::new(self.seed, self.device.clone(), load, terminal)?)
    }

    /// Prints a result to stdout. Whoever closes it early has seen enough.
    pub fn report(&self, outcome: &Outcome) -> anyhow::Result<()> {
        let text = match &outcome.summary {
            _ if self.json => outcome.figures.to_string(),
            summary if !self.quiet && !summary.is_empty() => summary.trim_end().to_owned(),
            _ => return Ok(()),
        };
        let mut stdout = std::io::stdout().lock();
        match writeln!(stdout, "{text}").and_then(|()| stdout.flush()) {
            Err(e) if e.kind() != ErrorKind::BrokenPipe => Err(e).context("the result cannot be printed"),
            _ => Ok(()),
        }
    }
}

/// Parses a number of bytes: digits, with K, M or G for powers of 1024.
pub fn parse_bytes(text: &str) -> Result<u64, String> {
    let expected = || format!("\"{text}\": expected bytes, like 512M or 2G");
    let digits = text.trim_end_matches(['K', 'M', 'G']);
    let shift = match &text[digits.len()..] {
        "" => 0,
        "K" => 10,
        "M" => 20,
        "G" => 30,
        _ => return Err(expected()),
    };
    let number: u64 = digits.parse().map_err(|_| expected())?;
    number.checked_mul(1 << shift).ok_or_else(expected)
}
