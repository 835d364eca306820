//! `reprobe render-path`.

use crate::common::parse_bytes;
use clap::builder::{PossibleValue, PossibleValuesParser};
use reprobe::io::jobs::Shard;
use reprobe::method::{FilterChoice, LayerChoice, METHODS};
use reprobe::plan::option::Size;
use reprobe::plan::stages::{Aov, RenderPath};
use reprobe::plan::views::FrameList;
use reprobe::view::denoiser::Kind;
use std::path::PathBuf;

/// Render the frames of a camera path
///
/// An option that the chosen method has no use for is an error. Finished frames in the output are kept.
/// Memory of glossy-probes: the scene's, some 530 bytes a pixel (N x N as many with --supersample N), and 55 a texel of the probes around
/// the camera (8 to 32).
#[derive(clap::Args)]
#[command(after_help = "Examples:
  reprobe render-path room/scene.xml --path room/path.json --probes probes/ --lightmap lightmap.exr --curvature curvature.exr -o frames/
  reprobe render-path room/scene.xml --path room/path.json --probes probes/ --lightmap lightmap.exr --curvature curvature.exr --set rays.per_pixel=24 --denoise -o joined/
  reprobe render-path room/scene.xml --path room/path.json --method path-trace --spp 256 --shard 0/4 -o reference/
  reprobe render-path room/scene.xml --path room/path.json --method path-trace --spp 4 --denoise oidn -o denoised/
  reprobe render-path room/scene.xml --path room/path.json --method lightmap-rt --lightmap lightmap.exr --match-time frames/ -o rays/
  reprobe render-path room/scene.xml --lights lights.json --method path-trace --spp 64 -o evening/
  reprobe render-path room/scene.xml --lights lights.json --method many-light --set bounces=3 -o preview/

