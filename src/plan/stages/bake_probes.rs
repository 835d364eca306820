//! `bake-probes`.

use crate::base::clock::seconds;
use crate::base::named::{Parameters, split, within};
use crate::gpu::{GpuScene, Paths};
use crate::io::Provenance;
use crate::io::jobs::{Done, Shard, complete, is_finished, is_sealed_as, touch};
use crate::io::provenance::hash_file;
use crate::lightmap::{DenoiseParams, LightMap};
use crate::method::Options;
use crate::method::glossy_probes::bake::{Bake, PAPER_ROUGHNESS_SCALE, ProbeBakeParams, Traced, bake_glossy, probe_geometry};
use crate::method::glossy_probes::gather::GatherParams;
use crate::method::glossy_probes::resolve;
use crate::method::glossy_probes::wanted::{Served, Wanted, wanted_texels};
use crate::plan::option::{Size, stage};
use crate::plan::views::{FrameList, views};
use crate::plan::{Context, Outcome};
use crate::probe::file::{BakedSet, MAX_MATERIALS};
use crate::probe::parameter_map::{ParameterMap, map_paths};
use crate::probe::places::Places;
use crate::probe::set::{ProbeSet, numbered};
use crate::probe::store::{ProbeStore, write_set};
use crate::scene::{Camera, Scene};
use crate::surface::curvature_file;
use crate::transport::World;
use crate::transport::follow::Follow;
use crate::transport::path::PathParams;
use crate::view::mirror_light;
use crate::{Error, Result};
use rayon::prelude::*;
use serde_json::json;
use std::path::PathBuf;
use std::sync::Arc;

stage! {
    /// Bakes the glossy light probes.
    BakeProbes "bake-probes"
    {
        /// The scene.
        scene,
    }
    {
        /// The probes.
        "--probes" probes: PathBuf,
        /// Their parameterisations.
        "--qhmap" qhmap: PathBuf,
        /// Paths a texel; the most of them with an error.
        "--spp" spp: Option<u32>,
        /// Standard error at which a texel is done.
        "--error" error: Option<f32>,
        /// Factor on roughness at the first glossy vertex.
        "--roughness-scale" roughness_scale: Option<f32>,
        /// Take the noise out of the texels.
        "--denoise" denoise: bool,
        /// Spread a texel's paths over its solid angle.
        "--spread" spread: bool,
        /// Light map to read diffuse light from.
        "--lightmap" lightmap: Option<PathBuf>,
        /// Bake this shard's probes only.
        "--shard" shard: Option<Shard>,
        /// Camera path whose views' texels are baked, and no others.
        "--for-path" for_path: Option<PathBuf>,
        /// Curvatures, for the choice of texels.
        "--curvature" curvature: Option<PathBuf>,
        /// Size of the views.
        "--size" size: Option<Size>,
        /// Frames of the path.
        "--frames" frames: Option<FrameList>,
        /// Rays a pixel along one side.
        "--supersample" supersample: Option<u32>,
        /// The paper's roughness factor and choice of texels.
        "--paper" paper: bool,
        /// Parameters of the gather that chooses the texels.
        "--set" set: Vec<String>,
        /// Other choices, whose texels are baked as well.
        "--alternative" alternative: Vec<String>,
        /// Folder for the probes.
        "--output" output: PathBuf,
    }
}

/// The scene and what was made of it, checked against one another.
struct Inputs {
    world: Arc<World>,
    places: Places,
    maps: ProbeSet,
}

impl BakeProbes {
    fn params(&self) -> Result<ProbeBakeParams> {
        let base = ProbeBakeParams::default();
        let by_choice = if self.paper { PAPER_ROUGHNESS_SCALE } else { base.roughness_scale };
        let params = ProbeBakeParams {
            spp: self.spp.unwrap_or(base.spp),
            error: self.error,
            roughness_scale: self.roughness_scale.unwrap_or(by_choice),
            spread: self.spread,
            denoise: self.denoise.then(DenoiseParams::default),
        };
        params.validate()?;
        Ok(params)
    }

    /// The choices of texels: the first, and its alternatives.
    fn choices(&self) -> Result<(GatherParams, Vec<GatherParams>)> {
        let gather = |paper, set| Ok::<_, Error>(resolve(&Options { paper, set, ..Options::default() })?.gather);
        let alternative = |text: &String| {
            let (mut parts, all) = (split(text), split(text).len());
            parts.retain(|part| part != "paper");
            gather(self.paper || parts.len() < all, parts)
        };
        Ok((gather(self.paper, self.set.clone())?, self.alternative.iter().map(alternative).collect::<Result<_>>()?))
    }

