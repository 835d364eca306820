//! `reprobe place-probes`.

use reprobe::plan::option::List;
use reprobe::plan::stages::PlaceProbes;
use reprobe::probe::placement::Placement;
use std::path::PathBuf;

/// Place probes on a regular grid, or where a scene's shape asks for them
///
/// A grid (--method grid) fills a box: the one given by --bounds; or that of the camera path's positions, widened by --margin; or, without
/// either, the free space that the scene's own sensor sees in all directions. Probes inside objects or behind walls are listed
/// as blocked, and are not used.
///
/// The other methods look for places in the free space of all that cameras see, or of --bounds: what can be walked to from there. sdf takes those that are
/// equally far from several surfaces, by a distance field; medial-axis the middles of balls that touch several surfaces. Of these,
/// probes are chosen until they see enough (--coverage), those first that see most of what no other sees; or so many (--count) that all
/// surfaces are seen well by one of them, from near and not at a slant. --refine moves them to where they see more. voxel spreads probes evenly
/// through the empty space next to surfaces, as many as a grid of --spacing has points or --count, with one support radius: within it, a
/// point on a surface has ten probes to interpolate on average. Every stage takes such sets in the place of a grid.
#[derive(clap::Args)]
#[command(after_help = "Examples:
  reprobe place-probes room/scene.xml -o probes.json
  reprobe place-probes room/scene.xml -o probes.json --grid 4x3x4 --path room/path.json
  reprobe place-probes room/scene.xml -o probes.json --spacing 0.5 --bounds=-2,0.2,-2,2,2.2,2
  reprobe place-probes room/scene.xml -o probes.json --method sdf --coverage 0.999 --picture plan.png
  reprobe place-probes room/scene.xml -o probes.json --method medial-axis --count 24 --refine 20
  reprobe place-probes room/scene.xml -o probes.json --method voxel --spacing 0.7 --path room/path.json --picture plan.png
  reprobe place-probes room/scene.xml -o probes.json --path room/path.json --grid 4x3x4 --coverage-picture coverage.png")]
pub struct Args {
    /// Scene: Mitsuba XML or JSON, or glTF
    #[arg(value_name = "SCENE")]
    scene: PathBuf,
    /// The file to write
    #[arg(short, long, value_name = "FILE")]
    output: PathBuf,
    /// How to place them: grid, sdf, medial-axis or voxel [default: grid]
    #[arg(long, value_name = "METHOD")]
    method: Option<Placement>,
    /// Probes along x, y and z [default: 7x6x6]
    #[arg(long, value_name = "XxYxZ", conflicts_with_all = ["spacing", "count"])]
    grid: Option<List<u32, 3, 'x'>>,
    /// About so many probes, evenly spaced; of the other methods, so many [default of voxel: 200]
    #[arg(long, value_name = "N", conflicts_with = "spacing")]
    count: Option<u32>,
    /// grid, voxel: distance of neighbours, metres; of voxel, as many probes as a grid of it has
    #[arg(long, value_name = "M")]
    spacing: Option<f32>,
    /// sdf, medial-axis: share of the reachable surfaces that probes are to see [default: 0.999, or what --count sees]
    #[arg(long, value_name = "SHARE")]
    coverage: Option<f64>,
    /// sdf, medial-axis: passes over all probes that move them to where they see more
    #[arg(long, value_name = "N")]
    refine: Option<u32>,
    /// voxel: more probes where this transport of other probes, from bake-transport, loses light, and fewer elsewhere
    #[arg(long, value_name = "FOLDER")]
    refine_by: Option<PathBuf>,
    /// The box to fill, metres
    #[arg(long, value_name = "x0,y0,z0,x1,y1,z1", conflicts_with = "path", allow_hyphen_values = true)]
    bounds: Option<List<f32, 6, ','>>,
    /// Fill the space that this camera path moves in; of the other methods, that its cameras see
    #[arg(long, value_name = "PATH.json")]
    path: Option<PathBuf>,
    /// grid: widens the box of the camera path, metres [default: 0.5]
    #[arg(long, value_name = "M")]
    margin: Option<f32>,
    /// Draw the probes in the scene from above and from the side; magenta is what none of them sees
    #[arg(long, value_name = "FILE.png")]
    picture: Option<PathBuf>,
    /// Draw how many probes see each place: on the surfaces' atlas, and in the view of the path's first camera, or the sensor's; magenta is
    /// what none of them sees
    #[arg(long, value_name = "FILE.png")]
    coverage_picture: Option<PathBuf>,
}

impl Args {
    /// What the arguments come to.
    pub fn stage(self) -> PlaceProbes {
        let Self {
            scene,
            output,
            method,
            grid,
            count,
            spacing,
            coverage,
            refine,
            refine_by,
            bounds,
            path,
            margin,
            picture,
            coverage_picture,
        } = self;
        PlaceProbes {
            scene,
            method,
            grid,
            count,
            spacing,
            coverage,
            refine,
            refine_by,
            bounds,
            path,
            margin,
            picture,
            coverage_picture,
            output,
        }
    }
}
