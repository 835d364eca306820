//! `reprobe curvature`.

use reprobe::plan::stages::Curvature;
use reprobe::surface::CurvatureParams;
use std::path::PathBuf;

/// Estimate the principal curvatures at every vertex
///
/// Reflections are reprojected by the curvature of what mirrors them.
#[derive(clap::Args)]
#[command(after_help = "Examples:
  reprobe curvature room/scene.xml -o curvature.exr
  reprobe curvature room/scene.xml -o curvature.exr --regularize 30 --no-tessellation
  reprobe view curvature.exr --layer k1 -o k1.png")]
pub struct Args {
    /// Scene: Mitsuba XML or JSON, or glTF
    scene: PathBuf,
    /// The table to write
    #[arg(short, long, value_name = "FILE.exr")]
    output: PathBuf,
    /// Average with neighbours whose normals differ by less than this
    #[arg(long, value_name = "DEGREES", default_value_t = CurvatureParams::default().regularize_degrees)]
    regularize: f32,
    /// Leave coarse flat parts as they are
    #[arg(long)]
    no_tessellation: bool,
}

impl Args {
    /// What the arguments come to.
    pub fn stage(self) -> Curvature {
        let Self { scene, output, regularize, no_tessellation } = self;
        Curvature { scene, output, regularize: Some(regularize), no_tessellation }
    }
}
