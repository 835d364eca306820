//! What mirrors and polished surfaces show: rays that follow their lobes, and the same light where they end.
//!
//! *Paper*: its exponents end at 60, and it leaves specular reflection out. *Ours*: a lobe as sharp as that, or sharper, is not gathered for, as
//! clusters would be seen one by one in it: rays follow it ([`super::params::ManyLightParams::mirror_rays`]), and what they meet is lit as a view's points are,
//! straight from emitters and by the gather. They see what is in their way. Light straight from emitters, which rays may meet too, is left to
//! the pass that samples it. By default a lobe has one ray, in the mirror direction: what is polished shows as sharp an image as a mirror, and
//! no noise ([`super::params::ManyLightParams::mirror_samples`]).

use super::shade::Shading;
use crate::base::math::{Rgb, hash_words};
use crate::material::Surface;
use crate::material::bsdf::Query;
use crate::transport::Sampler;
use crate::view::direct::direct_at;
use crate::view::gbuffer::{GBuffer, GLOSSY, Pixel, view_alpha};
use crate::view::mirror::mirror_direction;
use crate::view::mirror_light::glossy_albedo;
use glam::{Vec2, Vec3};

/// Marks random numbers of rays along lobes.
pub(crate) const RAY: u32 = 0x6d69_7272;
/// Branch of a ray's stream: light straight from emitters where it ends.
pub(crate) const STRAIGHT: u32 = 1;

impl Shading<'_> {
    /// What lobes that are followed add to the glossy layer of indirect light, and at how many pixels.
    pub fn followed(&self, view: &GBuffer) -> (Vec<Rgb>, usize) {
        let [seed, frame] = self.seeds;
        let is_mirror = |p: &Pixel| p.alpha.is_some_and(|alpha| self.params.follows(alpha));
        let layer = view.shade([hash_words(&[seed, RAY]), frame], |p, stream| {
            if !is_mirror(p) {
                return Rgb::ZERO;
            }
            // All rays of a perfect mirror are the same.
            let count = if p.alpha == Some(0.0) { 1 } else { self.params.mirror_samples.max(1) };
            let straight = self.params.direct_samples.div_ceil(count);
            let ray = |k| self.along(&p.surface, p.wo, straight, hash_words(&[stream, k]));
            (0..count).map(ray).sum::<Rgb>() / count as f32
        });
        (layer, view.pixels.iter().flatten().filter(|p| is_mirror(p)).count())
    }

    /// What a ray that leaves a surface by its lobe, seen from `wo`, brings back, and those that follow it from mirror to mirror.
    fn along(&self, surface: &Surface, wo: Vec3, straight: u32, stream: u32) -> Rgb {
        let (mut surface, mut wo) = (*surface, wo);
        let (mut sum, mut throughput) = (Rgb::ZERO, Rgb::ONE);
        let mut sampler = Sampler::new(stream, 0);
        for left in (0..self.params.mirror_rays).rev() {
            let Some((d, weight)) = self.reflected(&surface, wo, &mut sampler) else { break };
            let Some(hit) = self.world.intersect(&surface.spawn(d)) else { break };
            throughput *= weight;
            (surface, wo) = (hit, -d);
            let alpha = view_alpha(self.world, &surface, wo);
            let goes_on = left > 0 && alpha.is_some_and(|alpha| self.params.follows(alpha));
            sum +=
                throughput * self.scattered_at(&surface, wo, alpha.filter(|_| !goes_on), straight, hash_words(&[stream, left]));
            if !goes_on {
                break;
            }
        }
        if sum.is_finite() { sum } else { Rgb::ZERO }
    }

    /// A direction of a lobe, and what radiance from there is multiplied with.
    fn reflected(&self, surface: &Surface, wo: Vec3, sampler: &mut Sampler) -> Option<(Vec3, Rgb)> {
        if self.params.mirror_samples == 0 {
            return Some((mirror_direction(surface, wo), glossy_albedo(self.world, surface, wo)));
        }
        let [x, y, lobe, _] = sampler.next_4d();
        let bsdf = self.world.scene.bsdf(surface);
        let sample = bsdf.sample(surface, surface.frame.to_local(wo), lobe, Vec2::new(x, y), GLOSSY)?;
        Some((surface.frame.to_world(sample.wo), sample.weight))
    }

    /// What a surface sends to `wo`: all light straight from emitters, and of indirect light that of its diffuse lobe and of a glossy one of `alpha`.
    fn scattered_at(&self, surface: &Surface, wo: Vec3, alpha: Option<f32>, straight: u32, stream: u32) -> Rgb {
        let (light, _) = self.gathered(surface, wo, alpha, stream);
        let mut sum = light.irradiance * self.diffuse_out(surface, wo);
        if alpha.is_some() {
            sum += light.glossy * glossy_albedo(self.world, surface, wo);
        }
        sum + direct_at(self.world, (surface, wo), Query::default(), straight, hash_words(&[stream, STRAIGHT]))
    }
}
