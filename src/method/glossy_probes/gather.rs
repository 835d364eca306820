//! Gathering view-dependent colour from the probes around the camera (§5.2).
//!
//! For each glossy pixel and each of the eight nearest probes: estimate where on the reflector the probe sees the same reflected
//! point (§5.1), search the probe's texels around it for the one with least energy (Eq. 1), and blend the eight colours (Eq. 2).
//!
//! *Ours*: colour is fetched at the fractional coordinate, geometry at the texel that holds it.

use super::candidates::Candidates;
use super::perturb::{PerturbParams, Perturbation};
use crate::base::math::{Rgb, floor, fraction};
use crate::material::bsdf::{Lobes, Query};
use crate::probe::file::Probe;
use crate::transport::World;
use crate::view::gbuffer::{GBuffer, Pixel};
use crate::view::mirror::{NOTHING, Reflected};
use glam::{Vec2, Vec3};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// Most samples to each side of a search's centre.
pub const MAX_RADIUS: i32 = 15;

/// One level of the neighbour search: (2 radius + 1)² samples.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SearchLevel {
    /// Samples to each side of the centre; more than [`MAX_RADIUS`] count as that.
    pub radius: i32,
    /// Distance between samples, texels of an undistorted map; scaled by the map's derivative.
    pub step: f32,
}

/// When a neighbouring texel's colour may be blended in.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum BilinearRule {
    /// Never: the nearest texel's colour alone.
    Nearest,
    /// On the same reflecting object. *Paper*.
    SameReflector,
    /// On the same reflecting object, showing the same reflected material: does not bleed over edges seen in mirrors.
    SameReflectorAndReflected,
}

/// Parameters of the gather.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GatherParams {
    /// The search, coarse to fine. *Paper* (§5.2): 7x7 at 4 texels, then 3x3 at 2 texels. *Ours*: then 3x3 at 1 texel, which finds
    /// thin reflectors.
    pub search: Vec<SearchLevel>,
    /// Of the pixels, one in so many each way is searched for in full; those between begin where these ended, with the finest
    /// level alone, unless that is much worse. *Paper*: 1, each. *Ours*: 4, a quarter of the time for the same error.
    #[serde(default = "every_pixel")]
    pub anchors: usize,
    /// s_a, the factor on the energy where the reflected materials differ. *Paper*: 10.
    pub material_penalty: f32,
    /// s_e, the factor on how much the reflectors' roughness differs, |α - α'| / (α + α'), which is added to the energy (Eq. 1). *Paper*: 0;
    /// its §8 names the term. *Ours*: 1.
    #[serde(default)]
    pub roughness_penalty: f32,
    /// φ, the falloff of a sample's weight with its energy (Eq. 2). *Paper*: 8. *Ours*: 128.
    pub falloff: f32,
    /// The power of t_i that counts as a probe's weight: below 1, the nearest probe outweighs the others less, and all still come
    /// and go without a jump. *Paper*: 1. *Ours*: 0.5.
    #[serde(default = "as_it_is")]
    pub trilinear_power: f32,
    /// How many of the eight nearest probes are asked, those of largest weight first. *Paper*: 8.
    pub probes: usize,
    /// How the reflection point is predicted (§5.1).
    pub perturb: PerturbParams,
    /// Which texels bilinear interpolation may blend.
    pub bilinear: BilinearRule,
    /// Divide the lobe's directional albedo out of a probe's sample and multiply the view's in. *Ours*; the paper does not.
    pub albedo_ratio: bool,
}

/// What sets of probes say that were baked before there were anchors.
fn every_pixel() -> usize {
    1
}

/// The same of the weights' power.
fn as_it_is() -> f32 {
    1.0
}

impl Default for GatherParams {
    fn default() -> Self {
        let paper = Self::paper();
        let finest = SearchLevel { radius: 1, step: 1.0 };
        Self {
            search: [paper.search, vec![finest]].concat(),
            anchors: 4,
            falloff: 128.0,
            trilinear_power: 0.5,
            bilinear: BilinearRule::SameReflectorAndReflected,
            albedo_ratio: true,
            roughness_penalty: 1.0,
            perturb: PerturbParams::default(),
            ..paper
        }
    }
}

impl GatherParams {
    /// The paper's text.
    pub fn paper() -> Self {
        Self {
            search: vec![SearchLevel { radius: 3, step: 4.0 }, SearchLevel { radius: 1, step: 2.0 }],
            anchors: 1,
            material_penalty: 10.0,
            roughness_penalty: 0.0,
            falloff: 8.0,
            trilinear_power: 1.0,
            probes: 8,
            perturb: PerturbParams::paper(),
            bilinear: BilinearRule::SameReflector,
            albedo_ratio: false,
        }
    }

    /// A probe's weight at equal energy, for its trilinear weight t_i.
    pub fn probe_weight(&self, t: f32) -> f32 {
        t.powf(self.trilinear_power).max(MIN_WEIGHT)
    }
}

/// s_b: distance of the reflected hits, m, at most 1. Two hits at infinity differ by the chord between their directions, as at a
/// distance of 1 m; one at infinity and one not are as far apart as the energy can say.
fn reflected_distance(view: &Reflected, probe: &Reflected) -> f32 {
    if view.is_sky() == probe.is_sky() { view.point.distance(probe.point).min(1.0) } else { 1.0 }
}

/// Side of a tile of pixels: what their searches read of a probe, some 100 KB, fits into a core's cache.
pub(crate) const TILE: usize = 16;

/// Least weight: a probe at the far side of the cell still serves a pixel that no other serves.
const MIN_WEIGHT: f32 = 1e-6;

