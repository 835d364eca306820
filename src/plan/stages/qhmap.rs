//! `qhmap`.

use super::set::fill;
use crate::base::clock::seconds;
use crate::io::Provenance;
use crate::io::jobs::{Done, Shard};
use crate::io::provenance::hash_file;
use crate::method::glossy_probes::qhmap::{QhmapParams, parameter_map};
use crate::method::glossy_probes::quasi_harmonic::Solver;
use crate::method::glossy_probes::resmap::{density_correlation, read_m};
use crate::plan::option::{Size, stage};
use crate::plan::{Context, Outcome};
use crate::probe::parameter_map::map_paths;
use crate::probe::set::{ProbeSet, numbered, read_member};
use crate::{Error, Result};
use serde_json::json;
use std::path::PathBuf;
use std::sync::{Mutex, PoisonError};

stage! {
    /// Turns resolution maps into parameterisations of the probes.
    Qhmap "qhmap"
    {
        /// Folder of resolution maps.
        resmap,
    }
    {
        /// Size of the probes, texels.
        "--size" size: Option<Size>,
        /// Added to m, in units of its mean.
        "--epsilon" epsilon: Option<f32>,
        /// Plain lat-long maps.
        "--lat-long" lat_long: bool,
        /// Make this shard's maps only.
        "--shard" shard: Option<Shard>,
        /// Folder for the maps.
        "--output" output: PathBuf,
    }
}

/// What the maps of one run came to.
#[derive(Default)]
struct Tally {
    correlation: Vec<(usize, f64)>,
    raised: usize,
}

impl Qhmap {
    fn params(&self) -> Result<QhmapParams> {
        if self.lat_long && self.epsilon.is_some() {
            return Err(Error::Request("--lat-long, --epsilon: expected one of them".into()));
        }
        let base = QhmapParams::default();
        let params = QhmapParams {
            size: self.size.map_or(base.size, |s| s.0),
            epsilon: self.epsilon.unwrap_or(base.epsilon),
            lat_long: self.lat_long,
        };
        params.validate()?;
        Ok(params)
    }

    /// Refuses options that are out of range.
    pub fn check(&self) -> Result<()> {
        self.params().map(|_| ())
    }

    /// Reads resolution maps, makes the parameterisations that are missing, seals them.
    pub fn run(&self, cx: &Context) -> Result<Outcome> {
        let params = self.params()?;
        let clock = seconds();
        let from = ProbeSet::read(&self.resmap, "resmap")?;
        let mut provenance = Provenance::new(Self::COMMAND, &from.provenance.scene, cx.seed, &params)
            .with_input("resmap", hash_file(&ProbeSet::path(&self.resmap))?);
        provenance.inputs.extend(from.provenance.inputs.clone());
        let set = ProbeSet { count: from.count, size: params.size, provenance };
        let tally = Mutex::new(Tally::default());
        let make = |solver: &mut Solver, i: usize| {
            let path = numbered(&self.resmap, i);
            let image = read_member(&path, Some(from.size), &from.provenance)?;
            let (_, m) = read_m(&path, &image)?;
            let (map, epsilon) = parameter_map(solver, &m, &params)?;
            if !params.lat_long {
                let correlation = density_correlation(&map.log_density(), &m);
                let mut tally = tally.lock().unwrap_or_else(PoisonError::into_inner);
                tally.correlation.push((i, correlation));
                tally.raised += usize::from(epsilon > params.epsilon);
            }
            map.save(&self.output, i, &set.provenance)
        };
        let files = |i| map_paths(&self.output, i).to_vec();
        let done = fill(&self.output, (&set, self.shard), files, cx.progress(), || Solver::new(from.size), make)?;
        Ok(self.outcome(&set, done, tally.into_inner().unwrap_or_else(PoisonError::into_inner), clock()))
    }

    fn outcome(&self, set: &ProbeSet, done: Done, tally: Tally, seconds: f64) -> Outcome {
        let Tally { mut correlation, raised } = tally;
        correlation.sort_by_key(|c| c.0);
        // None where all maps were kept from before.
        let least = correlation.iter().map(|c| c.1).reduce(f64::min);
        let mean = least.map(|_| correlation.iter().map(|c| c.1).sum::<f64>() / correlation.len() as f64);
        let [w, h] = set.size;
        let follows = match (mean, least) {
            (Some(mean), Some(least)) => format!(", log-density follows log m by {mean:.2} (at least {least:.2})"),
            _ => String::new(),
        };
        let warning = if raised > 0 { format!(", {raised} with a larger epsilon, lest quads flip") } else { String::new() };
        let (out, count) = (self.output.display(), set.count);
        let (kept, rest) = (done.kept, done.rest(""));
        Outcome {
            summary: format!("{out}: {count} maps of {w} x {h}, {kept} kept from before{follows}{warning}, {seconds:.1} s{rest}"),
            figures: json!({
                "count": count, "kept": kept, "missing": done.missing, "size": set.size, "correlation": mean, "correlation_least": least,
                "epsilon_raised": raised, "seconds": seconds,
            }),
            ..Outcome::default()
        }
    }
}
