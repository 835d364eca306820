//! The stages as the commands that a person would type, for the commands that string them together.

use crate::common::{Common, Outcome};
use crate::views::FrameList;
use crate::{Cli, dispatch};
use anyhow::Context;
use clap::Parser;
use reprobe::gpu::Choice;
use std::path::{Path, PathBuf};

/// What a preset stands for.
#[derive(Clone, Copy, PartialEq, clap::ValueEnum)]
pub enum Preset {
    /// A look in some 3 minutes on 2 cores
    Draft,
    /// A judgement in some 20 minutes on 2 cores
    Medium,
    /// 252 probes of 1024x512 at 2048 paths a texel, 1920x1080
    Paper,
}

/// Numbers of all stages.
pub struct Settings {
    pub probes: u32,
    pub probe_size: [u32; 2],
    pub spp: u32,
    pub lightmap_spp: u32,
    pub lightmap_first_spp: u32,
    pub lightmap_texels: u32,
    /// In place of `lightmap_texels`.
    pub texel: Option<f32>,
    /// `None` for the path's own.
    pub size: Option<[u32; 2]>,
    pub supersample: u32,
    pub reference_spp: u32,
    pub all_texels: bool,
    pub paper: bool,
}

impl Preset {
    /// The preset's numbers; the size is the path's own where there is one and the preset is the paper's.
    pub fn settings(self, has_path: bool) -> Settings {
        let settings = match self {
            Self::Draft => Settings {
                probes: 12,
                probe_size: [256, 128],
                spp: 64,
                lightmap_spp: 96,
                lightmap_first_spp: 12,
                lightmap_texels: 150_000,
                texel: None,
                size: Some([320, 180]),
                supersample: 2,
                reference_spp: 32,
                all_texels: false,
                paper: false,
            },
            Self::Medium => Settings {
                probes: 64,
                probe_size: [512, 256],
                spp: 128,
                lightmap_spp: 128,
                lightmap_first_spp: 16,
                lightmap_texels: 1_000_000,
                size: Some([480, 270]),
                reference_spp: 256,
                ..Self::Draft.settings(has_path)
            },
            Self::Paper => Settings {
                probes: 252,
                probe_size: [1024, 512],
                spp: 2048,
                lightmap_spp: 2048,
                lightmap_first_spp: 0,
                lightmap_texels: 4_000_000,
                size: (!has_path).then_some([1920, 1080]),
                supersample: 1,
                reference_spp: 1024,
                all_texels: true,
                ..Self::Draft.settings(has_path)
            },
        };
        // Without a path there are no views to bake for.
        Settings { all_texels: settings.all_texels || !has_path, ..settings }
    }
}

/// One command of the pipeline.
#[derive(Clone)]
pub struct Stage(Vec<String>);

impl Stage {
    pub fn new(command: &str) -> Self {
        Self(vec![command.into()])
    }

    /// The subcommand.
    pub fn command(&self) -> &str {
        &self.0[0]
    }

    fn arg(mut self, value: impl std::fmt::Display) -> Self {
        self.0.push(value.to_string());
        self
    }

    pub fn path(self, value: &Path) -> Self {
        self.arg(value.display())
    }

    pub fn option(self, name: &str, value: impl std::fmt::Display) -> Self {
        self.arg(name).arg(value)
    }

    pub fn optional(self, name: &str, value: Option<impl std::fmt::Display>) -> Self {
        match value {
            Some(v) => self.option(name, v),
            None => self,
        }
    }

    pub fn flag(self, name: &str, on: bool) -> Self {
        if on { self.arg(name) } else { self }
    }

    /// Gives an option, in place of the one of that name that is there.
    pub fn replace(mut self, name: &str, value: Option<&str>) -> Self {
        match (self.0.iter().position(|a| a == name), value) {
            (Some(at), Some(value)) if at + 1 < self.0.len() => self.0[at + 1] = value.into(),
            (Some(_), _) => {}
            (None, value) => {
                self.0.push(name.into());
                self.0.extend(value.map(str::to_owned));
            }
        }
        self
    }

    /// What a person would type.
    pub fn command_line(&self) -> String {
        let quote = |a: &String| {
            if a.contains([' ', '\'', '"', '$', '[', '{']) { format!("'{}'", a.replace('\'', r"'\''")) } else { a.clone() }
        };
        format!("reprobe {}", self.0.iter().map(quote).collect::<Vec<_>>().join(" "))
    }

    fn parse(&self) -> anyhow::Result<Cli> {
        let arguments = std::iter::once("reprobe").chain(self.0.iter().map(String::as_str));
        Cli::try_parse_from(arguments).with_context(|| self.command_line())
    }

    /// Refuses options that the command does not know.
    pub fn check(&self) -> anyhow::Result<()> {
        self.parse().map(|_| ())
    }

    /// Prints the command and runs it on `common`'s scene. `place` is its number among all, where there is one.
    pub fn execute(&self, common: &Common, place: &str) -> anyhow::Result<Outcome> {
        if !common.quiet {
            eprintln!("{place}$ {}", self.command_line());
        }
        let mut cli = self.parse()?;
        cli.common.share_scene(common);
        let outcome = dispatch(&cli.command, &cli.common).with_context(|| self.command().to_owned())?;
        if !common.quiet {
            eprintln!("  {}", outcome.summary.trim_end().replace('\n', "\n  "));
        }
        Ok(outcome)
    }
}

