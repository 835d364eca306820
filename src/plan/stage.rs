//! A stage of a pipeline: one of the subcommands that read files and write files.

use super::stages::{
    BakeLightfield, BakeLightmap, BakeProbes, BakeTransport, Compare, Curvature, ExportGltf, ExportProbes, InspectLightfield,
    InspectTransport, PlaceProbes, Qhmap, Relight, RenderPath, Resmap, Video, View,
};
use super::{Context, Outcome, overwrite};
use crate::Result;
use crate::io::atomic;
use std::ffi::OsString;
use std::path::{Path, PathBuf};

/// A stage with its inputs and options.
#[derive(Debug, Clone, PartialEq)]
pub enum Stage {
    /// `place-probes`
    PlaceProbes(PlaceProbes),
    /// `resmap`
    Resmap(Resmap),
    /// `qhmap`
    Qhmap(Qhmap),
    /// `curvature`
    Curvature(Curvature),
    /// `bake-lightmap`
    BakeLightmap(BakeLightmap),
    /// `bake-probes`
    BakeProbes(BakeProbes),
    /// `bake-lightfield`
    BakeLightfield(BakeLightfield),
    /// `bake-transport`
    BakeTransport(BakeTransport),
    /// `relight`
    Relight(Relight),
    /// `render-path`
    RenderPath(RenderPath),
    /// `compare`
    Compare(Compare),
    /// `export-gltf`
    ExportGltf(ExportGltf),
    /// `export-probes`
    ExportProbes(ExportProbes),
    /// `inspect-lightfield`
    InspectLightfield(InspectLightfield),
    /// `inspect-transport`
    InspectTransport(InspectTransport),
    /// `view`
    View(View),
    /// `video`
    Video(Video),
}

/// The stages that bake, in the order in which they run.
pub const BAKES: [&str; 8] = [
    PlaceProbes::COMMAND,
    Resmap::COMMAND,
    Qhmap::COMMAND,
    Curvature::COMMAND,
    BakeLightmap::COMMAND,
    BakeProbes::COMMAND,
    BakeLightfield::COMMAND,
    BakeTransport::COMMAND,
];

/// Does the same with whichever stage it is.
macro_rules! with {
    ($stage:expr, $s:ident => $what:expr) => {
        match $stage {
            Stage::PlaceProbes($s) => $what,
            Stage::Resmap($s) => $what,
            Stage::Qhmap($s) => $what,
            Stage::Curvature($s) => $what,
            Stage::BakeLightmap($s) => $what,
            Stage::BakeProbes($s) => $what,
            Stage::BakeLightfield($s) => $what,
            Stage::BakeTransport($s) => $what,
            Stage::Relight($s) => $what,
            Stage::RenderPath($s) => $what,
            Stage::Compare($s) => $what,
            Stage::ExportGltf($s) => $what,
            Stage::ExportProbes($s) => $what,
            Stage::InspectLightfield($s) => $what,
            Stage::InspectTransport($s) => $what,
            Stage::View($s) => $what,
            Stage::Video($s) => $what,
        }
    };
}

macro_rules! from {
    ($($name:ident),+) => { $(impl From<$name> for Stage {
        fn from(stage: $name) -> Self {
            Self::$name(stage)
        }
    })+ };
}
from!(
    PlaceProbes,
    Resmap,
    Qhmap,
    Relight,
    Curvature,
    BakeLightmap,
    BakeProbes,
    BakeLightfield,
    BakeTransport,
    RenderPath,
    Compare,
    ExportGltf,
    ExportProbes,
    InspectLightfield,
    InspectTransport,
    View,
    Video
);

impl Stage {
    /// The subcommand.
    pub fn command(&self) -> &'static str {
        fn of<T>(_: &T, command: &'static str) -> &'static str {
            command
        }
        match self {
            Self::PlaceProbes(s) => of(s, PlaceProbes::COMMAND),
            Self::Resmap(s) => of(s, Resmap::COMMAND),
            Self::Qhmap(s) => of(s, Qhmap::COMMAND),
            Self::Curvature(s) => of(s, Curvature::COMMAND),
            Self::BakeLightmap(s) => of(s, BakeLightmap::COMMAND),
            Self::BakeProbes(s) => of(s, BakeProbes::COMMAND),
            Self::BakeLightfield(s) => of(s, BakeLightfield::COMMAND),
            Self::BakeTransport(s) => of(s, BakeTransport::COMMAND),
            Self::Relight(s) => of(s, Relight::COMMAND),
            Self::RenderPath(s) => of(s, RenderPath::COMMAND),
            Self::Compare(s) => of(s, Compare::COMMAND),
            Self::ExportGltf(s) => of(s, ExportGltf::COMMAND),
            Self::ExportProbes(s) => of(s, ExportProbes::COMMAND),
            Self::InspectLightfield(s) => of(s, InspectLightfield::COMMAND),
            Self::InspectTransport(s) => of(s, InspectTransport::COMMAND),
            Self::View(s) => of(s, View::COMMAND),
            Self::Video(s) => of(s, Video::COMMAND),
        }
    }

    /// Gives an option a value, by its name.
    pub fn set(&mut self, option: &str, value: Option<&str>) -> Result<()> {
        with!(self, s => s.set(option, value))
    }

