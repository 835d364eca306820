//! `reprobe inspect-transport`.

use reprobe::plan::stages::InspectTransport;
use std::path::PathBuf;

/// Draw where radiance probes lose light, whatever the lights: on the atlas, and in a view
///
/// Light of any kind that comes to a texel is taken to the probes and back: what is missing then, as a share of all of it, is what the
/// picture shows. place-probes --method voxel --refine-by puts more probes there.
#[derive(clap::Args)]
#[command(after_help = "Examples:
  reprobe inspect-transport room/scene.xml --probes transport/ -o lost.png
  reprobe inspect-transport room/scene.xml --probes transport/ --path room/path.json --frame 3 --receivers 20000 -o lost.png
  reprobe place-probes room/scene.xml --method voxel --count 60 --refine-by transport/ -o better.json")]
pub struct Args {
    /// Scene: Mitsuba XML or JSON, or glTF
    #[arg(value_name = "SCENE")]
    scene: PathBuf,
    /// The operator, from bake-transport
    #[arg(long, value_name = "FOLDER")]
    probes: PathBuf,
    /// The picture to write
    #[arg(short, long, value_name = "FILE.png")]
    output: PathBuf,
    /// About how many texels are asked
    #[arg(long, value_name = "N")]
    receivers: Option<u32>,
    /// Camera path; the scene's own sensor without it
    #[arg(long, value_name = "PATH.json")]
    path: Option<PathBuf>,
    /// Frame of the path
    #[arg(long, value_name = "N")]
    frame: Option<u32>,
    /// Also write what each of these texels loses, with its place
    #[arg(long, value_name = "FILE.json")]
    table: Option<PathBuf>,
}

impl Args {
    /// What the arguments come to.
    pub fn stage(self) -> InspectTransport {
        let Self { scene, probes, output, receivers, path, frame, table } = self;
        InspectTransport { scene, probes, receivers, path, frame, table, output }
    }
}
