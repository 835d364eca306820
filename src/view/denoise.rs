//! Denoiser of frames of few samples: an edge-avoiding à-trous wavelet filter a layer.
//!
//! *Sources*: Dammertz et al. 2010 (five levels of a 5 x 5 B3 spline with holes, weights from normal, depth and albedo); the
//! colour's own edge stop is that of Schied et al. 2017, relative to the noise that the pixel's neighbourhood shows, since no earlier frame
//! is asked. *Paper* (§7.3.1): its path tracer is denoised by OptiX's network; [`crate::view::oidn`] is its like.
//! *Ours*: each layer is divided by its albedo before, and multiplied after, so that textures stay out of the filter; glossy light on surfaces that
//! are nearly mirrors is guided by what the mirror shows, as if it were seen directly; a pixel far brighter than all
//! around it is a sample of a rare path, and cut to its neighbours.
//!
//! In: layers and their guides, linear. Out: layers.

use crate::Result;
use crate::base::math::{Rgb, hash_words, luminance};
use crate::base::named::{Parameters, within};
use crate::material::Surface;
use crate::material::bsdf::Lobes;
use crate::scene::Camera;
use crate::transport::{Sampler, World};
use crate::view::gbuffer::GLOSSY;
use crate::view::mirror::mirror_direction;
use crate::view::mirror_light::glossy_albedo;
use glam::{Vec2, Vec3};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// Camera rays that a pixel's guides are the mean of, at the most.
pub(crate) const GUIDE_SAMPLES: u32 = 8;
/// Least albedo that light is divided by.
pub(crate) const MIN_ALBEDO: f32 = 0.02;
/// Depth that stands for the environment, in units of nothing: farther than all.
pub(crate) const FAR: f32 = 1e4;
/// Most levels: holes of 4096 pixels.
pub(crate) const MOST_LEVELS: u32 = 12;
/// Pixels that a despeckled one is compared with.
pub(crate) const NEIGHBOURS: u32 = 24;
/// One row of the B3 spline.
const SPLINE: [f32; 5] = [1.0 / 16.0, 1.0 / 4.0, 3.0 / 8.0, 1.0 / 4.0, 1.0 / 16.0];

/// Widths of the edge stops.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DenoiseParams {
    /// Levels; the holes double with each.
    pub levels: u32,
    /// Standard deviations of noise that two pixels may differ by.
    pub luminance_sigma: f32,
    /// How fast a pixel's weight falls with the angle between normals: exp(-power (1 - cos)), close to a power of the cosine.
    pub normal_power: f32,
    /// Depth that two pixels may differ by, in units of what the surface's slope explains.
    pub depth_sigma: f32,
    /// Albedo that two pixels may differ by.
    pub albedo_sigma: f32,
    /// Greatest alpha at which the glossy layer is guided by what the mirror shows.
    pub mirror_alpha: f32,
    /// Of how many neighbours a pixel must not be the brightest by far: the rank, among 24, of the one that it is cut to; 0: never.
    pub despeckle: u32,
}

impl Default for DenoiseParams {
    fn default() -> Self {
        Self {
            levels: 5,
            luminance_sigma: 4.0,
            normal_power: 16.0,
            depth_sigma: 1.0,
            albedo_sigma: 0.3,
            mirror_alpha: 0.02,
            despeckle: 2,
        }
    }
}

impl Parameters for DenoiseParams {
    fn validate(&self) -> Result<()> {
        within("levels", self.levels, 0..=MOST_LEVELS)?;
        within("luminance_sigma", self.luminance_sigma, 0.0..=1e9)?;
        within("normal_power", self.normal_power, 0.0..=1e9)?;
        within("depth_sigma", self.depth_sigma, 0.0..=1e9)?;
        within("albedo_sigma", self.albedo_sigma, 0.0..=1e9)?;
        within("mirror_alpha", self.mirror_alpha, 0.0..=1.0)?;
        within("despeckle", self.despeckle, 0..=NEIGHBOURS)
    }
}

/// What a filter is guided by at a pixel.
#[derive(Debug, Clone, Copy, Default)]
pub struct Guide {
    /// Mean normal; shorter than 1 at edges, zero for the environment.
    pub normal: Vec3,
    /// Mean distance along the view's way, m.
    pub depth: f32,
    /// Mean albedo of the lobe that makes the layer.
    pub albedo: Rgb,
    /// Mean albedo that divides the layer.
    pub factor: Rgb,
}

impl Guide {
    fn scaled(self, f: f32) -> Self {
        Self { normal: self.normal * f, depth: self.depth * f, albedo: self.albedo * f, factor: self.factor * f }
    }

    fn plus(self, o: Self) -> Self {
        Self {
            normal: self.normal + o.normal,
            depth: self.depth + o.depth,
            albedo: self.albedo + o.albedo,
            factor: self.factor + o.factor,
        }
    }
}