/// Where the bakes lie.
#[derive(Clone)]
pub struct Bakes {
    pub grid: PathBuf,
    pub resmap: PathBuf,
    pub qhmap: PathBuf,
    pub curvature: PathBuf,
    pub lightmap: PathBuf,
    pub probes: PathBuf,
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
        }
    }
}

/// What all stages of a pipeline share.
pub struct Pipeline<'a> {
    pub common: &'a Common,
    pub scene: &'a Path,
    pub path: Option<&'a Path>,
    pub frames: Option<&'a FrameList>,
    pub settings: Settings,
}

/// Stages that can use a GPU.
const ON_GPU: [&str; 4] = ["resmap", "bake-probes", "bake-lightmap", "render-path"];

impl Pipeline<'_> {
    /// A command that reads the scene.
    pub fn stage(&self, command: &str) -> Stage {
        let common = self.common;
        let mut s = Stage::new(command).path(self.scene).option("--seed", common.seed);
        s = s.optional("--threads", common.threads).flag("--quiet", common.quiet);
        s = s.optional("--unit-scale", (common.unit_scale != 1.0).then_some(common.unit_scale));
        s = s.flag("--skip-unsupported", common.skip_unsupported).flag("--allow-truncated", common.allow_truncated);
        let device = Some(&common.device).filter(|d| **d != Choice::Auto && ON_GPU.contains(&command));
        s = s.optional("--device", device);
        common.defines.iter().fold(s, |s, d| s.option("--define", d))
    }

    fn path_option(&self, stage: Stage, name: &str) -> Stage {
        stage.optional(name, self.path.map(Path::display))
    }

    fn size(&self) -> Option<String> {
        self.settings.size.map(size_text)
    }

    /// The stages that make `bakes`, in order.
    pub fn bakes(&self, bakes: &Bakes) -> Vec<Stage> {
        let Settings { paper, texel, .. } = self.settings;
        let settings = &self.settings;
        let place = self.stage("place-probes").option("--count", settings.probes);
        let mut probes = self
            .stage("bake-probes")
            .option("--probes", bakes.grid.display())
            .option("--qhmap", bakes.qhmap.display())
            .option("--output", bakes.probes.display())
            .option("--spp", settings.spp)
            .flag("--paper", paper);
        if !paper {
            probes = probes.option("--lightmap", bakes.lightmap.display());
        }
        if !settings.all_texels {
            probes = self
                .path_option(probes, "--for-path")
                .option("--curvature", bakes.curvature.display())
                .optional("--size", self.size())
                .optional("--frames", self.frames)
                .option("--supersample", settings.supersample);
        }
        vec![
            self.path_option(place, "--path").option("--output", bakes.grid.display()),
            self.stage("resmap")
                .flag("--paper", paper)
                .option("--probes", bakes.grid.display())
                .option("--output", bakes.resmap.display()),
            Stage::new("qhmap")
                .path(&bakes.resmap)
                .option("--size", size_text(settings.probe_size))
                .option("--output", bakes.qhmap.display())
                .optional("--threads", self.common.threads)
                .flag("--quiet", self.common.quiet),
            self.stage("curvature").option("--output", bakes.curvature.display()),
            self.stage("bake-lightmap")
                .option("--spp", settings.lightmap_spp)
                .option("--first-spp", if paper { 0 } else { settings.lightmap_first_spp })
                .optional("--texels", texel.is_none().then_some(settings.lightmap_texels))
                .optional("--texel", texel)
                .option("--output", bakes.lightmap.display()),
            probes,
        ]
    }

    /// Frames, by a method that has no use for bakes unless they are added.
    pub fn render(&self, output: &Path) -> Stage {
        self.path_option(self.stage("render-path"), "--path")
            .optional("--size", self.size())
            .optional("--frames", self.frames)
            .option("--output", output.display())
    }

    /// Frames made from `bakes`.
    pub fn render_from(&self, bakes: &Bakes, output: &Path) -> Stage {
        self.render(output)
            .option("--probes", bakes.probes.display())
            .option("--lightmap", bakes.lightmap.display())
            .option("--curvature", bakes.curvature.display())
            .option("--supersample", self.settings.supersample)
            .flag("--paper", self.settings.paper)
    }

    /// The path-traced reference.
    pub fn reference(&self, output: &Path) -> Stage {
        self.render(output).option("--method", "path-trace").option("--spp", self.settings.reference_spp)
    }
}

fn size_text(size: [u32; 2]) -> String {
    format!("{}x{}", size[0], size[1])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_option_takes_the_place_of_the_one_that_is_there() {
        let stage = Stage::new("bake-probes").option("--spp", 8).flag("--spread", true);
        let stage = stage.replace("--spp", Some("16")).replace("--spread", None).replace("--error", Some("0.1"));
        assert_eq!(stage.command_line(), "reprobe bake-probes --spp 16 --spread --error 0.1");
    }
}
