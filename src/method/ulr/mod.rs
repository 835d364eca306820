//! Baseline: unstructured lumigraph rendering of the probes (Buehler et al. 2001), a pixel at a time.
//!
//! Every pixel's surface point is projected into the probes that see it; their glossy colours are blended by how little their rays
//! differ from the pixel's. What a mirror shows moves with the viewer and the colours do not, so that reflections come out doubled:
//! that is what this baseline is there to show.
//!
//! *Buehler*: a penalty, the weighted sum of the angle at the point between the rays to the eye and to the probe, of the resolution
//! that is lost where the probe is farther away than the eye, and of visibility; the k probes of least penalty; a weight that falls to zero at
//! the k-th, so that none pops in or out; a weight without bound where a probe's ray is the eye's own (epipole consistency).
//! *Paper* (§7.3.1): "standard ULR weights per-pixel", the scene's geometry as the proxy, all without numbers.
//! *Ours*: the numbers; the weight (1 - q / q_k) / q; visibility by comparing surfaces, tap by tap; the resolution's loss relative to the
//! distance, so that it has no unit; where no probe sees the point, those that see its object stand in, far behind all others.
//!
//! The probes' colours have their own, reduced roughness (§6.1): bake them with a scale of 1 for the material's. A probe set that was baked
//! for the views of another method has texels without light: they count as unseen.
//!
//! In: a view's G-buffer, and probes. Out: its glossy layer, linear radiance.

pub mod gpu;
mod row;

pub use row::METHOD;

use crate::Result;
use crate::base::math::{Rgb, floor, fraction};
use crate::base::named::{Parameters, within};
use crate::probe::file::{NO_TRIANGLE, Probe, Texel};
use crate::probe::places::Places;
use crate::transport::World;
use crate::view::MOST_SUPERSAMPLES;
use crate::view::gbuffer::{GBuffer, Pixel, glossy};
use glam::{Vec2, Vec3};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// Least angle between two rays, radians: keeps the weight of a probe at the eye finite.
pub(crate) const MIN_PENALTY: f32 = 1e-3;
/// How far a texel that sees the same surface may lie from the point, as a fraction of the probe's distance: a slanted surface spreads
/// a texel far.
pub(crate) const MAX_SPREAD: f32 = 0.2;

/// Most probes that a pixel blends.
const MOST_BLENDED: u32 = 64;

/// Parameters of the method.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct UlrParams {
    /// N x N rays a pixel through all passes.
    pub supersample: u32,
    /// Probes that a pixel blends, k.
    pub blend: u32,
    /// Probes that are asked at all: those nearest the eye.
    pub probes: u32,
    /// Weight of the angle, per radian.
    pub angle: f32,
    /// Weight of the resolution's loss.
    pub resolution: f32,
    /// Penalty of a probe that sees the point's object, but not the point.
    pub hidden: f32,
    /// How far off the point's tangent plane a texel may lie that sees it, as a fraction of the probe's distance.
    pub plane_tolerance: f32,
}

impl Default for UlrParams {
    fn default() -> Self {
        Self { supersample: 1, blend: 4, probes: 64, angle: 1.0, resolution: 0.1, hidden: 10.0, plane_tolerance: 0.01 }
    }
}

impl Parameters for UlrParams {
    fn validate(&self) -> Result<()> {
        within("supersample", self.supersample, 1..=MOST_SUPERSAMPLES)?;
        within("blend", self.blend, 1..=MOST_BLENDED)?;
        within("probes", self.probes, 1..=1 << 20)?;
        within("angle", self.angle, 0.0..=1e9)?;
        within("resolution", self.resolution, 0.0..=1e9)?;
        within("hidden", self.hidden, 0.0..=1e9)?;
        within("plane_tolerance", self.plane_tolerance, 0.0..=1e9)
    }
}

/// A view's glossy layer.
pub struct UlrImage {
    /// Linear radiance.
    pub glossy: Vec<Rgb>,
    /// Glossy pixels that no probe served: black.
    pub unserved: usize,
}

/// Indices of the `count` probes nearest the eye that are neither blocked nor left out by `is_baked`, nearest first.
pub fn nearest(places: &Places, eye: Vec3, count: usize, is_baked: impl Fn(usize) -> bool) -> Vec<usize> {
    let usable = (0..places.len()).filter(|&i| !places.is_blocked(i) && is_baked(i));
    let mut list: Vec<(f32, usize)> = usable.map(|i| (places.position(i).distance_squared(eye), i)).collect();
    list.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    list.into_iter().take(count).map(|(_, i)| i).collect()
}

/// Blends the probes' colours at every glossy pixel.
pub fn ulr(world: &World, view: &GBuffer, probes: &[Arc<Probe>], params: &UlrParams) -> UlrImage {
    let eye = view.camera.position();
    let pixel = |pixel: &Option<Pixel>| match glossy(pixel) {
        Some(p) => blend(world, eye, p, probes, params),
        None => Some(Rgb::ZERO),
    };
    let found: Vec<Option<Rgb>> = view.pixels.par_iter().with_min_len(view.size()[0]).map(pixel).collect();
    let unserved = found.iter().filter(|c| c.is_none()).count();
    UlrImage { glossy: found.into_iter().map(Option::unwrap_or_default).collect(), unserved }
}

/// The penalty of a probe at `at` for the point `p` seen from `eye`, visibility left out.
fn penalty(eye: Vec3, p: Vec3, at: Vec3, params: &UlrParams) -> f32 {
    let (to_eye, to_probe) = (eye - p, at - p);
    let (near, far) = (to_eye.length(), to_probe.length().max(f32::MIN_POSITIVE));
    let angle = to_eye.angle_between(to_probe);
    params.angle * angle + params.resolution * (1.0 - near / far).max(0.0)
}

