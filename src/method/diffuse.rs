//! Diffuse light that one method computes for others: `render-path --diffuse`.

use super::{Method, Setup};
use crate::Result;
use crate::base::clock::Clock;
use crate::base::math::Rgb;
use crate::material::Surface;
use crate::transport::World;
use crate::view::View;
use crate::view::gbuffer::GBuffer;
use glam::Vec3;
use serde_json::Value;
use std::path::PathBuf;

/// Light of frames whose lights, colours and shapes may change.
pub trait DiffuseLight: Sync {
    /// Lights the frame of a view, whose world this is; passes are timed.
    fn relight(&mut self, view: &View, world: &World, clock: &mut Clock);

    /// The diffuse layer of a view of the frame that was lit last, linear radiance a pixel.
    fn layer(&self, world: &World, view: &GBuffer) -> Vec<Rgb>;

    /// Diffuse radiance that a surface of that frame sends towards `wo` (unit, away from it), direct light included.
    fn radiance(&self, world: &World, surface: &Surface, wo: Vec3) -> Rgb;

    /// Bytes that it takes.
    fn bytes(&self) -> usize;
}

/// Makes a method's diffuse light from what frames are made of.
pub type DiffuseConstructor = for<'a> fn(&Setup<'a>) -> Result<Box<dyn DiffuseLight + 'a>>;

/// Whose diffuse light the frames of another method have.
pub struct Joined {
    /// The method.
    pub method: &'static Method,
    /// Its parameters.
    pub parameters: Value,
    /// Its probes.
    pub probes: PathBuf,
}

impl Joined {
    /// The light, of what `setup` says of the frames.
    pub fn light<'a>(&'a self, setup: &Setup<'a>) -> Result<Box<dyn DiffuseLight + 'a>> {
        let setup = Setup { parameters: &self.parameters, probes: Some(&self.probes), diffuse: None, ..*setup };
        match self.method.diffuse {
            Some(make) => make(&setup),
            None => Err(crate::Error::Request(format!("--diffuse {}: it has no light for others", self.method.name))),
        }
    }
}