    /// The views that the bake is for.
    pub fn served(&self, cameras: &[Camera]) -> Result<Served> {
        let (gather, alternatives) = self.choices()?;
        let views = Served::new(cameras, self.supersample.unwrap_or(1), &gather);
        Ok(alternatives.iter().fold(views, |views, gather| views.or(gather)))
    }

    /// Refuses what is out of range or does not go together.
    pub fn check(&self) -> Result<()> {
        self.params()?;
        self.choices()?;
        let for_path = [
            ("--size", self.size.is_some()),
            ("--frames", self.frames.is_some()),
            ("--supersample", self.supersample.is_some()),
            ("--set", !self.set.is_empty()),
            ("--alternative", !self.alternative.is_empty()),
        ];
        match (&self.for_path, &self.curvature) {
            (Some(_), None) => Err(Error::Request("--for-path needs --curvature FILE, written by curvature".into())),
            (None, _) => match for_path.into_iter().find(|(_, given)| *given) {
                Some((option, _)) => Err(Error::Request(format!("{option} chooses texels for a path: give --for-path too"))),
                None => Ok(()),
            },
            _ => within("--supersample", self.supersample.unwrap_or(1), 1..=crate::view::MOST_SUPERSAMPLES),
        }
    }

    fn inputs(&self, cx: &Context) -> Result<Inputs> {
        let world = cx.opaque_world(&self.scene)?;
        let (scene, count) = (&world.scene, world.scene.materials.len());
        if count > MAX_MATERIALS {
            let message = format!("{count} materials, but a probe file tells at most {MAX_MATERIALS} apart");
            return Err(Error::input(&self.scene, message));
        }
        let places = Places::read(&self.probes)?;
        places.provenance().check_scene(&self.probes, &scene.hash)?;
        let maps = ProbeSet::read(&self.qhmap, "qhmap")?;
        maps.provenance.check_scene(&self.qhmap, &scene.hash)?;
        maps.provenance.check_input(&self.qhmap, "probes", &hash_file(&self.probes)?)?;
        Ok(Inputs { world, places, maps })
    }

    /// Reads, bakes the probes that are missing, seals the set.
    pub fn run(&self, cx: &Context) -> Result<Outcome> {
        self.check()?;
        let (params, clock) = (self.params()?, seconds());
        let inputs = self.inputs(cx)?;
        let scene = &inputs.world.scene;
        let cameras = match &self.for_path {
            Some(path) => Some(views(scene, Some(path), self.size.map(|s| s.0), self.frames.as_ref())?),
            None => None,
        };
        let cameras: Option<Vec<Camera>> = cameras.map(|views| views.into_iter().map(|v| v.camera).collect());
        let served = cameras.as_ref().map(|cameras| self.served(cameras)).transpose()?;
        // How far mirrors hand light on is no parameter, but what is stored depends on it.
        let parameters = json!({ "bake": params, "views": served, "mirrors": mirror_light::PERFECT.rays });
        let mut provenance = Provenance::new(Self::COMMAND, &scene.hash, cx.seed, &parameters)
            .with_input("probes", hash_file(&self.probes)?)
            .with_input("qhmap", hash_file(&ProbeSet::path(&self.qhmap))?);
        if let Some(file) = &self.lightmap {
            provenance = provenance.with_input("lightmap", hash_file(file)?);
        }
        if self.is_up_to_date(scene, &provenance) {
            touch(&ProbeSet::path(&self.output));
            return Ok(Outcome::up_to_date(&self.output, json!({ "baked": 0, "up_to_date": true })));
        }
        let wanted = match (&cameras, &served) {
            (Some(cameras), Some(served)) => Some(self.wanted(cx, &inputs, cameras, served)?),
            _ => None,
        };
        let (done, traced, device) = self.bake(cx, &inputs, &params, wanted.as_ref(), served, &provenance)?;
        Ok(self.outcome(&params, done, traced, &device, clock()))
    }

    /// Whether the set is there, and every file of it whole.
    fn is_up_to_date(&self, scene: &Scene, provenance: &Provenance) -> bool {
        let Ok(ProbeStore { set, .. }) = ProbeStore::<Served>::open(&self.output, scene, 0) else { return false };
        let is_whole = |(i, hash): (usize, &String)| {
            let [forward, inverse] = map_paths(&self.output, i);
            hash.is_empty() || is_finished(&forward, provenance) && is_sealed_as(hash, &inverse, provenance)
        };
        set.provenance == *provenance && set.files.par_iter().enumerate().all(is_whole)
    }

    fn has_finished(&self, probe: usize, provenance: &Provenance) -> bool {
        map_paths(&self.output, probe).iter().all(|file| is_finished(file, provenance))
    }

