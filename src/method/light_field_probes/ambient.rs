//! Diffuse light from the probes around a point, without what they see through walls (McGuire 2017, §4.3).

use super::octree::{NO_PROBE, Octree, WIDTH};
use super::probe::{Ambient, Surfels};
use crate::base::math::Rgb;
use crate::base::octahedral::{middle, solid_angle, taps};
use crate::probe::placement::ProbeWeight;
use crate::probe::places::Places;
use glam::{Vec2, Vec3};
use rayon::prelude::*;
use std::f32::consts::PI;

/// Exponent of the cosine about a direction by which distances are averaged. *Ours*: the lobe is some 20 degrees wide.
const SHARPNESS: f32 = 50.0;
/// Weight of a probe that the surface faces away from. *Paper*: small, so that no point is without any.
pub(crate) const LEAST_FACING: f32 = 0.05;
/// Weight of a probe that is likely hidden.
pub(crate) const LEAST_SEEN: f32 = 1e-6;
/// Least weight by place of a probe that the octree says sees the point: more than that of hidden ones, less than that of any beside it.
pub(crate) const LEAST_NEAR: f32 = 1e-3;
/// Texels of the map that light is gathered from, along an edge.
const COARSE: usize = 64;

impl Ambient {
    /// Of a probe that sees `radiance` from its surfaces, in maps of `size` x `size`. `far` stands for the distance of what is not seen.
    pub fn new(surfels: &Surfels, radiance: &[Rgb], size: usize, far: f32) -> Self {
        let coarse = Coarse::new(surfels, radiance, far);
        let texel = |i: usize| coarse.about(middle(i, size));
        let (irradiance, moments) = (0..size * size).into_par_iter().map(texel).unzip();
        Self { size, irradiance, moments }
    }

    fn taps(&self, d: Vec3) -> [(usize, f32); 4] {
        taps(d, self.size)
    }
}

/// A probe's light and distances at few texels, each the mean of those that it covers.
struct Coarse {
    directions: Vec<Vec3>,
    /// Radiance times solid angle.
    power: Vec<Rgb>,
    /// Distance, its square, and solid angle.
    depth: Vec<[f32; 3]>,
}

impl Coarse {
    fn new(surfels: &Surfels, radiance: &[Rgb], far: f32) -> Self {
        let n = COARSE.min(surfels.size);
        let step = surfels.size / n;
        let mut coarse = Self { directions: Vec::new(), power: Vec::new(), depth: Vec::new() };
        for i in 0..n * n {
            let (x0, y0) = (i % n * step, i / n * step);
            let (mut power, mut depth) = (Rgb::ZERO, [0.0; 3]);
            for (x, y) in (0..step).flat_map(|y| (0..step).map(move |x| (x0 + x, y0 + y))) {
                let (texel, omega) = (y * surfels.size + x, solid_angle(x, y, surfels.size));
                let distance = surfels.distance[texel].min(far);
                power += radiance[texel] * omega;
                depth = [depth[0] + distance * omega, depth[1] + distance * distance * omega, depth[2] + omega];
            }
            coarse.directions.push(middle(i, n));
            coarse.power.push(power);
            coarse.depth.push(depth);
        }
        coarse
    }

    /// Irradiance of a surface that faces `d`, and the moments of distance about `d`.
    fn about(&self, d: Vec3) -> (Rgb, Vec2) {
        let (mut light, mut shares) = (Rgb::ZERO, 0.0);
        let (mut moments, mut weights) = (Vec2::ZERO, 0.0);
        for ((direction, power), [first, second, omega]) in self.directions.iter().zip(&self.power).zip(&self.depth) {
            let cos = direction.dot(d);
            if cos > 0.0 {
                light += *power * cos;
                shares += omega * cos;
                let weight = cos.powf(SHARPNESS);
                moments += Vec2::new(*first, *second) * weight;
                weights += omega * weight;
            }
        }
        // The cosines' own sum is not quite pi.
        (light * (PI / shares), moments / weights)
    }
}

/// Irradiance at a point with a unit normal, from the probes around it, and those that the octree says see it: weighted by place, by facing,
/// and by Chebyshev's bound on the share of surfaces about the direction that are farther than the point.
pub fn irradiance(places: &Places, octree: Option<&Octree>, probes: &[Ambient], p: Vec3, normal: Vec3) -> Rgb {
    let (mut sum, mut weights) = (Rgb::ZERO, 0.0);
    let seeing = octree.map_or([NO_PROBE; WIDTH], |octree| octree.at(p));
    let seeing = seeing.into_iter().filter(|&i| i != NO_PROBE).map(|i| ProbeWeight { probe: i as usize, weight: LEAST_NEAR });
    for around in places.around(p).into_iter().chain(seeing) {
        if around.weight <= 0.0 {
            continue;
        }
        let probe = &probes[around.probe];
        let to_point = p - places.position(around.probe);
        let distance = to_point.length();
        let d = to_point / distance.max(f32::MIN_POSITIVE);
        let facing = (-d.dot(normal)).max(LEAST_FACING);
        let [mean, square] =
            probe.taps(d).into_iter().fold([0.0; 2], |[a, b], (i, w)| [a + probe.moments[i].x * w, b + probe.moments[i].y * w]);
        let seen = if distance <= mean {
            1.0
        } else {
            let variance = (square - mean * mean).max(1e-4 * mean * mean);
            variance / (variance + (distance - mean).powi(2))
        };
        // Cubed: what is half hidden counts little, as leaks show more than missing light.
        let weight = around.weight * facing * seen.powi(3).max(LEAST_SEEN);
        let light: Rgb = probe.taps(normal).into_iter().map(|(i, w)| probe.irradiance[i] * w).sum();
        sum += light * weight;
        weights += weight;
    }
    if weights > 0.0 { sum / weights } else { Rgb::ZERO }
}
