//! `reprobe qhmap`.

use reprobe::io::jobs::Shard;
use reprobe::method::glossy_probes::qhmap::QhmapParams;
use reprobe::plan::option::Size;
use reprobe::plan::stages::Qhmap;
use std::path::PathBuf;

/// Turn resolution maps into parameterisations of the probes
///
/// Writes NNNN.exr (inverse.U, inverse.V: the lat-long coordinate that each texel looks at; derivative.X, derivative.Y) and
/// NNNN_forward.exr (forward.U, forward.V: where each vertex of the lat-long mesh lies in the probe). Finished files are kept.
#[derive(clap::Args)]
#[command(after_help = "Examples:
  reprobe qhmap resmap/ -o qhmap/
  reprobe qhmap resmap/ -o qhmap/ --size 512x256 --epsilon 0.05")]
pub struct Args {
    /// Folder of resolution maps, from resmap
    #[arg(value_name = "RESMAP")]
    resmap: PathBuf,
    /// Folder for NNNN.exr, NNNN_forward.exr and set.json
    #[arg(short, long, value_name = "FOLDER")]
    output: PathBuf,
    /// Size of the probes, texels
    #[arg(long, value_name = "WxH", default_value = "1024x512")]
    size: Size,
    #[arg(long, value_name = "E", help = format!("Added to m, in units of its mean: larger compresses directions without need less [default: {}]", QhmapParams::default().epsilon))]
    epsilon: Option<f32>,
    /// Plain lat-long maps, whatever the resolution maps ask for
    #[arg(long, conflicts_with = "epsilon")]
    lat_long: bool,
    /// Make maps I, I+N, I+2N, ... only; the shard that completes them marks the folder as complete
    #[arg(long, value_name = "I/N")]
    shard: Option<Shard>,
}

impl Args {
    /// What the arguments come to.
    pub fn stage(self) -> Qhmap {
        let Self { resmap, output, size, epsilon, lat_long, shard } = self;
        Qhmap { resmap, output, size: Some(size), epsilon, lat_long, shard }
    }
}
