//! `reprobe bake-probes`.

use reprobe::io::jobs::Shard;
use reprobe::method::glossy_probes::bake::ProbeBakeParams;
use reprobe::plan::option::Size;
use reprobe::plan::stages::BakeProbes;
use reprobe::plan::views::FrameList;
use std::path::PathBuf;

/// Bake the glossy light probes
///
/// Each probe becomes NNNN.exr: its glossy colour at reduced roughness, the reflector (triangle and barycentrics), and what a
/// mirror there would show. Finished probes are kept when the command runs again; set.json is written when all are there.
/// Memory: the scene's, and some 210 bytes a texel of one probe, however many there are.
#[derive(clap::Args)]
#[command(after_help = "Examples:
  reprobe bake-probes room/scene.xml --probes probes.json --qhmap qhmap/ -o probes/ --spp 256
  reprobe bake-probes room/scene.xml --probes probes.json --qhmap qhmap/ -o probes/ --shard 0/4
  reprobe bake-probes room/scene.xml --probes probes.json --qhmap qhmap/ -o probes/ --lightmap lightmap.exr --spp 32 --denoise
  reprobe bake-probes room/scene.xml --probes probes.json --qhmap qhmap/ -o probes/ --lightmap lightmap.exr --error 0.05 --spp 512
  reprobe bake-probes room/scene.xml --probes probes.json --qhmap qhmap/ -o probes/ --spp 128 \\
      --for-path path.json --curvature curvature.exr --size 480x270 --supersample 2")]
pub struct Args {
    /// Scene: Mitsuba XML or JSON, or glTF
    scene: PathBuf,
    /// Probe positions, from place-probes
    #[arg(long, value_name = "FILE")]
    probes: PathBuf,
    /// Parameterisations, from qhmap
    #[arg(long, value_name = "DIR")]
    qhmap: PathBuf,
    /// Folder of baked probes to write
    #[arg(short, long, value_name = "DIR")]
    output: PathBuf,
    /// Paths a texel; the most of them with --error
    #[arg(long, value_name = "N", default_value_t = ProbeBakeParams::default().spp)]
    spp: u32,
    /// Trace a texel until its standard error is this fraction of its luminance, by the variance of its first 8 paths and its neighbours'
    #[arg(long, value_name = "E")]
    error: Option<f32>,
    /// Factor on roughness at the first glossy vertex [default: 1; with --paper 0.5]
    #[arg(long, value_name = "S")]
    roughness_scale: Option<f32>,
    /// Take the noise out of the texels, by a filter along each reflector that keeps what differs by more than the noise. For probes
    /// that are looked at or handed on: frames average the noise of few paths by themselves
    #[arg(long)]
    denoise: bool,
    /// Spread a texel's paths over its solid angle, in place of sending all through its centre
    #[arg(long)]
    spread: bool,
    /// Read diffuse light from this light map, in place of tracing on from diffuse surfaces: faster, less noise, slightly biased
    #[arg(long, value_name = "FILE")]
    lightmap: Option<PathBuf>,
    /// Bake probes I, I+N, I+2N, ... only
    #[arg(long, value_name = "I/N")]
    shard: Option<Shard>,
    /// Bake only the texels that the views of this camera path use
    #[arg(long, value_name = "PATH.json", requires = "curvature")]
    for_path: Option<PathBuf>,
    /// Curvatures, for --for-path
    #[arg(long, value_name = "FILE")]
    curvature: Option<PathBuf>,
    /// Size of the views, for --for-path [default: the path's]
    #[arg(long, value_name = "WxH")]
    size: Option<Size>,
    /// Frames of the path, for --for-path [default: all]
    #[arg(long, value_name = "LIST")]
    frames: Option<FrameList>,
    /// Rays a pixel along one side, for --for-path [default: 1]
    #[arg(long, value_name = "N")]
    supersample: Option<u32>,
    /// The paper's roughness factor, and its choice of texels with --for-path
    #[arg(long)]
    paper: bool,
    /// Choose texels with this parameter of the gather, as render-path's --set, for --for-path
    #[arg(long = "set", value_name = "NAME=VALUE")]
    set: Vec<String>,
    /// Also bake the texels of another choice, with these parameters of the gather, for --for-path; `paper` for those of
    /// --paper; may be repeated
    #[arg(long, value_name = "[paper,]NAME=VALUE,...", requires = "for_path")]
    alternative: Vec<String>,
}

impl Args {
    /// What the arguments come to.
    pub fn stage(self) -> BakeProbes {
        BakeProbes {
            scene: self.scene,
            probes: self.probes,
            qhmap: self.qhmap,
            output: self.output,
            spp: Some(self.spp),
            error: self.error,
            roughness_scale: self.roughness_scale,
            denoise: self.denoise,
            spread: self.spread,
            lightmap: self.lightmap,
            shard: self.shard,
            for_path: self.for_path,
            curvature: self.curvature,
            size: self.size,
            frames: self.frames,
            supersample: self.supersample,
            paper: self.paper,
            set: self.set,
            alternative: self.alternative,
        }
    }
}
