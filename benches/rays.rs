//! Rays a second: `cargo bench --bench rays -- [--write FOLDER] SCENE...`.
//!
//! The rays are those of paths: through the pixels of the scene's sensor, then cosine-distributed bounces; and from each hit
//! one to a random point of the scene's emitters, for any hit. All are shuffled, and alpha masks are left out. With
//! --write they and the triangles go to FOLDER, for `scripts/bench_vs_embree.py`. Without a scene it says so and ends.

use glam::{Vec2, Vec3};
use rayon::prelude::*;
use reprobe::base::math::{Basis, hash_words, unit};
use reprobe::base::ray::Ray;
use reprobe::scene::Scene;
use reprobe::transport::World;
use reprobe::transport::light_tree::Receiver;
use std::path::Path;
use std::time::Instant;

const PATHS: u32 = 200_000;
const BOUNCES: u32 = 5;
const RUNS: usize = 3;

fn uniform(words: &[u32]) -> f32 {
    unit(hash_words(words))
}

/// Time this thread has computed: says the same on a busy machine. Wall time where the system does not tell.
fn cpu_seconds() -> f64 {
    static START: std::sync::OnceLock<Instant> = std::sync::OnceLock::new();
    let start = START.get_or_init(Instant::now);
    let told = std::fs::read_to_string("/proc/thread-self/schedstat").ok();
    let nanoseconds = told.and_then(|s| s.split_whitespace().next()?.parse::<f64>().ok());
    nanoseconds.map_or_else(|| start.elapsed().as_secs_f64(), |n| n * 1e-9)
}

/// Rays of paths, and shadow rays, each shuffled.
fn rays(world: &World) -> [Vec<Ray>; 2] {
    let camera = world.scene.sensor.as_ref().expect("a sensor");
    let path = |path: u32| {
        let u = |k: u32| uniform(&[path, k]);
        let [width, height] = camera.size.map(|s| s as f32);
        let mut ray = camera.ray(Vec2::new(u(0) * width, u(1) * height), Vec2::ZERO);
        let (mut out, mut shadow) = (Vec::new(), Vec::new());
        for bounce in 0..BOUNCES {
            out.push(ray);
            let Some(s) = world.intersect(&ray) else { break };
            let n = s.ng * -ray.d.dot(s.ng).signum();
            let k = 8 + 8 * bounce;
            if let Some(l) = world.lights.sample(&world.scene, &Receiver { p: s.p, n }, u(k), Vec2::new(u(k + 1), u(k + 2))) {
                shadow.push(l.shadow_ray(&s));
            }
            let (r, phi) = (u(k + 3).sqrt(), u(k + 4) * std::f32::consts::TAU);
            let local = Vec3::new(r * phi.cos(), r * phi.sin(), (1.0 - r * r).max(0.0).sqrt());
            ray = s.spawn(Basis::from_normal(n).to_world(local).normalize());
        }
        (out, shadow)
    };
    let (closest, any): (Vec<_>, Vec<_>) = (0..PATHS).into_par_iter().map(path).unzip();
    [closest.concat(), any.concat()].map(|mut rays| {
        rays.sort_by_cached_key(|r| hash_words(&[r.o.x, r.o.y, r.o.z, r.d.x, r.d.y, r.d.z].map(f32::to_bits)));
        rays
    })
}

/// obvhs's binary tree with its own triangle test, to compare with.
struct Obvhs {
    tree: obvhs::bvh2::Bvh2,
    triangles: Vec<obvhs::triangle::Triangle>,
}

impl Obvhs {
    fn new(scene: &Scene) -> Self {
        let of = |t: u32| {
            let [v0, v1, v2] = scene.geometry.corners(t).map(|p| p.to_vec3a());
            obvhs::triangle::Triangle { v0, v1, v2 }
        };
        let triangles: Vec<_> = (0..scene.geometry.triangles.len() as u32).map(of).collect();
        let params = obvhs::BvhBuildParams { pre_split: false, ..obvhs::BvhBuildParams::medium_build() };
        let tree = obvhs::bvh2::builder::build_bvh2_from_tris(&triangles, params, &mut std::time::Duration::default());
        let triangles = tree.primitive_indices.iter().map(|&i| triangles[i as usize]).collect();
        Self { tree, triangles }
    }

