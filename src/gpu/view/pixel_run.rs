//! Runs of a view's pixels: what a dispatch covers that is to take well below a second on a slow GPU.

use crate::Result;
use crate::gpu::Gpu;
use crate::gpu::camera::GpuCamera;
use crate::gpu::commands::Commands;
use crate::gpu::kernel::{Kernel, area};
use crate::gpu::scene::GpuScene;
use crate::gpu::spec::{KernelSpec, StructLayout, layout};
use crate::scene::Camera;
use bytemuck::{Pod, Zeroable};

/// Most paths of a dispatch, each with a shadow ray and a ray that looks for emitters.
const MOST_PATHS: u32 = 1 << 20;

/// `Params` of pixel_run.wgsl.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
pub(crate) struct PixelRun {
    camera: GpuCamera,
    seed: u32,
    frame: u32,
    first_pixel: u32,
    pixels: u32,
    samples: u32,
    padding: [u32; 3],
}
pub(crate) const PIXEL_RUN: StructLayout = layout!(PixelRun as "Params" { camera, seed, frame, first_pixel, pixels, samples });

impl PixelRun {
    /// The first pixel and how many, each with so many samples whose random streams follow from seed and frame.
    pub(crate) fn new(camera: &Camera, [seed, frame]: [u32; 2], (first_pixel, pixels): (u32, u32), samples: u32) -> Self {
        Self { camera: camera.into(), seed, frame, first_pixel, pixels, samples, padding: [0; 3] }
    }
}

/// First and number of the pieces, of so many paths each, of dispatches that cover `count`.
pub(crate) fn runs(count: u32, paths: u32) -> impl Iterator<Item = (u32, u32)> {
    let most = (MOST_PATHS / paths.max(1)).max(1);
    (0..count).step_by(most as usize).map(move |first| (first, most.min(count - first)))
}

/// A kernel of a scene that covers a view in such runs.
pub(crate) struct PixelPass(Kernel);

impl PixelPass {
    pub(crate) fn new(scene: &GpuScene, spec: &'static KernelSpec) -> Result<Self> {
        Ok(Self(Kernel::in_scene(scene, spec, &[])?))
    }

    /// Takes another scene of the same triangles.
    pub(crate) fn rebind(&mut self, scene: &GpuScene) {
        self.0.rebind(scene);
    }

    /// Covers a view, each of whose pixels takes as long as so many paths; `buffers` come after the parameters.
    pub(crate) fn run(
        &self,
        gpu: &Gpu,
        (commands, pass): (&mut Commands, &'static str),
        camera: &Camera,
        (samples, seeds): (u32, [u32; 2]),
        paths: u32,
        buffers: &[&wgpu::Buffer],
    ) -> Result<()> {
        for run in runs(area(camera.size) as u32, paths) {
            let params = gpu.uniform("parameters of a run of pixels", &PixelRun::new(camera, seeds, run, samples))?;
            commands.run(pass, &self.0, &[&[&params], buffers].concat(), [run.1, 1]);
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn runs_cover_all_once() {
        let of = |count, paths| runs(count, paths).collect::<Vec<_>>();
        assert_eq!(of(100, 8), [(0, 100)]);
        assert_eq!(of(5, MOST_PATHS / 2), [(0, 2), (2, 2), (4, 1)]);
        assert_eq!(of(2, u32::MAX), [(0, 1), (1, 1)]);
        assert!(of(0, 4).is_empty());
    }
}
