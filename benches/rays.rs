//! Rays a second: `cargo bench --bench rays -- FOLDER...`, each folder with the OBJ files of a scene.
//!
//! The rays are those of paths: from the middle of the scene in all directions, then four cosine-distributed bounces,
//! shuffled. Without a folder it says so and ends.

use glam::{Mat4, Vec2, Vec3};
use rayon::prelude::*;
use reprobe::math::{Frame, direction_from_lat_long, hash_words};
use reprobe::scene::{Scene, shapes};
use reprobe::transport::bvh::Bvh;
use reprobe::transport::{Ray, Surface};
use std::time::Instant;

const PATHS: u32 = 50_000;
const BOUNCES: u32 = 5;

fn uniform(words: &[u32]) -> f32 {
    (hash_words(words) >> 8) as f32 / 16_777_216.0
}

/// Time this thread has computed: says the same on a busy machine. Wall time where the system does not tell.
fn cpu_seconds() -> f64 {
    static START: std::sync::OnceLock<Instant> = std::sync::OnceLock::new();
    let start = START.get_or_init(Instant::now);
    let told = std::fs::read_to_string("/proc/thread-self/schedstat").ok();
    let nanoseconds = told.and_then(|s| s.split_whitespace().next()?.parse::<f64>().ok());
    nanoseconds.map_or_else(|| start.elapsed().as_secs_f64(), |n| n * 1e-9)
}

fn load(folder: &str) -> Scene {
    let mut files: Vec<_> = std::fs::read_dir(folder)
        .expect("a folder")
        .map(|e| e.expect("an entry").path())
        .filter(|p| p.extension().is_some_and(|e| e == "obj"))
        .collect();
    files.sort();
    let meshes: Vec<_> = files.par_iter().map(|f| shapes::obj::load(f).expect("an OBJ file")).collect();
    let mut scene = Scene::default();
    for mesh in meshes {
        shapes::append(&mut scene.geometry, mesh, Mat4::IDENTITY, false, false, String::new(), 0, None);
    }
    scene
}

/// Rays of paths, shuffled.
fn rays(scene: &Scene, bvh: &Bvh) -> Vec<Ray> {
    let (lo, hi) = scene.geometry.bounds();
    let paths: Vec<Vec<Ray>> = (0..PATHS)
        .into_par_iter()
        .map(|path| {
            let u = |k: u32| uniform(&[path, k]);
            let d = direction_from_lat_long(Vec2::new(u(0), (1.0 - 2.0 * u(1)).acos() / std::f32::consts::PI));
            let mut ray = Ray::new((lo + hi) / 2.0 + (Vec3::new(u(2), u(3), u(4)) - 0.5) * (hi - lo) * 0.2, d);
            let mut out = Vec::new();
            for bounce in 0..BOUNCES {
                out.push(ray);
                let Some(hit) = bvh.closest(scene, &ray) else { break };
                let s = Surface::new(scene, &hit);
                let n = s.ng * -ray.d.dot(s.ng).signum();
                let (r, phi) = (u(5 + 2 * bounce).sqrt(), u(6 + 2 * bounce) * std::f32::consts::TAU);
                let local = Vec3::new(r * phi.cos(), r * phi.sin(), (1.0 - r * r).max(0.0).sqrt());
                ray = s.spawn(Frame::from_normal(n).to_world(local).normalize());
            }
            out
        })
        .collect();
    let mut rays = paths.concat();
    let mut order: Vec<u32> = (0..rays.len() as u32).collect();
    order.sort_by_key(|&i| hash_words(&[i, 9]));
    let unshuffled = rays.clone();
    for (ray, &i) in rays.iter_mut().zip(&order) {
        *ray = unshuffled[i as usize];
    }
    rays
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

fn main() {
    let folders: Vec<String> = std::env::args().skip(1).filter(|a| !a.starts_with("--")).collect();
    if folders.is_empty() {
        println!("rays: no folder given, nothing measured");
    }
    for folder in folders {
        let scene = load(&folder);
        let start = Instant::now();
        let bvh = Bvh::build(&scene, &|_| true);
        let build = start.elapsed().as_secs_f64();
        let rays = rays(&scene, &bvh);
        let shadow: Vec<Ray> =
            rays.iter().enumerate().map(|(i, r)| Ray { t_max: 0.2 + 3.0 * uniform(&[i as u32, 3]), ..*r }).collect();
        let rate = |f: &dyn Fn() -> usize| {
            let best = (0..3).map(|_| {
                let start = cpu_seconds();
                std::hint::black_box(f());
                cpu_seconds() - start
            });
            rays.len() as f64 / 1e6 / best.fold(f64::INFINITY, f64::min)
        };
        let closest = rate(&|| rays.iter().filter(|r| bvh.closest(&scene, r).is_some()).count());
        let any = rate(&|| shadow.iter().filter(|r| bvh.occluded(&scene, r)).count());
        let obvhs = Obvhs::new(&scene);
        let obvhs_closest = rate(&|| rays.iter().filter(|r| obvhs.closest(r)).count());
        let obvhs_any = rate(&|| shadow.iter().filter(|r| obvhs.occluded(r)).count());
        println!(
            "{folder}: {} triangles built in {build:.2} s; closest {closest:.2}, any {any:.2} million rays a second and thread (obvhs {obvhs_closest:.2}, {obvhs_any:.2})",
            scene.geometry.triangles.len()
        );
    }
}
