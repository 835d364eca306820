//! Options that every subcommand has, and how results and progress are shown.

use anyhow::{Context, bail};
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use reprobe::base::progress::Progress;
use reprobe::exchange::{LoadOptions, load};
use reprobe::gpu::{Choice, Gpu};
use reprobe::scene::Scene;
use reprobe::transport::World;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};

/// Options of every subcommand.
#[derive(clap::Args)]
pub struct Common {
    /// Worker threads [default: all cores]
    #[arg(long, global = true, value_name = "N")]
    pub threads: Option<usize>,
    /// Seed of all random numbers
    #[arg(long, global = true, value_name = "N", default_value_t = 0)]
    pub seed: u32,
    /// Where to compute: auto, cpu, gpu or gpu:NAME
    #[arg(long, global = true, value_name = "DEVICE", default_value = "auto")]
    pub device: Choice,
    /// No progress bar and no summary
    #[arg(long, short, global = true)]
    pub quiet: bool,
    /// Print one JSON object with the run's figures in place of the summary
    #[arg(long, global = true)]
    pub json: bool,
    /// Say more
    #[arg(long, short, global = true)]
    pub verbose: bool,
    /// Multiplies all lengths of the scene, to make them metres
    #[arg(long, global = true, value_name = "S", default_value_t = 1.0)]
    pub unit_scale: f32,
    /// Gives a scene parameter a value: NAME=VALUE for `$NAME`
    #[arg(long = "define", short = 'D', global = true, value_name = "NAME=VALUE")]
    pub defines: Vec<String>,
    /// The scene of the last stage: stages run in one process load it once.
    #[arg(skip)]
    opaque: Arc<SceneSlot>,
}

/// A scene's file and its opaque part.
type SceneSlot = Mutex<Option<(PathBuf, Arc<World>)>>;

/// `--shard I/N`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Shard {
    index: u32,
    count: u32,
}

impl Shard {
    /// Whether item `i` is this shard's.
    pub fn has(&self, i: u32) -> bool {
        i % self.count == self.index
    }
}

/// Parses `I/N`, I from 0.
pub fn parse_shard(text: &str) -> Result<Shard, String> {
    let parsed = text.split_once('/').and_then(|(i, n)| Some((i.parse().ok()?, n.parse().ok()?)));
    match parsed {
        Some((index, count)) if index < count => Ok(Shard { index, count }),
        _ => Err("expected I/N with I from 0 to N-1, like 0/4".into()),
    }
}

/// What a subcommand did.
#[derive(Default)]
pub struct Outcome {
    /// For people.
    pub summary: String,
    /// For programs (`--json`).
    pub figures: serde_json::Value,
    /// A `--max-*` threshold was passed: exit code 1.
    pub check_failed: bool,
}

impl Common {
    /// Sets up the thread pool.
    pub fn start(&self) -> anyhow::Result<()> {
        if let Some(n) = self.threads {
            if n == 0 {
                bail!("--threads 0: expected at least 1");
            }
            rayon::ThreadPoolBuilder::new().num_threads(n).build_global().context("--threads")?;
        }
        Ok(())
    }

    /// An error where a GPU is asked for by a command that has no use for one.
    pub fn refuse_gpu(&self) -> anyhow::Result<()> {
        match self.device {
            Choice::Auto | Choice::Cpu => Ok(()),
            Choice::Gpu | Choice::Named(_) => {
                bail!(
                    "--device: resmap, bake-probes, bake-lightmap, run, evaluate and render-path use a GPU; use --device cpu here"
                )
            }
        }
    }

    /// What `make` makes of the GPU that `--device` asks for; `None` for the CPU. Where the choice is ours, a GPU on which that fails is
    /// passed over.
    pub fn on_gpu<T>(&self, make: impl FnOnce(Arc<Gpu>) -> reprobe::Result<T>) -> anyhow::Result<Option<T>> {
        let made = Gpu::open(&self.device).and_then(|gpu| gpu.map(|gpu| make(Arc::new(gpu))).transpose());
        match made {
            Err(e) if self.device == Choice::Auto => {
                eprintln!("reprobe: warning: on the CPU, since: {e}");
                Ok(None)
            }
            made => Ok(made?),
        }
    }

