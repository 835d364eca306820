//! Cubes about a probe: reflections blurred by GGX lobes, rougher from level to level, and diffuse light.
//!
//! A level's lobes are those of a viewer who looks along the normal, as is usual (Karis 2013), and its samples look their light up in coarser maps the less
//! likely they are (Křivánek and Colbert 2008).

use super::{Around, Probe};
use crate::base::math::{Basis, Rgb};
use crate::base::named::words;
use crate::export::ktx2::Texture;
use glam::{Vec2, Vec3};
use rayon::prelude::*;
use std::f32::consts::PI;

/// Samples of a lobe.
const SAMPLES: u32 = 256;
/// Texels that a linear lookup spreads over, about.
const SPREAD: f32 = 3.0;
/// Texels along an edge of a cube of diffuse light.
const DIFFUSE: u32 = 32;

/// How a cube's axes lie in the world: engines look a cube up, whose own axes are left-handed, after turning one round.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Mirror {
    /// +Z of the cube is -Z of the world, as Bevy has it.
    #[default]
    Z,
    /// +X of the cube is -X of the world, as three.js has it.
    X,
    /// None: to be looked up along world directions.
    None,
}

words!(Mirror { Z "z", X "x", None "none" });

impl Mirror {
    fn turned(self, d: Vec3) -> Vec3 {
        match self {
            Self::Z => Vec3::new(d.x, d.y, -d.z),
            Self::X => Vec3::new(-d.x, d.y, d.z),
            Self::None => d,
        }
    }
}

/// Reflections: level l of L is blurred by a roughness (the square root of alpha) of l / (L - 1). `size` is a power of two.
pub fn reflections(probe: &Probe, size: u32, mirror: Mirror) -> Texture {
    let count = size.ilog2() + 1;
    let level = |l: u32| {
        let roughness = l as f32 / (count - 1).max(1) as f32;
        faces(size >> l, mirror, |d| blurred(probe, d, roughness * roughness, size >> l))
    };
    Texture { size: [size, size, 0], faces: 6, levels: (0..count).map(level).collect() }
}

/// Irradiance over π.
pub fn diffuse(around: &Around, mirror: Mirror) -> Texture {
    Texture { size: [DIFFUSE, DIFFUSE, 0], faces: 6, levels: vec![faces(DIFFUSE, mirror, |d| around.diffuse(d))] }
}

/// A value for each texel of a cube.
fn faces(size: u32, mirror: Mirror, value: impl Fn(Vec3) -> Rgb + Sync) -> Vec<Rgb> {
    let texel = |i: u32| {
        let (face, at) = (i / (size * size), i % (size * size));
        let place = (Vec2::new((at % size) as f32, (at / size) as f32) + 0.5) / size as f32;
        value(mirror.turned(direction(face, place)))
    };
    (0..6 * size * size).into_par_iter().map(texel).collect()
}

/// The unit direction of a place of a face, from its upper left corner, by the rules of Vulkan and OpenGL.
pub fn direction(face: u32, place: Vec2) -> Vec3 {
    let Vec2 { x: s, y: t } = place * 2.0 - 1.0;
    let d = match face {
        0 => Vec3::new(1.0, -t, -s),
        1 => Vec3::new(-1.0, -t, s),
        2 => Vec3::new(s, 1.0, t),
        3 => Vec3::new(s, -1.0, -t),
        4 => Vec3::new(s, -t, 1.0),
        _ => Vec3::new(-s, -t, -1.0),
    };
    d.normalize()
}

/// Radiance about `d` under the lobe of a mirror of this alpha, for texels of a cube so many along an edge.
fn blurred(probe: &Probe, d: Vec3, alpha: f32, size: u32) -> Rgb {
    let texel = 4.0 * PI / (probe.light.size * probe.light.size) as f32;
    let about = |d: Vec3, solid_angle: f32| probe.light.about(d, (0.5 * (solid_angle / (SPREAD * texel)).log2()).max(0.0));
    let own = 4.0 * PI / (6 * size * size) as f32;
    if alpha == 0.0 {
        return about(d, own);
    }
    let frame = Basis::from_normal(d);
    let (mut sum, mut weight) = (Rgb::ZERO, 0.0);
    for i in 0..SAMPLES {
        // Hammersley's points.
        let (u, v) = ((i as f32 + 0.5) / SAMPLES as f32, i.reverse_bits() as f32 / 2f32.powi(32));
        let cos2 = (1.0 - u) / (1.0 + (alpha * alpha - 1.0) * u);
        let (cos, sin) = (cos2.sqrt(), (1.0 - cos2).max(0.0).sqrt());
        let (y, x) = (2.0 * PI * v).sin_cos();
        let h = Vec3::new(sin * x, sin * y, cos);
        let l = Vec3::new(2.0 * cos * h.x, 2.0 * cos * h.y, 2.0 * cos * cos - 1.0);
        if l.z <= 0.0 {
            continue;
        }
        let k = cos2 * (alpha * alpha - 1.0) + 1.0;
        // D · cos h / (4 v·h), with v along the normal.
        let pdf = alpha * alpha / (PI * k * k) / 4.0;
        sum += about(frame.to_world(l), 1.0 / (SAMPLES as f32 * pdf)) * l.z;
        weight += l.z;
    }
    if weight > 0.0 { sum / weight } else { about(d, own) }
}