/// A gathered pixel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Gathered {
    /// Glossy radiance at the probes' reduced roughness (Eq. 2); black where `energy` is infinite.
    pub color: Rgb,
    /// Least energy among the probes' samples; infinite where no probe had a valid sample.
    pub energy: f32,
    /// The probe whose sample that was, and its texel coordinate; for inspection.
    pub best: Option<(usize, Vec2)>,
}

impl Gathered {
    /// Nothing was found.
    pub const NONE: Self = Self { color: Rgb::ZERO, energy: f32::INFINITY, best: None };
}

/// A probe that takes part.
pub struct WeightedProbe<'a> {
    /// Index in the set.
    pub index: usize,
    /// The probe.
    pub probe: &'a Probe,
    /// Its texels, ready for the search.
    pub candidates: &'a Candidates,
    /// Its weight at equal energy ([`GatherParams::probe_weight`]).
    pub weight: f32,
}

/// Gathers all pixels of a view from `probes` (§5.2). `reflected` holds the view's mirror hits, one a pixel.
/// `roughness_scale` is what the probes were baked at.
pub fn gather(
    world: &World,
    view: &GBuffer,
    reflected: &[Reflected],
    probes: &[WeightedProbe],
    roughness_scale: f32,
    params: &GatherParams,
) -> Vec<Gathered> {
    let eye = view.camera.position();
    let tiles = tiles(view, reflected);
    let gathered: Vec<Vec<Gathered>> = tiles
        .par_iter()
        .map(|tile| {
            let samples = best_samples(eye, reflected, (tile.as_slice(), view.size()[0]), probes, params);
            let blended = tile.iter().zip(&samples).map(|((_, p), s)| blend(world, p, s, probes, roughness_scale, params));
            blended.collect()
        })
        .collect();
    let mut image = vec![Gathered::NONE; view.pixels.len()];
    for ((i, _), g) in tiles.iter().flatten().zip(gathered.iter().flatten()) {
        image[*i] = *g;
    }
    image
}

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

/// Eq. 2.
fn blend(
    world: &World,
    pixel: &Pixel,
    samples: &[Option<Sample>; 8],
    probes: &[WeightedProbe],
    roughness_scale: f32,
    params: &GatherParams,
) -> Gathered {
    let found = || probes.iter().zip(samples).filter_map(|(w, s)| s.map(|s| (w, s)));
    let Some((nearest, best)) = found().min_by(|a, b| a.1.energy.total_cmp(&b.1.energy)) else {
        return Gathered::NONE;
    };
    // exp(-φ E_min) is cancelled against Z, so that it cannot underflow.
    let (mut sum, mut z) = (Rgb::ZERO, 0.0);
    let albedo = params.albedo_ratio.then(|| view_albedo(world, pixel, roughness_scale));
    for (w, sample) in found() {
        let weight = w.weight * (-params.falloff * (sample.energy - best.energy)).exp();
        let mut color = fetch(w, sample.texel, params.bilinear);
        if let Some(view) = albedo {
            color *= albedo_ratio(view, w, sample.texel);
        }
        sum += color * weight;
        z += weight;
    }
    Gathered { color: sum / z, energy: best.energy, best: Some((nearest.index, best.texel)) }
}

/// The texels that [`fetch`] may read for a sample: the four around it.
pub fn footprint_texels(probe: &Probe, at: Vec2) -> [usize; 4] {
    let (x, y) = (floor(at.x - 0.5), floor(at.y - 0.5));
    [(0, 0), (1, 0), (0, 1), (1, 1)].map(|(i, j)| probe.index(x + i, y + j))
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

/// Colour at a fractional texel coordinate, bilinear over those of the four texels around it that `rule` lets in.
fn fetch(w: &WeightedProbe, at: Vec2, rule: BilinearRule) -> Rgb {
    let light = &w.candidates.light;
    let centre = &light[w.probe.index_at(at)];
    if rule == BilinearRule::Nearest {
        return centre.glossy;
    }
    let f = fraction(at - 0.5);
    let (mut sum, mut total) = (Rgb::ZERO, 0.0);
    let weights = [(1.0 - f.x) * (1.0 - f.y), f.x * (1.0 - f.y), (1.0 - f.x) * f.y, f.x * f.y];
    for (i, weight) in footprint_texels(w.probe, at).into_iter().zip(weights) {
        let tap = &light[i];
        let same_reflected = tap.reflected_material == centre.reflected_material;
        if tap.object == centre.object && (rule == BilinearRule::SameReflector || same_reflected) {
            sum += tap.glossy * weight;
            total += weight;
        }
    }
    // The centre texel is among the four with a weight of at least 1/4.
    sum / total
}

/// Directional albedo of the non-diffuse lobe in the view over that at a probe's sample, both at the probes' roughness:
/// carries Fresnel and the specular texture over from one to the other. Clamped, as a ratio of small numbers says little.
fn albedo_ratio(view: Rgb, w: &WeightedProbe, at: Vec2) -> Rgb {
    let probe = w.candidates.light[w.probe.index_at(at)].albedo;
    (view / probe.max(Rgb::splat(1e-4))).clamp(Rgb::splat(0.25), Rgb::splat(4.0))
}

/// Directional albedo of the non-diffuse lobe in the view.
fn view_albedo(world: &World, pixel: &Pixel, roughness_scale: f32) -> Rgb {
    let query = Query { lobes: Lobes::NON_DIFFUSE, roughness_scale };
    let bsdf = &world.scene.materials[pixel.surface.material as usize].bsdf;
    bsdf.glossy_albedo(&pixel.surface, pixel.surface.frame.to_local(pixel.wo), query)
}
