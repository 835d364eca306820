//! `render-path`.

use crate::base::clock::timed;
use crate::base::named::words;
use crate::gpu::camera;
use crate::io::Provenance;
use crate::io::jobs::Shard;
use crate::io::provenance::hash_file;
use crate::lightmap::LightMap;
use crate::method::diffuse::Joined;
use crate::method::glossy_probes::wanted::Served;
use crate::method::glossy_probes::{self, GlossyProbeParams};
use crate::method::{FilterChoice, LayerChoice, METHODS, Method, Need, Options, Renderer, Setup};
use crate::plan::budget::{self, Budget};
use crate::plan::frames::{Frames, render};
use crate::plan::lights;
use crate::plan::option::{Size, stage};
use crate::plan::timings::Timings;
use crate::plan::views::{FrameList, views, views_of_changes};
use crate::plan::{Context, Outcome};
use crate::probe::file::BakedSet;
use crate::probe::store::{SET_FILE, set_hash};
use crate::scene::{Animation, Camera, camera_path};
use crate::surface::{CurvatureMap, curvature_file};
use crate::transport::World;
use crate::view::View;
use crate::view::denoiser::{Denoiser, Kind};
use crate::view::oidn::Oidn;
use crate::{Error, Result};
use serde::de::IgnoredAny;
use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Memory that a GPU may be filled with, bytes.
pub const GPU_MEMORY: u64 = 2 << 30;

stage! {
    /// Renders the frames of a camera path.
    RenderPath "render-path"
    {
        /// The scene.
        scene,
    }
    {
        /// The camera path; the scene's own sensor is the one frame without it.
        "--path" path: Option<PathBuf>,
        /// Lights, materials and objects that change from frame to frame.
        "--lights" lights: Option<PathBuf>,
        /// Only these frames of it.
        "--frames" frames: Option<FrameList>,
        /// Size of the frames.
        "--size" size: Option<Size>,
        /// The row of the table of methods.
        "--method" method: Option<String>,
        /// Baked probes.
        "--probes" probes: Option<PathBuf>,
        /// The method whose diffuse light frames have.
        "--diffuse" diffuse: Option<String>,
        /// Its probes.
        "--diffuse-probes" diffuse_probes: Option<PathBuf>,
        /// Its parameters, by name.
        "--diffuse-set" diffuse_set: Vec<String>,
        /// The light map.
        "--lightmap" lightmap: Option<PathBuf>,
        /// Curvatures of the scene.
        "--curvature" curvature: Option<PathBuf>,
        /// N x N rays a pixel.
        "--supersample" supersample: Option<u32>,
        /// Paths a pixel.
        "--spp" spp: Option<u32>,
        /// Rays or taps a pixel.
        "--samples" samples: Option<u32>,
        /// How light field probes' maps are searched.
        "--trace" trace: Option<String>,
        /// Most scattering vertices of a path.
        "--max-depth" max_depth: Option<u32>,
        /// What to write of a path-traced frame.
        "--layers" layers: Option<LayerChoice>,
        /// Reconstruction filter of path-traced frames.
        "--rfilter" rfilter: Option<FilterChoice>,
        /// Take the noise out of the layers, and by what.
        "--denoise" denoise: Option<Option<Kind>>,
        /// Choose the samples with which a frame takes so many milliseconds.
        "--budget-ms" budget_ms: Option<f64>,
        /// Choose those with which it takes as long as the frames of this folder.
        "--match-time" match_time: Option<PathBuf>,
        /// Memory that a GPU may be filled with, bytes.
        "--gpu-memory" gpu_memory: Option<u64>,
        /// The paper's text in every choice.
        "--paper" paper: bool,
        /// Parameters of the method, by name.
        "--set" set: Vec<String>,
        /// Auxiliary layers.
        "--aov" aov: Option<Aov>,
        /// Render this shard's frames only.
        "--shard" shard: Option<Shard>,
        /// Folder for the frames.
        "--output" output: PathBuf,
    }
}

/// Auxiliary layers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Aov {
    /// All there are.
    All,
}

words!(Aov { All "all" });
words!(LayerChoice { All "all", Full "full" });
words!(FilterChoice { Box "box", Scene "scene" });
crate::plan::option::text!(Aov, LayerChoice, FilterChoice, Kind);

/// Options that make sense together: what is computed.
pub struct Resolved {
    /// The method.
    pub method: &'static Method,
    /// Its parameters.
    pub parameters: Value,
    /// Whose diffuse light frames have, where it is not the method's own.
    pub joined: Option<Joined>,
}

