//! `reprobe export-gltf`.

use reprobe::plan::stages::ExportGltf;
use std::path::PathBuf;

/// Write a scene with its light map as glTF, for engines and viewers
///
/// One binary file: shapes, materials as metallic-roughness, lights, the camera. The light map lies on the second texture
/// coordinates, as MX_lightmap (irradiance, RGBM): those that a glTF scene came with where they are laid out for a light map
/// (within [0, 1], nothing on top of anything else), else places in the map's own atlas. Viewers that know no light maps see occlusion: ambient occlusion where it is
/// given, else the light map relative to its brightest.
#[derive(clap::Args)]
#[command(after_help = "Examples:
  reprobe export-gltf room/scene.xml --lightmap out/lightmap.exr -o room.glb
  reprobe export-gltf room/scene.xml --lightmap out/lightmap.exr --ao out/ao.exr -o room.glb
  reprobe export-gltf room.glb --lightmap out/lightmap.exr -o lit.glb        in the layout of room.glb's second UV map, if it has one
  reprobe export-gltf room/scene.xml -o room.glb        geometry, materials and lights alone")]
pub struct Args {
    /// Scene: Mitsuba XML or JSON, or glTF
    scene: PathBuf,
    /// Its light map, from bake-lightmap; what is not in it (glass, mirrors) is written without
    #[arg(long, value_name = "FILE.exr")]
    lightmap: Option<PathBuf>,
    /// Its ambient occlusion, from bake-lightmap --ao, for the occlusion texture
    #[arg(long, value_name = "FILE.exr")]
    ao: Option<PathBuf>,
    /// The file to write
    #[arg(short, long, value_name = "FILE.glb")]
    output: PathBuf,
}

impl Args {
    /// What the arguments come to.
    pub fn stage(self) -> ExportGltf {
        let Self { scene, lightmap, ao, output } = self;
        ExportGltf { scene, lightmap, ao, output }
    }
}
