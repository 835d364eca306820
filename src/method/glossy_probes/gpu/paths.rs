//! The glossy paths of a probe's texels: the twin of [`crate::method::glossy_probes::bake::bake_glossy`]'s own.

use crate::gpu::follow::{Follow, PathStart, Place, Purpose, SampleSum};
use crate::gpu::pace::Pace;
use crate::gpu::scene::GpuScene;
use crate::material::bsdf::{Lobes, Query};
use crate::method::glossy_probes::bake::BakeParams;
use crate::transport::path::PathParams;
use crate::{Error, Result};
use std::sync::{Arc, Mutex, PoisonError};

/// Follows the paths of probes' texels.
pub struct ProbePaths {
    follow: Follow,
    scene: Arc<GpuScene>,
    pace: Mutex<Pace>,
}

impl ProbePaths {
    /// Compiles the kernel. Where the scene has a light map, paths read diffuse light from it.
    pub fn new(scene: Arc<GpuScene>, params: &BakeParams) -> Result<Self> {
        if params.spread {
            return Err(Error::Request("--spread: the GPU sends a texel's paths through its centre; use --device cpu".into()));
        }
        let query = Query { lobes: Lobes::NON_DIFFUSE, roughness_scale: params.roughness_scale };
        // The first set of dimensions would spread them.
        let place = Place { branch: None, first_set: 1 };
        let follow = Follow::new(scene.clone(), &PathParams::default(), Purpose::Scattering(query), place)?;
        Ok(Self { follow, scene, pace: Mutex::new(Pace::new(4096)) })
    }

    /// The device's name.
    pub fn device(&self) -> &str {
        self.scene.device()
    }

    /// Sums over the samples of every start. `done` hears how many more paths are done.
    pub(crate) fn sums(&self, starts: &[PathStart], done: &dyn Fn(usize)) -> Result<Vec<SampleSum>> {
        self.follow.sums(starts, &mut self.pace.lock().unwrap_or_else(PoisonError::into_inner), done)
    }
}
