//! `reprobe place-probes`.

use crate::common::{Common, Outcome};
use anyhow::bail;
use glam::Vec3;
use reprobe::io::Provenance;
use reprobe::probe::placement::{Density, ProbeGrid};
use reprobe::probe::reach::{ReachParams, blocked, reach};
use reprobe::scene::Scene;
use reprobe::scene::camera_path::load as load_path;
use serde_json::json;
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
    #[arg(long, value_name = "XxYxZ", value_parser = parse_grid, conflicts_with_all = ["spacing", "count"])]
    grid: Option<[u32; 3]>,
    /// About so many probes, evenly spaced
    #[arg(long, value_name = "N", conflicts_with = "spacing")]
    count: Option<u32>,
    /// Distance of neighbours, metres
    #[arg(long, value_name = "M")]
    spacing: Option<f32>,
    /// The box to fill, metres
    #[arg(long, value_name = "x0,y0,z0,x1,y1,z1", value_parser = parse_bounds, conflicts_with = "path", allow_hyphen_values = true)]
    bounds: Option<[f32; 6]>,
    /// Fill the space that this camera path moves in
    #[arg(long, value_name = "PATH.json")]
    path: Option<PathBuf>,
    /// Widens the box of the camera path, metres
    #[arg(long, value_name = "M", default_value_t = ReachParams::default().margin)]
    margin: f32,
}

fn parse_grid(text: &str) -> Result<[u32; 3], String> {
    let parts: Vec<u32> = text.split('x').map(str::parse).collect::<Result<_, _>>().unwrap_or_default();
    parts.try_into().map_err(|_| format!("\"{text}\": expected three counts, like 7x6x6"))
}

fn parse_bounds(text: &str) -> Result<[f32; 6], String> {
    let parts: Vec<f32> = text.split(',').map(|s| s.trim().parse()).collect::<Result<_, _>>().unwrap_or_default();
    let bounds: Option<[f32; 6]> = parts.try_into().ok();
    bounds
        .filter(|b| b.iter().all(|x| x.is_finite()) && (0..3).all(|i| b[i] <= b[i + 3]))
        .ok_or_else(|| format!("\"{text}\": expected x0,y0,z0,x1,y1,z1, the lower corner first, like -2,0,-2,2,2.5,2"))
}

pub fn run(args: &Args, common: &Common) -> anyhow::Result<Outcome> {
    if !(args.margin.is_finite() && args.margin >= 0.0) {
        bail!("--margin {}: expected metres, not negative", args.margin);
    }
    let density = match (args.spacing, args.grid, args.count) {
        (Some(s), ..) => Density::Spacing(s),
        (_, Some(counts), _) => Density::Counts(counts),
        (.., Some(n)) => Density::Count(n),
        _ => Density::default(),
    };
    let world = common.opaque_world(&args.scene)?;
    let cameras = cameras(args, &world.scene, common)?;
    let params = ReachParams { margin: args.margin, ..ReachParams::default() };
    let (lower, upper) = match args.bounds {
        Some([x0, y0, z0, x1, y1, z1]) => (Vec3::new(x0, y0, z0), Vec3::new(x1, y1, z1)),
        None if cameras.is_empty() => bail!("{}: has no sensor; give --bounds or --path", args.scene.display()),
        None => reach(&world, &cameras, &params)?,
    };
    let parameters = json!({
        "density": density, "bounds": [lower.to_array(), upper.to_array()], "reach": args.bounds.is_none().then_some(params),
        "cameras": cameras.iter().map(|c| c.to_array()).collect::<Vec<_>>(),
    });
    let provenance = Provenance::new("place-probes", &world.scene.hash, common.seed, &parameters);
    let mut grid = ProbeGrid::in_box(lower, upper, density, provenance)?;
    if !cameras.is_empty() {
        grid.blocked = blocked(&world, &grid, &cameras);
    }
    grid.write(&args.output)?;
    let ([nx, ny, nz], [sx, sy, sz]) = (grid.counts, grid.spacing);
    Ok(Outcome {
        summary: format!(
            "{}: {} probes ({nx}x{ny}x{nz}), {sx:.2} x {sy:.2} x {sz:.2} m apart, from {lower:.2} to {upper:.2}, {} of them blocked",
            args.output.display(),
            grid.len(),
            grid.blocked.len(),
        ),
        figures: json!({
            "count": grid.len(), "counts": grid.counts, "spacing": grid.spacing, "blocked": grid.blocked.len(),
            "bounds": [lower.to_array(), upper.to_array()],
        }),
        ..Outcome::default()
    })
}

/// Where the camera stands: along the path, or the scene's own sensor.
fn cameras(args: &Args, scene: &Scene, common: &Common) -> anyhow::Result<Vec<Vec3>> {
    Ok(match &args.path {
        Some(path) => load_path(path, scene.sensor.as_ref(), common.unit_scale)?.iter().map(|c| c.position()).collect(),
        None => scene.sensor.iter().map(|c| c.position()).collect(),
    })
}