/// What was read.
struct Inputs {
    world: Arc<World>,
    animation: Option<Animation>,
    lightmap: Option<LightMap>,
    curvature: Option<CurvatureMap>,
    provenance: Provenance,
}

impl RenderPath {
    /// The method's row.
    pub fn method(&self) -> Result<&'static Method> {
        self.method.as_deref().map_or(Ok(METHODS[0]), Method::find)
    }

    /// Options that not every method uses, and whether they are given.
    fn given(&self) -> [(&'static str, bool); 20] {
        [
            ("lights", self.lights.is_some()),
            ("probes", self.probes.is_some()),
            ("diffuse", self.diffuse.is_some()),
            ("diffuse-probes", self.diffuse_probes.is_some()),
            ("diffuse-set", !self.diffuse_set.is_empty()),
            ("lightmap", self.lightmap.is_some()),
            ("curvature", self.curvature.is_some()),
            ("supersample", self.supersample.is_some()),
            ("spp", self.spp.is_some()),
            ("samples", self.samples.is_some()),
            ("trace", self.trace.is_some()),
            ("max-depth", self.max_depth.is_some()),
            ("layers", self.layers.is_some()),
            ("rfilter", self.rfilter.is_some()),
            ("denoise", self.denoise.is_some()),
            ("budget-ms", self.budget_ms.is_some()),
            ("match-time", self.match_time.is_some()),
            ("gpu-memory", self.gpu_memory.is_some()),
            ("paper", self.paper),
            ("set", !self.set.is_empty()),
        ]
    }

    /// Checks all options, and reads nothing.
    pub fn resolve(&self) -> Result<Resolved> {
        let method = self.method()?;
        // Another method's diffuse light follows lights, whatever the method's own does.
        let uses = |option: &str| method.uses(option) || (option == "lights" && self.diffuse.is_some());
        if let Some((option, _)) = self.given().into_iter().find(|(option, given)| *given && !uses(option)) {
            let others: Vec<&str> = METHODS.iter().filter(|m| m.uses(option)).map(|m| m.name).collect();
            let (name, why) = (method.name, why_not(method, option));
            return Err(Error::Request(format!("--{option}: --method {name} has no use for it{why}; {} has", others.join(", "))));
        }
        for (given, is_required, option, stage) in [
            (self.probes.is_some(), method.reads.probes.is_some(), "probes DIR", method.reads.probes.map_or("", |p| p.stage)),
            (self.lightmap.is_some(), method.reads.lightmap == Need::Required, "lightmap FILE", "bake-lightmap"),
            (self.curvature.is_some(), method.reads.curvature == Need::Required, "curvature FILE", "curvature"),
        ] {
            if is_required && !given {
                return Err(Error::Request(format!("--method {} needs --{option}, written by {stage}", method.name)));
            }
        }
        let joined = self.joined()?;
        let budgets = [self.budget_ms.is_some(), self.match_time.is_some(), self.spp.is_some(), self.samples.is_some()];
        if budgets.into_iter().filter(|given| *given).count() > 1 {
            return Err(Error::Request("--budget-ms, --match-time, --spp, --samples: expected one of them".into()));
        }
        if self.shard.is_some() && (self.budget_ms.is_some() || self.match_time.is_some()) {
            let message =
                "--shard: every shard would choose samples of its own for --budget-ms or --match-time; give their number";
            return Err(Error::Request(message.into()));
        }
        budget::check(self.budget_ms)?;
        let options = Options {
            supersample: self.supersample,
            spp: self.spp,
            samples: self.samples,
            trace: self.trace.clone(),
            max_depth: self.max_depth,
            layers: self.layers,
            rfilter: self.rfilter,
            denoise: self.denoise,
            paper: self.paper,
            set: self.set.clone(),
        };
        Ok(Resolved { method, parameters: (method.parameters)(&options)?, joined })
    }

    /// Whose diffuse light frames have, where it is not the method's own.
    fn joined(&self) -> Result<Option<Joined>> {
        let Some(name) = &self.diffuse else {
            let orphan = [("diffuse-probes", self.diffuse_probes.is_some()), ("diffuse-set", !self.diffuse_set.is_empty())];
            return match orphan.into_iter().find(|(_, given)| *given) {
                Some((option, _)) => Err(Error::Request(format!("--{option}: whose is missing: --diffuse METHOD"))),
                None => Ok(None),
            };
        };
        let method = Method::find(name).map_err(|e| Error::Request(format!("--diffuse: {e}")))?;
        if method.diffuse.is_none() {
            let others: Vec<&str> = METHODS.iter().filter(|m| m.diffuse.is_some()).map(|m| m.name).collect();
            return Err(Error::Request(format!("--diffuse {name}: it has no light for others; {} has", others.join(", "))));
        }
        let stage = method.reads.probes.map_or("", |p| p.stage);
        let missing = || Error::Request(format!("--diffuse {name} needs --diffuse-probes DIR, written by {stage}"));
        let probes = self.diffuse_probes.clone().ok_or_else(missing)?;
        let options = Options { set: self.diffuse_set.clone(), ..Options::default() };
        Ok(Some(Joined { method, parameters: (method.parameters)(&options)?, probes }))
    }

    /// Refuses what does not go together or is out of range.
    pub fn check(&self) -> Result<()> {
        self.resolve().map(|_| ())
    }

    /// The method's name, and the samples that its frames have, where they have a number of them that is not left to a budget.
    pub fn samples(&self) -> Result<(&'static str, Option<u32>)> {
        let Resolved { method, parameters, .. } = self.resolve()?;
        let is_fixed = self.budget_ms.is_none() && self.match_time.is_none();
        Ok((method.name, method.count(&parameters).filter(|_| is_fixed)))
    }

    /// The texels of probes that its views want, where the method can say it; `None` elsewhere.
    pub fn served(&self, cameras: &[Camera]) -> Result<Option<Served>> {
        let Resolved { method, parameters, .. } = self.resolve()?;
        if method.name != glossy_probes::METHOD.name {
            return Ok(None);
        }
        let params: GlossyProbeParams = serde_json::from_value(parameters).map_err(|e| Error::Request(e.to_string()))?;
        Ok(Some(Served::new(cameras, params.supersample, &params.gather)))
    }

    /// Reads, renders the frames that are not finished, writes them and what they took.
    pub fn run(&self, cx: &Context) -> Result<Outcome> {
        let Resolved { method, parameters, joined } = self.resolve()?;
        let mut timings = Timings::of(method.name);
        let Inputs { world, animation, lightmap, curvature, provenance } =
            self.inputs(cx, (method, joined.as_ref()), &mut timings)?;
        let (path, size, frames) = (self.path.as_deref(), self.size.map(|s| s.0), self.frames.as_ref());
        let views = match &animation {
            None => views(&world.scene, path, size, frames)?,
            Some(animation) => views_of_changes(&world.scene, path, size, frames, animation.frames())?,
        };
        timings.fps = path.map(camera_path::fps).transpose()?.flatten().or(animation.as_ref().map(|a| a.fps));
        refuse_parallel(method, &views)?;
        let (parameters, warnings) = (method.for_scene)(parameters, &world.scene)?;
        warnings.iter().for_each(|w| cx.listener.warn(w));
        if let Some(denoiser) = Denoiser::among(&parameters) {
            timings.denoiser = Some(denoiser.to_string());
            cx.listener.detail(&in_words(denoiser, self.denoise.flatten()));
        }
        let budget = Budget::read(self.budget_ms, self.match_time.as_deref(), cx)?;
        let setup = Setup {
            world: &world,
            animation: animation.as_ref(),
            views: &views,
            parameters: &parameters,
            seed: cx.seed,
            lightmap: lightmap.as_ref(),
            curvature: curvature.as_ref(),
            probes: self.probes.as_deref(),
            diffuse: joined.as_ref(),
            inspect: self.aov.is_some(),
            gpu_memory: self.gpu_memory.unwrap_or(GPU_MEMORY),
        };
        let make = || make(cx, method, &setup);
        let frames = Frames { method, setup: &setup, provenance, output: &self.output, shard: self.shard, budget, make: &make };
        render(&frames, cx, timings)
    }

    fn inputs(&self, cx: &Context, (method, joined): (&Method, Option<&Joined>), timings: &mut Timings) -> Result<Inputs> {
        let world = if method.transmissive {
            let (scene, load_ms) = timed(|| cx.load_scene(&self.scene));
            let (world, build_ms) = timed(|| scene.map(|scene| World::new(scene).with_outlook()));
            (timings.load_ms, timings.build_ms) = (load_ms, build_ms);
            Arc::new(world?)
        } else {
            let (world, load_ms) = timed(|| cx.opaque_world(&self.scene));
            timings.load_ms = load_ms;
            world?
        };
        let scene = &world.scene;
        let provenance = Provenance::new(Self::COMMAND, &scene.hash, cx.seed, &json!({}));
        let (animation, mut provenance) = lights::load(self.lights.as_deref(), scene, provenance)?;
        if let Some(folder) = &self.probes {
            provenance = provenance.with_input("probes", set_hash(folder, method.reads.probes.map_or("", |p| p.stage))?);
            if method.reads.probes.is_some_and(|p| p.any_texel) {
                warn_of_partial_set(folder, method, cx);
            }
        }
        if let Some(Joined { method, probes, .. }) = joined {
            let hash = set_hash(probes, method.reads.probes.map_or("", |p| p.stage))?;
            provenance = provenance.with_input("diffuse-probes", hash);
        }
        let curvature = match &self.curvature {
            Some(file) => {
                provenance = provenance.with_input("curvature", hash_file(file)?);
                Some(curvature_file::read(file, scene.geometry.positions.len(), &scene.hash)?)
            }
            None => None,
        };
        let lightmap = match &self.lightmap {
            Some(file) => {
                provenance = provenance.with_input("lightmap", hash_file(file)?);
                Some(LightMap::load(file, scene)?)
            }
            None => None,
        };
        if lightmap.is_none() && method.reads.lightmap == Need::Wanted {
            cx.listener.warn("no --lightmap: the diffuse layer is black");
        }
        Ok(Inputs { animation, lightmap, curvature, provenance, world })
    }
}

