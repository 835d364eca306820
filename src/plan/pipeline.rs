//! From a scene to frames: the stages that lead to a method's frames, each reading what the ones before it write.

use super::settings::Settings;
use super::stages::{BakeLightfield, BakeLightmap, BakeProbes, BakeTransport, Curvature, PlaceProbes, Qhmap, RenderPath, Resmap};
use super::views::FrameList;
use super::{Context, Outcome, Stage};
use crate::method::{Method, Need};
use crate::{Error, Result};
use std::path::{Path, PathBuf};

/// Where the bakes lie.
#[derive(Debug, Clone, PartialEq)]
pub struct Bakes {
    /// The probes' places.
    pub grid: PathBuf,
    /// Resolution maps.
    pub resmap: PathBuf,
    /// Parameterisations.
    pub qhmap: PathBuf,
    /// Curvatures.
    pub curvature: PathBuf,
    /// The light map.
    pub lightmap: PathBuf,
    /// Baked probes.
    pub probes: PathBuf,
    /// Light field probes.
    pub lightfield: PathBuf,
    /// Transport of radiance probes.
    pub transport: PathBuf,
}

impl Bakes {
    /// All in one folder.
    pub fn within(folder: &Path) -> Self {
        let at = |name: &str| folder.join(name);
        Self {
            grid: at("probes.json"),
            resmap: at("resmap"),
            qhmap: at("qhmap"),
            curvature: at("curvature.exr"),
            lightmap: at("lightmap.exr"),
            probes: at("probes"),
            lightfield: at("lightfield"),
            transport: at("transport"),
        }
    }

    /// The folder of baked probes that a stage writes.
    fn of(&self, stage: &str) -> &PathBuf {
        match stage {
            BakeLightfield::COMMAND => &self.lightfield,
            BakeTransport::COMMAND => &self.transport,
            _ => &self.probes,
        }
    }
}

/// What all stages of a pipeline share.
#[derive(Debug, Clone)]
pub struct Pipeline {
    /// The scene.
    pub scene: PathBuf,
    /// The camera path.
    pub path: Option<PathBuf>,
    /// Only these frames of it.
    pub frames: Option<FrameList>,
    /// Numbers.
    pub settings: Settings,
}

impl Pipeline {
    /// The stages that make `bakes`, in order.
    pub fn bakes(&self, bakes: &Bakes) -> [Stage; 8] {
        let (s, scene) = (&self.settings, || self.scene.clone());
        let for_path = !s.all_texels;
        [
            PlaceProbes {
                scene: scene(),
                count: Some(s.probes),
                path: self.path.clone(),
                output: bakes.grid.clone(),
                ..Default::default()
            }
            .into(),
            Resmap {
                scene: scene(),
                probes: bakes.grid.clone(),
                paper: s.paper,
                output: bakes.resmap.clone(),
                ..Default::default()
            }
            .into(),
            Qhmap { resmap: bakes.resmap.clone(), size: Some(s.probe_size), output: bakes.qhmap.clone(), ..Default::default() }
                .into(),
            Curvature { scene: scene(), output: bakes.curvature.clone(), ..Default::default() }.into(),
            BakeLightmap {
                scene: scene(),
                spp: Some(s.lightmap_spp),
                error: s.lightmap_error.filter(|_| !s.paper),
                first_spp: Some(if s.paper { 0 } else { s.lightmap_first_spp }),
                // One path tells nothing of its noise.
                denoise: s.lightmap_denoise && !s.paper && s.lightmap_spp > 1,
                texels: s.texel.is_none().then_some(s.lightmap_texels),
                texel: s.texel,
                output: bakes.lightmap.clone(),
                ..Default::default()
            }
            .into(),
            BakeProbes {
                scene: scene(),
                probes: bakes.grid.clone(),
                qhmap: bakes.qhmap.clone(),
                spp: Some(s.spp),
                error: s.error.filter(|_| !s.paper),
                paper: s.paper,
                lightmap: (!s.paper).then(|| bakes.lightmap.clone()),
                for_path: self.path.clone().filter(|_| for_path),
                curvature: for_path.then(|| bakes.curvature.clone()),
                size: s.size.filter(|_| for_path),
                frames: self.frames.clone().filter(|_| for_path),
                supersample: for_path.then_some(s.supersample),
                output: bakes.probes.clone(),
                ..Default::default()
            }
            .into(),
            self.lightfield(bakes).into(),
            self.transport(bakes).into(),
        ]
    }

    fn lightfield(&self, bakes: &Bakes) -> BakeLightfield {
        let [width, height] = self.settings.probe_size.0;
        BakeLightfield {
            scene: self.scene.clone(),
            probes: bakes.grid.clone(),
            // As many texels as the other probes have, or about.
            size: Some((width * height).isqrt().next_power_of_two()),
            output: bakes.lightfield.clone(),
            ..Default::default()
        }
    }