/// Weights of the penalties of k probes, in ascending order: they fall to zero at the last. A probe alone has all the weight.
fn weights(penalties: &[f32]) -> impl Iterator<Item = f32> {
    let last = penalties.last().copied().unwrap_or(0.0) * (1.0 + 1e-5) + MIN_PENALTY;
    penalties.iter().map(move |&q| {
        let q = q + MIN_PENALTY;
        (1.0 - q / last).max(1e-6) / q
    })
}

/// The pixel's colour; `None` where no probe sees its object.
fn blend(world: &World, eye: Vec3, pixel: &Pixel, probes: &[Arc<Probe>], params: &UlrParams) -> Option<Rgb> {
    let p = pixel.surface.p;
    let mut order: Vec<(f32, usize)> = probes.iter().map(|probe| penalty(eye, p, probe.position, params)).zip(0..).collect();
    order.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    let (mut seen, mut hidden) = (Vec::new(), Vec::new());
    let most = params.blend.max(1) as usize;
    for (q, i) in order {
        match look(world, pixel, &probes[i], params) {
            Some((color, true)) => seen.push((q, color)),
            Some((color, false)) => hidden.push((q + params.hidden, color)),
            None => {}
        }
        if seen.len() == most {
            break;
        }
    }
    seen.extend(hidden);
    seen.truncate(most);
    let penalties: Vec<f32> = seen.iter().map(|s| s.0).collect();
    let (mut sum, mut total) = (Rgb::ZERO, 0.0);
    for (weight, (_, color)) in weights(&penalties).zip(&seen) {
        sum += *color * weight;
        total += weight;
    }
    (total > 0.0).then(|| sum / total)
}

/// What a probe shows where it should see the pixel's point, bilinear over the texels that do, and true; over those that see another
/// point of the same object, and false, where none does.
fn look(world: &World, pixel: &Pixel, probe: &Probe, params: &UlrParams) -> Option<(Rgb, bool)> {
    let p = pixel.surface.p;
    let distance = p.distance(probe.position);
    let at = probe.map.texel_from_direction((p - probe.position).try_normalize()?);
    let f = fraction(at - 0.5);
    let (x, y) = (floor(at.x - 0.5), floor(at.y - 0.5));
    // Colour and weight of the texels that see the point, and of those that see its object.
    let mut sums = [(Rgb::ZERO, 0.0); 2];
    for (i, j) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
        let texel = &probe.texels[probe.index(x + i, y + j)];
        let color = texel.glossy();
        if color == Rgb::ZERO {
            continue;
        }
        let Some(there) = reflector(world, texel, pixel.surface.object) else { continue };
        let off = there - p;
        let sees = off.dot(pixel.surface.ng).abs() < params.plane_tolerance * distance && off.length() < MAX_SPREAD * distance;
        let share = Vec2::new(if i == 1 { f.x } else { 1.0 - f.x }, if j == 1 { f.y } else { 1.0 - f.y });
        let weight = share.x * share.y + 1e-4;
        let sum = &mut sums[usize::from(!sees)];
        *sum = (sum.0 + color * weight, sum.1 + weight);
    }
    let [seen, same_object] = sums.map(|(color, weight)| (weight > 0.0).then(|| color / weight));
    seen.map(|c| (c, true)).or(same_object.map(|c| (c, false)))
}

/// Where a texel's reflector lies, if it belongs to `object`.
fn reflector(world: &World, texel: &Texel, object: u32) -> Option<Vec3> {
    let geometry = &world.scene.geometry;
    if texel.triangle == NO_TRIANGLE || geometry.triangle_object[texel.triangle as usize] != object {
        return None;
    }
    let [a, b, c] = geometry.corners(texel.triangle);
    let w = texel.barycentric();
    Some(a * (1.0 - w.x - w.y) + b * w.x + c * w.y)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_eye_s_own_ray_has_no_penalty_and_both_angle_and_distance_cost() {
        let params = UlrParams::default();
        let (eye, p) = (Vec3::new(0.0, 0.0, 2.0), Vec3::ZERO);
        assert_eq!(penalty(eye, p, eye, &params), 0.0);
        // Nearer on the same ray: no resolution is lost. Twice as far: half of it.
        assert!(penalty(eye, p, Vec3::Z, &params).abs() < 1e-6);
        assert!((penalty(eye, p, Vec3::Z * 4.0, &params) - 0.05).abs() < 1e-6);
        let aside = penalty(eye, p, Vec3::new(2.0, 0.0, 0.0), &params);
        assert!((aside - std::f32::consts::FRAC_PI_2).abs() < 1e-5, "{aside}");
    }

    #[test]
    fn weights_vanish_at_the_last_and_grow_without_bound_at_the_eye_s_own_ray() {
        let normalised = |penalties: &[f32]| -> Vec<f32> {
            let all: Vec<f32> = weights(penalties).collect();
            let sum: f32 = all.iter().sum();
            all.into_iter().map(|w| w / sum).collect()
        };
        let w = normalised(&[0.1, 0.2, 0.3, 0.4]);
        assert!(w[3] < 1e-3, "{w:?}");
        // (1 - q / 0.4) / q: 7.5, 2.5, 0.83.
        for (found, expected) in w.iter().zip([0.692, 0.231, 0.077]) {
            assert!((found - expected).abs() < 0.01, "{w:?}");
        }
        assert!(normalised(&[0.0, 0.2, 0.3])[0] > 0.98);
        assert_eq!(normalised(&[0.7]), [1.0]);
        // Two that agree share evenly.
        assert_eq!(normalised(&[0.3, 0.3]), [0.5, 0.5]);
    }
}