/// Guides of the diffuse and of the glossy layer of frame number `frame`: means over the camera rays of its first samples. Up to
/// `mirror_alpha`, glossy surfaces are guided by what they show as mirrors.
pub fn guides(world: &World, camera: &Camera, mirror_alpha: f32, samples: u32, seed: u32, frame: u32) -> [Vec<Guide>; 2] {
    let [width, height] = camera.size;
    let samples = samples.clamp(1, GUIDE_SAMPLES);
    let pixel = |i: u32| {
        let mut sums = [Guide::default(); 2];
        for index in 0..samples {
            let ray = camera.drawn_ray(i, Sampler::new(hash_words(&[seed, frame, i]), index).next_4d());
            let far = Guide { depth: FAR, ..Guide::default() };
            let both = world.seen(&ray).map_or([far; 2], |s| surface_guides(world, &s, -ray.d, mirror_alpha));
            sums = [sums[0].plus(both[0]), sums[1].plus(both[1])];
        }
        sums.map(|g| g.scaled(1.0 / samples as f32))
    };
    let (diffuse, glossy) =
        (0..width * height).into_par_iter().with_min_len(width as usize).map(pixel).map(|[d, g]| (d, g)).unzip();
    [diffuse, glossy]
}

fn surface_guides(world: &World, s: &Surface, wo: Vec3, mirror_alpha: f32) -> [Guide; 2] {
    let bsdf = world.scene.bsdf(s);
    let wi = s.frame.to_local(wo);
    let (normal, depth) = (s.facing_normal(wo), s.t);
    let diffuse = bsdf.diffuse_albedo(s, wi);
    let lobe = bsdf.glossy_albedo(s, wi, GLOSSY);
    let plain = |albedo: Rgb| Guide { normal, depth, albedo, factor: albedo };
    let is_mirror = bsdf.lobes().contains(Lobes::NON_DIFFUSE) && bsdf.alpha(s).is_some_and(|a| a <= mirror_alpha);
    if !is_mirror || bsdf.is_transmissive() {
        return [plain(diffuse), plain(lobe)];
    }
    let ray = s.spawn(mirror_direction(s, wo));
    let through = match world.intersect(&ray) {
        Some(hit) => {
            let there = world.scene.bsdf(&hit).diffuse_albedo(&hit, hit.frame.to_local(-ray.d));
            let all = there + glossy_albedo(world, &hit, -ray.d);
            Guide { normal: hit.facing_normal(-ray.d), depth: depth + hit.t, albedo: all * lobe, factor: lobe * all }
        }
        None => Guide { normal: Vec3::ZERO, depth: FAR, albedo: lobe, factor: lobe },
    };
    [plain(diffuse), through]
}

/// One layer's light, albedo divided out, and the variance of its luminance.
type Signal = Vec<(Rgb, f32)>;

/// One layer, filtered.
pub fn filter_layer(layer: &[Rgb], guides: &[Guide], width: usize, params: &DenoiseParams) -> Vec<Rgb> {
    let image = Image { guides, slopes: slopes(guides, width), width, height: layer.len() / width.max(1), params };
    let factor = |g: &Guide| g.factor.max(Rgb::splat(MIN_ALBEDO));
    let light: Vec<Rgb> = layer.iter().zip(guides).map(|(&c, g)| c / factor(g)).collect();
    let light = if params.despeckle > 0 { image.despeckled(&light) } else { light };
    let mut signal = image.with_variance(&light);
    for level in 0..params.levels.min(MOST_LEVELS) {
        signal = image.smoothed(&signal, 1 << level);
    }
    signal.iter().zip(guides).map(|((c, _), g)| *c * factor(g)).collect()
}

/// Change of depth from a pixel to the next, the smaller of both sides' along each axis.
fn slopes(guides: &[Guide], width: usize) -> Vec<Vec2> {
    let height = guides.len() / width.max(1);
    let slope = |i: usize| {
        let (x, y) = (i % width, i / width);
        let step = |ok: bool, j: usize| if ok { (guides[j].depth - guides[i].depth).abs() } else { f32::INFINITY };
        let least = |a: f32, b: f32| if a.min(b).is_finite() { a.min(b) } else { 0.0 };
        Vec2::new(
            least(step(x > 0, i.wrapping_sub(1)), step(x + 1 < width, i + 1)),
            least(step(y > 0, i.wrapping_sub(width)), step(y + 1 < height, i + width)),
        )
    };
    (0..guides.len()).into_par_iter().with_min_len(width.max(1)).map(slope).collect()
}

struct Image<'a> {
    guides: &'a [Guide],
    slopes: Vec<Vec2>,
    width: usize,
    height: usize,
    params: &'a DenoiseParams,
}

