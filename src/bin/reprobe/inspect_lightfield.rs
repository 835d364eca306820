//! `reprobe inspect-lightfield`.

use reprobe::method::light_field_probes::march::Search;
use reprobe::plan::option::{List, Size};
use reprobe::plan::stages::InspectLightfield;
use std::path::PathBuf;

/// Draw what a light field probe holds, or a ray's way through the probes
///
/// With --probe: the octahedral maps of one probe, side by side: radiance, distance, normals, irradiance, mean distance. +Y is in
/// the middle of a map, -Y in its corners, +X at the right and +Z below.
///
/// With --pixel: the mirror ray of what a frame shows at a pixel, or the view's own ray where the surface there is not glossy. The scene from
/// above and from the side has the probes, the stretch that each asked one follows, where it loses the ray, and the true hit; beside it are
/// the maps of distance of the probes that were asked, with the ray on them. A line a probe says from where and to where along the ray it was
/// followed, in metres.
#[derive(clap::Args)]
#[command(after_help = "Examples:
  reprobe inspect-lightfield room/scene.xml --probes lightfield/ --probe 3 -o probe.png
  reprobe inspect-lightfield room/scene.xml --probes lightfield/ --probe 3 --exposure 2 -o probe.png
  reprobe inspect-lightfield room/scene.xml --probes lightfield/ --path room/path.json --frame 3 --pixel 200,100 -o way.png
  reprobe inspect-lightfield room/scene.xml --probes lightfield/ --pixel 200,100 --trace two-scale -o way.png --json")]
pub struct Args {
    /// Mitsuba scene, XML or JSON
    #[arg(value_name = "SCENE")]
    scene: PathBuf,
    /// The probes, from bake-lightfield
    #[arg(long, value_name = "DIR")]
    probes: PathBuf,
    /// The picture to write
    #[arg(short, long, value_name = "FILE.png")]
    output: PathBuf,
    /// Draw the maps of this probe
    #[arg(long, value_name = "N", conflicts_with_all = ["pixel", "path", "frame", "size", "trace"], required_unless_present = "pixel")]
    probe: Option<u32>,
    /// --probe: stops by which colours are brightened [default: 0]
    #[arg(long, value_name = "STOPS", allow_negative_numbers = true, conflicts_with = "pixel")]
    exposure: Option<f32>,
    /// Draw the way of this pixel's ray: column and row from 0, from the upper left corner
    #[arg(long, value_name = "X,Y")]
    pixel: Option<List<u32, 2, ','>>,
    /// --pixel: camera path of the frame [default: the scene's own sensor]
    #[arg(long, value_name = "PATH.json")]
    path: Option<PathBuf>,
    /// --pixel: frame of the path [default: 0]
    #[arg(long, value_name = "F")]
    frame: Option<u32>,
    /// --pixel: size of the frame [default: the path's, or the sensor's]
    #[arg(long, value_name = "WxH")]
    size: Option<Size>,
    /// --pixel: how a probe's map is searched: two-scale or hi-z [default: hi-z]
    #[arg(long, value_name = "SEARCH")]
    trace: Option<Search>,
}

impl Args {
    /// What the arguments come to.
    pub fn stage(self) -> InspectLightfield {
        let Self { scene, probes, output, probe, exposure, pixel, path, frame, size, trace } = self;
        InspectLightfield { scene, probes, probe, exposure, pixel, path, frame, size, trace, output }
    }
}