    fn ray(ray: &Ray) -> obvhs::ray::Ray {
        obvhs::ray::Ray::new(ray.o.to_vec3a(), ray.d.to_vec3a(), ray.t_min, ray.t_max)
    }

    fn closest(&self, ray: &Ray) -> bool {
        let mut hit = obvhs::ray::RayHit::none();
        self.tree.ray_traverse(Self::ray(ray), &mut hit, |r, i| self.triangles[i].intersect(r));
        hit.t < f32::INFINITY
    }

    fn occluded(&self, ray: &Ray) -> bool {
        !self.tree.ray_traverse_miss(Self::ray(ray), |r, i| self.triangles[i].intersect(r))
    }
}

/// Triangles, rays, hits and rates as plain little-endian arrays.
fn write(folder: &Path, world: &World, [closest, any]: &[Vec<Ray>; 2], rates: [f64; 2]) -> std::io::Result<()> {
    std::fs::create_dir_all(folder)?;
    let geometry = &world.scene.geometry;
    let corners: Vec<[Vec3; 3]> = (0..geometry.triangles.len() as u32).map(|t| geometry.corners(t)).collect();
    let numbers = |rays: &[Ray]| -> Vec<[f32; 8]> {
        rays.iter().map(|r| [r.o.x, r.o.y, r.o.z, r.d.x, r.d.y, r.d.z, r.t_min, r.t_max]).collect()
    };
    let hits: Vec<[f32; 2]> = closest
        .iter()
        .map(|r| world.closest(r).map_or([f32::from_bits(u32::MAX), f32::INFINITY], |h| [f32::from_bits(h.triangle), h.t]))
        .collect();
    let blocked: Vec<u8> = any.iter().map(|r| u8::from(world.occluded(r))).collect();
    std::fs::write(folder.join("triangles.f32"), bytemuck::cast_slice(&corners))?;
    std::fs::write(folder.join("closest.f32"), bytemuck::cast_slice(&numbers(closest)))?;
    std::fs::write(folder.join("any.f32"), bytemuck::cast_slice(&numbers(any)))?;
    std::fs::write(folder.join("hits.f32"), bytemuck::cast_slice(&hits))?;
    std::fs::write(folder.join("blocked.u8"), blocked)?;
    std::fs::write(folder.join("rates.json"), serde_json::json!({ "closest": rates[0], "any": rates[1] }).to_string())
}

fn main() {
    let mut args = std::env::args().skip(1).filter(|a| a != "--bench").peekable();
    let folder = args.next_if(|a| a == "--write").and_then(|_| args.next());
    let scenes: Vec<String> = args.collect();
    if scenes.is_empty() {
        println!("rays: no scene given, nothing measured");
    }
    for path in scenes {
        let mut scene = reprobe::exchange::load(Path::new(&path), &Default::default()).expect("a scene");
        scene.materials.iter_mut().for_each(|m| m.opacity = None);
        let start = Instant::now();
        let world = World::new(scene);
        let build = start.elapsed().as_secs_f64();
        let rays = rays(&world);
        let [closest, any] = &rays;
        let rate = |n: usize, f: &dyn Fn() -> usize| {
            let mut times = [(); RUNS].map(|()| {
                let start = cpu_seconds();
                std::hint::black_box(f());
                cpu_seconds() - start
            });
            times.sort_by(f64::total_cmp);
            n as f64 / 1e6 / times[RUNS / 2]
        };
        let ours = [
            rate(closest.len(), &|| closest.iter().filter(|r| world.closest(r).is_some()).count()),
            rate(any.len(), &|| any.iter().filter(|r| world.occluded(r)).count()),
        ];
        let obvhs = Obvhs::new(&world.scene);
        let theirs = [
            rate(closest.len(), &|| closest.iter().filter(|r| obvhs.closest(r)).count()),
            rate(any.len(), &|| any.iter().filter(|r| obvhs.occluded(r)).count()),
        ];
        println!(
            "{path}: {} triangles, ready in {build:.2} s; million rays a second and thread: closest {:.2}, any {:.2} (obvhs {:.2}, {:.2})",
            world.scene.geometry.triangles.len(),
            ours[0],
            ours[1],
            theirs[0],
            theirs[1]
        );
        if let Some(folder) = &folder {
            write(Path::new(folder), &world, &rays, ours).expect("the files to be written");
        }
    }
}