    /// Loads a scene and prints its warnings.
    pub fn load_scene(&self, path: &Path) -> anyhow::Result<Scene> {
        if !(self.unit_scale.is_finite() && self.unit_scale > 0.0) {
            bail!("--unit-scale {}: expected a positive number", self.unit_scale);
        }
        let mut options = LoadOptions { unit_scale: self.unit_scale, ..LoadOptions::default() };
        for d in &self.defines {
            let (name, value) = d.split_once('=').with_context(|| format!("--define {d}: expected NAME=VALUE"))?;
            options.defines.push((name.into(), value.into()));
        }
        let scene = load(path, &options)?;
        for w in &scene.warnings {
            eprintln!("reprobe: warning: {w}");
        }
        Ok(scene)
    }

    /// The opaque part of a scene, ready for rays; says how many transmissive shapes were left out.
    pub fn opaque_world(&self, path: &Path) -> anyhow::Result<Arc<World>> {
        let mut slot = self.opaque.lock().unwrap_or_else(|e| e.into_inner());
        if let Some((_, world)) = slot.as_ref().filter(|(p, _)| p == path) {
            return Ok(world.clone());
        }
        let (world, left_out) = World::opaque(self.load_scene(path)?);
        if left_out > 0 {
            eprintln!(
                "reprobe: warning: {left_out} transmissive shapes are left out: probes and light maps hold opaque surfaces"
            );
        }
        let world = Arc::new(world);
        *slot = Some((path.into(), world.clone()));
        Ok(world)
    }

    /// Lets this stage use the scene that `other` has loaded, and the other way round.
    pub fn share_scene(&mut self, other: &Self) {
        self.opaque = other.opaque.clone();
    }

    /// Prints a result to stdout.
    pub fn report(&self, outcome: &Outcome) {
        if self.json {
            println!("{}", outcome.figures);
        } else if !self.quiet && !outcome.summary.is_empty() {
            println!("{}", outcome.summary.trim_end());
        }
    }

    /// A progress bar on stderr, drawn only on a terminal.
    pub fn progress(&self) -> Bar {
        Bar { hidden: self.quiet, bar: Mutex::new(None) }
    }
}

/// Parses `WIDTHxHEIGHT`, pixels.
pub fn parse_size(text: &str) -> Result<[u32; 2], String> {
    const MOST: u32 = 16384;
    let expected = || format!("\"{text}\": expected WIDTHxHEIGHT, each from 1 to {MOST}, like 960x540");
    let (w, h) = text.split_once('x').ok_or_else(expected)?;
    let side = |s: &str| s.parse().ok().filter(|n| (1..=MOST).contains(n)).ok_or_else(expected);
    Ok([side(w)?, side(h)?])
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

/// Shows a stage's progress with the time left.
pub struct Bar {
    hidden: bool,
    bar: Mutex<Option<ProgressBar>>,
}

impl Progress for Bar {
    fn start(&self, what: &str, total: u64) {
        let target = if self.hidden { ProgressDrawTarget::hidden() } else { ProgressDrawTarget::stderr() };
        let style = ProgressStyle::with_template("{msg:24} {wide_bar} {percent:>3} %  {elapsed} gone, {eta} left")
            .unwrap_or_else(|_| ProgressStyle::default_bar());
        let bar = ProgressBar::with_draw_target(Some(total), target).with_style(style).with_message(what.to_owned());
        *self.bar.lock().unwrap_or_else(|e| e.into_inner()) = Some(bar);
    }

    fn advance(&self, n: u64) {
        if let Some(bar) = &*self.bar.lock().unwrap_or_else(|e| e.into_inner()) {
            bar.inc(n);
        }
    }

    fn finish(&self) {
        if let Some(bar) = self.bar.lock().unwrap_or_else(|e| e.into_inner()).take() {
            bar.finish_and_clear();
        }
    }
}
