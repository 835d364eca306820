//! One texel's value: which samples of it count (see [`crate::lightmap::visible`]), the light at each, and what is made of them.

use super::bake::{CONTACT, FIRST_SAMPLES, OPEN, PART, Pass, Plan, SPLIT};
use super::parts::{Record, WORDS};
use super::visible::Sight;
use crate::Result;
use crate::base::math::{Rgb, hash_words};
use crate::base::progress::Progress;
use crate::material::Surface;
use crate::transport::Sampler;
use crate::transport::follow::{Follow, PathStart, PathSum};
use crate::transport::path::{KnownDiffuse, openness, transmitted_irradiance};
use rayon::prelude::*;

/// Most sample points tried for each one that counts, in a texel that is hidden in part.
const TRIES: u32 = 4;

/// Most regions of a texel that are told apart.
const MAX_REGIONS: usize = 4;

/// The samples of a texel that count.
struct Choice {
    /// What they see.
    view: Sight,
    /// Whether others do not.
    in_part: bool,
    /// A point of each region that the texel falls into, above which its samples see each other.
    regions: Vec<Surface>,
    /// Number and region of each sample.
    samples: Vec<(u32, u8)>,
}

/// Light of a region's samples.
#[derive(Clone, Copy, Default)]
struct Sum {
    paths: PathSum,
    count: u32,
    /// Number of the first sample.
    first: u32,
}

impl Sum {
    fn add(&mut self, sample: u32, light: PathSum) {
        if self.count == 0 {
            self.first = sample;
        }
        self.paths = self.paths + light;
        self.count += 1;
    }

    fn is_lit(&self) -> bool {
        self.paths.color != Rgb::ZERO
    }

    /// The samples' mean, and the variance of its luminance as if they were independent: infinite for a single sample.
    fn record(&self, flags: u32) -> Record {
        let (n, mean) = (f64::from(self.count), self.paths.luminance / f64::from(self.count));
        let variance = (self.paths.squares / n - mean * mean).max(0.0) / (n - 1.0);
        let [r, g, b] = (self.paths.color / self.count as f32).to_array().map(f32::to_bits);
        [r, g, b, flags, if self.count > 1 { variance as f32 } else { f32::INFINITY }.to_bits(), self.first]
    }
}

