//! The search of a probe's texels (§5.2): for a pixel, the texel of least energy (Eq. 1) around where the probe sees the same reflected point.
//!
//! *Ours*: one pixel in so many each way, an anchor, is searched for in full; those between begin where it ended.

use super::candidates::WeightedProbe;
use super::gather::{GatherParams, SearchLevel};
use super::perturb::Perturbation;
use crate::base::math::floor;
use crate::view::gbuffer::{GBuffer, Pixel};
use crate::view::mirror::{NOTHING, Reflected};
use glam::{Vec2, Vec3};

/// Most samples to each side of a search's centre.
pub const MAX_RADIUS: i32 = 15;

/// Side of a tile of pixels: what their searches read of a probe, some 100 KB, fits into a core's cache.
pub(crate) const TILE: usize = 16;

/// The glossy pixels of a view that reflect something, with their indices, square by square: neighbours search the same texels of a
/// probe, which then stay in the cache.
pub fn tiles<'a>(view: &'a GBuffer, reflected: &[Reflected]) -> Vec<Vec<(usize, &'a Pixel)>> {
    let [width, height] = view.size();
    let glossy = |i: usize| {
        let pixel = view.pixels[i].as_ref().filter(|p| p.alpha.is_some() && reflected[i].material != NOTHING);
        pixel.map(|p| (i, p))
    };
    let tile = |x: usize, y: usize| {
        let rows = y..(y + TILE).min(height);
        rows.flat_map(|y| (x..(x + TILE).min(width)).map(move |x| y * width + x)).filter_map(glossy).collect()
    };
    (0..height).step_by(TILE).flat_map(|y| (0..width).step_by(TILE).map(move |x| tile(x, y))).collect()
}

/// What one probe offers a pixel.
#[derive(Debug, Clone, Copy)]
pub struct Sample {
    /// Its energy (Eq. 1).
    pub energy: f32,
    /// Its continuous texel coordinate.
    pub texel: Vec2,
}

/// How much worse than its anchor a pixel's sample may be before it is searched for in full: a factor, and an addend.
pub(crate) const ANCHOR_TOLERANCE: (f32, f32) = (3.0, 0.1);

/// The sample of least energy of each of `probes` (at most eight), for each pixel of one of [`tiles`], as `eye` sees it. `width`
/// is the view's.
pub fn best_samples(
    eye: Vec3,
    reflected: &[Reflected],
    (tile, width): (&[(usize, &Pixel)], usize),
    probes: &[WeightedProbe],
    params: &GatherParams,
) -> Vec<[Option<Sample>; 8]> {
    let targets: Vec<_> = tile
        .iter()
        .map(|&(i, pixel)| {
            let reflected = reflected[i];
            let (r, n) = (pixel.surface.p, pixel.normal);
            let direction = reflected.direction_from(r);
            let distance = reflected.distance_from(r);
            let path = Perturbation::new(eye, r, n, distance, &pixel.curvature, &params.perturb);
            let alpha = pixel.alpha.unwrap_or(0.0);
            (Target { normal: n, direction, reflected, material: pixel.surface.material, alpha }, path)
        })
        .collect();
    let step = params.anchors.max(1);
    let place = |i: usize| [i % width % TILE, i / width % TILE];
    let is_anchor = |i: usize| place(i).iter().all(|x| x.is_multiple_of(step));
    let mut samples = vec![[None; 8]; tile.len()];
    // By place in the tile: where an anchor's search ended, from where it began.
    let mut ends: Vec<Option<(Vec2, f32, u32)>> = vec![None; TILE * TILE];
    for (k, w) in probes.iter().enumerate() {
        let begin = |path: &Perturbation| w.texel_towards(path.reflection_point(w.probe.position));
        ends.fill(None);
        for ((samples, (target, path)), &(i, _)) in samples.iter_mut().zip(&targets).zip(tile).filter(|(_, t)| is_anchor(t.0)) {
            let Some(centre) = begin(path) else { continue };
            samples[k] = search(w, centre, target, &params.search, None, params);
            let [x, y] = place(i);
            ends[y * TILE + x] = samples[k].map(|s| (s.texel - centre, s.energy, target.material));
        }
        for ((samples, (target, path)), &(i, _)) in samples.iter_mut().zip(&targets).zip(tile).filter(|(_, t)| !is_anchor(t.0)) {
            let Some(centre) = begin(path) else { continue };
            let [x, y] = place(i).map(|x| x / step * step);
            let around = [(0, 0), (step, 0), (0, step), (step, step)].into_iter().filter_map(|(dx, dy)| {
                let inside = x + dx < TILE && y + dy < TILE;
                inside.then(|| ends[(y + dy) * TILE + x + dx]).flatten().filter(|a| a.2 == target.material)
            });
            samples[k] = between_anchors(w, centre, target, around, params)
                .or_else(|| search(w, centre, target, &params.search, None, params));
        }
    }
    samples
}

