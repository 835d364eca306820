//! `relight`.

use crate::base::clock::Clock;
use crate::base::named::{Parameters, apply};
use crate::io::Provenance;
use crate::io::jobs::is_finished;
use crate::io::provenance::hash_file;
use crate::lightmap::lookup::encode;
use crate::method::radiance_probes::light::{Lighting, as_light_map};
use crate::method::radiance_probes::operator::Transport;
use crate::method::radiance_probes::params::RadianceProbeParams;
use crate::method::radiance_probes::transport::Kept;
use crate::plan::lights;
use crate::plan::option::stage;
use crate::plan::timings::{FrameTimings, Timings};
use crate::plan::views::FrameList;
use crate::plan::{Context, Outcome};
use crate::probe::set::{ProbeSet, numbered};
use crate::scene::Animation;
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
        /// Lights, materials and objects that change from frame to frame.
        "--lights" lights: Option<PathBuf>,
        /// Only these frames of them.
        "--frames" frames: Option<FrameList>,
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
        if params.feedback {
            return Err(Error::Request(
                "--set feedback=true: light maps have all bounces of their own frame; give bounces=N".into(),
            ));
        }
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
        let (animation, provenance) = lights::load(self.lights.as_deref(), &world.scene, provenance)?;
        let transport = Transport::load(&self.probes, &world.scene)?;
        if transport.params.receiver != Kept::Irradiance {
            return Err(Error::input(
                &self.probes,
                "its texels keep sh1, a light map has irradiance: bake with --receiver irradiance",
            ));
        }
        let count = animation.as_ref().map_or(1, Animation::frames);
        let frames: Vec<u32> = (0..count).filter(|&f| self.frames.as_ref().is_none_or(|list| list.has(f))).collect();
        if frames.is_empty() {
            return Err(Error::Request(format!("--frames: there are frames 0 to {}", count - 1)));
        }
        let lighting = Lighting::new(&world, transport, animation.as_ref());
        let mut timings = Timings::of("radiance-probes");
        // Light maps are of the scene's own triangles.
        let geometry = &world.scene.geometry;
        cx.progress().start("light maps", frames.len() as u64);
        for frame in frames {
            let mut provenance = provenance.clone();
            provenance.parameters["frame"] = frame.into();
            let file = numbered(&self.output, frame as usize);
            let name = format!("{frame:04}.exr");
            let mut times = FrameTimings { name, kept: is_finished(&file, &provenance), ..FrameTimings::default() };
            if !times.kept {
                let of_frame = animation.as_ref().map(|animation| world.at(animation, frame));
                let world = of_frame.as_ref().unwrap_or(&world);
                let mut clock = Clock::start();
                let light = lighting.light(world, &params, (None, cx.seed), &mut clock);
                let values = if self.indirect { light.indirect } else { lighting.total(&light) };
                let map = as_light_map(&lighting.transport, world, &values);
                clock.lap("light map");
                times.passes(&clock.laps);
                let (front, back) = (&map.front, map.back.as_deref());
                encode(geometry, &lighting.transport.atlas, front, back, provenance).write(&file)?;
            }
            timings.frames.push(times);
            cx.progress().advance(1);
        }
        cx.progress().finish();
        timings.finish(&self.output.join("timings.json"));
        crate::io::json::write(&self.output.join("timings.json"), &timings)?;
        let ms: f64 = timings.mean_ms.values().sum();
        let summary = format!("{}: {} light maps, {ms:.0} ms each", self.output.display(), timings.frames.len());
        let figures = serde_json::to_value(&timings).map_err(|e| Error::Request(e.to_string()))?;
        Ok(Outcome { summary, figures, ..Outcome::default() })
    }
}