/// Which denoiser frames have, and where it lies or why it is not another.
fn in_words(denoiser: Denoiser, wanted: Option<Kind>) -> String {
    match (denoiser, Oidn::found()) {
        (Denoiser::Oidn { .. }, Ok(oidn)) => format!("denoised by {denoiser}: {}", oidn.path.display()),
        (Denoiser::Filter(_), Err(why)) if wanted.is_none() => format!("denoised by {denoiser}: {why}"),
        _ => format!("denoised by {denoiser}"),
    }
}

/// Why a method has no use for an option, where it is not plain.
fn why_not(method: &Method, option: &str) -> &'static str {
    match (option, method.reads.probes, method.reads.lightmap) {
        ("lights", Some(_), _) if method.uses("diffuse") => {
            ": its probes hold the light that was baked (--diffuse radiance-probes lights them anew)"
        }
        ("lights", Some(_), _) => ": its probes hold the light that was baked",
        ("lights", None, Need::Wanted | Need::Required) => ": its light map holds the light that was baked",
        _ => "",
    }
}

/// An error where a view has parallel rays that the method does not know.
fn refuse_parallel(method: &Method, views: &[View]) -> Result<()> {
    if !method.orthographic && views.iter().any(|v| v.camera.orthographic.is_some()) {
        let others: Vec<&str> = METHODS.iter().filter(|m| m.orthographic).map(|m| m.name).collect();
        let (name, others) = (method.name, others.join(", "));
        return Err(Error::Request(format!(
            "--method {name} has no orthographic camera: use --method {others}, or give a camera path with --path"
        )));
    }
    Ok(())
}

