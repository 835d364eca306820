//! `relight`.

use crate::base::clock::Clock;
use crate::base::named::{Parameters, apply};
use crate::io::Provenance;
use crate::io::jobs::is_finished;
use crate::io::provenance::hash_file;
use crate::lightmap::lookup::encode;
use crate::method::radiance_probes::light::{Light, as_light_map, light, reflectances, total};
use crate::method::radiance_probes::operator::Transport;
use crate::method::radiance_probes::params::RadianceProbeParams;
use crate::method::radiance_probes::transport::Kept;
use crate::plan::option::stage;
use crate::plan::timings::{FrameTimings, Timings};
use crate::plan::{Context, Outcome};
use crate::probe::set::{ProbeSet, numbered};
use crate::{Error, Result};
use serde_json::json;
use std::path::PathBuf;

stage! {
    /// Lights the texels of radiance probes' receivers.
    Relight "relight"
    {
        /// The scene.
        scene,
    }
    {
        /// The operator.
        "--probes" probes: PathBuf,
        /// Light that came by way of probes alone.
        "--indirect" indirect: bool,
        /// Parameters, by name.
        "--set" set: Vec<String>,
        /// Folder for the light maps.
        "--output" output: PathBuf,
    }
}

impl Relight {
    fn params(&self) -> Result<RadianceProbeParams> {
        let params = apply(&RadianceProbeParams::default(), &self.set)?;
        params.validate()?;
        Ok(params)
    }

    /// Refuses parameters that are out of range.
    pub fn check(&self) -> Result<()> {
        self.params().map(|_| ())
    }

    /// Reads, lights the frames that are not finished, writes them.
    pub fn run(&self, cx: &Context) -> Result<Outcome> {
        let params = self.params()?;
        let world = cx.opaque_world(&self.scene)?;
        let parameters = json!({ "indirect": self.indirect, "parameters": params });
        let provenance = Provenance::new(Self::COMMAND, &world.scene.hash, cx.seed, &parameters)
            .with_input("probes", hash_file(&ProbeSet::path(&self.probes))?);
        let transport = Transport::load(&self.probes, &world.scene)?;
        if transport.params.receiver != Kept::Irradiance {
            return Err(Error::input(
                &self.probes,
                "its texels keep sh1, a light map has irradiance: bake with --receiver irradiance",
            ));
        }
        let mut timings = Timings::of("radiance-probes");
        let reflectance = reflectances(&world, &transport.receivers);
        let file = numbered(&self.output, 0);
        let mut times =
            FrameTimings { name: "0000.exr".into(), kept: is_finished(&file, &provenance), ..FrameTimings::default() };
        if !times.kept {
            let mut clock = Clock::start();
            let found: Light = light(&transport, &world, &reflectance, &params, cx.seed, &mut clock);
            let values = if self.indirect { found.indirect } else { total(&found) };
            let map = as_light_map(&transport, &world, &values);
            clock.lap("light map");
            times.passes(&clock.laps);
            encode(&world.scene.geometry, &transport.atlas, &map.front, map.back.as_deref(), provenance).write(&file)?;
        }
        timings.frames.push(times);
        timings.finish(&self.output.join("timings.json"));
        crate::io::json::write(&self.output.join("timings.json"), &timings)?;
        let ms: f64 = timings.mean_ms.values().sum();
        let summary = format!("{}: {} light maps, {ms:.0} ms each", self.output.display(), timings.frames.len());
        let figures = serde_json::to_value(&timings).map_err(|e| Error::Request(e.to_string()))?;
        Ok(Outcome { summary, figures, ..Outcome::default() })
    }
}
