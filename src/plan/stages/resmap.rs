//! `resmap`.

use super::set::fill;
use crate::base::clock::seconds;
use crate::gpu::{GpuScene, RayTracer};
use crate::io::Provenance;
use crate::io::jobs::Shard;
use crate::io::provenance::hash_file;
use crate::method::glossy_probes::resmap::{ALPHA_HALF, ResmapParams, Smoothness, resolution_map};
use crate::method::glossy_probes::seen::SeenBuffers;
use crate::plan::option::{Size, stage};
use crate::plan::{Context, Outcome};
use crate::probe::places::Places;
use crate::probe::set::{ProbeSet, numbered};
use crate::{Error, Result};
use serde_json::json;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

stage! {
    /// Decides how much resolution each direction of a probe deserves.
    Resmap "resmap"
    {
        /// The scene.
        scene,
    }
    {
        /// The probes.
        "--probes" probes: PathBuf,
        /// Size of the maps, texels.
        "--size" size: Option<Size>,
        /// Edge of the DCT's window, texels.
        "--dct-size" dct_size: Option<u32>,
        /// Exponent of the DCT's frequency weights.
        "--frequency-exponent" frequency_exponent: Option<f32>,
        /// Sigma of the blur of m, texels.
        "--blur-sigma" blur_sigma: Option<f32>,
        /// Smallest facing cosine that counts.
        "--facing-min" facing_min: Option<f32>,
        /// Roughness alpha that deserves half of a mirror's texels.
        "--alpha-half" alpha_half: Option<f32>,
        /// The paper's text in every choice.
        "--paper" paper: bool,
        /// Make this shard's maps only.
        "--shard" shard: Option<Shard>,
        /// Folder for the maps.
        "--output" output: PathBuf,
    }
}

impl Resmap {
    fn params(&self) -> Result<ResmapParams> {
        if self.paper && self.alpha_half.is_some() {
            return Err(Error::Request("--paper, --alpha-half: expected one of them".into()));
        }
        let base = ResmapParams::default();
        let params = ResmapParams {
            size: self.size.map_or(base.size, |s| s.0),
            dct_size: self.dct_size.unwrap_or(base.dct_size),
            frequency_exponent: self.frequency_exponent.unwrap_or(base.frequency_exponent),
            blur_sigma: self.blur_sigma.unwrap_or(base.blur_sigma),
            facing_min: self.facing_min.unwrap_or(base.facing_min),
            smoothness: match self.paper {
                true => Smoothness::Linear,
                false => Smoothness::Lobe { alpha_half: self.alpha_half.unwrap_or(ALPHA_HALF) },
            },
        };
        params.validate()?;
        Ok(params)
    }

    /// Refuses options that are out of range.
    pub fn check(&self) -> Result<()> {
        self.params().map(|_| ())
    }

    /// Reads scene and probes, makes the maps that are missing, seals them.
    pub fn run(&self, cx: &Context) -> Result<Outcome> {
        let params = self.params()?;
        let places = Places::read(&self.probes)?;
        let world = cx.opaque_world(&self.scene)?;
        places.provenance().check_scene(&self.probes, &world.scene.hash)?;
        let clock = seconds();
        let tracer = cx.on_gpu(|gpu| RayTracer::new(Arc::new(GpuScene::new(gpu, &world)?)))?;
        let provenance =
            Provenance::new(Self::COMMAND, &world.scene.hash, cx.seed, &params).with_input("probes", hash_file(&self.probes)?);
        let set = ProbeSet { count: places.len(), size: params.size, provenance };
        let (texels, glossy) = (AtomicU64::new(0), AtomicU64::new(0));
        let make = |(): &mut (), i: usize| {
            let seen = match &tracer {
                None => SeenBuffers::cast(&world, places.position(i), params.size),
                Some(tracer) => {
                    let rays = SeenBuffers::rays(places.position(i), params.size);
                    SeenBuffers::from_hits(&world, params.size, &rays, &tracer.closest(&rays)?)
                }
            };
            let map = resolution_map(&params, &seen);
            texels.fetch_add(map.m_mat.len() as u64, Ordering::Relaxed);
            glossy.fetch_add(map.m_mat.iter().filter(|m| **m > 0.0).count() as u64, Ordering::Relaxed);
            map.image(&seen).with_provenance(set.provenance.clone()).write_uncompressed(&numbered(&self.output, i))
        };
        let files = |i| vec![numbered(&self.output, i)];
        let done = fill(&self.output, (&set, self.shard), files, cx.progress(), || Ok(()), make)?;
        let device = tracer.as_ref().map_or("cpu", |t| t.device());
        // None where all maps were kept from before.
        let (texels, glossy) = (texels.into_inner(), glossy.into_inner());
        let share = (texels > 0).then(|| glossy as f64 / texels as f64);
        let [w, h] = params.size;
        let seen = share.map_or_else(String::new, |s| format!(", {:.0} % of their texels glossy", s * 100.0));
        let (out, count, seconds) = (self.output.display(), set.count, clock());
        let (kept, rest) = (done.kept, done.rest(""));
        Ok(Outcome {
            summary: format!("{out}: {count} maps of {w} x {h}, {kept} kept from before{seen}, {seconds:.1} s on {device}{rest}"),
            figures: json!({
                "count": count, "kept": kept, "missing": done.missing, "size": params.size, "glossy_share": share, "device": device, "seconds": seconds,
            }),
            ..Outcome::default()
        })
    }
}
