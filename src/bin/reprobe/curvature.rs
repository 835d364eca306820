//! `reprobe curvature`.

use crate::common::{Common, Outcome};
use reprobe::io::Provenance;
use reprobe::surface::{CurvatureParams, curvature, curvature_file};
use std::path::PathBuf;
use std::time::Instant;

/// Estimates the principal curvatures at every vertex
#[derive(clap::Args)]
pub struct Args {
    /// Mitsuba scene (XML or JSON)
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

pub fn run(args: &Args, common: &Common) -> anyhow::Result<Outcome> {
    if !(0.0..=90.0).contains(&args.regularize) {
        anyhow::bail!("--regularize {}: expected 0 to 90 degrees", args.regularize);
    }
    let mut params = CurvatureParams { regularize_degrees: args.regularize, ..CurvatureParams::default() };
    if args.no_tessellation {
        params.tessellation.max_triangles = 0;
    }
    let world = common.opaque_world(&args.scene)?;
    let scene = &world.scene;
    let start = Instant::now();
    let map = curvature(&scene.geometry, &params, &common.progress());
    let seconds = start.elapsed().as_secs_f64();
    curvature_file::write(&map, &args.output, Provenance::new("curvature", &scene.hash, common.seed, &params))?;
    let curved = map.k1.iter().zip(&map.k2).filter(|(a, b)| **a != 0.0 || **b != 0.0).count();
    let (vertices, triangles) = (map.k1.len(), scene.geometry.triangles.len());
    Ok(Outcome {
        summary: format!("{}: {vertices} vertices, {curved} of them curved, in {seconds:.2} s", args.output.display()),
        figures: serde_json::json!({"vertices": vertices, "triangles": triangles, "curved": curved, "seconds": seconds}),
        check_failed: false,
    })
}
