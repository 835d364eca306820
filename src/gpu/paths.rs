//! The paths of a bake on a device: the twin of [`crate::transport::follow::OnCpu`].

use super::follow::{Place, Purpose, Samples};
use super::pace::Pace;
use super::scene::GpuScene;
use crate::Result;
use crate::base::math::luminance;
use crate::material::bsdf::Query;
use crate::transport::follow::{Follow, PathStart, PathSum};
use crate::transport::path::PathParams;
use std::sync::{Arc, Mutex, PoisonError};

/// Paths that a bake hands over at once.
const BATCH: usize = 1 << 21;

/// Follows paths of one purpose. Where the scene has a light map, they read diffuse light from it.
pub struct Paths {
    samples: Samples,
    scene: Arc<GpuScene>,
    pace: Mutex<Pace>,
}

impl Paths {
    /// Compiles what scatters light towards a viewer by the lobes of `query`.
    pub fn scattering(scene: Arc<GpuScene>, query: Query, params: &PathParams) -> Result<Self> {
        Self::new(scene, Purpose::Scattering(query), params)
    }

    /// Compiles what brings light to a light map.
    pub fn irradiance(scene: Arc<GpuScene>, params: &PathParams) -> Result<Self> {
        Self::new(scene, Purpose::Irradiance, params)
    }

    fn new(scene: Arc<GpuScene>, purpose: Purpose, params: &PathParams) -> Result<Self> {
        // The first set of dimensions places the sample in its texel.
        let place = Place { branch: None, first_set: 1 };
        let samples = Samples::new(scene.clone(), params, purpose, place)?;
        Ok(Self { samples, scene, pace: Mutex::new(Pace::new(4096)) })
    }
}

impl Follow for Paths {
    fn device(&self) -> &str {
        self.scene.device()
    }

    fn batch(&self) -> usize {
        BATCH
    }

    fn sums(&self, starts: &[PathStart], done: &(dyn Fn(usize) + Sync)) -> Result<Vec<PathSum>> {
        let mut pace = self.pace.lock().unwrap_or_else(PoisonError::into_inner);
        let sums = self.samples.sums(starts, &mut pace, done)?;
        let of = |s: &super::SampleSum| {
            let color = s.color();
            PathSum { color, luminance: luminance(color).into(), squares: s.squares.into() }
        };
        Ok(sums.iter().map(of).collect())
    }
}
