//! Prints what a scene file holds: `cargo run --example scene_summary -- SCENE.xml`.

use reprobe::exchange::{LoadOptions, load};
use reprobe::scene::Emitter;

fn main() {
    for path in std::env::args().skip(1) {
        let start = std::time::Instant::now();
        match load(path.as_ref(), &LoadOptions::default()) {
            Err(e) => println!("error: {e}"),
            Ok(scene) => {
                let g = &scene.geometry;
                println!("{path}: {:.2} s", start.elapsed().as_secs_f64());
                println!(
                    "  {} triangles, {} vertices, {} shapes, {} materials, {} emitters",
                    g.triangles.len(),
                    g.positions.len(),
                    g.objects.len(),
                    scene.materials.len(),
                    scene.emitters.len()
                );
                let (lower, upper) = g.bounds();
                println!("  from {lower} to {upper}, hash {}", scene.hash);
                for emitter in &scene.emitters {
                    match emitter {
                        Emitter::Area { object, radiance } => {
                            println!(
                                "  area light {} of {:?}",
                                g.objects[*object as usize].name,
                                radiance.eval(glam::Vec2::ZERO)
                            );
                        }
                        Emitter::Envmap { image, scale, .. } => {
                            println!("  envmap of {} x {}, scale {scale}", image.width, image.height);
                        }
                        other => println!("  {other:?}"),
                    }
                }
                println!("  {:?}", scene.sensor);
                for warning in &scene.warnings {
                    println!("  warning: {warning}");
                }
            }
        }
    }
}