    fn wanted(&self, cx: &Context, inputs: &Inputs, cameras: &[Camera], served: &Served) -> Result<Wanted> {
        let Inputs { world, places, .. } = inputs;
        let file = self.curvature.as_ref().ok_or_else(|| Error::Request("--for-path needs --curvature".into()))?;
        let curvature = curvature_file::read(file, world.scene.geometry.positions.len(), &world.scene.hash)?;
        let map = |i| Ok(ParameterMap::load(&self.qhmap, i)?.0);
        wanted_texels(world, &curvature, places, &map, cameras, served, cx.progress())
    }

    /// Bakes what is missing; what became of the probes, what was traced, and where.
    fn bake(
        &self,
        cx: &Context,
        inputs: &Inputs,
        params: &ProbeBakeParams,
        wanted: Option<&Wanted>,
        served: Option<Served>,
        provenance: &Provenance,
    ) -> Result<(Done, Traced, String)> {
        let Inputs { world, places, maps } = inputs;
        let needed: Vec<usize> = match wanted {
            Some(w) => w.keys().copied().collect(),
            None => (0..places.len()).collect(),
        };
        let lightmap = self.lightmap.as_ref().map(|file| LightMap::load(file, &world.scene)).transpose()?;
        let (mut traced, mut name) = (Traced::default(), "cpu".to_owned());
        let on_cpu = Bake { world, params, seed: cx.seed, lightmap: lightmap.as_ref(), device: None };
        let tells_mirrored = on_cpu.tells_mirrored();
        let make = |todo: &[usize]| {
            let device =
                if todo.is_empty() { None } else { cx.on_gpu(|gpu| self.on_gpu(gpu, world, lightmap.as_ref(), params))? };
            name = device.as_ref().map_or("cpu", |d| d.device()).to_owned();
            let bake = Bake { device: device.as_ref().map(|d| d as &dyn Follow), ..on_cpu };
            cx.progress().start("probes", (todo.len() * maps.size[1] as usize) as u64);
            for &index in todo {
                let mut probe = probe_geometry(world, places.position(index), ParameterMap::load(&self.qhmap, index)?.0);
                let flags = wanted.and_then(|w| w.get(&index));
                let want = |i: u32| flags.is_none_or(|f| f[i as usize]);
                let Traced { texels, paths } = bake_glossy(&bake, &mut probe, index as u32, &want, cx.progress())?;
                traced.texels += texels;
                traced.paths += paths;
                let [forward, inverse] = map_paths(&self.output, index);
                probe.map.forward_image().with_provenance(provenance.clone()).write(&forward)?;
                probe.to_image(provenance.clone()).write(&inverse)?;
            }
            cx.progress().finish();
            Ok(())
        };
        let is_kept = |i| self.has_finished(i, provenance);
        let seal = || {
            let hash =
                |i| if needed.binary_search(&i).is_ok() { hash_file(&numbered(&self.output, i)) } else { Ok(String::new()) };
            let set = BakedSet {
                size: maps.size,
                roughness_scale: params.roughness_scale,
                mirrored: tells_mirrored,
                views: served,
                files: (0..places.len()).map(hash).collect::<Result<_>>()?,
                provenance: provenance.clone(),
                places: places.clone(),
            };
            write_set(&self.output, &set)
        };
        let done = complete(&needed, self.shard, &is_kept, make, seal)?;
        Ok((done, traced, name))
    }

    fn on_gpu(
        &self,
        gpu: Arc<crate::gpu::Gpu>,
        world: &World,
        lightmap: Option<&LightMap>,
        params: &ProbeBakeParams,
    ) -> Result<Paths> {
        if params.spread {
            return Err(Error::Request("--spread: the GPU sends a texel's paths through its centre; use --device cpu".into()));
        }
        Paths::scattering(Arc::new(GpuScene::lit(gpu, world, lightmap)?), params.query(), &PathParams::default())
    }

    fn outcome(&self, params: &ProbeBakeParams, done: Done, traced: Traced, device: &str, seconds: f64) -> Outcome {
        let Done { made, kept, missing } = done;
        let rest = done.rest("");
        Outcome {
            summary: format!(
                "{}: {made} probes baked, {kept} kept, {} glossy texels at {:.0} paths, {seconds:.1} s on {device}{rest}",
                self.output.display(),
                traced.texels,
                traced.paths as f64 / traced.texels.max(1) as f64
            ),
            figures: json!({
                "probes": made + kept + missing, "baked": made, "missing": missing, "texels": traced.texels, "paths": traced.paths,
                "spp": params.spp, "device": device, "seconds": seconds,
            }),
            ..Outcome::default()
        }
    }
}
