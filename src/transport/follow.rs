//! Paths that begin at given points: the one way in which a bake has them followed, on the CPU or on a GPU.

use super::path::{KnownDiffuse, PathParams, openness, scattered, transmitted_irradiance};
use super::{Sampler, World};
use crate::Result;
use crate::base::math::{Rgb, luminance};
use crate::base::ray::Hit;
use crate::material::Surface;
use crate::material::bsdf::Query;
use bytemuck::{Pod, Zeroable};
use glam::{Vec2, Vec3};
use rayon::prelude::*;

/// Where the samples of a path begin, and which they are; `PathStart` of the shaders.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub struct PathStart {
    /// Triangle.
    pub triangle: u32,
    /// Barycentric weight of its second vertex.
    pub u: f32,
    /// Barycentric weight of its third vertex.
    pub v: f32,
    /// Random stream.
    pub stream: u32,
    /// Unit direction towards the viewer, world. Of a light map's paths x alone counts: 1 before the shading normal, -1 behind it.
    pub wo: [f32; 3],
    /// Number of its first sample.
    pub first: u32,
    /// Number after its last one.
    pub end: u32,
    /// As WGSL lays it out.
    pub padding: [u32; 3],
}

impl PathStart {
    /// Where it begins.
    pub fn surface(&self, world: &World) -> Surface {
        world.surface(&Hit { t: 0.0, triangle: self.triangle, u: self.u, v: self.v })
    }

    /// How many samples it has.
    pub fn samples(&self) -> u32 {
        self.end.saturating_sub(self.first)
    }
}

/// Sums over the samples of a start.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PathSum {
    /// Of radiance, or of a light map's irradiance.
    pub color: Rgb,
    /// Of its luminance.
    pub luminance: f64,
    /// Of the luminance's square.
    pub squares: f64,
}

impl PathSum {
    /// Of one sample.
    pub fn of(color: Rgb) -> Self {
        let y = f64::from(luminance(color));
        Self { color, luminance: y, squares: y * y }
    }
}

/// Samples, from `least` to `most`, that bring a standard error down to `error` of the mean luminance and `floor`, by the variance of some that
/// were drawn: `sums` are those of starts that are taken to be alike, and how many samples each is of.
pub fn samples_to_error(error: f32, floor: f32, [least, most]: [u32; 2], sums: impl Iterator<Item = (PathSum, u32)>) -> u32 {
    let (mut squares, mut degrees, mut sum, mut count) = (0.0, 0.0, 0.0, 0.0);
    for (of, n) in sums {
        let n = f64::from(n);
        squares += (of.squares - of.luminance * of.luminance / n).max(0.0);
        degrees += n - 1.0;
        sum += of.luminance;
        count += n;
    }
    if degrees == 0.0 {
        return least;
    }
    let allowed = f64::from(error) * (sum / count + f64::from(floor));
    ((squares / degrees / (allowed * allowed)).ceil() as u32).clamp(least, most)
}

impl std::ops::Add for PathSum {
    type Output = Self;

    fn add(self, more: Self) -> Self {
        Self { color: self.color + more.color, luminance: self.luminance + more.luminance, squares: self.squares + more.squares }
    }
}

/// Follows paths of one purpose. The sample of a start draws its numbers from the start's stream and the sample's number alone.
pub trait Follow: Sync {
    /// The device's name.
    fn device(&self) -> &str;

    /// How many paths it is best given at once.
    fn batch(&self) -> usize;

    /// Sums over the samples of every start. `done` hears how many more paths are done.
    fn sums(&self, starts: &[PathStart], done: &(dyn Fn(usize) + Sync)) -> Result<Vec<PathSum>>;
}

/// What paths are followed for.
#[derive(Clone, Copy)]
pub enum Purpose<'a> {
    /// Light that the lobes of the query scatter towards the viewer; and what moves a sample's beginning within its texel, where something does.
    Scattering(Query, Option<&'a Elsewhere<'a>>),
    /// Light for a light map.
    Irradiance,
    /// How open a light map's texel is: whether nothing blocks a ray within so many metres.
    Openness(f32),
}

/// Surface, and direction towards the viewer, of a sample at an offset in [0, 1)² of the texel whose start has this index; `None` for the
/// start's own.
pub type Elsewhere<'a> = dyn Fn(usize, Vec2) -> Option<(Surface, Vec3)> + Sync + 'a;

/// Follows paths on the CPU's threads.
pub struct OnCpu<'a> {
    /// The scene.
    pub world: &'a World,
    /// What for.
    pub purpose: Purpose<'a>,
    /// Diffuse light that is known from elsewhere.
    pub known: Option<KnownDiffuse<'a>>,
    /// Depth and termination.
    pub params: PathParams,
}

impl OnCpu<'_> {
    /// One sample. Its first set of dimensions is for its place in its texel, which most have been given.
    fn sample(&self, (i, start): (usize, &PathStart), surface: &Surface, number: u32) -> Rgb {
        let mut sampler = Sampler::new(start.stream, number);
        let mut offset = Vec2::ZERO;
        match self.purpose {
            Purpose::Irradiance | Purpose::Scattering(_, None) => sampler.skip_4d(),
            Purpose::Openness(_) | Purpose::Scattering(_, Some(_)) => offset = sampler.next_2d(),
        }
        match self.purpose {
            Purpose::Irradiance => {
                transmitted_irradiance(self.world, surface, start.wo[0] < 0.0, self.known, &self.params, &mut sampler)
            }
            Purpose::Openness(distance) => openness(self.world, surface, start.wo[0] < 0.0, distance, &mut sampler),
            Purpose::Scattering(query, elsewhere) => {
                let (surface, wo) = elsewhere.and_then(|elsewhere| elsewhere(i, offset)).unwrap_or((*surface, start.wo.into()));
                scattered(self.world, &surface, wo, query, self.known, &self.params, &mut sampler)
            }
        }
    }
}

impl Follow for OnCpu<'_> {
    fn device(&self) -> &str {
        "cpu"
    }

    fn batch(&self) -> usize {
        1 << 18
    }

    fn sums(&self, starts: &[PathStart], done: &(dyn Fn(usize) + Sync)) -> Result<Vec<PathSum>> {
        let sum = |(i, start): (usize, &PathStart)| {
            let surface = start.surface(self.world);
            let sample = |number| PathSum::of(self.sample((i, start), &surface, number));
            let sum = (start.first..start.end).map(sample).fold(PathSum::default(), |a, b| a + b);
            done(start.samples() as usize);
            sum
        };
        Ok(starts.par_iter().enumerate().map(sum).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_number_of_samples_is_the_variance_over_the_square_of_what_is_allowed() {
        // Eight samples of 1 and eight of 2, in a texel and in one beside it.
        let texel = (PathSum { luminance: 24.0, squares: 40.0, ..PathSum::default() }, 16);
        let (least, floor) = (16, 0.03);
        let (variance, allowed) = (4.0 / 15.0, 0.02 * (1.5 + f64::from(floor)));
        let expected = (variance / (allowed * allowed)).ceil() as u32;
        let samples =
            |error, most, around: &[(PathSum, u32)]| samples_to_error(error, floor, [least, most], around.iter().copied());
        for around in [vec![texel], vec![texel, texel]] {
            assert!(samples(0.02, 1 << 20, &around).abs_diff(expected) <= 1, "in place of {expected}");
        }
        assert_eq!(samples(0.02, 100, &[texel]), 100, "no more than the most");
        assert_eq!(samples(1e3, 100, &[texel]), least);
        assert_eq!(samples(0.02, 100, &[]), least, "nothing is lit");
    }
}
