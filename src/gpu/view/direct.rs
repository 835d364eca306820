//! Light straight from emitters in every pixel: the twin of [`crate::view::direct`].

use super::{PIXEL, REFLECTED, SHADING, ViewBuffers};
use crate::Result;
use crate::gpu::camera::{CAMERA, GpuCamera};
use crate::gpu::commands::Commands;
use crate::gpu::kernel::{Kernel, area};
use crate::gpu::scene::GpuScene;
use crate::gpu::spec::Access::{Read, ReadWrite, Uniform};
use crate::gpu::spec::{KernelSpec, StructLayout, layout};
use crate::scene::Camera;
use bytemuck::{Pod, Zeroable};

/// Most paths of a dispatch, each with a shadow ray and a ray that looks for emitters: well below a second on a slow GPU.
pub(crate) const MOST_PATHS: u32 = 1 << 20;

/// `Params` of direct_light.wgsl.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct Params {
    camera: GpuCamera,
    seed: u32,
    frame: u32,
    first_pixel: u32,
    pixels: u32,
    samples: u32,
    padding: [u32; 3],
}

/// The kernel.
pub(crate) const DIRECT_LIGHT: KernelSpec = KernelSpec {
    file: "shared/direct_light.wgsl",
    twin: "src/view/direct.rs: direct",
    workgroup: [64, 1],
    scene: true,
    bindings: &[("params", Uniform), ("view", Read), ("shading", ReadWrite)],
    structs: &[&PARAMS, &CAMERA, &PIXEL, &REFLECTED, &SHADING],
};
const PARAMS: StructLayout = layout!(Params as "Params" { camera, seed, frame, first_pixel, pixels, samples });

/// First and number of the pieces, of so many paths each, of dispatches that cover `count`.
pub(crate) fn runs(count: u32, paths: u32) -> impl Iterator<Item = (u32, u32)> {
    let most = (MOST_PATHS / paths.max(1)).max(1);
    (0..count).step_by(most as usize).map(move |first| (first, most.min(count - first)))
}

/// The kernel, compiled.
pub(crate) struct DirectLight(Kernel);

impl DirectLight {
    pub(crate) fn new(scene: &GpuScene) -> Result<Self> {
        Ok(Self(Kernel::in_scene(scene, &DIRECT_LIGHT, &[])?))
    }

    /// Takes another scene of the same triangles.
    pub(crate) fn rebind(&mut self, scene: &GpuScene) {
        self.0.rebind(scene);
    }

    /// Adds the mean of so many samples a pixel to the view's diffuse light, whose random streams follow from seed and frame.
    pub(crate) fn run(
        &self,
        scene: &GpuScene,
        (commands, pass): (&mut Commands, &'static str),
        (camera, view): (&Camera, &ViewBuffers),
        samples: u32,
        [seed, frame]: [u32; 2],
    ) -> Result<()> {
        if samples == 0 {
            return Ok(());
        }
        for (first_pixel, pixels) in runs(area(view.size) as u32, samples) {
            let params = Params { camera: camera.into(), seed, frame, first_pixel, pixels, samples, padding: [0; 3] };
            let params = scene.gpu.uniform("parameters of direct light", &params)?;
            commands.run(pass, &self.0, &[&params, &view.pixels, &view.shading], [pixels, 1]);
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
