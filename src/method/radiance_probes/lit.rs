//! The light of frames on the CPU, ready to be looked up: for the method's own views, and for those of others.

use super::frame_map::FrameMap;
use super::light::{Light, Lighting};
use super::params::RadianceProbeParams;
use super::shade::{Indirect, Shading};
use crate::Result;
use crate::base::clock::Clock;
use crate::base::math::Rgb;
use crate::lightmap::LightMap;
use crate::material::Surface;
use crate::method::Setup;
use crate::method::diffuse::DiffuseLight;
use crate::transport::World;
use crate::view::View;
use crate::view::gbuffer::GBuffer;
use glam::Vec3;

/// Light of the frame that was lit last.
pub struct Lit<'a> {
    setup: Setup<'a>,
    lighting: Lighting,
    map: FrameMap,
    /// How.
    pub params: RadianceProbeParams,
    /// Whether diffuse light is asked for elsewhere than in a view's pixels.
    is_read: bool,
    now: Option<Now>,
}

/// A frame's light.
struct Now {
    frame: u32,
    light: Light,
    indirect: Indirect,
    total: Option<LightMap>,
}

impl<'a> Lit<'a> {
    /// Of a setup's frames. `is_read`: whether glossy paths or other methods read diffuse light.
    pub fn new(setup: &Setup<'a>, is_read: bool) -> Result<Self> {
        let (lighting, params) = (Lighting::load(setup)?, setup.parameters()?);
        let map = FrameMap::new(&setup.world.scene.geometry, &lighting.transport);
        Ok(Self { setup: *setup, lighting, map, params, is_read, now: None })
    }

    /// What views of the frame are shaded with; `None` before the first one is lit.
    pub fn shading<'l>(&'l self, world: &'l World) -> Option<Shading<'l>> {
        let now = self.now.as_ref()?;
        let volume = self.lighting.transport.volume.as_ref();
        Some(Shading {
            world,
            indirect: &now.indirect,
            total: now.total.as_ref(),
            volume: volume.map(|volume| (volume, now.light.volume.as_slice())),
            params: &self.params,
            seed: self.setup.seed,
            frame: now.frame,
        })
    }

    /// The light of a frame; with feedback, that of all frames before it comes first, whichever of them are asked for.
    fn light(&mut self, view: &View, world: &World, clock: &mut Clock) -> Light {
        let seed = self.setup.seed;
        if !self.params.feedback {
            return self.lighting.light(world, &self.params, (None, seed), clock);
        }
        let (from, mut before) = match self.now.take() {
            Some(now) if now.frame < view.frame => (now.frame + 1, Some(now.light)),
            _ => (0, None),
        };
        for frame in from..view.frame {
            let earlier = View { frame, camera: view.camera.clone() };
            let of_frame = self.setup.world_at(&earlier);
            let world = of_frame.as_ref().unwrap_or(self.setup.world);
            before = Some(self.lighting.light(world, &self.params, (before, seed), &mut Clock::start()));
        }
        clock.restart();
        self.lighting.light(world, &self.params, (before, seed), clock)
    }
}

impl DiffuseLight for Lit<'_> {
    fn relight(&mut self, view: &View, world: &World, clock: &mut Clock) {
        let light = self.light(view, world, clock);
        let indirect = Indirect::new(&self.map, self.lighting.transport.params.receiver, &light);
        let total = self.is_read.then(|| self.map.lit(&self.lighting.total(&light)));
        clock.lap("light map");
        self.now = Some(Now { frame: view.frame, light, indirect, total });
    }

    fn layer(&self, world: &World, view: &GBuffer) -> Vec<Rgb> {
        self.shading(world).map_or_else(Vec::new, |shading| shading.diffuse(view))
    }

    fn radiance(&self, world: &World, surface: &Surface, wo: Vec3) -> Rgb {
        self.shading(world).map_or(Rgb::ZERO, |shading| shading.radiance(surface, wo))
    }

    fn bytes(&self) -> usize {
        self.lighting.transport.bytes()
    }
}
