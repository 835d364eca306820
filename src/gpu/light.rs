//! Light that arrives at points of a light map: the twin of [`crate::transport::path::transmitted_irradiance`].

use super::follow::{Follow, PathStart, Place, Purpose};
use super::pace::Pace;
use super::scene::GpuScene;
use crate::Result;
use crate::base::math::Rgb;
use crate::transport::path::PathParams;
use glam::Vec2;
use rayon::prelude::*;
use std::sync::{Arc, Mutex, PoisonError};

/// One sample of the light at a point.
#[derive(Debug, Clone, Copy)]
pub struct LightStart {
    /// Triangle.
    pub triangle: u32,
    /// Barycentric weights of its second and third vertex.
    pub barycentric: Vec2,
    /// Behind the shading normal.
    pub back: bool,
    /// Random stream.
    pub stream: u32,
    /// Number of the sample.
    pub sample: u32,
}

/// Follows the paths of a light map.
pub struct LightPaths {
    follow: Follow,
    scene: Arc<GpuScene>,
    pace: Mutex<Pace>,
}

impl LightPaths {
    /// Compiles the kernel. Where the scene has a light map, paths read diffuse light from it.
    pub fn new(scene: Arc<GpuScene>, params: &PathParams) -> Result<Self> {
        // The first set of dimensions places the sample in its texel.
        let place = Place { branch: None, first_set: 1 };
        let follow = Follow::new(scene.clone(), params, Purpose::Irradiance, place)?;
        Ok(Self { follow, scene, pace: Mutex::new(Pace::new(4096)) })
    }

    /// The device's name.
    pub fn device(&self) -> &str {
        self.scene.device()
    }

    /// The light of each sample.
    pub fn light(&self, samples: &[LightStart]) -> Result<Vec<Rgb>> {
        let start = |s: &LightStart| PathStart {
            triangle: s.triangle,
            u: s.barycentric.x,
            v: s.barycentric.y,
            stream: s.stream,
            wo: [if s.back { -1.0 } else { 1.0 }, 0.0, 0.0],
            first: s.sample,
            end: s.sample + 1,
            padding: [0; 3],
        };
        let starts: Vec<PathStart> = samples.par_iter().map(start).collect();
        let mut pace = self.pace.lock().unwrap_or_else(PoisonError::into_inner);
        Ok(self.follow.sums(&starts, &mut pace, &|_| ())?.iter().map(|s| s.color()).collect())
    }
}
