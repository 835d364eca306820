//! `reprobe bake-lightfield`.

use reprobe::io::jobs::Shard;
use reprobe::method::light_field_probes::bake::LightFieldBakeParams;
use reprobe::plan::stages::BakeLightfield;
use std::path::PathBuf;

/// Bake light field probes: octahedral maps of distance, normals, radiance, irradiance
///
/// Writes NNNN.exr (distance, normal.X ..., direct light), NNNN_light.exr (radiance of all bounces) and NNNN_ambient.exr (irradiance and
/// the moments of distance); of probes in no grid also octree.json, which of them see a place. Finished probes are kept; blocked ones are
/// left out. inspect-lightfield draws what comes of it.
/// Memory: the scene's, some 30 bytes a texel of all probes, and 380 a texel of one.
#[derive(clap::Args)]
#[command(after_help = "Examples:
  reprobe bake-lightfield room/scene.xml --probes probes.json -o lightfield/
  reprobe bake-lightfield room/scene.xml --probes probes.json -o lightfield/ --size 256 --spp 32 --bounces 4
  reprobe render-path room/scene.xml --path room/path.json --method light-field-probes --probes lightfield/ -o frames/")]
pub struct Args {
    /// Scene: Mitsuba XML or JSON, or glTF
    #[arg(value_name = "SCENE")]
    scene: PathBuf,
    /// The probes, from place-probes
    #[arg(long, value_name = "FILE")]
    probes: PathBuf,
    /// Folder for the probes and set.json
    #[arg(short, long, value_name = "FOLDER")]
    output: PathBuf,
    /// Texels along an edge of a map, a power of two
    #[arg(long, value_name = "N", default_value_t = LightFieldBakeParams::default().size)]
    size: u32,
    /// Samples of direct light a texel
    #[arg(long, value_name = "N", default_value_t = LightFieldBakeParams::default().spp)]
    spp: u32,
    /// Bounces of light that the probes hold; 1 is direct light alone
    #[arg(long, value_name = "N", default_value_t = LightFieldBakeParams::default().bounces)]
    bounces: u32,
    /// Bake probes I, I + N, I + 2N, ... only
    #[arg(long, value_name = "I/N")]
    shard: Option<Shard>,
}

impl Args {
    /// What the arguments come to.
    pub fn stage(self) -> BakeLightfield {
        let Self { scene, probes, output, size, spp, bounces, shard } = self;
        BakeLightfield { scene, probes, output, size: Some(size), spp: Some(spp), bounces: Some(bounces), shard }
    }
}
