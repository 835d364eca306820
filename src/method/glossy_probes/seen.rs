//! What a probe sees along each direction of its lat-long map, by ray casting: the buffers of §4.2.1.

use crate::base::math::direction_from_lat_long;
use crate::base::ray::{Hit, Ray};
use crate::material::bsdf::Lobes;
use crate::transport::World;
use glam::{Vec2, Vec3};

/// The surface that one texel sees.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Seen {
    /// Microfacet alpha of its glossy lobe, 0 for a mirror; `None` where it has none on this side.
    pub alpha: Option<f32>,
    /// Distance along the ray, metres.
    pub depth: f32,
    /// Unit shading normal, world space, on the probe's side.
    pub normal: Vec3,
    /// Cosine between the ray and the geometric normal, 0 to 1.
    pub facing: f32,
}

/// What a probe sees: one ray through each texel's centre, rows from the top; `None` where it leaves the scene.
#[derive(Debug, Clone, PartialEq)]
pub struct SeenBuffers {
    /// Width and height, texels.
    pub size: [u32; 2],
    /// The texels.
    pub texels: Vec<Option<Seen>>,
}

impl SeenBuffers {
    /// Fills the buffers, given what is seen along each unit direction.
    pub fn from_fn(size: [u32; 2], see: impl Fn(Vec3) -> Option<Seen>) -> Self {
        Self { size, texels: centres(size).map(|centre| see(direction_from_lat_long(centre))).collect() }
    }

    /// The rays from `position` through the texels' centres.
    pub fn rays(position: Vec3, size: [u32; 2]) -> Vec<Ray> {
        centres(size).map(|centre| Ray::new(position, direction_from_lat_long(centre))).collect()
    }

    /// Fills the buffers, given what each of [`SeenBuffers::rays`] meets first.
    pub fn from_hits(world: &World, size: [u32; 2], rays: &[Ray], hits: &[Option<Hit>]) -> Self {
        let texels = rays.iter().zip(hits).map(|(ray, hit)| hit.map(|hit| see(world, ray, &hit))).collect();
        Self { size, texels }
    }

    /// Casts the rays from `position`.
    pub fn cast(world: &World, position: Vec3, size: [u32; 2]) -> Self {
        let rays = Self::rays(position, size);
        let hits: Vec<_> = rays.iter().map(|ray| world.closest(ray)).collect();
        Self::from_hits(world, size, &rays, &hits)
    }
}

/// Lat-long coordinates of the texels' centres, rows from the top.
fn centres([w, h]: [u32; 2]) -> impl Iterator<Item = Vec2> {
    let centre = move |x: u32, y: u32| (Vec2::new(x as f32, y as f32) + 0.5) / Vec2::new(w as f32, h as f32);
    (0..h).flat_map(move |y| (0..w).map(move |x| centre(x, y)))
}

fn see(world: &World, ray: &Ray, hit: &Hit) -> Seen {
    let s = world.surface(hit);
    let ng = if s.ng.dot(ray.d) > 0.0 { -s.ng } else { s.ng };
    let normal = if s.frame.n.dot(ng) < 0.0 { -s.frame.n } else { s.frame.n };
    let bsdf = world.scene.bsdf(&s);
    // One-sided models are black from behind.
    let lit = bsdf.is_two_sided() || s.frame.n.dot(ray.d) < 0.0;
    let alpha = if lit && bsdf.lobes().contains(Lobes::NON_DIFFUSE) { bsdf.alpha(&s) } else { None };
    Seen { alpha, depth: s.t, normal, facing: ng.dot(-ray.d).clamp(0.0, 1.0) }
}
