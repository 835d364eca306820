//! The G-buffer: the twin of [`crate::view::gbuffer`].

use super::{PIXEL, REFLECTED, SHADING, ViewBuffers};
use crate::Result;
use crate::gpu::camera::{CAMERA, GpuCamera};
use crate::gpu::commands::Commands;
use crate::gpu::kernel::Kernel;
use crate::gpu::scene::GpuScene;
use crate::gpu::spec::Access::{Read, ReadWrite, Uniform};
use crate::gpu::spec::{KernelSpec, StructLayout, layout};
use crate::scene::Camera;
use crate::surface::CurvatureMap;
use crate::transport::World;
use bytemuck::{Pod, Zeroable};

/// Among the vertices: the triangle is a plane.
const NONE: u32 = crate::gpu::scene::NONE;

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

/// The surfaces seen.
pub(crate) const GBUFFER: KernelSpec = KernelSpec {
    file: "shared/gbuffer.wgsl",
    twin: "src/view/gbuffer.rs: gbuffer",
    workgroup: [8, 8],
    scene: true,
    bindings: &[
        ("params", Uniform),
        ("curved_vertices", Read),
        ("curvatures", Read),
        ("view", ReadWrite),
        ("shading", ReadWrite),
    ],
    structs: &[&PARAMS, &CAMERA, &VERTEX_CURVATURE, &PIXEL, &REFLECTED, &SHADING],
};
/// Their light and albedos.
pub(crate) const VIEW_FACTORS: KernelSpec = KernelSpec {
    file: "shared/view_factors.wgsl",
    twin: "src/method/glossy_probes/gather.rs: view_albedo",
    workgroup: [8, 8],
    scene: true,
    bindings: &[("params", Uniform), ("view", Read), ("shading", ReadWrite)],
    structs: &[&PARAMS, &CAMERA, &PIXEL, &REFLECTED, &SHADING],
};
const PARAMS: StructLayout = layout!(Params as "Params" { camera, roughness_scale });
const VERTEX_CURVATURE: StructLayout = layout!(VertexCurvature as "VertexCurvature" { k1, k2, d1 });

/// The kernels, with the scene's curvatures.
pub(crate) struct GBuffer {
    gbuffer: Kernel,
    view_factors: Kernel,
    curved_vertices: wgpu::Buffer,
    curvatures: wgpu::Buffer,
}

impl GBuffer {
    pub(crate) fn new(scene: &GpuScene, world: &World, curvature: &CurvatureMap) -> Result<Self> {
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
            gbuffer: Kernel::in_scene(scene, &GBUFFER, &[])?,
            view_factors: Kernel::in_scene(scene, &VIEW_FACTORS, &[])?,
            curved_vertices: gpu.upload("the curved triangles", bytemuck::cast_slice(&vertices))?,
            curvatures: gpu.upload("the scene's curvatures", bytemuck::cast_slice(&curvatures))?,
        })
    }

    /// Looks at another scene of the same triangles.
    pub(crate) fn rebind(&mut self, scene: &GpuScene) {
        self.gbuffer.rebind(scene);
        self.view_factors.rebind(scene);
    }

    /// Bytes of the curvatures.
    pub(crate) fn bytes(&self) -> u64 {
        self.curved_vertices.size() + self.curvatures.size()
    }

    /// Fills a view, but for its mirror hits; its glossy albedos where the probes' `roughness_scale` is given.
    pub(crate) fn run(
        &self,
        scene: &GpuScene,
        commands: &mut Commands,
        camera: &Camera,
        view: &ViewBuffers,
        roughness_scale: Option<f32>,
    ) -> Result<()> {
        let gpu = &scene.gpu;
        let params = Params { camera: camera.into(), roughness_scale: roughness_scale.unwrap_or(-1.0), padding: [0; 3] };
        let params = gpu.uniform("the G-buffer's parameters", &params)?;
        let ViewBuffers { size, pixels, shading } = view;
        commands.run("gbuffer", &self.gbuffer, &[&params, &self.curved_vertices, &self.curvatures, pixels, shading], *size);
        commands.run("gbuffer", &self.view_factors, &[&params, pixels, shading], *size);
        Ok(())
    }
}