impl Plan<'_> {
    /// Values and flags of texel sides, whose paths `device` follows.
    pub(super) fn bake_texels(
        &self,
        device: &dyn Follow,
        pass: &Pass,
        items: &[(u32, bool)],
        progress: &dyn Progress,
    ) -> Result<Vec<Record>> {
        let mut records = Vec::with_capacity(items.len());
        for items in items.chunks((device.batch() / pass.spp as usize).max(1)) {
            let choices: Vec<Choice> = items.par_iter().map(|&(texel, back)| self.choose(pass, texel as usize, back)).collect();
            let starts: Vec<Vec<PathStart>> =
                items.par_iter().zip(&choices).map(|(&item, choice)| self.starts(pass, item, choice)).collect();
            let mut lights = device.sums(&starts.concat(), &|_| ())?.into_iter();
            for (&(_, back), choice) in items.iter().zip(&choices) {
                let mut sums = vec![Sum::default(); choice.regions.len()];
                for (&(sample, region), light) in choice.samples.iter().zip(&mut lights) {
                    sums[region as usize].add(sample, light);
                }
                records.push(self.settle(choice, &sums, back));
            }
            progress.advance(items.len() as u64);
        }
        Ok(records)
    }

    /// A path for each sample of a texel.
    fn starts(&self, pass: &Pass, (texel, back): (u32, bool), choice: &Choice) -> Vec<PathStart> {
        let stream = self.stream(pass, texel as usize, back);
        let wo = [if back { -1.0 } else { 1.0 }, 0.0, 0.0];
        let start = |&(sample, _): &(u32, u8)| {
            let (surface, _) = self.draw(pass, texel as usize, back, sample);
            let [u, v] = surface.barycentric.to_array();
            PathStart { triangle: surface.triangle, u, v, stream, wo, first: sample, end: sample + 1, padding: [0; 3] }
        };
        choice.samples.iter().map(start).collect()
    }

    fn stream(&self, pass: &Pass, texel: usize, back: bool) -> u32 {
        hash_words(&[pass.seed, u32::from(back), self.texels.pixel[texel]])
    }

    /// Sample `i` of a texel: its place and the rest of its random numbers.
    pub(super) fn draw(&self, pass: &Pass, texel: usize, back: bool, i: u32) -> (Surface, Sampler) {
        let mut sampler = Sampler::new(self.stream(pass, texel, back), i);
        (self.visibility().sample(texel, sampler.next_2d()), sampler)
    }

    pub(super) fn light(&self, pass: &Pass, surface: &Surface, back: bool, mut sampler: Sampler) -> Rgb {
        if let Some(distance) = self.params.ao {
            return openness(self.world, surface, back, distance, &mut sampler);
        }
        let known = pass.known.map(|map| |s: &Surface, wo| map.diffuse_radiance(&self.world.scene, s, wo));
        let known = known.as_ref().map(|known| known as KnownDiffuse);
        // The path starts with a set of dimensions of its own, whether the view was tested or not.
        transmitted_irradiance(self.world, surface, back, known, &self.params.path, &mut sampler)
    }

    fn choose(&self, pass: &Pass, texel: usize, back: bool) -> Choice {
        let visibility = self.visibility();
        let first: Vec<_> = (0..FIRST_SAMPLES).map(|i| self.draw(pass, texel, back, i)).collect();
        let views: Vec<Sight> = first.iter().map(|(s, sampler)| visibility.view(s, back, &mut sampler.clone())).collect();
        let best = views.iter().max().copied().unwrap_or(Sight::Inside);
        if best == Sight::Inside {
            return Choice { view: best, in_part: false, regions: Vec::new(), samples: Vec::new() };
        }
        let plain = views.iter().all(|&v| v == best)
            && (best == Sight::Contact || first[1..].iter().all(|(s, _)| visibility.together(&first[0].0, s, back)));
        if !plain {
            return self.choose_in_part(pass, texel, back, best);
        }
        Choice { view: best, in_part: false, regions: vec![first[0].0], samples: (0..pass.spp).map(|i| (i, 0)).collect() }
    }

    /// The samples of a texel of which some are hidden, or lie in several regions.
    fn choose_in_part(&self, pass: &Pass, texel: usize, back: bool, wanted: Sight) -> Choice {
        let visibility = self.visibility();
        let (mut regions, mut samples): (Vec<Surface>, _) = (Vec::new(), Vec::new());
        for i in 0..pass.spp.saturating_mul(TRIES).max(FIRST_SAMPLES) {
            let (surface, mut sampler) = self.draw(pass, texel, back, i);
            if visibility.view(&surface, back, &mut sampler) != wanted {
                continue;
            }
            let mut region = regions.iter().position(|at| visibility.together(at, &surface, back));
            if region.is_none() && regions.len() < MAX_REGIONS {
                regions.push(surface);
                region = Some(regions.len() - 1);
            }
            let Some(region) = region else { continue };
            samples.push((i, region as u8));
            if samples.len() >= pass.spp as usize {
                break;
            }
        }
        Choice { view: wanted, in_part: true, regions, samples }
    }

    /// The largest region that gets any light, and of those one from which the sensor is seen in two segments, if there is one.
    fn settle(&self, choice: &Choice, sums: &[Sum], back: bool) -> Record {
        let flag = match choice.view {
            Sight::Inside => return [0; WORDS],
            Sight::Contact => CONTACT,
            Sight::Open => OPEN,
        };
        let mut lit: Vec<_> = choice.regions.iter().zip(sums).filter(|(_, sum)| sum.is_lit()).collect();
        let split = if lit.len() < sums.len() && !lit.is_empty() { SPLIT } else { 0 };
        let flags = flag | split | if choice.in_part { PART } else { 0 };
        if lit.len() > 1 {
            let visibility = self.visibility();
            let near: Vec<bool> = lit.iter().map(|(at, _)| visibility.near_sensor(at, back)).collect();
            if near.contains(&true) {
                let mut keep = near.iter();
                lit.retain(|_| *keep.next().unwrap_or(&true));
            }
        }
        // The first of equals.
        let chosen = lit.into_iter().rev().max_by_key(|(_, sum)| sum.count);
        let dark = || [0, 0, 0, flags, 0, choice.samples.first().map_or(0, |s| s.0)];
        chosen.map_or_else(dark, |(_, sum)| sum.record(flags))
    }
}