    /// With as many receivers as the light map has texels.
    fn transport(&self, bakes: &Bakes) -> BakeTransport {
        let s = &self.settings;
        BakeTransport {
            scene: self.scene.clone(),
            probes: bakes.grid.clone(),
            texels: s.texel.is_none().then_some(s.lightmap_texels),
            texel: s.texel,
            output: bakes.transport.clone(),
            ..Default::default()
        }
    }

    /// Frames by `method`, from what it reads of `bakes`.
    pub fn render(&self, method: &Method, bakes: &Bakes, output: &Path) -> RenderPath {
        RenderPath {
            scene: self.scene.clone(),
            path: self.path.clone(),
            frames: self.frames.clone(),
            size: self.settings.size,
            method: Some(method.name.into()),
            probes: method.reads.probes.map(|p| bakes.of(p.stage).clone()),
            lightmap: (method.reads.lightmap != Need::No).then(|| bakes.lightmap.clone()),
            curvature: (method.reads.curvature != Need::No).then(|| bakes.curvature.clone()),
            supersample: method.uses("supersample").then_some(self.settings.supersample),
            paper: method.uses("paper") && self.settings.paper,
            output: output.into(),
            ..Default::default()
        }
    }

    /// The path-traced reference.
    pub fn reference(&self, output: &Path) -> RenderPath {
        let path_trace = &crate::method::path_trace::METHOD;
        let spp = Some(self.settings.reference_spp);
        RenderPath { spp, ..self.render(path_trace, &Bakes::within(output), output) }
    }
}

/// Those of `bakes` that `stage` reads, by itself or through others of them, in their order.
pub fn needed(bakes: impl IntoIterator<Item = Stage>, stage: &Stage) -> Vec<Stage> {
    let bakes: Vec<Stage> = bakes.into_iter().collect();
    let mut wanted: Vec<PathBuf> = stage.inputs().into_iter().cloned().collect();
    let mut needed: Vec<Stage> = Vec::new();
    for bake in bakes.into_iter().rev() {
        if wanted.iter().any(|path| path == bake.output()) {
            wanted.extend(bake.inputs().into_iter().cloned());
            needed.push(bake);
        }
    }
    needed.reverse();
    needed
}

/// Says what a stage is, runs it, and says what came of it. `place` is its number among all, where there is one.
pub fn execute(stage: &Stage, cx: &Context, place: &str) -> Result<Outcome> {
    cx.listener.say(&format!("{place}$ {}", stage.command_line(cx)));
    let outcome = stage.run(cx).map_err(|e| Error::Request(format!("{}: {e}", stage.command())))?;
    cx.listener.say(&format!("  {}", outcome.summary.trim_end().replace('\n', "\n  ")));
    Ok(outcome)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::method::METHODS;
    use crate::plan::settings::Preset;

    fn pipeline(all_texels: bool) -> Pipeline {
        let settings = Settings { all_texels, ..Preset::Draft.settings(true) };
        Pipeline { scene: "scene.xml".into(), path: Some("path.json".into()), frames: None, settings }
    }

    #[test]
    fn a_method_is_planned_what_it_reads_and_nothing_else() {
        let all = ["place-probes", "resmap", "qhmap", "curvature", "bake-lightmap", "bake-probes"];
        let bakes = Bakes::within(Path::new("out"));
        for (name, all_texels, expected) in [
            ("glossy-probes", false, &all[..]),
            ("glossy-probes", true, &all[..]),
            ("ulr", true, &["place-probes", "resmap", "qhmap", "bake-lightmap", "bake-probes"]),
            ("image-space-gather", false, &["bake-lightmap"]),
            ("path-trace", false, &[]),
        ] {
            let pipeline = pipeline(all_texels);
            let render = pipeline.render(Method::find(name).unwrap(), &bakes, Path::new("frames"));
            let found: Vec<_> = needed(pipeline.bakes(&bakes), &render.into()).iter().map(Stage::command).collect();
            assert_eq!(found, expected, "{name}");
        }
    }

    #[test]
    fn every_stage_of_every_preset_and_method_passes_its_own_checks() {
        for preset in [Preset::Draft, Preset::Medium, Preset::Paper] {
            for paper in [false, true] {
                let settings = Settings { paper, ..preset.settings(true) };
                let pipeline = Pipeline { scene: "s.xml".into(), path: Some("p.json".into()), frames: None, settings };
                let bakes = Bakes::within(Path::new("out"));
                for bake in pipeline.bakes(&bakes) {
                    bake.check().unwrap();
                }
                for method in METHODS {
                    pipeline.render(method, &bakes, Path::new("frames")).check().unwrap();
                }
                pipeline.reference(Path::new("reference")).check().unwrap();
            }
        }
    }
}
