//! `bake-lightfield`.

use crate::base::clock::seconds;
use crate::base::math::Rgb;
use crate::base::named::Parameters;
use crate::io::Provenance;
use crate::io::jobs::{Done, Shard, complete, is_finished, is_sealed_as, touch};
use crate::io::json;
use crate::io::provenance::hash_file;
use crate::method::light_field_probes::bake::{LightFieldBakeParams, Seen, bounce, look};
use crate::method::light_field_probes::field::{LightField, no_surfels};
use crate::method::light_field_probes::probe::{Ambient, Surfels};
use crate::method::light_field_probes::shade::Shading;
use crate::method::light_field_probes::store::{LightFieldSet, files, octree_path, write_light};
use crate::plan::option::stage;
use crate::plan::{Context, Outcome};
use crate::probe::places::Places;
use crate::probe::set::ProbeSet;
use crate::transport::World;
use crate::{Error, Result};
use rayon::prelude::*;
use serde_json::json;
use std::path::PathBuf;

stage! {
    /// Bakes light field probes.
    BakeLightfield "bake-lightfield"
    {
        /// The scene.
        scene,
    }
    {
        /// The probes.
        "--probes" probes: PathBuf,
        /// Texels along an edge of a map.
        "--size" size: Option<u32>,
        /// Samples of direct light a texel.
        "--spp" spp: Option<u32>,
        /// Bounces of light.
        "--bounces" bounces: Option<u32>,
        /// Bake this shard's probes only.
        "--shard" shard: Option<Shard>,
        /// Folder for the probes.
        "--output" output: PathBuf,
    }
}

impl BakeLightfield {
    fn params(&self) -> Result<LightFieldBakeParams> {
        let base = LightFieldBakeParams::default();
        let params = LightFieldBakeParams {
            size: self.size.unwrap_or(base.size),
            spp: self.spp.unwrap_or(base.spp),
            bounces: self.bounces.unwrap_or(base.bounces),
            ..base
        };
        params.validate()?;
        Ok(params)
    }

    /// Refuses options that are out of range.
    pub fn check(&self) -> Result<()> {
        self.params().map(|_| ())
    }

    /// Reads, bakes the probes that are missing, and when all are there lets light bounce and seals the set.
    pub fn run(&self, cx: &Context) -> Result<Outcome> {
        let (params, clock) = (self.params()?, seconds());
        let world = cx.opaque_world(&self.scene)?;
        let places = Places::read(&self.probes)?;
        places.provenance().check_scene(&self.probes, &world.scene.hash)?;
        let provenance =
            Provenance::new(Self::COMMAND, &world.scene.hash, cx.seed, &params).with_input("probes", hash_file(&self.probes)?);
        if self.is_up_to_date(&provenance) {
            touch(&ProbeSet::path(&self.output));
            return Ok(Outcome::up_to_date(&self.output, json!({ "baked": 0, "up_to_date": true })));
        }
        let items = places.used();
        let is_kept = |i| is_finished(&files(&self.output, i)[0], &provenance);
        let make = |todo: &[usize]| {
            cx.progress().start("light field probes", todo.len() as u64);
            for &i in todo {
                let seen = look(&world, places.position(i), i as u32, &params, cx.seed);
                seen.to_image(&provenance).write(&files(&self.output, i)[0])?;
                cx.progress().advance(1);
            }
            cx.progress().finish();
            Ok(())
        };
        let seal = || self.seal(cx, &world, &places, &params, &provenance);
        let done = complete(&items, self.shard, &is_kept, make, seal)?;
        Ok(self.outcome(&params, done, places.len() - items.len(), clock()))
    }

    fn is_up_to_date(&self, provenance: &Provenance) -> bool {
        let Ok(set) = LightFieldSet::read(&self.output) else { return false };
        let whole = |i: usize| {
            let of = |(file, hash): (PathBuf, &String)| is_sealed_as(hash, &file, provenance);
            files(&self.output, i).into_iter().zip(&set.files[i]).all(of)
        };
        let octree = octree_path(&self.output);
        let is_octree_whole = set.octree.is_empty() || hash_file(&octree).is_ok_and(|hash| hash == set.octree);
        set.provenance == *provenance && is_octree_whole && set.places.used().into_iter().all(whole)
    }

    /// Lets light bounce between all probes, writes what comes of it, and the set.
    fn seal(
        &self,
        cx: &Context,
        world: &World,
        places: &Places,
        params: &LightFieldBakeParams,
        provenance: &Provenance,
    ) -> Result<()> {
        let far = Shading::far(world);
        let probes = places.used();
        let read = |i: usize| Seen::read(&files(&self.output, i)[0], params.size as usize, provenance);
        let surfels = |i: usize| if places.is_blocked(i) { Ok(no_surfels()) } else { read(i).map(|seen| seen.surfels) };
        let surfels: Vec<Surfels> = (0..places.len()).into_par_iter().map(surfels).collect::<Result<_>>()?;
        if surfels.iter().all(|s| s.distance.iter().all(|d| d.is_infinite())) {
            let message = "none of its probes sees any surface: place them in the scene (place-probes --path, --bounds)";
            return Err(Error::input(&self.probes, message));
        }
        let mut field = LightField::unlit(places.clone(), surfels);
        cx.progress().start("bounces of light", (probes.len() * params.bounces as usize) as u64);
        for bounces in 1..=params.bounces {
            let mut each = |i: usize, radiance: &[Rgb], ambient: &Ambient| {
                cx.progress().advance(1);
                if bounces < params.bounces { Ok(()) } else { write_light(&self.output, i, radiance, ambient, provenance) }
            };
            bounce((world, &mut field), &read, params, (far, cx.seed), &mut each)?;
        }
        cx.progress().finish();
        let octree = match &field.octree {
            Some(octree) => {
                json::write(&octree_path(&self.output), octree)?;
                hash_file(&octree_path(&self.output))?
            }
            None => String::new(),
        };
        let hashes = |i: usize| -> Result<[String; 3]> {
            if places.is_blocked(i) {
                return Ok(Default::default());
            }
            let [a, b, c] = files(&self.output, i);
            Ok([hash_file(&a)?, hash_file(&b)?, hash_file(&c)?])
        };
        let set = LightFieldSet {
            bake: *params,
            places: places.clone(),
            files: (0..places.len()).map(hashes).collect::<Result<_>>()?,
            octree,
            provenance: provenance.clone(),
        };
        json::write(&ProbeSet::path(&self.output), &set)
    }

    fn outcome(&self, params: &LightFieldBakeParams, done: Done, blocked: usize, seconds: f64) -> Outcome {
        let Done { made, kept, missing } = done;
        let rest = done.rest("");
        let LightFieldBakeParams { size, bounces, .. } = *params;
        Outcome {
            summary: format!(
                "{}: {made} probes of {size} x {size} baked, {kept} kept, {blocked} blocked, {bounces} bounces, {seconds:.1} s{rest}",
                self.output.display()
            ),
            figures: json!({
                "probes": made + kept + missing, "baked": made, "missing": missing, "blocked": blocked, "size": size,
                "bounces": bounces, "seconds": seconds,
            }),
            ..Outcome::default()
        }
    }
}
