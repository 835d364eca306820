//! The G-buffer of a novel view: one ray through each pixel's centre (§5).

use super::mirror::facing_normal;
use crate::base::math::{Rgb, hash_words};
use crate::material::Surface;
use crate::material::bsdf::{Lobes, Query};
use crate::scene::Camera;
use crate::surface::{Curvature, CurvatureMap};
use crate::transport::World;
use glam::{Vec2, Vec3};
use rayon::prelude::*;

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

/// Casts the camera's rays.
pub fn gbuffer(world: &World, curvature: &CurvatureMap, camera: &Camera) -> GBuffer {
    let [width, height] = camera.size.map(|s| s as usize);
    let (pixels, background) = (0..width * height)
        .into_par_iter()
        .with_min_len(width)
        .map(|i| {
            let centre = Vec2::new((i % width) as f32 + 0.5, (i / width) as f32 + 0.5);
            let ray = camera.ray(centre, Vec2::splat(0.5));
            match world.seen(&ray) {
                Some(surface) => (Some(pixel(world, curvature, surface, -ray.d)), Rgb::ZERO),
                None => (None, world.backdrop(ray.d)),
            }
        })
        .unzip();
    GBuffer { camera: camera.clone(), pixels, background }
}

fn pixel(world: &World, curvature: &CurvatureMap, surface: Surface, wo: Vec3) -> Pixel {
    let normal = facing_normal(&surface, wo);
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
    let bsdf = &world.scene.materials[surface.material as usize].bsdf;
    if is_glossy(world, surface, wo) { bsdf.alpha(surface) } else { None }
}

/// Whether a view of `surface` from `wo` has a lobe for a probe to store.
pub fn is_glossy(world: &World, surface: &Surface, wo: Vec3) -> bool {
    let bsdf = &world.scene.materials[surface.material as usize].bsdf;
    bsdf.lobes().contains(Lobes::NON_DIFFUSE) && (bsdf.is_two_sided() || surface.frame.n.dot(wo) > 0.0)
}

/// The lobes that make the glossy layer, at the material's own roughness.
pub(crate) const GLOSSY: Query = Query { lobes: Lobes::NON_DIFFUSE, roughness_scale: 1.0 };

/// Pixels that have a glossy layer at all.
pub(crate) fn glossy(pixel: &Option<Pixel>) -> Option<&Pixel> {
    pixel.as_ref().filter(|p| p.alpha.is_some())
}
