//! `bake-transport`.

use crate::base::clock::seconds;
use crate::base::named::Parameters;
use crate::io::Provenance;
use crate::io::jobs::{Done, Shard, complete, is_finished, is_sealed_as, touch};
use crate::io::json;
use crate::io::provenance::hash_file;
use crate::lightmap::AtlasParams;
use crate::method::radiance_probes::bake::Bake;
use crate::method::radiance_probes::compress::CompressParams;
use crate::method::radiance_probes::interpolate::Interpolation;
use crate::method::radiance_probes::params::TransportParams;
use crate::method::radiance_probes::store::{
    TransportSet, VolumeSet, encode_cells, encode_clusters, encode_receivers, encode_relight, positions, shared_files,
};
use crate::method::radiance_probes::transport::Kept;
use crate::plan::option::{stage, text};
use crate::plan::{Context, Outcome};
use crate::probe::places::Places;
use crate::probe::set::{ProbeSet, numbered};
use crate::{Error, Result};
use rayon::prelude::*;
use serde_json::json;
use std::path::PathBuf;

text!(Kept, Interpolation);

stage! {
    /// Bakes the transport of radiance probes.
    BakeTransport "bake-transport"
    {
        /// The scene.
        scene,
    }
    {
        /// The probes.
        "--probes" probes: PathBuf,
        /// Order of the probes' spherical harmonics.
        "--sh-order" sh_order: Option<u32>,
        /// What a receiver keeps of its light.
        "--receiver" receiver: Option<Kept>,
        /// How the probes' radiance comes to it.
        "--interpolation" interpolation: Option<Interpolation>,
        /// About how many texels the receivers are.
        "--texels" texels: Option<u32>,
        /// Edge of a texel, metres, in place of the above.
        "--texel" texel: Option<f32>,
        /// Rays over a receiver's hemisphere.
        "--rays" rays: Option<u32>,
        /// Rays by which light comes to a probe.
        "--relight-rays" relight_rays: Option<u32>,
        /// Radius of a probe's support, metres.
        "--radius" radius: Option<f32>,
        /// Between receivers in free space, metres.
        "--volume" volume: Option<f32>,
        /// Relative error of the compressed operator.
        "--error" error: Option<f32>,
        /// Most coefficients a receiver.
        "--most-terms" most_terms: Option<u32>,
        /// Bake this shard's receivers only.
        "--shard" shard: Option<Shard>,
        /// Folder for the operator.
        "--output" output: PathBuf,
    }
}

impl BakeTransport {
    fn params(&self) -> Result<TransportParams> {
        if self.texel.is_some() && self.texels.is_some() {
            return Err(Error::Request("--texel, --texels: expected one of them".into()));
        }
        let base = TransportParams::default();
        let receiver = self.receiver.unwrap_or(base.receiver);
        let order = if receiver == Kept::Sh1 { 4 } else { base.sh_order };
        let compress = CompressParams {
            error: self.error.unwrap_or(base.compress.error),
            most_terms: self.most_terms.unwrap_or(base.compress.most_terms),
            ..base.compress
        };
        let params = TransportParams {
            sh_order: self.sh_order.unwrap_or(order),
            receiver,
            interpolation: self.interpolation.unwrap_or(base.interpolation),
            atlas: AtlasParams { texel: self.texel, budget: self.texels.unwrap_or(base.atlas.budget) },
            rays: self.rays.unwrap_or(base.rays),
            relight_rays: self.relight_rays.unwrap_or(base.relight_rays),
            radius: self.radius.or(base.radius),
            volume: self.volume,
            compress,
        };
        params.validate()?;
        Ok(params)
    }

    /// Refuses options that are out of range.
    pub fn check(&self) -> Result<()> {
        self.params().map(|_| ())
    }

    /// Reads, bakes the groups of receivers that are missing, and when all are there seals the set.
    pub fn run(&self, cx: &Context) -> Result<Outcome> {
        let (params, clock) = (self.params()?, seconds());
        let world = cx.opaque_world(&self.scene)?;
        let places = Places::read(&self.probes)?;
        places.provenance().check_scene(&self.probes, &world.scene.hash)?;
        let params = TransportParams { radius: params.radius.or(places.radius()), ..params };
        let provenance =
            Provenance::new(Self::COMMAND, &world.scene.hash, cx.seed, &params).with_input("probes", hash_file(&self.probes)?);
        if self.is_up_to_date(&provenance) {
            touch(&ProbeSet::path(&self.output));
            return Ok(Outcome::up_to_date(&self.output, json!({ "baked": 0, "up_to_date": true })));
        }
        let bake = Bake::new(&world, positions(&places), &params, cx.progress())?;
        let items: Vec<usize> = (0..bake.groups()).collect();
        let is_kept = |i| is_finished(&numbered(&self.output, i), &provenance);
        let make = |todo: &[usize]| {
            cx.progress().start("transport", todo.len() as u64);
            todo.par_iter().try_for_each(|&i| {
                let clusters = bake.group(i);
                cx.progress().advance(1);
                encode_clusters(&clusters, &provenance).write(&numbered(&self.output, i))
            })?;
            cx.progress().finish();
            Ok(())
        };
        let seal = || self.seal(&bake, &places, &params, &provenance);
        let done = complete(&items, self.shard, &is_kept, make, seal)?;
        Ok(self.outcome(&bake, done, clock()))
    }

    fn is_up_to_date(&self, provenance: &Provenance) -> bool {
        let Ok(set) = TransportSet::read(&self.output) else { return false };
        set.provenance == *provenance
            && set.paths(&self.output).iter().zip(&set.files).all(|(file, hash)| is_sealed_as(hash, file, provenance))
    }

    /// Writes what all groups share, and the set.
    fn seal(&self, bake: &Bake, places: &Places, params: &TransportParams, provenance: &Provenance) -> Result<()> {
        let ground = &bake.ground;
        let volume = bake.volume();
        let shared = shared_files(&self.output, volume.is_some());
        encode_receivers(&ground.receivers.list, provenance).write(&shared[0])?;
        encode_relight(&bake.hits(), ground.probes.len(), provenance).write(&shared[1])?;
        if let Some(volume) = &volume {
            encode_cells(&volume.cells, provenance).write(&shared[2])?;
        }
        let set = TransportSet {
            bake: *params,
            places: places.clone(),
            radius: ground.radius,
            receivers: ground.receivers.list.len(),
            volume: volume.as_ref().map(|v| VolumeSet { grid: v.grid, points: v.cells.len(), groups: bake.groups_in_space() }),
            files: TransportSet::hashes(&self.output, volume.is_some(), bake.groups())?,
            provenance: provenance.clone(),
        };
        json::write(&ProbeSet::path(&self.output), &set)
    }

    fn outcome(&self, bake: &Bake, done: Done, seconds: f64) -> Outcome {
        let ground = &bake.ground;
        let Done { made, kept, missing } = done;
        let rest = done.rest("");
        let (receivers, probes, radius) = (ground.receivers.list.len(), ground.probes.len(), ground.radius);
        let points = bake.volume().map(|v| v.cells.len());
        let in_space = points.map_or(String::new(), |n| format!(" and {n} in free space"));
        Outcome {
            summary: format!(
                "{}: {receivers} receivers{in_space} of {probes} probes that reach {radius:.2} m; {made} groups baked, {kept} kept, {seconds:.1} s{rest}",
                self.output.display()
            ),
            figures: json!({
                "receivers": receivers, "in_free_space": points, "probes": probes, "radius": radius, "groups": made + kept + missing, "baked": made,
                "missing": missing, "seconds": seconds,
            }),
            ..Outcome::default()
        }
    }
}
