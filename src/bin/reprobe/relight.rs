//! `reprobe relight`.

use reprobe::plan::stages::Relight;
use reprobe::plan::views::FrameList;
use std::path::PathBuf;

/// Light the texels of a transport: a light map a frame, by radiance probes
///
/// Writes NNNN.exr, light maps as bake-lightmap writes them, which every --lightmap takes, and timings.json, the milliseconds of each pass.
#[derive(clap::Args)]
#[command(after_help = "Examples:
  reprobe relight room/scene.xml --probes transport/ -o lightmaps/
  reprobe relight room/scene.xml --probes transport/ --lights lights.json -o lightmaps/
  reprobe relight room/scene.xml --probes transport/ --set bounces=8 --set map_samples=64 -o lightmaps/
  reprobe render-path room/scene.xml --path room/path.json --method lightmap-rt --lightmap lightmaps/0000.exr -o frames/")]
pub struct Args {
    /// Scene: Mitsuba XML or JSON, or glTF
    #[arg(value_name = "SCENE")]
    scene: PathBuf,
    /// The operator, from bake-transport
    #[arg(long, value_name = "FOLDER")]
    probes: PathBuf,
    /// Lights, materials and objects that change from frame to frame: a light map of each
    #[arg(long, value_name = "FILE")]
    lights: Option<PathBuf>,
    /// Only these frames: numbers and ranges, like 0,4,10-19
    #[arg(long, value_name = "LIST")]
    frames: Option<FrameList>,
    /// Folder for the light maps
    #[arg(short, long, value_name = "FOLDER")]
    output: PathBuf,
    /// Leave out what comes straight from lights
    #[arg(long)]
    indirect: bool,
    /// Parameters as of render-path --method radiance-probes: NAME=VALUE
    #[arg(long, value_name = "NAME=VALUE")]
    set: Vec<String>,
}

impl Args {
    /// What the arguments come to.
    pub fn stage(self) -> Relight {
        let Self { scene, probes, lights, frames, output, indirect, set } = self;
        Relight { scene, probes, lights, frames, indirect, set, output }
    }
}