/// What a search looks for: what the energy compares, at the view.
struct Target {
    /// n, unit shading normal facing the viewer.
    normal: Vec3,
    /// Unit direction of the reflected ray, from the reflector's position r to R.
    direction: Vec3,
    /// R, what a mirror there shows.
    reflected: Reflected,
    /// Material of the reflector.
    material: u32,
    /// Its microfacet alpha.
    alpha: f32,
}

/// s_b: distance of the reflected hits, m, at most 1. Two hits at infinity differ by the chord between their directions, as at a
/// distance of 1 m; one at infinity and one not are as far apart as the energy can say.
fn reflected_distance(view: &Reflected, probe: &Reflected) -> f32 {
    if view.is_sky() == probe.is_sky() { view.point.distance(probe.point).min(1.0) } else { 1.0 }
}

impl WeightedProbe<'_> {
    /// The texel coordinate at which the probe sees the point `x`.
    fn texel_towards(&self, x: Vec3) -> Option<Vec2> {
        (x - self.probe.position).try_normalize().map(|d| self.probe.map.texel_from_direction(d))
    }

    /// E of Eq. 1, how badly a texel stands in for the target, where it is below `limit` and the reflectors are of one material.
    /// Zero is a perfect match; at most (3 + s_e) s_a.
    #[inline]
    fn energy_below(&self, limit: f32, texel: usize, target: &Target, params: &GatherParams) -> Option<f32> {
        let seen = &self.candidates.seen[texel];
        let reflected = seen.reflected();
        let s_a = if target.reflected.material == reflected.material { 1.0 } else { params.material_penalty };
        let s_b = reflected_distance(&target.reflected, &reflected);
        // The reflected hit alone rules most texels out.
        if u32::from(seen.material) != target.material || s_a * s_b >= limit {
            return None;
        }
        let directions = &self.candidates.directions[texel];
        let s_c = 1.0 - target.normal.dot(directions.normal);
        let s_d = 1.0 - target.direction.dot(directions.reflected);
        let both = target.alpha + directions.alpha;
        let s_e = if both > 0.0 { params.roughness_penalty * (target.alpha - directions.alpha).abs() / both } else { 0.0 };
        let energy = s_a * (s_b + s_c.clamp(0.0, 1.0) + s_d.clamp(0.0, 1.0) + s_e);
        (energy < limit).then_some(energy)
    }
}

/// The sample that the ends of the anchors `around` lead to; `None` where it is much worse than theirs, or there is none.
fn between_anchors(
    w: &WeightedProbe,
    centre: Vec2,
    target: &Target,
    around: impl Iterator<Item = (Vec2, f32, u32)>,
    params: &GatherParams,
) -> Option<Sample> {
    let mut start = None;
    let (mut least, mut allowed) = (f32::INFINITY, 0f32);
    for (end, energy, _) in around {
        allowed = allowed.max(energy * ANCHOR_TOLERANCE.0 + ANCHOR_TOLERANCE.1);
        let texel = centre + end;
        if let Some(energy) = w.energy_below(least, w.probe.index_at(texel), target, params) {
            (least, start) = (energy, Some(Sample { energy, texel }));
        }
    }
    let start = start?;
    let finest = params.search.last().map(std::slice::from_ref)?;
    search(w, start.texel, target, finest, Some(start), params).filter(|s| s.energy <= allowed)
}

/// The texel coordinate of least energy around `centre`, coarse level first; `known` is a sample there.
/// Only texels whose reflector is of the target's material count; `None` where there is none.
fn search(
    w: &WeightedProbe,
    mut centre: Vec2,
    target: &Target,
    levels: &[SearchLevel],
    known: Option<Sample>,
    params: &GatherParams,
) -> Option<Sample> {
    let probe = w.probe;
    let (mut least, mut found) = known.map_or((f32::INFINITY, centre), |s| (s.energy, s.texel));
    for level in levels {
        let step = probe.map.search_scale(centre) * level.step;
        let radius = level.radius.min(MAX_RADIUS);
        let mut columns = [(0.0, 0); 2 * MAX_RADIUS as usize + 1];
        for (i, column) in (-radius..=radius).zip(&mut columns) {
            let x = centre.x + step.x * i as f32;
            *column = (x, probe.column(floor(x)));
        }
        for j in -radius..=radius {
            let y = centre.y + step.y * j as f32;
            let row = probe.row(floor(y));
            for &(x, column) in &columns[..(2 * radius + 1).max(0) as usize] {
                if let Some(energy) = w.energy_below(least, row + column, target, params) {
                    least = energy;
                    found = Vec2::new(x, y);
                }
            }
        }
        if least == f32::INFINITY {
            return None;
        }
        centre = found;
    }
    Some(Sample { energy: least, texel: found })
}
