//! What all stages of a run share: options that every stage has, the scene, and who listens.

use crate::base::clock::seconds;
use crate::base::progress::{Progress, Silent};
use crate::exchange::{LoadOptions, load};
use crate::gpu::{Choice, Gpu};
use crate::scene::Scene;
use crate::scene::summary::Summary;
use crate::scene::units::METRES;
use crate::transport::World;
use crate::{Error, Result};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

/// Hears how far a stage has come, and what it has to say besides its result.
pub trait Listener: Progress + Send + Sync {
    /// Something is odd, but no error.
    fn warn(&self, message: &str);
    /// What is done next, or was done.
    fn say(&self, line: &str);
    /// What only those want to know who ask for more (`-v`).
    fn detail(&self, line: &str);
}

/// Hears nothing.
impl Listener for Silent {
    fn warn(&self, _: &str) {}
    fn say(&self, _: &str) {}
    fn detail(&self, _: &str) {}
}

/// Depth from which on what longer paths carry is not worth a word.
const LONG_PATH: u32 = 64;

/// Says what of a scene does not count for bakes.
fn warn_of_bakes(scene: &Scene, listener: &dyn Listener) {
    if let Some(depth) = scene.max_depth.filter(|&depth| depth < LONG_PATH) {
        let at = &scene.max_depth_at;
        listener.warn(&format!("{at}: max_depth = {depth} counts for path-trace alone: bakes follow paths to their end"));
    }
    let (low, high) = scene.geometry.bounds();
    let across = low.distance(high);
    if across > 0.0 && across.is_finite() && !METRES.contains(&across) {
        // The power of ten that makes it a room.
        let scale = 10f32.powi(1 - across.log10().ceil() as i32);
        let path = scene.path.display();
        listener.warn(&format!(
            "{path} is {across:.1e} across, and bakes count in metres: if that is not so, give every command --unit-scale {scale:e}"
        ));
    }
}

/// Options of every stage.
#[derive(Clone)]
pub struct Context {
    /// Seed of all random numbers.
    pub seed: u32,
    /// Where to compute.
    pub device: Choice,
    /// How scenes are loaded.
    pub load: LoadOptions,
    /// Who listens.
    pub listener: Arc<dyn Listener>,
    /// The scene of the last stage: stages run in one process load it once.
    scene: Arc<Mutex<Option<Loaded>>>,
}

/// A scene's file, and its opaque part.
type Loaded = (PathBuf, Arc<World>);

/// What a stage did.
#[derive(Debug, Default)]
pub struct Outcome {
    /// For people.
    pub summary: String,
    /// For programs (`--json`).
    pub figures: serde_json::Value,
    /// A threshold was passed: exit code 1.
    pub check_failed: bool,
}

impl Outcome {
    /// Of a stage whose output an earlier run has finished.
    pub fn up_to_date(output: &Path, figures: serde_json::Value) -> Self {
        Self { summary: format!("{}: up to date", output.display()), figures, check_failed: false }
    }
}

impl Context {
    /// A context; a scale must be positive.
    pub fn new(seed: u32, device: Choice, load: LoadOptions, listener: Arc<dyn Listener>) -> Result<Self> {
        if let Some(unit_scale) = load.unit_scale.filter(|s| !(s.is_finite() && *s > 0.0)) {
            return Err(Error::Request(format!("--unit-scale {unit_scale}: expected a positive number")));
        }
        Ok(Self { seed, device, load, listener, scene: Arc::default() })
    }

    /// The same with another seed.
    pub fn with_seed(&self, seed: u32) -> Self {
        Self { seed, ..self.clone() }
    }

    /// Who hears how far a stage has come.
    pub fn progress(&self) -> &dyn Progress {
        &*self.listener
    }

    /// Loads a scene and tells its warnings.
    pub fn load_scene(&self, path: &Path) -> Result<Scene> {
        let clock = seconds();
        let scene = load(path, &self.load)?;
        scene.warnings.iter().for_each(|w| self.listener.warn(w));
        let summary = Summary::of(&scene).to_string().replace('\n', "; ");
        self.listener.detail(&format!("{}: {summary}; loaded in {:.2} s", path.display(), clock()));
        Ok(scene)
    }

    /// The opaque part of a scene, ready for rays; says how many transmissive shapes were left out.
    pub fn opaque_world(&self, path: &Path) -> Result<Arc<World>> {
        let mut slot = self.scene.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((_, world)) = slot.as_ref().filter(|(p, _)| p == path) {
            return Ok(world.clone());
        }
        let scene = self.load_scene(path)?;
        warn_of_bakes(&scene, &*self.listener);
        let clock = seconds();
        let (world, left_out) = World::opaque(scene);
        let world = world.with_outlook();
        self.listener.detail(&format!("ready for rays in {:.2} s", clock()));
        if left_out > 0 {
            let message = format!("{left_out} transmissive shapes are left out: probes and light maps hold opaque surfaces");
            self.listener.warn(&message);
        }
        let world = Arc::new(world);
        *slot = Some((path.into(), world.clone()));
        Ok(world)
    }

    /// What `make` makes of the GPU that is asked for; `None` for the CPU. Where the choice is ours, a GPU on which that fails is passed over.
    pub fn on_gpu<T>(&self, make: impl FnOnce(Arc<Gpu>) -> Result<T>) -> Result<Option<T>> {
        let made = Gpu::open(&self.device).and_then(|gpu| gpu.map(|gpu| make(Arc::new(gpu))).transpose());
        let place = made.as_ref().map_or("neither", |gpu| if gpu.is_some() { "the GPU" } else { "the CPU" });
        self.listener.detail(&format!("computed on {place}"));
        match made {
            Err(e) if self.device == Choice::Auto => {
                self.listener.warn(&format!("on the CPU, since: {e}"));
                Ok(None)
            }
            made => made,
        }
    }

    /// An error where a GPU is asked for by what has no use for one.
    pub fn refuse_gpu(&self, what: &str) -> Result<()> {
        match self.device {
            Choice::Auto | Choice::Cpu => Ok(()),
            Choice::Gpu | Choice::Named(_) => {
                Err(Error::Request(format!("--device: {what} runs on the CPU alone; use --device cpu")))
            }
        }
    }
}
