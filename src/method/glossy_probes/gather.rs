//! Gathering view-dependent colour from the probes around the camera (§5.2).
//!
//! For each glossy pixel and each of the eight nearest probes: estimate where on the reflector the probe sees the same reflected
//! point (§5.1), search the probe's texels around it for the one with least energy (Eq. 1), and blend the eight colours (Eq. 2).
//!
//! *Ours*: colour is fetched at the fractional coordinate, geometry at the texel that holds it.

use super::blend::blend;
use super::candidates::WeightedProbe;
use super::perturb::PerturbParams;
use super::search::{BestSamples, MAX_RADIUS, TILE, tile};
use crate::Result;
use crate::base::math::{Rgb, floor};
use crate::base::named::within;
use crate::base::simd::{Kernel, Lanes, Simd};
use crate::material::bsdf::{Lobes, Query};
use crate::probe::file::Probe;
use crate::transport::World;
use crate::view::gbuffer::{GBuffer, Pixel};
use crate::view::mirror::Reflected;
use glam::Vec2;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// Most levels of a search.
pub const MAX_LEVELS: usize = 8;

/// One level of the neighbour search: (2 radius + 1)² samples.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SearchLevel {
    /// Samples to each side of the centre, [`MAX_RADIUS`] at the most.
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
    /// Divide the lobe's directional albedo out of a probe's sample and multiply the view's in. *Paper*: no. *Ours*: yes.
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

    /// An error where a parameter is out of its range.
    pub fn validate(&self) -> Result<()> {
        within("gather.search: levels", self.search.len(), 1..=MAX_LEVELS)?;
        for (i, level) in self.search.iter().enumerate() {
            within(&format!("gather.search.{i}.radius"), level.radius, 0..=MAX_RADIUS)?;
            within(&format!("gather.search.{i}.step"), level.step, 0.0..=1024.0)?;
        }
        within("gather.anchors", self.anchors, 1..=TILE)?;
        within("gather.material_penalty", self.material_penalty, 0.0..=1e9)?;
        within("gather.roughness_penalty", self.roughness_penalty, 0.0..=1e9)?;
        within("gather.falloff", self.falloff, 0.0..=1e9)?;
        within("gather.trilinear_power", self.trilinear_power, 0.0..=16.0)?;
        within("gather.probes", self.probes, 1..=8)?;
        self.perturb.validate()
    }

    /// A probe's weight at equal energy, for its trilinear weight t_i.
    pub fn probe_weight(&self, t: f32) -> f32 {
        t.powf(self.trilinear_power).max(MIN_WEIGHT)
    }
}

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
    gather_by(Lanes::chosen(), (world, view, reflected), probes, roughness_scale, params)
}

/// [`gather`] in one form of lanes.
fn gather_by(
    lanes: Lanes,
    (world, view, reflected): (&World, &GBuffer, &[Reflected]),
    probes: &[WeightedProbe],
    roughness_scale: f32,
    params: &GatherParams,
) -> Vec<Gathered> {
    let (eye, [width, _]) = (view.camera.position(), view.size());
    let mut image = vec![Gathered::NONE; view.pixels.len()];
    image.par_chunks_mut(width.max(1) * TILE).enumerate().for_each(|(strip, out)| {
        for left in (0..width).step_by(TILE) {
            let tile = tile(view, reflected, [left, strip * TILE]);
            let albedo = |p: &Pixel| params.albedo_ratio.then(|| view_albedo(world, p, roughness_scale));
            let search = BestSamples { eye, reflected, tile: &tile, width, probes, params };
            let albedos = tile.iter().map(|(_, p)| albedo(p)).collect();
            let found = lanes.run(Tile { search, albedos });
            tile.iter().zip(found).for_each(|((i, _), g)| out[i - strip * TILE * width] = g);
        }
    });
    image
}

/// A tile's search and what comes of it.
struct Tile<'a> {
    search: BestSamples<'a>,
    /// Of each pixel, where they are asked for.
    albedos: Vec<Option<Rgb>>,
}

impl Kernel for Tile<'_> {
    type Output = Vec<Gathered>;

    #[inline(always)]
    fn run<S: Simd>(self, s: S) -> Vec<Gathered> {
        let (probes, params) = (self.search.probes, self.search.params);
        let samples = self.search.run(s);
        let mut gathered = Vec::with_capacity(samples.len());
        for (samples, albedo) in samples.iter().zip(self.albedos) {
            gathered.push(blend(s, samples, albedo, probes, params));
        }
        gathered
    }
}

/// The texels that [`blend`] may read for a sample: the four around it.
pub fn footprint_texels(probe: &Probe, at: Vec2) -> [usize; 4] {
    let (x, y) = (floor(at.x - 0.5), floor(at.y - 0.5));
    [(0, 0), (1, 0), (0, 1), (1, 1)].map(|(i, j)| probe.index(x + i, y + j))
}

/// Directional albedo of the non-diffuse lobe in the view.
fn view_albedo(world: &World, pixel: &Pixel, roughness_scale: f32) -> Rgb {
    let query = Query { lobes: Lobes::NON_DIFFUSE, roughness_scale };
    let bsdf = &world.scene.materials[pixel.surface.material as usize].bsdf;
    bsdf.glossy_albedo(&pixel.surface, pixel.surface.frame.to_local(pixel.wo), query)
}