A lamp that is carried through a darkened room for two seconds, as lights.json says it (docs/lights.md has all there is):
  {\"fps\": 24, \"scene_lights\": false, \"lights\": [
    {\"type\": \"point\", \"intensity\": [10, 9, 7], \"keyframes\": [
      {\"time\": 0, \"position\": [1, 1.5, 1]}, {\"time\": 2, \"position\": [4, 1.5, 2]}]}]}
Without --path, or with a path of one frame, that camera stays for all frames of the file.")]
pub struct Args {
    /// Scene: Mitsuba XML or JSON, or glTF
    #[arg(value_name = "SCENE")]
    scene: PathBuf,
    /// Camera path [default: one frame from the scene's own sensor]
    #[arg(long, value_name = "PATH.json")]
    path: Option<PathBuf>,
    /// Folder for NNNN.exr and timings.json; finished frames in it are kept
    #[arg(long, short, value_name = "FOLDER")]
    output: PathBuf,
    /// How to render
    #[arg(long, value_parser = methods(), default_value = METHODS[0].name)]
    method: String,
    /// Image size [default: the path's, or the sensor's]
    #[arg(long, value_name = "WxH")]
    size: Option<Size>,
    /// Only these frames of the path
    #[arg(long, value_name = "LIST")]
    frames: Option<FrameList>,
    /// Auxiliary layers (all): the first hit's, and the buffers of glossy-probes' passes
    #[arg(long, value_name = "LAYERS")]
    aov: Option<Aov>,
    /// Render one of N runs of frames only, the I-th from 0, into the folder of the whole
    #[arg(long, value_name = "I/N", conflicts_with_all = ["budget_ms", "match_time"])]
    shard: Option<Shard>,
    #[arg(long, value_name = "LIGHTS.json", help = used_by("lights", "lights, materials and objects that change from frame to frame, see below"))]
    lights: Option<PathBuf>,
    #[arg(long, value_name = "DIR", help = used_by("probes", "the baked probes"))]
    probes: Option<PathBuf>,
    #[arg(long, value_name = "METHOD", help = used_by("diffuse", "diffuse layer of another method, by whose light its own probes are lit \
        anew in every frame, so that --lights changes all light: radiance-probes"))]
    diffuse: Option<String>,
    #[arg(long, value_name = "DIR", help = used_by("diffuse-probes", "the baked probes of that method"))]
    diffuse_probes: Option<PathBuf>,
    #[arg(long, value_name = "NAME=VALUE", help = used_by("diffuse-set", "a parameter of that method, like bounces=8"))]
    diffuse_set: Vec<String>,
    #[arg(long, value_name = "FILE.exr", help = used_by("lightmap", "the diffuse light"))]
    lightmap: Option<PathBuf>,
    #[arg(long, value_name = "FILE.exr", help = used_by("curvature", "curvatures of the scene"))]
    curvature: Option<PathBuf>,
    #[arg(long, value_name = "N", help = used_by("supersample", "N x N rays a pixel through all passes [default: 1]"))]
    supersample: Option<u32>,
    #[arg(long, value_name = "N", help = used_by("spp", "paths a pixel [default: 64]"))]
    spp: Option<u32>,
    #[arg(long, value_name = "N", help = used_by("samples", "taps a pixel, or glossy rays at the first vertex [default: 64, 4]"))]
    samples: Option<u32>,
    #[arg(long, value_name = "WAY", help = used_by("trace", "how maps are searched: two-scale or hi-z [default: hi-z]"))]
    trace: Option<String>,
    #[arg(long, value_name = "N", help = used_by("max-depth", "most scattering vertices of a path [default: the scene's max_depth less one; lightmap-rt: 3]"))]
    max_depth: Option<u32>,
    #[arg(long, value_name = "LAYERS", help = used_by("layers", "all: the image and its layers; full: the image alone, one path a sample [default: all]"))]
    layers: Option<LayerChoice>,
    #[arg(long, value_name = "FILTER", help = used_by("rfilter", "box, or scene: the filter of the scene's film, for the image that Mitsuba \
        would make of it; frames of other methods and references are box-filtered, and only like can be compared with like [default: box]"))]
    rfilter: Option<FilterChoice>,
    #[arg(long, value_name = "DENOISER", require_equals = true, help = used_by("denoise", "take the noise out of the layers: oidn, Intel's Open Image \
        Denoise (pip install pyoidn, or OIDN_DIR=folder); filter, our own [default: oidn where it is found, else filter]"))]
    denoise: Option<Option<Kind>>,
    #[arg(long, value_name = "MS", conflicts_with_all = ["spp", "samples"],
        help = used_by("budget-ms", "choose the samples with which a frame takes about so long, milliseconds"))]
    budget_ms: Option<f64>,
    #[arg(long, value_name = "FRAMES", conflicts_with_all = ["spp", "samples", "budget_ms"],
        help = used_by("match-time", "choose the samples with which a frame takes about as long as those in this folder"))]
    match_time: Option<PathBuf>,
    #[arg(long, value_name = "SIZE", value_parser = parse_bytes,
        help = used_by("gpu-memory", "memory that a GPU may be filled with, like 512M; probes past it are uploaded again [default: 2G]"))]
    gpu_memory: Option<u64>,
    #[arg(long, help = used_by("paper", "the paper's text in every choice"))]
    paper: bool,
    /// Set a parameter of the method (path-trace: of its denoiser), like gather.falloff=4; a wrong name lists them all
    #[arg(long, value_name = "NAME=VALUE")]
    set: Vec<String>,
}

/// The table's methods.
pub fn methods() -> PossibleValuesParser {
    PossibleValuesParser::new(METHODS.iter().map(|m| PossibleValue::new(m.name).help(m.about)))
}

/// Help for an option, after the methods that use it.
fn used_by(option: &str, what: &str) -> String {
    let users: Vec<&str> = METHODS.iter().filter(|m| m.uses(option)).map(|m| m.name).collect();
    format!("{}: {what}", users.join(", "))
}

impl Args {
    /// What the arguments come to.
    pub fn stage(self) -> RenderPath {
        RenderPath {
            scene: self.scene,
            path: self.path,
            lights: self.lights,
            frames: self.frames,
            size: self.size,
            method: Some(self.method),
            probes: self.probes,
            diffuse: self.diffuse,
            diffuse_probes: self.diffuse_probes,
            diffuse_set: self.diffuse_set,
            lightmap: self.lightmap,
            curvature: self.curvature,
            supersample: self.supersample,
            spp: self.spp,
            samples: self.samples,
            trace: self.trace,
            max_depth: self.max_depth,
            layers: self.layers,
            rfilter: self.rfilter,
            denoise: self.denoise,
            budget_ms: self.budget_ms,
            match_time: self.match_time,
            gpu_memory: self.gpu_memory,
            paper: self.paper,
            set: self.set,
            aov: self.aov,
            shard: self.shard,
            output: self.output,
        }
    }
}
