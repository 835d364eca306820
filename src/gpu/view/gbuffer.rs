//! The G-buffer: the twin of [`crate::view::gbuffer`].

use super::View;
use crate::Result;
use crate::gpu::camera::GpuCamera;
use crate::gpu::commands::Commands;
use crate::gpu::kernel::{Kernel, groups, shader};
use crate::gpu::scene::{GpuScene, MATERIALS, PATHS, RAYS};
use crate::scene::Camera;
use crate::surface::CurvatureMap;
use crate::transport::World;
use bytemuck::{Pod, Zeroable};

/// Edges of a workgroup, pixels.
const WORKGROUP: [u32; 2] = [8, 8];
/// Among the vertices: the triangle is a plane.
const NONE: u32 = u32::MAX;

/// `Params` of gbuffer.wgsl.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct Params {
    camera: GpuCamera,
    roughness_scale: f32,
    padding: [u32; 3],
}

/// `VertexCurvature` of gbuffer.wgsl.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct VertexCurvature {
    k1: f32,
    k2: f32,
    d1: [f32; 3],
}

/// What the kernels are made of.
fn source() -> String {
    [RAYS, MATERIALS, PATHS, shader!("camera", "camera_ray", "view", "mirror", "gbuffer")].concat()
}

/// The kernels, with the scene's curvatures.
pub(crate) struct GBuffer {
    gbuffer: Kernel,
    view_factors: Kernel,
    curved_vertices: wgpu::Buffer,
    curvatures: wgpu::Buffer,
}

impl GBuffer {
    pub(crate) fn new(scene: &GpuScene, world: &World, curvature: &CurvatureMap) -> Result<Self> {
        let source = source();
        let geometry = &world.scene.geometry;
        let is_plane = |t: usize| {
            let flat = |&i: &u32| curvature.k1[i as usize] == 0.0 && curvature.k2[i as usize] == 0.0;
            geometry.object(t as u32).face_normals || geometry.triangles[t].iter().all(flat)
        };
        let triangles = geometry.triangles.iter().enumerate();
        let vertices: Vec<[u32; 3]> = triangles.map(|(t, &v)| if is_plane(t) { [NONE; 3] } else { v }).collect();
        let map = curvature.k1.iter().zip(&curvature.k2).zip(&curvature.d1);
        let curvatures: Vec<_> = map.map(|((&k1, &k2), d1)| VertexCurvature { k1, k2, d1: d1.to_array() }).collect();
        let gpu = &scene.gpu;
        Ok(Self {
            gbuffer: Kernel::in_scene(scene, &source, "gbuffer", [3, 6], &[])?,
            view_factors: Kernel::in_scene(scene, &source, "view_factors", [3, 2], &[])?,
            curved_vertices: gpu.upload("the curved triangles", bytemuck::cast_slice(&vertices))?,
            curvatures: gpu.upload("the scene's curvatures", bytemuck::cast_slice(&curvatures))?,
        })
    }

    /// Bytes of the curvatures.
    pub(crate) fn bytes(&self) -> u64 {
        self.curved_vertices.size() + self.curvatures.size()
    }

    /// Fills a view's planes; its glossy albedos where the probes' `roughness_scale` is given.
    pub(crate) fn run(
        &self,
        scene: &GpuScene,
        commands: &mut Commands,
        camera: &Camera,
        view: &View,
        roughness_scale: Option<f32>,
    ) -> Result<()> {
        let gpu = &scene.gpu;
        let params = Params { camera: camera.into(), roughness_scale: roughness_scale.unwrap_or(-1.0), padding: [0; 3] };
        let params = gpu.upload("the G-buffer's parameters", bytemuck::bytes_of(&params))?;
        let groups = groups(view.size, WORKGROUP);
        let (hits, materials) = (&view.hits, &view.guides.materials);
        let buffers = [
            &params,
            &self.curved_vertices,
            &self.curvatures,
            hits,
            &view.positions,
            &view.guides.normals,
            &view.curvatures,
            materials,
            &view.emission,
        ];
        commands.run("gbuffer", &self.gbuffer, &buffers, groups);
        commands.run("gbuffer", &self.view_factors, &[&params, hits, materials, &view.diffuse, &view.albedos], groups);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gpu::layout::check;

    #[test]
    fn structs_are_laid_out_as_in_the_shader() {
        let source = source();
        check!(&source, Params as "Params" { camera, roughness_scale });
        check!(&source, VertexCurvature as "VertexCurvature" { k1, k2, d1 });
    }
}
