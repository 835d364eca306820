//! Seconds that the curvature of a scene takes: `cargo bench --bench curvature -- SCENE...` (default: scenes/room/scene.xml).
//! The aim: a scene of a million triangles in 10 s on 2 cores.

use reprobe::base::progress::Silent;
use reprobe::exchange::LoadOptions;
use reprobe::surface::{CurvatureParams, curvature};
use std::hint::black_box;
use std::path::Path;
use std::time::Instant;

fn main() {
    let mut scenes: Vec<String> = std::env::args().skip(1).filter(|a| !a.starts_with("--")).collect();
    if scenes.is_empty() {
        scenes.push("scenes/room/scene.xml".into());
    }
    for path in &scenes {
        let scene = reprobe::exchange::load(Path::new(path), &LoadOptions::default()).unwrap_or_else(|e| panic!("{e}"));
        let mut seconds: Vec<f64> = (0..5)
            .map(|_| {
                let start = Instant::now();
                black_box(curvature(&scene.geometry, &CurvatureParams::default(), &Silent));
                start.elapsed().as_secs_f64()
            })
            .collect();
        seconds.sort_by(f64::total_cmp);
        let triangles = scene.geometry.triangles.len();
        println!("{path}: {triangles} triangles, {:.3} s (best {:.3}, worst {:.3})", seconds[2], seconds[0], seconds[4]);
    }
}
