//! The light map's denoiser: each texel becomes what a plane through the light around it says at its place.
//!
//! *Ours*, of known parts. A texel's neighbours are what its links lead to ([`super::links`]), so that charts do not show and nothing comes
//! through a wall. They are weighted by distance, by normal, and by how far their light differs beside the noise that both have, as in a
//! bilateral filter; the noise is measured, by how each texel's samples vary, as Rousselle et al. 2012 do. The fit is of first order
//! (Bitterli et al. 2016): light that falls off towards a corner keeps its slope where all neighbours lie on one side. Which light differs
//! is asked of an estimate: at first a mean of the nearest, whatever they show (of a texel that is hidden in part, its own light, which is often
//! unlike theirs), then what the pass before found. The light that is fitted is always that which was baked.
//!
//! In: sites, their links and light. Out: their light. The same bits for any number of threads: a site asks others alone.

use super::links::{Links, Site};
use crate::Result;
use crate::base::math::{Basis, Rgb, luminance};
use crate::base::named::{Parameters, within};
use crate::base::progress::Progress;
use glam::{DMat3, DVec3};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// Sites that one thread takes at a time.
const CHUNK: usize = 4096;

/// What holds the slope of a fit whose neighbours all lie on a line: a share of their weight, at the radius.
const RIDGE: f64 = 0.01;

/// How far and how freely light is shared. All *Ours*, by the errors of room's and staircase2's maps (docs/experiments.md).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DenoiseParams {
    /// Farthest neighbours, links.
    pub steps: u32,
    /// Distance at which a neighbour counts for nothing, texels.
    pub radius: f32,
    /// Both of the mean that the first pass compares by.
    pub first_steps: u32,
    /// See above.
    pub first_radius: f32,
    /// How fast the weight falls with the angle between normals: exp(-power (1 - cos)).
    pub normal_power: f32,
    /// Standard deviations of noise that neighbours may differ by: there the weight has fallen to 1/e.
    pub sigma: f32,
    /// Passes.
    pub passes: u32,
}

impl Default for DenoiseParams {
    fn default() -> Self {
        Self { steps: 6, radius: 6.5, first_steps: 3, first_radius: 3.2, normal_power: 8.0, sigma: 2.5, passes: 2 }
    }
}

impl Parameters for DenoiseParams {
    fn validate(&self) -> Result<()> {
        within("steps", self.steps, 1..=64)?;
        within("radius", self.radius, 0.1..=64.0)?;
        within("first_steps", self.first_steps, 1..=64)?;
        within("first_radius", self.first_radius, 0.1..=64.0)?;
        within("normal_power", self.normal_power, 0.0..=1e6)?;
        within("sigma", self.sigma, 0.0..=1e6)?;
        within("passes", self.passes, 0..=16)
    }
}

/// Light, and the variance of its luminance.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Light {
    /// E_T.
    pub color: Rgb,
    /// Of its luminance.
    pub variance: f32,
}

/// Where light is shared, and how.
pub struct Surfaces<'a> {
    /// Sites.
    pub sites: &'a [Site],
    /// Their links.
    pub links: &'a Links,
    /// Edge of a texel, metres.
    pub texel: f32,
    /// Radii and weights.
    pub params: &'a DenoiseParams,
    /// How far each site's light may be shared at most, texels; `None`: as far as the radii say.
    pub reach: Option<&'a [f32]>,
}

/// One fit of all sites: how far, how wide, and what light is compared by, if it is.
struct Pace<'a> {
    steps: u32,
    radius: f32,
    by: Option<&'a [Light]>,
}

