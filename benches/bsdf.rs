//! Nanoseconds of one thread for a BSDF's sample and its value with density: `cargo bench --bench bsdf`.

use glam::{Vec2, Vec3};
use reprobe::base::ray::Ray;
use reprobe::exchange::{LoadOptions, load};
use reprobe::material::bsdf::Query;
use reprobe::transport::{Sampler, World};
use std::hint::black_box;
use std::time::Instant;

const SAMPLES: u32 = 400_000;
const RUNS: u32 = 5;

const MODELS: [(&str, &str); 7] = [
    ("diffuse", r#"<bsdf type="diffuse"/>"#),
    ("plastic", r#"<bsdf type="plastic"/>"#),
    ("roughplastic, GGX .1", r#"<bsdf type="roughplastic"><string name="distribution" value="ggx"/></bsdf>"#),
    ("roughplastic, Beckmann .1", r#"<bsdf type="roughplastic"/>"#),
    ("roughconductor, GGX .1", r#"<bsdf type="roughconductor"><string name="distribution" value="ggx"/></bsdf>"#),
    ("roughdielectric, GGX .1", r#"<bsdf type="roughdielectric"><string name="distribution" value="ggx"/></bsdf>"#),
    ("principled", r#"<bsdf type="principled"><float name="roughness" value="0.4"/><float name="metallic" value="0.5"/></bsdf>"#),
];

fn main() {
    let folder = tempfile::tempdir().expect("a folder");
    for (name, model) in MODELS {
        let path = folder.path().join("scene.xml");
        let xml = format!(r#"<scene version="3.0.0"><shape type="rectangle">{model}</shape></scene>"#);
        std::fs::write(&path, xml).expect("a file");
        let world = World::new(load(&path, &LoadOptions::default()).expect("a scene"));
        let surface = world.intersect(&Ray::new(Vec3::new(0.1, 0.2, 1.0), Vec3::NEG_Z)).expect("a hit");
        let bsdf = world.scene.bsdf(&surface);
        let numbers: Vec<[f32; 4]> = (0..SAMPLES).map(|i| Sampler::new(1, i).next_4d()).collect();
        let wi = |u: &[f32; 4]| Vec3::new(u[0] - 0.5, u[1] - 0.5, 0.6).normalize();
        let best = |f: &dyn Fn(&[f32; 4]) -> f32| {
            let run = |_| {
                let start = Instant::now();
                black_box(numbers.iter().map(f).sum::<f32>());
                start.elapsed().as_secs_f64()
            };
            (0..RUNS).map(run).fold(f64::INFINITY, f64::min) * 1e9 / f64::from(SAMPLES)
        };
        let sample =
            best(&|u| bsdf.sample(&surface, wi(u), u[2], Vec2::new(u[3], u[0]), Query::default()).map_or(0.0, |s| s.pdf));
        let eval =
            best(&|u| bsdf.eval_pdf(&surface, wi(u), Vec3::new(u[2] - 0.5, u[3] - 0.5, 0.5).normalize(), Query::default()).1);
        println!("{name:28} sample {sample:6.1} ns, value and density {eval:6.1} ns");
    }
}
