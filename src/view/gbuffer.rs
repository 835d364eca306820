//! The G-buffer of a novel view: one ray through each pixel's centre (§5).

use crate::base::math::{Rgb, hash_words};
use crate::base::ray::{Hit, Ray};
use crate::material::Surface;
use crate::material::bsdf::{Lobes, Query};
use crate::scene::Camera;
use crate::surface::{Curvature, CurvatureMap};
use crate::transport::World;
use glam::{Vec2, Vec3};
use rayon::prelude::*;
use std::mem::MaybeUninit;

/// What the later passes need to know of a pixel.
#[derive(Debug, Clone, Copy)]
pub struct Pixel {
    /// The surface seen.
    pub surface: Surface,
    /// Unit direction to the camera.
    pub wo: Vec3,
    /// Shading normal on the camera's side.
    pub normal: Vec3,
    /// Distance to the camera, d_c.
    pub depth: f32,
    /// Microfacet alpha of the non-diffuse lobe; `None` where the surface has none and no probe is asked.
    pub alpha: Option<f32>,
    /// Principal curvatures and directions, about `normal`.
    pub curvature: Curvature,
    /// Radiance emitted towards the camera.
    pub emission: Rgb,
}

/// A view's pixels, rows from the top; `None` sees the environment.
#[derive(Debug, Clone)]
pub struct GBuffer {
    /// The view, at this buffer's size.
    pub camera: Camera,
    /// The pixels.
    pub pixels: Vec<Option<Pixel>>,
    /// Radiance of the environment where nothing is seen; black elsewhere.
    pub background: Vec<Rgb>,
}

impl GBuffer {
    /// Width and height.
    pub fn size(&self) -> [usize; 2] {
        self.camera.size.map(|s| s as usize)
    }

    /// A layer: what `of` says of each pixel that shows a surface, by a random stream of its own, which is a hash of (seed, frame, pixel).
    pub fn shade(&self, [seed, frame]: [u32; 2], of: impl Fn(&Pixel, u32) -> Rgb + Sync) -> Vec<Rgb> {
        let pixel = |(i, pixel): (usize, &Option<Pixel>)| {
            let stream = hash_words(&[seed, frame, i as u32]);
            pixel.as_ref().map_or(Rgb::ZERO, |p| of(p, stream))
        };
        self.pixels.par_iter().enumerate().with_min_len(self.size()[0]).map(pixel).collect()
    }
}

/// Side of the squares of pixels whose rays are followed together.
pub(crate) const BLOCK: usize = 4;

/// Casts the camera's rays.
pub fn gbuffer(world: &World, curvature: &CurvatureMap, camera: &Camera) -> GBuffer {
    let [width, height] = camera.size.map(|s| s as usize);
    let count = width * height;
    let (mut pixels, mut background) = (Vec::with_capacity(count), Vec::with_capacity(count));
    let of_strip = |(strip, (pixels, background)): (usize, (&mut [MaybeUninit<_>], &mut [MaybeUninit<_>]))| {
        for left in (0..width).step_by(BLOCK) {
            for ([x, y], ray, hit) in block(world, camera, [left, strip * BLOCK]) {
                let at = (y - strip * BLOCK) * width + x;
                let (seen, behind) = seen(world, curvature, &ray, hit);
                pixels[at].write(seen);
                background[at].write(behind);
            }
        }
    };
    let rows = BLOCK * width.max(1);
    let strips = pixels.spare_capacity_mut()[..count].par_chunks_mut(rows);
    strips.zip(background.spare_capacity_mut()[..count].par_chunks_mut(rows)).enumerate().for_each(of_strip);
    // SAFETY: the blocks of a strip hold each of its pixels once, and the strips are all there are.
    unsafe {
        pixels.set_len(count);
        background.set_len(count);
    }
    GBuffer { camera: camera.clone(), pixels, background }
}

/// The pixels of a square of [`BLOCK`] a side, with their rays and what these meet first. Followed together they share the way through the
/// tree.
pub(crate) fn block(
    world: &World,
    camera: &Camera,
    [left, top]: [usize; 2],
) -> impl Iterator<Item = ([usize; 2], Ray, Option<Hit>)> {
    let [width, height] = camera.size.map(|s| s as usize);
    let mut rays = [Ray::new(Vec3::ZERO, Vec3::Z); BLOCK * BLOCK];
    let mut at = [[0; 2]; BLOCK * BLOCK];
    let (mut count, focal_px) = (0, camera.focal_px());
    for y in top..(top + BLOCK).min(height) {
        for x in left..(left + BLOCK).min(width) {
            let centre = Vec2::new(x as f32 + 0.5, y as f32 + 0.5);
            (rays[count], at[count]) = (camera.ray_of(focal_px, centre, Vec2::splat(0.5)), [x, y]);
            count += 1;
        }
    }
    let hits = world.closest_of(&rays[..count]);
    (0..count).map(move |i| (at[i], rays[i], hits[i]))
}

/// What a ray shows whose first hit is known, and the radiance of the environment where it shows no surface.
#[inline]
pub(crate) fn seen(world: &World, curvature: &CurvatureMap, ray: &Ray, hit: Option<Hit>) -> (Option<Pixel>, Rgb) {
    match world.seen_from(ray, hit) {
        Some(surface) => (Some(pixel(world, curvature, surface, -ray.d)), Rgb::ZERO),
        None => (None, world.backdrop(ray.d)),
    }
}

fn pixel(world: &World, curvature: &CurvatureMap, surface: Surface, wo: Vec3) -> Pixel {
    let normal = surface.facing_normal(wo);
    Pixel {
        surface,
        wo,
        normal,
        depth: surface.t,
        alpha: view_alpha(world, &surface, wo),
        curvature: curvature.at(&world.scene.geometry, surface.triangle, surface.barycentric, normal),
        emission: world.lights.emitted(&world.scene, &surface, wo),
    }
}

/// Microfacet alpha of the lobe that a view of `surface` from `wo` asks the probes for; `None` where it has none.
pub fn view_alpha(world: &World, surface: &Surface, wo: Vec3) -> Option<f32> {
    let bsdf = world.scene.bsdf(surface);
    if is_glossy(world, surface, wo) { bsdf.alpha(surface) } else { None }
}

/// Whether a view of `surface` from `wo` has a lobe for a probe to store.
pub fn is_glossy(world: &World, surface: &Surface, wo: Vec3) -> bool {
    let bsdf = world.scene.bsdf(surface);
    bsdf.lobes().contains(Lobes::NON_DIFFUSE) && (bsdf.is_two_sided() || surface.frame.n.dot(wo) > 0.0)
}

/// The lobes that make the glossy layer, at the material's own roughness.
pub(crate) const GLOSSY: Query = Query { lobes: Lobes::NON_DIFFUSE, roughness_scale: 1.0 };

/// Pixels that have a glossy layer at all.
pub(crate) fn glossy(pixel: &Option<Pixel>) -> Option<&Pixel> {
    pixel.as_ref().filter(|p| p.alpha.is_some())
}
