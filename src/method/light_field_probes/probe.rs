//! What a light field probe stores of each direction: how far the surface is, how it lies, and the light that comes from there.

use crate::base::math::Rgb;
use crate::base::octahedral::{decode, middle, taps, unpack};
use glam::{Vec2, Vec3};
use half::f16;

/// A plane past a probe, relative to it.
#[derive(Debug, Clone, Copy)]
pub struct Plane {
    /// Unit normal, on the probe's side.
    pub normal: Vec3,
    /// Distance of the probe from the plane along the normal, metres; more than 0.
    pub height: f32,
}

impl Plane {
    /// Signed distance of a point, metres: above 0 on the probe's side.
    pub fn above(&self, p: Vec3) -> f32 {
        self.normal.dot(p) + self.height
    }

    /// How far the plane is along a unit direction; infinite where it is not met.
    pub fn along(&self, d: Vec3) -> f32 {
        let cos = -self.normal.dot(d);
        if cos > 0.0 { self.height / cos } else { f32::INFINITY }
    }
}

/// The surfaces that a probe sees: an octahedral map of small planes. *Ours*: McGuire et al. step over distances; planes meet rays where the
/// surface is, not where a texel's middle is.
#[derive(Debug, Clone)]
pub struct Surfels {
    /// Texels along an edge: a power of two.
    pub size: usize,
    /// Distance to the first surface, metres; infinite where there is none.
    pub distance: Vec<f32>,
    /// Unit geometric normal on the probe's side, [packed](crate::base::octahedral::pack).
    pub normal: Vec<u32>,
}

/// Texels along an edge of the coarsest level of radiance.
pub(crate) const LEAST_LIGHT: usize = 4;

/// Least cosine at which a plane is taken as it lies: flatter ones, seen edge on, count as facing the probe.
pub(crate) const LEAST_COS: f32 = 0.02;

impl Surfels {
    /// The direction of a place, in texels.
    pub fn direction(&self, at: Vec2) -> Vec3 {
        decode(at / self.size as f32)
    }

    /// The direction of a texel's middle.
    pub fn middle(&self, i: usize) -> Vec3 {
        middle(i, self.size)
    }

    /// The plane of a texel; `None` where there is no surface.
    pub fn plane(&self, i: usize) -> Option<Plane> {
        let distance = self.distance[i];
        if !distance.is_finite() {
            return None;
        }
        let d = self.middle(i);
        let normal = unpack(self.normal[i]);
        let cos = -normal.dot(d);
        Some(if cos > LEAST_COS { Plane { normal, height: distance * cos } } else { Plane { normal: -d, height: distance } })
    }

    /// Angle that a texel covers, radians, about.
    pub fn texel_angle(&self) -> f32 {
        (4.0 * std::f32::consts::PI).sqrt() / self.size as f32
    }

    /// Memory that they take.
    pub fn bytes(&self) -> usize {
        size_of_val(self.distance.as_slice()) + size_of_val(self.normal.as_slice())
    }
}

/// Light and visibility about a probe, in a small octahedral map.
#[derive(Debug, Clone)]
pub struct Ambient {
    /// Texels along an edge.
    pub size: usize,
    /// Irradiance of a surface that faces the direction, without light straight from emitters.
    pub irradiance: Vec<Rgb>,
    /// Mean distance to surfaces about the direction and the mean of its square (McGuire 2017, §4.3), metres.
    pub moments: Vec<Vec2>,
}

impl Ambient {
    /// Of a probe that nobody asks.
    pub fn dark() -> Self {
        Self { size: 1, irradiance: vec![Rgb::ZERO], moments: vec![Vec2::ZERO] }
    }
}

/// Radiance that surfaces scatter towards a probe, at several sizes.
#[derive(Debug, Clone)]
pub struct Light {
    /// Texels along an edge of level 0.
    pub size: usize,
    /// Level 0, and averages over 2 x 2, 4 x 4, ... of its texels.
    pub levels: Vec<Vec<[f16; 3]>>,
}

impl Light {
    /// Of the radiance of all texels.
    pub fn new(radiance: &[Rgb], size: usize) -> Self {
        let mut finer = radiance.to_vec();
        let half_floats = |colors: &[Rgb]| colors.iter().map(|c| c.to_array().map(f16::from_f32)).collect();
        let mut levels = vec![half_floats(&finer)];
        let mut n = size;
        while n > LEAST_LIGHT {
            let half = n / 2;
            let merged = |i: usize| {
                let (x, y) = (2 * (i % half), 2 * (i / half));
                (finer[y * n + x] + finer[y * n + x + 1] + finer[(y + 1) * n + x] + finer[(y + 1) * n + x + 1]) * 0.25
            };
            finer = (0..half * half).map(merged).collect();
            levels.push(half_floats(&finer));
            n = half;
        }
        Self { size, levels }
    }

    /// Radiance about a direction, of texels so many levels up: linear within levels, across the map's seams, and between them.
    pub fn about(&self, d: Vec3, level: f32) -> Rgb {
        let level = level.clamp(0.0, (self.levels.len() - 1) as f32);
        let (low, f) = (level.floor() as usize, level.fract());
        let fine = self.within(d, low);
        if f == 0.0 { fine } else { fine.lerp(self.within(d, low + 1), f) }
    }

    /// Radiance of a texel.
    pub fn texel(&self, i: usize) -> Rgb {
        Rgb::from_array(self.levels[0][i].map(f16::to_f32))
    }

    fn within(&self, d: Vec3, level: usize) -> Rgb {
        let texels = &self.levels[level];
        taps(d, self.size >> level).into_iter().map(|(i, w)| Rgb::from_array(texels[i].map(f16::to_f32)) * w).sum()
    }

    /// Memory that it takes.
    pub fn bytes(&self) -> usize {
        self.levels.iter().map(|level| size_of_val(level.as_slice())).sum()
    }
}
