//! `reprobe inspect-lightfield`.

use reprobe::method::light_field_probes::march::Search;
use reprobe::plan::option::{List, Size};
use reprobe::plan::stages::InspectLightfield;
use std::path::PathBuf;

/// Draw what a light field probe holds, a ray's way through the probes, or what all rays meet
///
/// With --probe: the octahedral maps of one probe, side by side: radiance, distance, normals, irradiance, mean distance. +Y is in
/// the middle of a map, -Y in its corners, +X at the right and +Z below.
///
/// With --pixel: the mirror ray of what a frame shows at a pixel, or the view's own ray where the surface there is not glossy. The scene from
/// above and from the side has the probes, the stretch that each asked one follows, where it loses the ray, and the true hit; beside it are
/// the maps of distance of the probes that were asked, with the ray on them. A line a probe says from where and to where along the ray it was
/// followed, in metres.
///
/// With --hits: rays along the glossy lobes of a frame, eight a pixel, held against the scene. The frame's pixels say whose rays meet the right
/// place, another one, nothing, or get lost; the shares of all rays say how well the probes serve, without a reference. It also says where the
/// two searches differ, and how long each takes.
#[derive(clap::Args)]
#[command(after_help = "Examples:
  reprobe inspect-lightfield room/scene.xml --probes lightfield/ --probe 3 -o probe.png
  reprobe inspect-lightfield room/scene.xml --probes lightfield/ --probe 3 --exposure 2 -o probe.png
  reprobe inspect-lightfield room/scene.xml --probes lightfield/ --path room/path.json --frame 3 --pixel 200,100 -o way.png
  reprobe inspect-lightfield room/scene.xml --probes lightfield/ --pixel 200,100 --trace two-scale -o way.png --json
  reprobe inspect-lightfield room/scene.xml --probes lightfield/ --path room/path.json --frame 3 --hits -o hits.png")]
pub struct Args {
    /// Scene: Mitsuba XML or JSON, or glTF
    #[arg(value_name = "SCENE")]
    scene: PathBuf,
    /// The probes, from bake-lightfield
    #[arg(long, value_name = "DIR")]
    probes: PathBuf,
    /// The picture to write
    #[arg(short, long, value_name = "FILE.png")]
    output: PathBuf,
    /// Draw the maps of this probe
    #[arg(long, value_name = "N", conflicts_with_all = ["pixel", "hits", "path", "frame", "size", "trace"], required_unless_present_any = ["pixel", "hits"])]
    probe: Option<u32>,
    /// --probe: stops by which colours are brightened [default: 0]
    #[arg(long, value_name = "STOPS", allow_negative_numbers = true, conflicts_with_all = ["pixel", "hits"])]
    exposure: Option<f32>,
    /// Draw what the rays of all glossy pixels meet
    #[arg(long, conflicts_with = "pixel")]
    hits: bool,
    /// Draw the way of this pixel's ray: column and row from 0, from the upper left corner
    #[arg(long, value_name = "X,Y")]
    pixel: Option<List<u32, 2, ','>>,
    /// --pixel, --hits: camera path of the frame [default: the scene's own sensor]
    #[arg(long, value_name = "PATH.json")]
    path: Option<PathBuf>,
    /// --pixel, --hits: frame of the path [default: 0]
    #[arg(long, value_name = "F")]
    frame: Option<u32>,
    /// --pixel, --hits: size of the frame [default: the path's, or the sensor's]
    #[arg(long, value_name = "WxH")]
    size: Option<Size>,
    /// --pixel, --hits: how a probe's map is searched: two-scale or hi-z [default: hi-z]
    #[arg(long, value_name = "SEARCH")]
    trace: Option<Search>,
}

impl Args {
    /// What the arguments come to.
    pub fn stage(self) -> InspectLightfield {
        let Self { scene, probes, output, probe, exposure, hits, pixel, path, frame, size, trace } = self;
        InspectLightfield { scene, probes, probe, exposure, hits, pixel, path, frame, size, trace, output }
    }
}
