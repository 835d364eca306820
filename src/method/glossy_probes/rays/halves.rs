//! The rays, in two halves that have nothing in common: neither a camera ray nor a stream of random numbers. So the noise of one says nothing of that of
//! the other, and either alone is spread as well over the pixel and the lobe as its count allows.
//!
//! In: a camera, and the light map that lights what the rays meet. Out: the light of either half, and how far single rays differ.

use super::Shot;
use crate::base::math::{Rgb, hash_words, luminance};
use crate::lightmap::LightMap;
use crate::material::Surface;
use crate::transport::path::{PathParams, scattered};
use crate::transport::{Sampler, World};
use crate::view::gbuffer::{GLOSSY, is_glossy};
use glam::Vec3;
use rayon::prelude::*;

/// Marks the random numbers of these rays.
const RAYS: u32 = 0x7261_7973;

/// A pixel's rays, of the halves in turns.
#[derive(Clone, Copy, Default)]
pub(super) struct Sums {
    /// Light of either half.
    light: [Rgb; 2],
    count: u32,
    /// Of squared luminance.
    squares: f32,
    is_glossy: bool,
}

impl Sums {
    /// Adds the next ray, with the light that a glossy surface scatters; `None` where there is none.
    pub fn add(&mut self, light: Option<Rgb>) {
        let half = (self.count % 2) as usize;
        self.count += 1;
        let Some(light) = light else { return };
        self.light[half] += light;
        self.squares += luminance(light).powi(2);
        self.is_glossy = true;
    }

    /// Rays so far.
    pub fn count(&self) -> u32 {
        self.count
    }

    /// Whether one of them has met something glossy.
    pub fn is_glossy(&self) -> bool {
        self.is_glossy
    }

    /// Mean of either half.
    pub fn means(&self) -> (Rgb, Rgb) {
        let [a, b] = self.light;
        (a / self.count.div_ceil(2).max(1) as f32, b / (self.count / 2).max(1) as f32)
    }

    /// Mean of all.
    pub fn mean(&self) -> Rgb {
        (self.light[0] + self.light[1]) / self.count.max(1) as f32
    }

    /// Variance of a single ray's luminance.
    pub fn variance(&self) -> f32 {
        let (n, mean) = (self.count as f32, luminance(self.mean()));
        (self.squares - n * mean * mean).max(0.0) / (n - 1.0).max(1.0)
    }
}

/// What rays are followed through, and lit by.
#[derive(Clone, Copy)]
pub(super) struct Lit<'a> {
    pub world: &'a World,
    pub lightmap: &'a LightMap,
}

/// Follows the rays of every pixel that are missing `until` it has so many.
pub(super) fn follow(
    Lit { world, lightmap }: Lit,
    Shot { camera, seeds: [seed, frame] }: Shot,
    bounces: u32,
    sums: &mut [Sums],
    until: impl Fn(usize) -> u32 + Sync,
) {
    let path = PathParams::of_rays(bounces);
    let known = |s: &Surface, wo: Vec3| lightmap.diffuse_radiance(&world.scene, s, wo);
    let ray = |i: u32, number: u32| {
        let [to_pixel, from_surface] = [0, 1].map(|k| hash_words(&[seed, frame, RAYS, i, 2 * (number % 2) + k]));
        let ray = camera.drawn_ray(i, Sampler::new(to_pixel, number / 2).next_4d());
        let surface = world.seen(&ray).filter(|s| is_glossy(world, s, -ray.d))?;
        let mut sampler = Sampler::new(from_surface, number / 2);
        Some(scattered(world, &surface, -ray.d, GLOSSY, Some(&known), &path, &mut sampler))
    };
    let pixel = |(i, sums): (usize, &mut Sums)| {
        for number in sums.count..until(i) {
            sums.add(ray(i as u32, number));
        }
    };
    sums.par_iter_mut().enumerate().with_min_len(camera.size[0] as usize).for_each(pixel);
}
