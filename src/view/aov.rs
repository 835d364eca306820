//! Auxiliary layers of a frame: what the ray through each pixel's centre meets first.

use crate::base::math::Rgb;
use crate::io::ExrImage;
use crate::scene::Camera;
use crate::transport::World;
use glam::{Vec2, Vec3};
use rayon::prelude::*;

/// Material number of a pixel that sees no surface.
pub const NO_MATERIAL: u32 = u32::MAX;

/// First hit of a pixel; zero, and [`NO_MATERIAL`], where there is none.
#[derive(Debug, Clone, Copy, PartialEq)]
struct FirstHit {
    depth: f32,
    normal: Vec3,
    position: Vec3,
    material: u32,
    albedo: Rgb,
    alpha: f32,
}

/// Adds to `image`: `depth` (distance along the ray), `normal.{X,Y,Z}` (shading normal, facing the viewer), `position.{X,Y,Z}`
/// (world), `material` (index), `albedo.{R,G,B}` (of the diffuse lobe, for this view) and `alpha` (of the glossy lobe; -1 without).
pub fn with_first_hits(image: ExrImage, world: &World, camera: &Camera) -> ExrImage {
    let [width, height] = camera.size;
    let row = |y: u32| (0..width).map(move |x| first_hit(world, camera, Vec2::new(x as f32 + 0.5, y as f32 + 0.5)));
    let hits: Vec<FirstHit> = (0..height).into_par_iter().flat_map_iter(row).collect();
    let floats =
        |image: ExrImage, name: &str, get: &dyn Fn(&FirstHit) -> f32| image.with_f32(name, hits.iter().map(get).collect());
    let mut image = floats(image, "depth", &|h| h.depth);
    for (i, axis) in ["X", "Y", "Z"].into_iter().enumerate() {
        image = floats(image, &format!("normal.{axis}"), &|h| h.normal[i]);
        image = floats(image, &format!("position.{axis}"), &|h| h.position[i]);
    }
    floats(image, "alpha", &|h| h.alpha)
        .with_rgb("albedo", &hits.iter().map(|h| h.albedo).collect::<Vec<_>>())
        .with_u32("material", hits.iter().map(|h| h.material).collect())
}

fn first_hit(world: &World, camera: &Camera, pixel: Vec2) -> FirstHit {
    let ray = camera.ray(pixel, Vec2::splat(0.5));
    let Some(s) = world.seen(&ray) else {
        let nothing = Vec3::ZERO;
        return FirstHit { depth: 0.0, normal: nothing, position: nothing, material: NO_MATERIAL, albedo: nothing, alpha: -1.0 };
    };
    let bsdf = world.scene.bsdf(&s);
    let wo = s.frame.to_local(-ray.d);
    FirstHit {
        depth: s.t,
        normal: if wo.z < 0.0 { -s.frame.n } else { s.frame.n },
        position: s.p,
        material: s.material,
        albedo: bsdf.diffuse_out(&s, wo),
        alpha: bsdf.alpha(&s).unwrap_or(-1.0),
    }
}
