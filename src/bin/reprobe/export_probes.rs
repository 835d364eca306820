//! `reprobe export-probes`.

use reprobe::export::probes::cube::Mirror;
use reprobe::plan::stages::export_probes::SIZE;
use reprobe::plan::stages::{ExportProbes, Format};
use std::path::PathBuf;

/// Write probes as textures for engines: reflection cubes, diffuse cubes, an irradiance volume
///
/// NNNN.ktx2 is a cube of reflections whose levels are blurred by GGX, level l of L for a roughness of l / (L - 1); NNNN_diffuse.ktx2 has
/// irradiance over π. Probes in a grid also make volume.ktx2, ambient cubes as Bevy's IrradianceVolume reads them. probes.json says
/// where all of it stands, and has the diffuse light in spherical harmonics of the first order (1, y, z, x). Half floats, linear.
/// Lamps and windows that emit light are dark in the cubes, as in light field probes: engines add their light by themselves.
///
/// Light field probes hold all light. Glossy probes hold what glossy surfaces send to them, and sparse radiance probes none of a direction: these
/// see the rest by a light map of the scene.
#[derive(clap::Args)]
#[command(after_help = "Examples:
  reprobe place-probes room/scene.xml --path room/path.json --grid 4x3x4 -o probes.json
  reprobe bake-lightfield room/scene.xml --probes probes.json -o lightfield/
  reprobe export-probes lightfield/ --format ktx2 -o engine/
  reprobe export-probes lightfield/ -o three/ --size 256 --mirror x
  reprobe export-probes probes/ --scene room/scene.xml --lightmap lightmap.exr -o engine/")]
pub struct Args {
    /// Folder of probes, from bake-lightfield, bake-probes or bake-transport
    #[arg(value_name = "PROBES")]
    probes: PathBuf,
    /// The scene, for probes that do not hold all light
    #[arg(long, value_name = "SCENE", requires = "lightmap")]
    scene: Option<PathBuf>,
    /// Its light map, from bake-lightmap or relight
    #[arg(long, value_name = "FILE.exr", requires = "scene")]
    lightmap: Option<PathBuf>,
    /// Folder for the textures and probes.json
    #[arg(short, long, value_name = "FOLDER")]
    output: PathBuf,
    /// Format of the textures: ktx2
    #[arg(long, value_name = "FORMAT", default_value_t = Format::default())]
    format: Format,
    /// Texels along an edge of a cube of reflections, a power of two
    #[arg(long, value_name = "N", default_value_t = SIZE)]
    size: u32,
    /// Which axis of the cubes is turned round: z for Bevy, x for three.js, none for lookups along world directions
    #[arg(long, value_name = "AXIS", default_value_t = Mirror::default())]
    mirror: Mirror,
}

impl Args {
    /// What the arguments come to.
    pub fn stage(self) -> ExportProbes {
        let Self { probes, scene, lightmap, output, format, size, mirror } = self;
        ExportProbes { probes, scene, lightmap, output, format: Some(format), size: Some(size), mirror: Some(mirror) }
    }
}
