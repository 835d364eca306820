//! Rays along edges: the twin of [`crate::method::glossy_probes::coverage`].

use crate::Result;
use crate::gpu::camera::GpuCamera;
use crate::gpu::commands::Commands;
use crate::gpu::kernel::{Kernel, groups, shader};
use crate::gpu::scene::{GpuScene, MATERIALS, PATHS, RAYS};
use crate::gpu::view::View;
use crate::gpu::view::composite::Layers;
use crate::scene::Camera;
use bytemuck::{Pod, Zeroable};

/// Edges of a workgroup, pixels.
const WORKGROUP: [u32; 2] = [8, 8];

/// `CoverageParams` of coverage.wgsl.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct Params {
    camera: GpuCamera,
    sub_pixels: u32,
    rays: u32,
    mirrors: u32,
    padding: u32,
}

fn source() -> String {
    [RAYS, MATERIALS, PATHS, shader!("camera", "camera_ray", "view", "mirror", "gbuffer", "coverage")].concat()
}

/// The kernel.
pub(crate) struct Coverage {
    kernel: Kernel,
    rays: u32,
}

impl Coverage {
    /// For N x N rays a pixel.
    pub(crate) fn new(scene: &GpuScene, rays: u32) -> Result<Self> {
        Ok(Self { kernel: Kernel::in_scene(scene, &source(), "cover", [6, 3], &[])?, rays })
    }

    /// Renders the pixels along edges anew. `camera` is of the frame's size; `mirrors` says that `glossy` lacks what perfect mirrors show.
    pub(crate) fn run(
        &self,
        scene: &GpuScene,
        commands: &mut Commands,
        camera: &Camera,
        (view, glossy, mirrors): (&View, &wgpu::Buffer, bool),
        layers: &Layers,
    ) -> Result<()> {
        let params = Params {
            camera: camera.into(),
            sub_pixels: view.size[0] / camera.size[0],
            rays: self.rays,
            mirrors: mirrors.into(),
            padding: 0,
        };
        let params = scene.gpu.upload("the coverage's parameters", bytemuck::bytes_of(&params))?;
        let [emission, diffuse, out] = &layers.planes;
        let (positions, normals) = (&view.positions, &view.guides.normals);
        let buffers = [&params, &view.hits, positions, normals, &view.reflected, glossy, emission, diffuse, out];
        commands.run("coverage", &self.kernel, &buffers, groups(camera.size, WORKGROUP));
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gpu::layout::check;

    #[test]
    fn structs_are_laid_out_as_in_the_shader() {
        check!(&source(), Params as "CoverageParams" { camera, sub_pixels, rays, mirrors });
    }
}
