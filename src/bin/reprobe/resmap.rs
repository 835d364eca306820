//! `reprobe resmap`.

use reprobe::io::jobs::Shard;
use reprobe::method::glossy_probes::resmap::{ALPHA_HALF, ResmapParams};
use reprobe::plan::option::Size;
use reprobe::plan::stages::Resmap;
use std::path::PathBuf;

/// Measure how much resolution each direction of each probe deserves
///
/// Smooth materials, large or slanted surfaces and fine geometry get more; diffuse surfaces get nothing. Writes NNNN.exr with
/// the channels m, m_mat, m_size, m_complexity, depth, normal.X, normal.Y, normal.Z, facing. Finished files are kept.
#[derive(clap::Args)]
#[command(after_help = "Examples:
  reprobe resmap room/scene.xml --probes probes.json -o resmap/
  reprobe resmap room/scene.xml --probes probes.json -o resmap/ --size 128x64")]
pub struct Args {
    /// Scene: Mitsuba XML or JSON, or glTF
    #[arg(value_name = "SCENE")]
    scene: PathBuf,
    /// Where the probes stand, from place-probes
    #[arg(long, value_name = "FILE")]
    probes: PathBuf,
    /// Folder for NNNN.exr and set.json
    #[arg(short, long, value_name = "FOLDER")]
    output: PathBuf,
    /// Size of the maps, texels
    #[arg(long, value_name = "WxH", default_value = "256x128")]
    size: Size,
    /// Edge of the DCT's window, texels: 8, 16 or 32
    #[arg(long, value_name = "N", default_value_t = ResmapParams::default().dct_size)]
    dct_size: u32,
    /// Exponent of the DCT's frequency weights
    #[arg(long, value_name = "K", default_value_t = ResmapParams::default().frequency_exponent)]
    frequency_exponent: f32,
    /// Sigma of the blur of m, texels
    #[arg(long, value_name = "SIGMA", default_value_t = ResmapParams::default().blur_sigma)]
    blur_sigma: f32,
    /// Smallest facing cosine that counts
    #[arg(long, value_name = "COS", default_value_t = ResmapParams::default().facing_min)]
    facing_min: f32,
    #[arg(long, value_name = "ALPHA", conflicts_with = "paper",
        help = format!("Roughness alpha that deserves half of a mirror's texels [default: {ALPHA_HALF}]"))]
    alpha_half: Option<f32>,
    /// The paper's text in every choice
    #[arg(long)]
    paper: bool,
    /// Make maps I, I+N, I+2N, ... only; the shard that completes them marks the folder as complete
    #[arg(long, value_name = "I/N")]
    shard: Option<Shard>,
}

impl Args {
    /// What the arguments come to.
    pub fn stage(self) -> Resmap {
        let Self { scene, probes, output, size, dct_size, frequency_exponent, blur_sigma, facing_min, alpha_half, paper, shard } =
            self;
        Resmap {
            scene,
            probes,
            output,
            size: Some(size),
            dct_size: Some(dct_size),
            frequency_exponent: Some(frequency_exponent),
            blur_sigma: Some(blur_sigma),
            facing_min: Some(facing_min),
            alpha_half,
            paper,
            shard,
        }
    }
}