impl Surfaces<'_> {
    /// The light of every site, with the variance that its weights leave.
    pub fn denoise(&self, light: &[Light], progress: &dyn Progress) -> Vec<Light> {
        let &DenoiseParams { steps, radius, first_steps, first_radius, passes, .. } = self.params;
        progress.start("Light map, without its noise", u64::from(passes + 1) * self.sites.len() as u64);
        let pooled = self.pooled(light);
        let mut estimate = self.fitted(&pooled, &Pace { steps: first_steps, radius: first_radius, by: None }, progress);
        for ((estimate, site), light) in estimate.iter_mut().zip(self.sites).zip(light) {
            if site.in_part && light.variance.is_finite() {
                *estimate = *light;
            }
        }
        for _ in 0..passes {
            estimate = self.fitted(&pooled, &Pace { steps, radius, by: Some(&estimate) }, progress);
        }
        progress.finish();
        if passes > 0 { estimate } else { light.to_vec() }
    }

    /// The same light, with the mean variance of a site and of those that it is linked with: that of a few samples is itself noise.
    /// One of a single sample, infinite, says nothing; a texel that is hidden in part keeps its own.
    fn pooled(&self, light: &[Light]) -> Vec<Light> {
        let of = |i: usize| {
            if self.sites[i].in_part && light[i].variance.is_finite() {
                return light[i];
            }
            let around = std::iter::once(i).chain(self.links.at(i).iter().map(|&j| j as usize));
            let known = around.map(|j| light[j].variance).filter(|v| v.is_finite());
            let (sum, count) = known.fold((0.0, 0.0f32), |(sum, count), v| (sum + v, count + 1.0));
            let variance = if count > 0.0 { sum / count } else { luminance(light[i].color).powi(2) };
            Light { color: light[i].color, variance }
        };
        (0..light.len()).into_par_iter().map(of).collect()
    }

    fn fitted(&self, light: &[Light], pace: &Pace, progress: &dyn Progress) -> Vec<Light> {
        let chunk = |k: usize| {
            let range = k * CHUNK..((k + 1) * CHUNK).min(light.len());
            let mut walk = Walk { seen: vec![u32::MAX; light.len()], found: Vec::new() };
            progress.advance(range.len() as u64);
            range.map(|i| self.fit(i, light, pace, &mut walk)).collect::<Vec<_>>()
        };
        (0..light.len().div_ceil(CHUNK)).into_par_iter().map(chunk).collect::<Vec<_>>().concat()
    }

    /// The plane through the light about site `i`, at its place; without anything to compare by, the mean.
    fn fit(&self, i: usize, light: &[Light], pace: &Pace, walk: &mut Walk) -> Light {
        walk.from(i, pace.steps, self.links);
        let own = &self.sites[i];
        let frame = Basis::from_normal(own.normal);
        let scale = 1.0 / (pace.radius * self.texel);
        let mut moments = DMat3::ZERO;
        let mut taps: Vec<(usize, f64, DVec3)> = Vec::with_capacity(walk.found.len());
        for &(j, _) in &walk.found {
            let d = (self.sites[j as usize].position - own.position) * scale;
            let narrowed = pace.radius / self.reach(i, j as usize).min(pace.radius);
            let weight = f64::from(self.weight(i, j as usize, d.length_squared() * narrowed * narrowed, pace.by));
            if weight > 0.0 {
                let slope = if pace.by.is_some() { (frame.s.dot(d), frame.t.dot(d)) } else { (0.0, 0.0) };
                let row = DVec3::new(1.0, slope.0.into(), slope.1.into());
                moments += DMat3::from_cols(row * row.x, row * row.y, row * row.z) * weight;
                taps.push((j as usize, weight, row));
            }
        }
        let ridge = RIDGE * moments.x_axis.x;
        let at_own_place = (moments + DMat3::from_diagonal(DVec3::new(0.0, ridge, ridge))).inverse().x_axis;
        let (mut color, mut variance) = (DVec3::ZERO, 0.0);
        for (j, weight, row) in taps {
            let share = weight * at_own_place.dot(row);
            color += light[j].color.as_dvec3() * share;
            variance += f64::from(light[j].variance) * share * share;
        }
        // A slope may lead below zero in front of the dark.
        Light { color: color.as_vec3().max(Rgb::ZERO), variance: variance as f32 }
    }

    /// How far two sites share their light at most, texels.
    fn reach(&self, i: usize, j: usize) -> f32 {
        self.reach.map_or(f32::INFINITY, |reach| reach[i].min(reach[j]))
    }

    /// What site `j` counts for at `i`; `square`: of their distance, in radii.
    fn weight(&self, i: usize, j: usize, square: f32, by: Option<&[Light]>) -> f32 {
        let cos = self.sites[i].normal.dot(self.sites[j].normal);
        if square >= 1.0 || cos <= 0.0 {
            return 0.0;
        }
        let unlike = by.filter(|_| i != j).map_or(0.0, |by| {
            let difference = by[i].color - by[j].color;
            let noise = (by[i].variance + by[j].variance) * self.params.sigma.powi(2) + f32::MIN_POSITIVE;
            luminance(difference * difference) / noise
        });
        (1.0 - square).powi(2) * (-self.params.normal_power * (1.0 - cos) - unlike).exp()
    }
}

