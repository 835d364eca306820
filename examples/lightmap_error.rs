//! How far light maps are from a reference, over the surfaces of their scene: points uniform by area, on both sides of each triangle.
//! `cargo run --example lightmap_error SCENE REFERENCE.exr MAP.exr ...`
//!
//! *Relative* is the root mean square of (x - r) / (r + a twentieth of r's mean), over red, green and blue; *absolute* that of x - r over
//! r's mean; the figure in brackets is the relative one without the worst 1 %; *median* its median. Points that the reference leaves black count for nothing: nobody sees them.

use glam::Vec2;
use reprobe::base::math::{Rgb, hash_words, luminance};
use reprobe::exchange::LoadOptions;
use reprobe::lightmap::LightMap;
use reprobe::transport::{Sampler, World};
use std::path::Path;

/// Points in all, about.
const POINTS: f64 = 2e6;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let [scene, reference, maps @ ..] = args.as_slice() else { return Err("SCENE REFERENCE.exr MAP.exr ...".into()) };
    let (world, _) = World::opaque(reprobe::exchange::load(Path::new(scene), &LoadOptions::default())?);
    let load = |file: &String| LightMap::load(Path::new(file), &world.scene);
    let reference = load(reference)?;
    let geometry = &world.scene.geometry;
    let areas: Vec<f64> = (0..geometry.triangles.len() as u32).map(|t| f64::from(geometry.area_normal(t).length())).collect();
    let density = POINTS / areas.iter().sum::<f64>();
    let mut points: Vec<(u32, Vec2, bool, Rgb)> = Vec::new();
    let mut carry = 0.0;
    for (t, area) in areas.iter().enumerate() {
        carry += area * density;
        for i in 0..carry as u32 {
            let u = Sampler::new(hash_words(&[t as u32]), i).next_2d();
            let at = if u.x + u.y > 1.0 { Vec2::ONE - u } else { u };
            for back in [false, true] {
                let r = reference.lookup(t as u32, at, back);
                if r != Rgb::ZERO {
                    points.push((t as u32, at, back, r));
                }
            }
        }
        carry = carry.fract();
    }
    let count = points.len() as f64;
    let mean = points.iter().map(|p| f64::from(luminance(p.3))).sum::<f64>() / count;
    for file in maps {
        let map = load(file)?;
        let (mut relative, mut absolute, mut bias) = (Vec::new(), 0.0, 0.0);
        for &(t, at, back, r) in &points {
            let x = map.lookup(t, at, back);
            let square = f64::from((x - r).length_squared()) / 3.0;
            relative.push(square / (f64::from(luminance(r)) + 0.05 * mean).powi(2));
            absolute += square;
            bias += f64::from(luminance(x - r));
        }
        let root = (relative.iter().sum::<f64>() / count).sqrt();
        relative.sort_by(f64::total_cmp);
        let most = &relative[..relative.len() * 99 / 100];
        println!(
            "{file}: relative {root:.4} ({:.4}), median {:.4}, absolute {:.4}, mean {:+.2} %",
            (most.iter().sum::<f64>() / most.len() as f64).sqrt(),
            relative[relative.len() / 2].sqrt(),
            (absolute / count).sqrt() / mean,
            100.0 * bias / count / mean
        );
    }
    Ok(())
}
