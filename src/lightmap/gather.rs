//! One texel's value: the light at the samples that count ([`super::choice`]), and what is made of it.

use super::bake::{CONTACT, FIRST_SAMPLES, OPEN, PART, Pass, Plan, SPLIT};
use super::choice::Choice;
use super::parts::{Record, WORDS};
use super::texels::Point;
use super::visible::Sight;
use crate::Result;
use crate::base::math::Rgb;
use crate::base::progress::{Progress, Silent};
use crate::transport::follow::{Follow, PathStart, PathSum};
use rayon::prelude::*;

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
        let variance = if self.count > 1 { variance as f32 } else { f32::INFINITY };
        [r, g, b, flags, variance.to_bits(), self.first, self.count]
    }
}

/// The samples of a texel that count, and the light of those that were followed.
struct Gathered {
    choice: Choice,
    /// Of each region.
    sums: Vec<Sum>,
    /// How many samples were followed.
    followed: usize,
}

impl Plan<'_> {
    /// Values and flags of texel sides, whose paths `device` follows. Their number is adaptive where the pass has an error to reach: the first
    /// [`FIRST_SAMPLES`] of each say how many more it takes. `items`: whole blocks.
    pub(super) fn bake_texels(
        &self,
        device: &dyn Follow,
        pass: &Pass,
        items: &[(u32, bool)],
        progress: &dyn Progress,
    ) -> Result<Vec<Record>> {
        let first = pass.error.map_or(pass.spp, |_| FIRST_SAMPLES.min(pass.spp));
        let begin = |&item: &(u32, bool)| {
            let choice = self.choose(pass, item, first);
            Gathered { sums: vec![Sum::default(); choice.regions.len()], choice, followed: 0 }
        };
        let mut texels: Vec<Gathered> = items.par_iter().map(begin).collect();
        if let Some(error) = pass.error {
            self.gather(device, pass, items, &mut texels, &Silent)?;
            let largest_lit = |texel: &Gathered| {
                let sum = texel.sums.iter().filter(|s| s.is_lit()).max_by_key(|s| s.count)?;
                Some((sum.paths, sum.count))
            };
            let counts = self.samples_for(error, pass.spp, items, &texels.iter().map(largest_lit).collect::<Vec<_>>());
            let more = texels.par_iter_mut().zip(items).zip(counts).filter(|(_, count)| *count > first);
            more.for_each(|((texel, &item), count)| {
                texel.choice = self.choose_more(pass, item, &texel.choice, count);
                texel.sums.resize(texel.choice.regions.len(), Sum::default());
            });
        }
        self.gather(device, pass, items, &mut texels, progress)?;
        Ok(texels.iter().zip(items).map(|(texel, &(_, back))| self.settle(texel, back)).collect())
    }

    /// Adds the light of the samples that were not followed yet.
    fn gather(
        &self,
        device: &dyn Follow,
        pass: &Pass,
        items: &[(u32, bool)],
        texels: &mut [Gathered],
        progress: &dyn Progress,
    ) -> Result<()> {
        let most = texels.iter().map(|t| t.choice.samples.len() - t.followed).max().unwrap_or_default();
        let batch = (device.batch() / most.max(1)).max(1);
        for (items, texels) in items.chunks(batch).zip(texels.chunks_mut(batch)) {
            let starts: Vec<Vec<PathStart>> =
                items.par_iter().zip(&*texels).map(|(&item, texel)| self.starts(pass, item, texel)).collect();
            let mut lights = device.sums(&starts.concat(), &|_| ())?.into_iter();
            for texel in texels {
                for (&(sample, region), light) in texel.choice.samples[texel.followed..].iter().zip(&mut lights) {
                    texel.sums[region as usize].add(sample, light);
                }
                texel.followed = texel.choice.samples.len();
            }
            progress.advance(items.len() as u64);
        }
        Ok(())
    }

    /// A path for each sample of a texel that was not followed yet.
    fn starts(&self, pass: &Pass, (texel, back): (u32, bool), of: &Gathered) -> Vec<PathStart> {
        let stream = self.stream(pass, texel as usize, back);
        let wo = [if back { -1.0 } else { 1.0 }, 0.0, 0.0];
        let start = |&(sample, _): &(u32, u8)| {
            let (Point { triangle, barycentric }, _) = self.place(pass, texel as usize, back, sample);
            let [u, v] = barycentric.to_array();
            PathStart { triangle, u, v, stream, wo, first: sample, end: sample + 1, padding: [0; 3] }
        };
        of.choice.samples[of.followed..].iter().map(start).collect()
    }

    /// The largest region that gets any light, and of those one from which the sensor is seen in two segments, if there is one.
    fn settle(&self, Gathered { choice, sums, .. }: &Gathered, back: bool) -> Record {
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
        let dark = || [0, 0, 0, flags, 0, choice.samples.first().map_or(0, |s| s.0), choice.samples.len() as u32];
        chosen.map_or_else(dark, |(_, sum)| sum.record(flags))
    }
}
