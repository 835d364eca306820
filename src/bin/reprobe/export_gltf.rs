//! `reprobe export-gltf`.

use reprobe::plan::stages::ExportGltf;
use std::path::PathBuf;

/// Write a scene with its light map as glTF, for engines and viewers
///
/// One binary file: shapes, materials as metallic-roughness, lights, the camera. The light map lies on the second texture
/// coordinates, as MX_lightmap (irradiance, RGBM), and relative to its brightest as occlusion, for viewers that know no light maps.
#[derive(clap::Args)]
#[command(after_help = "Examples:
  reprobe export-gltf room/scene.xml --lightmap out/lightmap.exr -o room.glb
  reprobe export-gltf room/scene.xml -o room.glb        geometry, materials and lights alone")]
pub struct Args {
    /// Scene: Mitsuba XML or JSON, or glTF
    scene: PathBuf,
    /// Its light map, from bake-lightmap; transmissive shapes are left out then, as in the map
    #[arg(long, value_name = "FILE.exr")]
    lightmap: Option<PathBuf>,
    /// The file to write
    #[arg(short, long, value_name = "FILE.glb")]
    output: PathBuf,
}

impl Args {
    /// What the arguments come to.
    pub fn stage(self) -> ExportGltf {
        let Self { scene, lightmap, output } = self;
        ExportGltf { scene, lightmap, output }
    }
}
