//! `bake-lightmap`.

use crate::base::clock::seconds;
use crate::base::named::within;
use crate::gpu::{GpuScene, Paths};
use crate::io::Provenance;
use crate::io::jobs::{Done, Shard, is_finished, touch};
use crate::lightmap::parts::Folder;
use crate::lightmap::{AtlasParams, DenoiseParams, First, LightMapParams, Plan, lookup};
use crate::plan::option::stage;
use crate::plan::{Context, Outcome};
use crate::transport::World;
use crate::transport::follow::Follow;
use crate::{Error, Result};
use serde_json::json;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Metres within which what a ray meets blocks it, where `--ao` does not say it.
pub const AO_DISTANCE: f32 = 1.0;

stage! {
    /// Bakes the diffuse light map.
    BakeLightmap "bake-lightmap"
    {
        /// The scene.
        scene,
    }
    {
        /// Samples a texel; the most, where an error is given.
        "--spp" spp: Option<u32>,
        /// Standard error of a texel at which it is done.
        "--error" error: Option<f32>,
        /// Samples a texel of a first pass, from whose map the paths of the second read diffuse light.
        "--first-spp" first_spp: Option<u32>,
        /// About how many texels the surfaces get in all.
        "--texels" texels: Option<u32>,
        /// Edge of a texel, metres, in place of the above.
        "--texel" texel: Option<f32>,
        /// Ambient occlusion in place of light: rays are blocked by what they meet within so many metres.
        "--ao" ao: Option<Option<f32>>,
        /// Take the noise out of the finished texels.
        "--denoise" denoise: bool,
        /// Bake this shard's blocks only.
        "--shard" shard: Option<Shard>,
        /// The light map to write.
        "--output" output: PathBuf,
    }
}

impl BakeLightmap {
    fn params(&self) -> Result<LightMapParams> {
        if self.output.extension().is_none_or(|e| !e.eq_ignore_ascii_case("exr")) {
            return Err(Error::Request(format!("-o {}: expected a file name that ends in .exr", self.output.display())));
        }
        if self.texel.is_some() && self.texels.is_some() {
            return Err(Error::Request("--texel, --texels: expected one of them".into()));
        }
        let base = LightMapParams::default();
        let atlas = AtlasParams { texel: self.texel, budget: self.texels.unwrap_or(base.atlas.budget) };
        let params = LightMapParams {
            spp: self.spp.unwrap_or(base.spp),
            error: self.error,
            first_spp: self.first_spp.unwrap_or(base.first_spp),
            atlas,
            denoise: self.denoise.then(DenoiseParams::default),
            ao: self.ao.map(|distance| distance.unwrap_or(AO_DISTANCE)),
            ..base
        };
        within("--spp", params.spp, 1..=1 << 24)?;
        within("--first-spp", params.first_spp, 0..=1 << 24)?;
        within("--texels", atlas.budget, 1..=1 << 26)?;
        params.validate()?;
        Ok(params)
    }

    /// Refuses options that are out of range.
    pub fn check(&self) -> Result<()> {
        self.params().map(|_| ())
    }

    /// Reads the scene, bakes the blocks that are missing, puts them together.
    pub fn run(&self, cx: &Context) -> Result<Outcome> {
        let params = self.params()?;
        let clock = seconds();
        let world = cx.opaque_world(&self.scene)?;
        let loaded = clock();
        let provenance = Provenance::new(Self::COMMAND, &world.scene.hash, cx.seed, &params);
        let key = serde_json::to_string(&provenance).map_err(|e| Error::Request(e.to_string()))?;
        let [first_store, store] = [".first.parts", ".parts"].map(|ending| Folder::new(&beside(&self.output, ending), &key));
        let up_to_date = || {
            // Blocks of a second run at the same time, or of one with other options that was killed.
            first_store.remove()?;
            store.remove()?;
            Ok(Outcome::up_to_date(&self.output, json!({ "up_to_date": true })))
        };
        if is_finished(&self.output, &provenance) {
            touch(&self.output);
            return up_to_date();
        }
        match self.bake(cx, &world, (&params, &provenance), [&first_store, &store], (clock, loaded)) {
            // Another run was faster, and has deleted the blocks.
            Err(_) if is_finished(&self.output, &provenance) => up_to_date(),
            baked => baked,
        }
    }

