//! Models that hold others: two sides, perturbed frames, blends.

use super::Bsdf;
use crate::scene::Texture;

/// Different models in front and behind (Mitsuba's `twosided`).
#[derive(Debug, Clone)]
pub struct TwoSided {
    /// Seen where cos > 0.
    pub front: Box<Bsdf>,
    /// Seen from behind; the same as `front` where the scene names one only.
    pub back: Box<Bsdf>,
}

/// A height field that tilts the frame (Mitsuba's `bumpmap`).
#[derive(Debug, Clone)]
pub struct BumpMap {
    /// Height, in scene units over `scale`.
    pub texture: Texture,
    /// Factor on the height. Mitsuba: 1.
    pub scale: f32,
    /// What scatters in the tilted frame.
    pub nested: Box<Bsdf>,
}

/// A normal map (Mitsuba's `normalmap`).
#[derive(Debug, Clone)]
pub struct NormalMap {
    /// Tangent-space normals, stored as (n + 1) / 2, read `raw`.
    pub texture: Texture,
    /// What scatters in the tilted frame.
    pub nested: Box<Bsdf>,
}

/// A linear mix (Mitsuba's `blendbsdf`).
#[derive(Debug, Clone)]
pub struct Blend {
    /// Share of `b`; clamped to [0, 1].
    pub weight: Texture,
    /// Where the weight is 0.
    pub a: Box<Bsdf>,
    /// Where the weight is 1.
    pub b: Box<Bsdf>,
}
