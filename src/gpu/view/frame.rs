//! What the baselines share on a device: a view's other layers. Twin of what `render-path` does about [`crate::view::gbuffer`].

use super::ViewBuffers;
use super::composite::{Composite, Layers};
use super::gbuffer::GBuffer;
use crate::Result;
use crate::base::clock::Clock;
use crate::gpu::Gpu;
use crate::gpu::commands::Commands;
use crate::gpu::kernel::area;
use crate::gpu::scene::GpuScene;
use crate::lightmap::LightMap;
use crate::scene::Camera;
use crate::surface::CurvatureMap;
use crate::transport::World;
use crate::view::layers::LayerImages;
use glam::Vec4;
use std::sync::Arc;

/// A frame, read back.
pub struct BaselineFrame {
    /// Its layers.
    pub layers: LayerImages,
    /// Milliseconds a pass.
    pub passes: Vec<(&'static str, f64)>,
}

/// Buffers of frames of one size.
pub(crate) struct Target {
    pub(crate) view: ViewBuffers,
    /// The glossy layer, at the view's size.
    pub(crate) glossy: wgpu::Buffer,
    layers: Layers,
}

/// All but the glossy layer; without a light map, also but the diffuse one.
pub(crate) struct Baseline {
    pub(crate) scene: Arc<GpuScene>,
    gbuffer: GBuffer,
    composite: Composite,
    supersample: u32,
    target: Option<Target>,
}

impl Baseline {
    pub(crate) fn new(gpu: Arc<Gpu>, world: &World, lightmap: Option<&LightMap>, supersample: u32) -> Result<Self> {
        let scene = GpuScene::lit(gpu.clone(), world, lightmap)?;
        let flat = CurvatureMap::flat(world.scene.geometry.positions.len());
        Ok(Self {
            gbuffer: GBuffer::new(&scene, world, &flat)?,
            composite: Composite::new(&gpu, supersample)?,
            supersample,
            target: None,
            scene: Arc::new(scene),
        })
    }

    /// Takes another scene of the same triangles.
    pub(crate) fn rebind(&mut self, scene: GpuScene) {
        self.gbuffer.rebind(&scene);
        self.scene = Arc::new(scene);
    }

    /// Renders a frame whose glossy layer `fill` puts into its target, with the camera at the view's size; it may put a diffuse layer in
    /// place of the view's. The view has its glossy albedos where `wants_albedo`.
    pub(crate) fn frame(
        &mut self,
        camera: &Camera,
        wants_albedo: bool,
        mut commands: Commands,
        fill: impl FnOnce(&mut Commands, &Camera, &Target) -> Result<()>,
    ) -> Result<BaselineFrame> {
        let scene = self.scene.clone();
        let gpu = &*scene.gpu;
        let fine = Camera { size: camera.size.map(|s| s * self.supersample), ..camera.clone() };
        let target = match self.target.take().filter(|t| t.view.size == fine.size) {
            Some(target) => target,
            None => Target::new(gpu, fine.size, self.supersample)?,
        };
        let frame = gpu.checked(|| {
            let albedos = wants_albedo.then_some(1.0);
            self.gbuffer.run(&scene, &mut commands, &fine, &target.view, albedos)?;
            fill(&mut commands, &fine, &target)?;
            self.composite.layers(gpu, &mut commands, &target.view, (&target.glossy, None), &target.layers)?;
            let passes = commands.finish()?;
            let mut clock = Clock::start();
            let ([emission, diffuse, glossy], _) = target.layers.read(gpu)?;
            clock.lap("read");
            Ok(BaselineFrame { layers: LayerImages { emission, diffuse, glossy }, passes: [passes, clock.laps].concat() })
        })?;
        self.target = Some(target);
        frame
    }
}

impl Target {
    fn new(gpu: &Gpu, size: [u32; 2], supersample: u32) -> Result<Self> {
        let pixels = area(size);
        Ok(Self {
            view: ViewBuffers::new(gpu, size)?,
            glossy: gpu.output("the glossy pixels", size_of::<Vec4>() as u64 * pixels)?,
            layers: Layers::new(gpu, pixels / u64::from(supersample * supersample))?,
        })
    }
}
