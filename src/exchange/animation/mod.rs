//! `LIGHTS.json`: lights, materials and objects that change from frame to frame, read for one scene.

mod entry;
mod surfaces;
mod things;

use crate::io::{json, read_text};
use crate::scene::{Animation, Scene};
use crate::{Error, Result};
use entry::Entry;
use serde::Deserialize;
use serde_json::Value;
use std::path::Path;

/// Most entries of a list.
const MAX_ENTRIES: usize = 1000;
/// Most frames until the last keyframe.
const MAX_FRAMES: f64 = 100_000.0;

/// What the file holds.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct LightsFile {
    /// Frames a second.
    fps: Option<f64>,
    #[serde(default = "yes")]
    scene_lights: bool,
    #[serde(default)]
    lights: Vec<Value>,
    #[serde(default)]
    materials: Vec<Value>,
    #[serde(default)]
    emission: Vec<Value>,
    #[serde(default)]
    objects: Vec<Value>,
}

fn yes() -> bool {
    true
}

impl Animation {
    /// Reads a file for a scene.
    ///
    /// # Errors
    /// It is no such file, with the line or the entry; the scene has not what it names; a mesh cannot be read; or it asks for too much.
    pub fn load(path: &Path, scene: &Scene) -> Result<Self> {
        Self::parse(path, &read_text(path)?, scene)
    }

    /// [`Animation::load`], of a text: messages call it `path`, and meshes are looked for beside that.
    ///
    /// # Errors
    /// As of [`Animation::load`].
    pub fn parse(path: &Path, text: &str, scene: &Scene) -> Result<Self> {
        let file: LightsFile = json::written_by_hand(path, text)?;
        let bad = |message: String| Error::input(path, message);
        for (name, list) in
            [("lights", &file.lights), ("materials", &file.materials), ("emission", &file.emission), ("objects", &file.objects)]
        {
            if list.len() > MAX_ENTRIES {
                return Err(bad(format!("{name}: found {} entries, expected at most {MAX_ENTRIES}", list.len())));
            }
        }
        let mut last = Last::default();
        let lights = things::lights(&file.lights, &mut last).map_err(bad)?;
        let materials = surfaces::materials(&file.materials, scene, &mut last).map_err(bad)?;
        let (emission, relit) = surfaces::emission(&file.emission, scene, &mut last).map_err(bad)?;
        let things::Objects { objects, files } = things::objects(&file.objects, path, scene, &mut last)?;
        let (fps, last) = (fps(&file, &last).map_err(bad)?, last.0.unwrap_or(0.0));
        let scene_lights = file.scene_lights;
        let animation = Self { fps, last, scene_lights, lights, materials, emission, objects, relit, files };
        check_aims(&animation).map_err(bad)?;
        Ok(animation)
    }
}

/// The latest time of any keyframe; `None` until there is one.
#[derive(Debug, Default)]
struct Last(Option<f64>);

impl Last {
    fn note(&mut self, entry: &Entry) {
        self.0 = entry.last().into_iter().chain(self.0).reduce(f64::max);
    }
}

fn fps(file: &LightsFile, last: &Last) -> entry::Result<f64> {
    let fps = match (file.fps, last.0) {
        (Some(fps), _) if fps > 0.0 && fps.is_finite() => fps,
        (Some(fps), _) => return Err(format!("fps = {fps}: expected more than 0")),
        (None, Some(_)) => return Err("found \"keyframes\" without \"fps\"".into()),
        (None, None) => 1.0,
    };
    let frames = last.0.unwrap_or(0.0) * fps;
    match frames < MAX_FRAMES {
        true => Ok(fps),
        false => Err(format!("{frames:.0} frames until the last keyframe, expected at most {MAX_FRAMES}")),
    }
}

/// An error where a light looks nowhere at a frame, or at a keyframe between two.
fn check_aims(animation: &Animation) -> entry::Result<()> {
    for (i, light) in animation.lights.iter().enumerate() {
        let keys = light.key_times();
        // One without keys is the same at all frames.
        let frames = if keys.is_empty() { 1 } else { animation.frames() };
        for time in (0..frames).map(|f| f64::from(f) / animation.fps).chain(keys) {
            light.frame(time).map_err(|e| format!("lights[{i}]: {e}, at {time} s"))?;
        }
    }
    Ok(())
}
