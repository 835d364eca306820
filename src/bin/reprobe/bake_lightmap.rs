//! `reprobe bake-lightmap`.

use reprobe::io::jobs::Shard;
use reprobe::lightmap::{AtlasParams, LightMapParams};
use reprobe::plan::stages::{AO_DISTANCE, BakeLightmap};
use std::path::PathBuf;

/// Bake the diffuse light map
///
/// Each texel becomes the light that enters the diffuse layer there; albedo stays out of it, so that textures keep their full
/// resolution. Surfaces without a diffuse lobe have no texels. Finished blocks are kept in OUTPUT.parts until the map is whole: a
/// killed bake goes on from them. Memory: the scene's, and some 300 bytes a texel.
#[derive(clap::Args)]
#[command(after_help = "Examples:
  reprobe bake-lightmap room/scene.xml -o lightmap.exr --spp 512
  reprobe bake-lightmap room/scene.xml -o lightmap.exr --spp 512 --shard 0/4
  reprobe bake-lightmap room/scene.xml -o lightmap.exr --spp 16 --denoise
  reprobe bake-lightmap room/scene.xml -o lightmap.exr --spp 256 --error 0.1 --first-spp 8 --denoise
  reprobe bake-lightmap room/scene.xml -o ao.exr --ao=0.5 --spp 64")]
pub struct Args {
    /// Scene: Mitsuba XML or JSON, or glTF
    #[arg(value_name = "SCENE")]
    scene: PathBuf,
    /// The light map to write
    #[arg(short, long, value_name = "FILE")]
    output: PathBuf,
    /// Samples a texel; the most, where --error is given
    #[arg(long, value_name = "N", default_value_t = LightMapParams::default().spp, value_parser = clap::value_parser!(u32).range(1..=1 << 24))]
    spp: u32,
    /// Give each texel as many samples as bring its standard error down to E of its light, by what its first 16 and those around them tell; of
    /// dim light, below that of a white wall of radiance 0.01, less is asked
    #[arg(long, value_name = "E")]
    error: Option<f32>,
    /// Edge of a texel, metres, in place of --texels
    #[arg(long, value_name = "M")]
    texel: Option<f32>,
    #[arg(long, value_name = "N", help = format!("About how many texels the surfaces get in all [default: {}]", AtlasParams::default().budget), conflicts_with = "texel", value_parser = clap::value_parser!(u32).range(1..=1 << 26))]
    texels: Option<u32>,
    /// Samples a texel of a first pass, from whose map the paths of the second read diffuse light; 0: trace every path in full
    #[arg(long, value_name = "N", default_value_t = LightMapParams::default().first_spp, value_parser = clap::value_parser!(u32).range(0..=1 << 24))]
    first_spp: u32,
    /// Take the noise out of the finished map, by a filter along the surfaces that keeps what differs by more than the noise;
    /// the map of a first pass keeps its own. With --shard, the one that completes the blocks does it
    #[arg(long)]
    denoise: bool,
    #[arg(long, value_name = "METRES", require_equals = true, conflicts_with = "first_spp",
        help = format!("Ambient occlusion in place of light, for export-gltf and other programs: each texel becomes the cosine-weighted share of \
            directions in which nothing lies within METRES [default: {AO_DISTANCE}]"))]
    ao: Option<Option<f32>>,
    /// Bake blocks I, I+N, I+2N, ... only; the shard that completes them writes the map
    #[arg(long, value_name = "I/N")]
    shard: Option<Shard>,
}

impl Args {
    /// What the arguments come to.
    pub fn stage(self) -> BakeLightmap {
        let Self { scene, output, spp, error, texel, texels, first_spp, denoise, ao, shard } = self;
        BakeLightmap { scene, output, spp: Some(spp), error, texel, texels, first_spp: Some(first_spp), denoise, ao, shard }
    }
}