impl Image<'_> {
    fn map<T: Send>(&self, pixel: impl Fn(usize) -> T + Sync + Send) -> Vec<T> {
        (0..self.guides.len()).into_par_iter().with_min_len(self.width.max(1)).map(pixel).collect()
    }

    /// The pixels `step` apart up to `radius` steps from `i`, with their offsets in steps.
    fn around(&self, i: usize, radius: isize, step: isize) -> impl Iterator<Item = (usize, [isize; 2])> {
        let (x, y) = ((i % self.width) as isize, (i / self.width) as isize);
        let (width, height) = (self.width as isize, self.height as isize);
        (-radius..=radius).flat_map(move |dy| (-radius..=radius).map(move |dx| [dx, dy])).filter_map(move |[dx, dy]| {
            let (x, y) = (x + dx * step, y + dy * step);
            (x >= 0 && y >= 0 && x < width && y < height).then_some(((y * width + x) as usize, [dx, dy]))
        })
    }

    /// How little the surfaces of two pixels agree, `offset` pixels apart: minus the logarithm of a weight.
    fn difference(&self, i: usize, j: usize, offset: Vec2) -> f32 {
        let (a, b) = (&self.guides[i], &self.guides[j]);
        let lengths = (a.normal.length_squared() * b.normal.length_squared()).sqrt();
        // Two pixels of sky agree.
        let cos = if lengths > 1e-6 { a.normal.dot(b.normal) / lengths } else { f32::from(a.normal == b.normal) };
        let slope = self.slopes[i].dot(offset.abs()) + 1e-3 * a.depth;
        let depth = (a.depth - b.depth).abs() / (self.params.depth_sigma * slope + f32::MIN_POSITIVE);
        let albedo = (a.albedo - b.albedo).length_squared() / (self.params.albedo_sigma * self.params.albedo_sigma);
        self.params.normal_power * (1.0 - cos) + depth + albedo
    }

    /// Whether a pixel's surface has the layer at all.
    fn is_lit(&self, i: usize) -> bool {
        self.guides[i].factor != Rgb::ZERO
    }

    /// Light in which no pixel is brighter than the neighbour of the given rank.
    fn despeckled(&self, light: &[Rgb]) -> Vec<Rgb> {
        self.map(|i| {
            if !self.is_lit(i) {
                return light[i];
            }
            let mut near: Vec<f32> = self.around(i, 2, 1).filter(|&(j, _)| j != i).map(|(j, _)| luminance(light[j])).collect();
            near.sort_unstable_by(|a, b| b.total_cmp(a));
            let own = luminance(light[i]);
            match near.get(self.params.despeckle as usize - 1) {
                Some(&limit) if own > limit => light[i] * (limit / own),
                _ => light[i],
            }
        })
    }

    /// The light with the variance of its luminance over the 7 x 7 pixels around, weighted by how well they agree.
    fn with_variance(&self, light: &[Rgb]) -> Signal {
        self.map(|i| {
            if !self.is_lit(i) {
                return (light[i], 0.0);
            }
            let (mut sum, mut squares, mut total) = (0.0, 0.0, 0.0);
            for (j, [dx, dy]) in self.around(i, 3, 1) {
                let weight = (-self.difference(i, j, Vec2::new(dx as f32, dy as f32))).exp();
                let y = luminance(light[j]);
                (sum, squares, total) = (sum + weight * y, squares + weight * y * y, total + weight);
            }
            let mean = sum / total;
            (light[i], (squares / total - mean * mean).max(0.0))
        })
    }

    /// One level of the wavelet: taps `step` pixels apart.
    fn smoothed(&self, signal: &Signal, step: isize) -> Signal {
        self.map(|i| {
            if !self.is_lit(i) {
                return signal[i];
            }
            let (mut blurred, mut total) = (0.0, 0.0);
            for (j, [dx, dy]) in self.around(i, 1, 1) {
                let weight = [0.5, 0.25][dx.unsigned_abs()] * [0.5, 0.25][dy.unsigned_abs()];
                (blurred, total) = (blurred + weight * signal[j].1, total + weight);
            }
            let noise = self.params.luminance_sigma * (blurred / total).sqrt() + 1e-6;
            let own = luminance(signal[i].0);
            let (mut light, mut variance, mut total) = (Rgb::ZERO, 0.0, 0.0);
            for (j, [dx, dy]) in self.around(i, 2, step) {
                let spline = SPLINE[(dx + 2) as usize] * SPLINE[(dy + 2) as usize];
                let offset = Vec2::new((dx * step) as f32, (dy * step) as f32);
                let weight = match i == j {
                    true => spline,
                    false => {
                        let bright = (luminance(signal[j].0) - own).abs() / noise;
                        spline * (-self.difference(i, j, offset) - bright).exp()
                    }
                };
                light += signal[j].0 * weight;
                variance += signal[j].1 * weight * weight;
                total += weight;
            }
            (light / total, variance / (total * total))
        })
    }
}
