//! `reprobe place-probes`.

use reprobe::plan::option::List;
use reprobe::plan::stages::PlaceProbes;
use reprobe::probe::reach::ReachParams;
use std::path::PathBuf;

/// Place probes on a regular grid
///
/// The grid fills a box: the one given by --bounds; or that of the camera path's positions, widened by --margin; or, without
/// either, the free space that the scene's own sensor sees in all directions. Probes inside objects or behind walls are listed
/// as blocked, and are not used.
#[derive(clap::Args)]
#[command(after_help = "Examples:
  reprobe place-probes room/scene.xml -o probes.json
  reprobe place-probes room/scene.xml -o probes.json --grid 4x3x4 --path room/path.json
  reprobe place-probes room/scene.xml -o probes.json --spacing 0.5 --bounds=-2,0.2,-2,2,2.2,2")]
pub struct Args {
    /// Mitsuba scene, XML or JSON
    #[arg(value_name = "SCENE")]
    scene: PathBuf,
    /// The file to write
    #[arg(short, long, value_name = "FILE")]
    output: PathBuf,
    /// Probes along x, y and z [default: 7x6x6]
    #[arg(long, value_name = "XxYxZ", conflicts_with_all = ["spacing", "count"])]
    grid: Option<List<u32, 3, 'x'>>,
    /// About so many probes, evenly spaced
    #[arg(long, value_name = "N", conflicts_with = "spacing")]
    count: Option<u32>,
    /// Distance of neighbours, metres
    #[arg(long, value_name = "M")]
    spacing: Option<f32>,
    /// The box to fill, metres
    #[arg(long, value_name = "x0,y0,z0,x1,y1,z1", conflicts_with = "path", allow_hyphen_values = true)]
    bounds: Option<List<f32, 6, ','>>,
    /// Fill the space that this camera path moves in
    #[arg(long, value_name = "PATH.json")]
    path: Option<PathBuf>,
    /// Widens the box of the camera path, metres
    #[arg(long, value_name = "M", default_value_t = ReachParams::default().margin)]
    margin: f32,
}

impl Args {
    /// What the arguments come to.
    pub fn stage(self) -> PlaceProbes {
        let Self { scene, output, grid, count, spacing, bounds, path, margin } = self;
        PlaceProbes { scene, output, grid, count, spacing, bounds, path, margin: Some(margin) }
    }
}