    /// Refuses options that do not go together or are out of range; reads no file.
    pub fn check(&self) -> Result<()> {
        with!(self, s => s.check())
    }

    /// What it writes.
    pub fn output(&self) -> &Path {
        with!(self, s => &s.output)
    }

    /// What it reads of what other stages write.
    pub fn inputs(&self) -> Vec<&PathBuf> {
        match self {
            Self::PlaceProbes(s) => s.refine_by.iter().collect(),
            Self::Curvature(_) | Self::BakeLightmap(_) => vec![],
            Self::Resmap(s) => vec![&s.probes],
            Self::BakeLightfield(s) => vec![&s.probes],
            Self::BakeTransport(s) => vec![&s.probes],
            Self::Relight(s) => vec![&s.probes],
            Self::ExportGltf(s) => s.lightmap.iter().collect(),
            Self::ExportProbes(s) => [&s.probes].into_iter().chain(&s.lightmap).collect(),
            Self::InspectLightfield(s) => vec![&s.probes],
            Self::InspectTransport(s) => vec![&s.probes],
            Self::Qhmap(s) => vec![&s.resmap],
            Self::BakeProbes(s) => [&s.probes, &s.qhmap].into_iter().chain(&s.lightmap).chain(&s.curvature).collect(),
            Self::RenderPath(s) => s.probes.iter().chain(&s.lightmap).chain(&s.curvature).collect(),
            Self::Compare(s) => vec![&s.image, &s.reference],
            Self::View(s) => s.files.iter().collect(),
            Self::Video(s) => [&s.frames].into_iter().chain(&s.beside).collect(),
        }
    }

    /// The scene and the camera path that it reads.
    fn sources(&self) -> Vec<&PathBuf> {
        match self {
            Self::PlaceProbes(s) => [&s.scene].into_iter().chain(&s.path).collect(),
            Self::Resmap(s) => vec![&s.scene],
            Self::Curvature(s) => vec![&s.scene],
            Self::BakeLightmap(s) => vec![&s.scene],
            Self::ExportGltf(s) => vec![&s.scene],
            Self::BakeLightfield(s) => vec![&s.scene],
            Self::BakeTransport(s) => vec![&s.scene],
            Self::Relight(s) => [&s.scene].into_iter().chain(&s.lights).collect(),
            Self::BakeProbes(s) => [&s.scene].into_iter().chain(&s.for_path).collect(),
            Self::RenderPath(s) => [&s.scene].into_iter().chain(&s.path).chain(&s.match_time).collect(),
            Self::InspectLightfield(s) => [&s.scene].into_iter().chain(&s.path).collect(),
            Self::InspectTransport(s) => [&s.scene].into_iter().chain(&s.path).collect(),
            Self::ExportProbes(s) => s.scene.iter().collect(),
            Self::Qhmap(_) | Self::View(_) | Self::Video(_) => vec![],
            Self::Compare(s) => s.second_reference.iter().collect(),
        }
    }

    /// Checks, reads, computes and writes.
    ///
    /// # Errors
    /// What it reads is not as it should be, or what it would write is an input, or a file of somebody else's.
    pub fn run(&self, cx: &Context) -> Result<Outcome> {
        overwrite::refuse(self.output(), self.inputs().into_iter().chain(self.sources()))?;
        atomic::sweep(self.output());
        with!(self, s => s.run(cx))
    }

    /// Whether it can use a GPU, where `cx` asks for one.
    pub fn uses_gpu(&self) -> bool {
        matches!(self, Self::Resmap(_) | Self::BakeLightmap(_) | Self::BakeProbes(_) | Self::RenderPath(_))
    }

    fn reads_scene(&self) -> bool {
        !matches!(self, Self::Qhmap(_) | Self::Compare(_) | Self::ExportProbes(_) | Self::View(_) | Self::Video(_))
    }

    /// The command and its arguments, as the program takes them.
    pub fn arguments(&self, cx: &Context) -> Vec<OsString> {
        let mut list: Vec<OsString> = vec![self.command().into()];
        list.extend(with!(self, s => s.arguments()));
        let mut option = |name: &str, value: String| list.extend([name.into(), value.into()]);
        option("--seed", cx.seed.to_string());
        if self.reads_scene()
            && let Some(scale) = cx.load.unit_scale
        {
            option("--unit-scale", scale.to_string());
        }
        if self.uses_gpu() && cx.device != crate::gpu::Choice::Auto {
            option("--device", cx.device.to_string());
        }
        if self.reads_scene() {
            for (name, value) in &cx.load.defines {
                option("--define", format!("{name}={value}"));
            }
            let flags = [("--skip-unsupported", cx.load.skip_unsupported), ("--allow-truncated", cx.load.allow_truncated)];
            list.extend(flags.into_iter().filter(|(_, on)| *on).map(|(flag, _)| flag.into()));
        }
        list
    }

    /// What a person would type.
    pub fn command_line(&self, cx: &Context) -> String {
        let quote = |a: &OsString| {
            let a = a.to_string_lossy();
            let plain = |c: char| c.is_alphanumeric() || "-_./,:=+%@".contains(c);
            if !a.is_empty() && a.chars().all(plain) { a.into_owned() } else { format!("'{}'", a.replace('\'', r"'\''")) }
        };
        format!("reprobe {}", self.arguments(cx).iter().map(quote).collect::<Vec<_>>().join(" "))
    }
}