/// Sites within a number of links of one, breadth first.
struct Walk {
    /// From which site each was seen last.
    seen: Vec<u32>,
    /// Site, and how many links away.
    found: Vec<(u32, u32)>,
}

impl Walk {
    fn from(&mut self, start: usize, steps: u32, links: &Links) {
        self.found.clear();
        self.found.push((start as u32, 0));
        self.seen[start] = start as u32;
        let mut next = 0;
        while let Some(&(site, far)) = self.found.get(next) {
            if far >= steps {
                break;
            }
            for &j in links.at(site as usize) {
                if self.seen[j as usize] != start as u32 {
                    self.seen[j as usize] = start as u32;
                    self.found.push((j, far + 1));
                }
            }
            next += 1;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::math::hash_words;
    use crate::base::progress::Silent;
    use crate::lightmap::links::link;
    use crate::lightmap::texels::Point;
    use glam::{Vec2, Vec3};

    const TEXEL: f32 = 0.1;

    fn site(position: Vec3, normal: Vec3) -> Site {
        Site { item: 0, point: Point { triangle: 0, barycentric: Vec2::ZERO }, position, normal, material: 0, in_part: false }
    }

    /// A square of `n` x `n` texels in the plane of `a` and `b`.
    fn square(corner: Vec3, a: Vec3, b: Vec3, n: usize) -> Vec<Site> {
        let at = |i: usize| corner + (a * ((i % n) as f32 + 0.5) + b * ((i / n) as f32 + 0.5)) * TEXEL;
        (0..n * n).map(|i| site(at(i), a.cross(b))).collect()
    }

    fn denoise(sites: &[Site], see: &(dyn Fn(usize, usize) -> bool + Sync), light: &[Light]) -> Vec<Light> {
        let links = link(sites, TEXEL, see);
        Surfaces { sites, links: &links, texel: TEXEL, params: &DenoiseParams::default(), reach: None }.denoise(light, &Silent)
    }

    /// Uniform noise of standard deviation 1.
    fn noise(i: usize) -> f32 {
        (hash_words(&[i as u32, 77]) as f32 / u32::MAX as f32 - 0.5) * 12f32.sqrt()
    }

    /// Mean square error and promised variance of the denoised texels of a wall of 96 x 96 whose light slopes.
    fn on_a_slope(noise_sigma: f32, params: &DenoiseParams) -> (f32, f32) {
        let n = 96;
        let sites = square(Vec3::ZERO, Vec3::Z, Vec3::X, n);
        // Nowhere near zero, below which no light goes.
        let truth = |s: &Site| 5.0 + 0.6 * s.position.x - 0.3 * s.position.z;
        let light = |(i, s): (usize, &Site)| Light {
            color: Rgb::splat(truth(s) + noise_sigma * noise(i)),
            variance: noise_sigma * noise_sigma,
        };
        let light: Vec<Light> = sites.iter().enumerate().map(light).collect();
        let links = link(&sites, TEXEL, &|_, _| true);
        let clean = Surfaces { sites: &sites, links: &links, texel: TEXEL, params, reach: None }.denoise(&light, &Silent);
        let mean = |of: &dyn Fn(usize) -> f32| (0..n * n).map(of).sum::<f32>() / (n * n) as f32;
        (mean(&|i| (clean[i].color.x - truth(&sites[i])).powi(2)), mean(&|i| clean[i].variance))
    }

    #[test]
    fn noise_on_a_sloping_light_falls_to_what_the_weights_promise() {
        let sigma = 0.3;
        // Weights that the light has no part in keep their promise, but for chance: some 200 neighbourhoods, 10 %.
        let (square, promised) = on_a_slope(sigma, &DenoiseParams { sigma: 1e4, ..DenoiseParams::default() });
        assert!((0.7..1.3).contains(&(square / promised)), "{square} in place of {promised}");
        // Those that ask the light follow its noise a little: a sixteenth of the variance all the same, borders included.
        let (square, _) = on_a_slope(sigma, &DenoiseParams::default());
        assert!(square < sigma * sigma / 16.0, "{square}");
    }

    #[test]
    fn constant_light_stays_and_neither_edges_nor_thin_walls_let_any_through() {
        let n = 12;
        let shift = Vec3::new(0.0, -0.02, 0.0);
        // A floor, a wall that stands on its border, and the other side of the floor, a fifth of a texel below.
        let mut sites = square(Vec3::ZERO, Vec3::Z, Vec3::X, n);
        sites.extend(square(Vec3::ZERO, Vec3::Y, Vec3::Z, n));
        sites.extend(square(shift, Vec3::X, Vec3::Z, n));
        // On the floor a thin wall from end to end, past which nothing is seen, with other light behind it.
        let split = |i: usize| i < n * n && sites[i].position.x > 0.62;
        let value = |i: usize| [1.0, 3.0, 0.0][i / (n * n)] + if split(i) { 4.0 } else { 0.0 };
        // A variance that would let everything through.
        let light: Vec<Light> = (0..sites.len()).map(|i| Light { color: Rgb::splat(value(i)), variance: 100.0 }).collect();
        let clean = denoise(&sites, &|i, j| split(i) == split(j), &light);
        for (i, c) in clean.iter().enumerate() {
            assert!((c.color.x - value(i)).abs() < 1e-5, "site {i}: {} in place of {}", c.color.x, value(i));
            assert!(c.variance < 30.0, "site {i} stands alone");
        }
        // The same without the wall: there it would bleed, so that the test above says something.
        let open = denoise(&sites, &|_, _| true, &light);
        assert!((0..n * n).any(|i| (open[i].color.x - value(i)).abs() > 1.0));
    }

    #[test]
    fn a_shadows_edge_beyond_the_noise_stays() {
        let n = 24;
        let sites = square(Vec3::ZERO, Vec3::Z, Vec3::X, n);
        let value = |s: &Site| if s.position.x > 1.2 { 5.0 } else { 1.0 };
        let light: Vec<Light> = sites
            .iter()
            .enumerate()
            .map(|(i, s)| Light { color: Rgb::splat(value(s) + 0.2 * noise(i)), variance: 0.04 })
            .collect();
        let clean = denoise(&sites, &|_, _| true, &light);
        let worst = sites.iter().zip(&clean).map(|(s, c)| (c.color.x - value(s)).abs()).fold(0.0, f32::max);
        assert!(worst < 0.5, "{worst}");
    }

    #[test]
    fn a_texel_hidden_in_part_keeps_to_its_own_light_where_that_is_sure() {
        let n = 12;
        let mut sites = square(Vec3::ZERO, Vec3::Z, Vec3::X, n);
        let middle = n * n / 2 + n / 2;
        let light = |i: usize| match i == middle {
            true => Light { color: Rgb::splat(0.1), variance: 1e-4 },
            false => Light { color: Rgb::splat(2.0 + 0.7 * noise(i)), variance: 0.49 },
        };
        let light: Vec<Light> = (0..n * n).map(light).collect();
        let of = |sites: &[Site]| denoise(sites, &|_, _| true, &light)[middle].color.x;
        assert!(of(&sites) > 1.0, "in the open it is taken for noise");
        sites[middle].in_part = true;
        assert!((of(&sites) - 0.1).abs() < 0.05, "{}", of(&sites));
    }
}
