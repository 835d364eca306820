//! Which samples of a texel count (see [`crate::lightmap::visible`]), and the regions that they fall into.

use super::bake::{FIRST_SAMPLES, Pass, Plan};
use super::texels::Point;
use super::visible::Sight;
use crate::base::math::{Rgb, hash_words};
use crate::material::Surface;
use crate::transport::Sampler;
use crate::transport::path::{KnownDiffuse, openness, transmitted_irradiance};

/// Most sample points tried for each one that counts, in a texel that is hidden in part.
const TRIES: u32 = 4;

/// Most regions of a texel that are told apart.
const MAX_REGIONS: usize = 4;

/// The samples of a texel that count.
pub(super) struct Choice {
    /// What they see.
    pub view: Sight,
    /// Whether others do not.
    pub in_part: bool,
    /// A point of each region that the texel falls into, above which its samples see each other.
    pub regions: Vec<Surface>,
    /// Number and region of each sample.
    pub samples: Vec<(u32, u8)>,
}

impl Plan<'_> {
    pub(super) fn stream(&self, pass: &Pass, texel: usize, back: bool) -> u32 {
        hash_words(&[pass.seed, u32::from(back), self.texels.pixel[texel]])
    }

    /// Sample `i` of a texel: its place and the rest of its random numbers.
    pub(super) fn place(&self, pass: &Pass, texel: usize, back: bool, i: u32) -> (Point, Sampler) {
        let mut sampler = Sampler::new(self.stream(pass, texel, back), i);
        (self.texels.random_point(&self.world.scene.geometry, &self.atlas, texel, sampler.next_2d()), sampler)
    }

    /// The same, with the surface there.
    pub(super) fn draw(&self, pass: &Pass, texel: usize, back: bool, i: u32) -> (Surface, Sampler) {
        let (point, sampler) = self.place(pass, texel, back, i);
        (self.visibility().surface(point), sampler)
    }

    pub(super) fn light(&self, pass: &Pass, surface: &Surface, back: bool, mut sampler: Sampler) -> Rgb {
        if let Some(distance) = self.params.ao {
            return openness(self.world, surface, back, distance, &mut sampler);
        }
        let known = pass.known.map(|first| |s: &Surface, wo| first.map.diffuse_radiance(&self.world.scene, s, wo));
        let known = known.as_ref().map(|known| known as KnownDiffuse);
        // The path starts with a set of dimensions of its own, whether the view was tested or not.
        transmitted_irradiance(self.world, surface, back, known, &self.params.path, &mut sampler)
    }

    /// The first `count` samples of a texel that count.
    pub(super) fn choose(&self, pass: &Pass, item: (u32, bool), count: u32) -> Choice {
        let ((texel, back), visibility) = (item, self.visibility());
        // What a first pass has found to be of one kind is not asked again.
        if let Some(view) = pass.known.and_then(|first| first.sight(self.texels.pixel[texel as usize], back)) {
            return self.all_alike(pass, item, view, count);
        }
        let first: Vec<_> = (0..FIRST_SAMPLES).map(|i| self.draw(pass, texel as usize, back, i)).collect();
        let views: Vec<Sight> = first.iter().map(|(s, sampler)| visibility.view(s, back, &mut sampler.clone())).collect();
        let best = views.iter().max().copied().unwrap_or(Sight::Inside);
        let alike = views.iter().all(|&v| v == best)
            && (best != Sight::Open || first[1..].iter().all(|(s, _)| visibility.together(&first[0].0, s, back)));
        if alike { self.all_alike(pass, item, best, count) } else { self.choose_in_part(pass, item, best, count) }
    }

    /// As many of them as `count`, of which `choice` has the first.
    pub(super) fn choose_more(&self, pass: &Pass, item: (u32, bool), choice: &Choice, count: u32) -> Choice {
        let choose = if choice.in_part { Self::choose_in_part } else { Self::all_alike };
        choose(self, pass, item, choice.view, count)
    }

    /// The samples of a texel of one region, all of which see the same.
    fn all_alike(&self, pass: &Pass, (texel, back): (u32, bool), view: Sight, count: u32) -> Choice {
        let counts = view != Sight::Inside;
        let regions = counts.then(|| self.draw(pass, texel as usize, back, 0).0).into_iter().collect();
        let samples = (0..if counts { count } else { 0 }).map(|i| (i, 0)).collect();
        Choice { view, in_part: false, regions, samples }
    }

    /// The samples of a texel of which some are hidden, or lie in several regions.
    fn choose_in_part(&self, pass: &Pass, (texel, back): (u32, bool), wanted: Sight, count: u32) -> Choice {
        let (visibility, texel) = (self.visibility(), texel as usize);
        let (mut regions, mut samples): (Vec<Surface>, _) = (Vec::new(), Vec::new());
        for i in 0..count.saturating_mul(TRIES).max(FIRST_SAMPLES) {
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
            if samples.len() >= count as usize {
                break;
            }
        }
        Choice { view: wanted, in_part: true, regions, samples }
    }
}
