//! What a probe sees along each direction of its lat-long map, by ray casting: the buffers of §4.2.1.

use crate::math::direction_from_lat_long;
use crate::transport::bsdf::Lobes;
use crate::transport::{Ray, World};
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
        let [w, h] = size;
        let centre = |x: u32, y: u32| (Vec2::new(x as f32, y as f32) + 0.5) / Vec2::new(w as f32, h as f32);
        let texels =
            (0..h).flat_map(|y| (0..w).map(move |x| (x, y))).map(|(x, y)| see(direction_from_lat_long(centre(x, y)))).collect();
        Self { size, texels }
    }

    /// Casts the rays from `position`.
    pub fn cast(world: &World, position: Vec3, size: [u32; 2]) -> Self {
        Self::from_fn(size, |d| see(world, &Ray::new(position, d)))
    }
}

fn see(world: &World, ray: &Ray) -> Option<Seen> {
    let s = world.intersect(ray)?;
    let ng = if s.ng.dot(ray.d) > 0.0 { -s.ng } else { s.ng };
    let normal = if s.frame.n.dot(ng) < 0.0 { -s.frame.n } else { s.frame.n };
    let bsdf = &world.scene.materials[s.material as usize].bsdf;
    // One-sided models are black from behind.
    let lit = bsdf.is_two_sided() || s.frame.n.dot(ray.d) < 0.0;
    let alpha = if lit && bsdf.lobes().contains(Lobes::NON_DIFFUSE) { bsdf.alpha(&s) } else { None };
    Some(Seen { alpha, depth: s.t, normal, facing: ng.dot(-ray.d).clamp(0.0, 1.0) })
}