/// The method's renderer, on the GPU that is asked for or on the CPU.
fn make<'a>(cx: &Context, method: &Method, setup: &Setup<'a>) -> Result<Box<dyn Renderer + 'a>> {
    let on_gpu = match method.gpu {
        Some(make) => cx.on_gpu(|gpu| {
            camera::check(&setup.world.scene, setup.views.iter().map(|v| &v.camera))?;
            make(gpu, setup)
        })?,
        None => {
            cx.refuse_gpu(&format!("--method {}", method.name))?;
            None
        }
    };
    on_gpu.map_or_else(|| (method.cpu)(setup), Ok)
}

/// A set that was baked for views lacks texels that other methods want.
fn warn_of_partial_set(folder: &Path, method: &Method, cx: &Context) {
    let text = std::fs::read_to_string(folder.join(SET_FILE)).unwrap_or_default();
    if serde_json::from_str::<BakedSet<IgnoredAny>>(&text).is_ok_and(|set| set.views.is_some()) {
        cx.listener.warn(&format!(
            "{}: baked for the views of another method: {} wants other texels, and goes without those that are missing; bake without \
             --for-path to be fair to it",
            folder.display(),
            method.name
        ));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(method: &str) -> RenderPath {
        let row = Method::find(method).unwrap();
        RenderPath {
            scene: "scene.xml".into(),
            output: "frames".into(),
            method: Some(method.into()),
            probes: row.uses("probes").then(|| "probes".into()),
            lightmap: row.uses("lightmap").then(|| "lightmap.exr".into()),
            curvature: row.uses("curvature").then(|| "curvature.exr".into()),
            ..RenderPath::default()
        }
    }

    #[test]
    fn an_option_that_the_method_has_no_use_for_is_an_error_that_says_who_has() {
        let mut refused = 0;
        for row in METHODS {
            for (option, value) in [
                ("lights", Some("l")),
                ("probes", Some("p")),
                ("diffuse", Some("radiance-probes")),
                ("lightmap", Some("l")),
                ("curvature", Some("c")),
                ("supersample", Some("2")),
                ("spp", Some("4")),
                ("samples", Some("4")),
                ("trace", Some("hi-z")),
                ("max-depth", Some("4")),
                ("layers", Some("all")),
                ("rfilter", Some("scene")),
                ("denoise", None),
                ("budget-ms", Some("100")),
                ("match-time", Some("other")),
                ("gpu-memory", Some("1000000")),
                ("paper", None),
            ] {
                let mut stage = of(row.name);
                stage.diffuse_probes = (option == "diffuse" && row.uses(option)).then(|| "t".into());
                stage.set(&format!("--{option}"), value).unwrap();
                // Probes have no noise but that of rays.
                if row.name == "glossy-probes" && option == "denoise" {
                    stage.set.push("rays.per_pixel=4".into());
                }
                let result = stage.check();
                assert_eq!(result.is_ok(), row.uses(option), "{} --{option}: {result:?}", row.name);
                if let Err(e) = result {
                    refused += 1;
                    assert!(e.to_string().starts_with(&format!("--{option}: --method {} has no use", row.name)), "{e}");
                }
            }
        }
        assert!(refused > 20);
    }

    #[test]
    fn parameters_out_of_range_are_refused() {
        for (method, sets) in [
            (
                "glossy-probes",
                &[
                    "supersample=0",
                    "supersample=9",
                    "gather.search=[]",
                    "gather.search.0.radius=-1",
                    "gather.search.0.radius=1000",
                    "gather.search.0.step=-1",
                    "gather.anchors=0",
                    "gather.falloff=-1",
                    "gather.falloff=1e999",
                    "gather.probes=0",
                    "gather.probes=9",
                    "gather.trilinear_power=-1",
                    "gather.perturb.newton=100000",
                    "coverage.rays=65536",
                    "footprint.fov_degrees=0",
                    "footprint.roughness_scale=2",
                    "filter.min_energy=0",
                    "filter.radius_sigmas=0",
                    "filter.max_radius=1e9",
                ][..],
            ),
            ("ulr", &["supersample=0", "blend=0", "blend=100000", "probes=0", "angle=-1"]),
            ("image-space-gather", &["supersample=0", "samples=0", "search_samples=0", "plane_sigma=0", "max_radius=1e9"]),
            ("lightmap-rt", &["supersample=0", "samples=0", "bounces=0"]),
            ("light-field-probes", &["supersample=0", "samples=0", "direct_samples=65537", "thickness=-1", "search=all"]),
            ("many-light", &["supersample=0", "vpls=0", "bounces=0", "min_cut=1", "max_exponent=0", "clamp=0", "sampling=some"]),
            ("path-trace", &["levels=100", "despeckle=25", "normal_power=-1"]),
        ] {
            for set in sets {
                let stage =
                    RenderPath { denoise: (method == "path-trace").then_some(None), set: vec![(*set).into()], ..of(method) };
                let message = stage.check().err().unwrap_or_else(|| panic!("{method} takes {set}")).to_string();
                assert!(message.contains("expected") || message.contains("--set"), "{message}");
            }
        }
        assert!(RenderPath { spp: Some(0), ..of("path-trace") }.check().is_err());
        assert!(
            RenderPath { set: vec!["levels=1".into()], ..of("path-trace") }.check().is_err(),
            "nothing to set without --denoise"
        );
        assert!(RenderPath { budget_ms: Some(-1.0), ..of("path-trace") }.check().is_err());
    }

    #[test]
    fn what_a_method_does_nothing_without_is_asked_for() {
        for (method, option, expected) in [
            ("glossy-probes", "probes", "--method glossy-probes needs --probes DIR, written by bake-probes"),
            ("glossy-probes", "curvature", "--method glossy-probes needs --curvature FILE, written by curvature"),
            ("lightmap-rt", "lightmap", "--method lightmap-rt needs --lightmap FILE, written by bake-lightmap"),
        ] {
            let mut stage = of(method);
            match option {
                "probes" => stage.probes = None,
                "curvature" => stage.curvature = None,
                _ => stage.lightmap = None,
            }
            assert_eq!(stage.check().unwrap_err().to_string(), expected);
        }
    }

    #[cfg(unix)]
    #[test]
    fn paths_that_are_no_text_are_handed_on_as_they_are() {
        use std::os::unix::ffi::OsStringExt;
        let odd = std::ffi::OsString::from_vec(b"room\xff.xml".to_vec());
        let stage = RenderPath { scene: odd.clone().into(), ..of("path-trace") };
        assert_eq!(stage.arguments()[0], odd);
    }
}