    /// Bakes the blocks that are missing; the run that makes the last one writes the map.
    fn bake(
        &self,
        cx: &Context,
        world: &World,
        (params, provenance): (&LightMapParams, &Provenance),
        [first_store, store]: [&Folder; 2],
        (clock, loaded): (impl Fn() -> f64, f64),
    ) -> Result<Outcome> {
        let plan = Plan::new(world, params, cx.seed)?;
        let planned = clock() - loaded;

        // Rays of ambient occlusion are followed on the CPU.
        let scene = if params.ao.is_none() { cx.on_gpu(|gpu| GpuScene::new(gpu, world))? } else { None };
        let first = self.first_pass(cx, &plan, params, first_store, scene.as_ref())?;
        let scene = match (scene, &first) {
            (Some(scene), Some(first)) => Some(scene.with_lightmap(&first.map)?),
            (scene, _) => scene,
        };
        let device = on_gpu(scene, params)?;
        let device = device.as_ref().map(|d| d as &dyn Follow);
        let pass = plan.second_pass(first.as_ref()).on(device);
        let mut samples = f64::from(params.spp);
        let done = plan.run(&pass, store, self.shard, cx.progress(), || {
            let baked = plan.assemble(&pass, store, cx.progress())?;
            samples = baked.samples;
            let encode = if plan.is_light() { lookup::encode } else { lookup::encode_openness };
            let image = encode(&world.scene.geometry, &plan.atlas, &baked.front, baked.back.as_deref(), provenance.clone());
            image.write(&self.output)?;
            store.remove()?;
            first_store.remove()
        })?;
        Ok(self.outcome(&plan, (params, samples), done, device.map_or("cpu", Follow::device), [loaded, planned, clock()]))
    }

    /// What the first pass has found, where there is one; every shard needs all of it.
    fn first_pass(
        &self,
        cx: &Context,
        plan: &Plan,
        params: &LightMapParams,
        store: &Folder,
        scene: Option<&GpuScene>,
    ) -> Result<Option<First>> {
        let Some(pass) = plan.first_pass() else { return Ok(None) };
        let device = on_gpu(scene.cloned(), params)?;
        let pass = pass.on(device.as_ref().map(|d| d as &dyn Follow));
        plan.run(&pass, store, None, cx.progress(), || Ok(()))?;
        plan.first(&pass, store, cx.progress()).map(Some)
    }

    fn outcome(
        &self,
        plan: &Plan,
        (params, samples): (&LightMapParams, f64),
        done: Done,
        device: &str,
        times: [f64; 3],
    ) -> Outcome {
        let atlas = &plan.atlas;
        let ([width, height], Done { kept, missing, .. }, [loaded, planned, seconds]) = (atlas.size, done, times);
        let state = done.rest(" blocks");
        let what = if params.ao.is_some() { ", ambient occlusion" } else { "" };
        let denoised = if self.denoise && missing == 0 { ", denoised" } else { "" };
        Outcome {
            summary: format!(
                "{}: {width} x {height}, {} charts, texels of {} m, {} of them baked ({} behind) at {samples:.0} samples{what}{denoised}, {kept} of {} blocks kept from before, {seconds:.1} s on {device}{state}",
                self.output.display(),
                atlas.charts.len(),
                atlas.texel,
                plan.len(),
                plan.backs(),
                plan.blocks(),
            ),
            figures: json!({
                "size": atlas.size, "charts": atlas.charts.len(), "texel": atlas.texel, "texels": plan.len(), "backs": plan.backs(),
                "spp": params.spp, "error": params.error, "samples": samples, "ao": params.ao, "denoise": self.denoise, "blocks": plan.blocks(), "blocks_kept": kept, "blocks_missing": missing,
                "device": device, "seconds_load": loaded, "seconds_plan": planned, "seconds": seconds,
            }),
            ..Outcome::default()
        }
    }
}

fn on_gpu(scene: Option<GpuScene>, params: &LightMapParams) -> Result<Option<Paths>> {
    scene.map(|scene| Paths::irradiance(Arc::new(scene), &params.path)).transpose()
}

/// The output's path with an ending more.
fn beside(output: &Path, ending: &str) -> PathBuf {
    let mut name = output.as_os_str().to_owned();
    name.push(ending);
    name.into()
}
