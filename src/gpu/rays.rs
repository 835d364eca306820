//! Closest hits of many rays: the twin of [`crate::transport::World::closest`].

use super::kernel::Kernel;
use super::scene::GpuScene;
use super::spec::{Access, KernelSpec, StructLayout, layout};
use crate::Result;
use crate::base::ray::{Hit, Ray};
use bytemuck::{Pod, Zeroable};
use std::sync::Arc;

/// Rays a dispatch: well below a second even on a software adapter.
const BATCH: usize = 1 << 18;

pub(crate) const NO_TRIANGLE: u32 = u32::MAX;

/// `Ray` of surface.wgsl.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct GpuRay {
    origin: [f32; 3],
    t_min: f32,
    direction: [f32; 3],
    t_max: f32,
}

/// `Hit` of surface.wgsl; [`NO_TRIANGLE`] for a ray that met nothing.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct GpuHit {
    t: f32,
    triangle: u32,
    u: f32,
    v: f32,
}

/// The kernel.
pub(crate) const CLOSEST: KernelSpec = KernelSpec {
    file: "shared/closest.wgsl",
    twin: "src/transport/world.rs: closest",
    workgroup: [64, 1],
    scene: true,
    bindings: &[("rays", Access::Read), ("hits", Access::ReadWrite)],
    structs: &[&RAY, &HIT],
};
const RAY: StructLayout = layout!(GpuRay as "Ray" { origin, t_min, direction, t_max });
const HIT: StructLayout = layout!(GpuHit as "Hit" { t, triangle, u, v });

impl GpuRay {
    fn new(ray: &Ray) -> Self {
        let Ray { o, d, t_min, t_max } = *ray;
        Self { origin: o.into(), t_min, direction: d.into(), t_max: t_max.min(f32::MAX) }
    }
}

impl GpuHit {
    fn hit(self) -> Option<Hit> {
        let Self { t, triangle, u, v } = self;
        (triangle != NO_TRIANGLE).then_some(Hit { t, triangle, u, v })
    }
}

/// Casts rays through a scene.
pub struct RayTracer {
    scene: Arc<GpuScene>,
    kernel: Kernel,
}

impl RayTracer {
    /// Compiles the kernel.
    pub fn new(scene: Arc<GpuScene>) -> Result<Self> {
        let kernel = Kernel::in_scene(&scene, &CLOSEST, &[])?;
        Ok(Self { scene, kernel })
    }

    /// The device's name.
    pub fn device(&self) -> &str {
        self.scene.device()
    }

    /// First hit of each of the rays, as [`crate::transport::World::closest`] would find it.
    pub fn closest(&self, rays: &[Ray]) -> Result<Vec<Option<Hit>>> {
        let batches = rays.chunks(BATCH).map(|batch| self.batch(batch));
        Ok(batches.collect::<Result<Vec<_>>>()?.concat())
    }

    fn batch(&self, rays: &[Ray]) -> Result<Vec<Option<Hit>>> {
        let gpu = &self.scene.gpu;
        let sent: Vec<GpuRay> = rays.iter().map(GpuRay::new).collect();
        let sent = gpu.upload("rays", bytemuck::cast_slice(&sent))?;
        let hits = gpu.output("hits", (rays.len() * size_of::<GpuHit>()) as u64)?;
        gpu.dispatch(&self.kernel, &[&sent, &hits], [rays.len() as u32, 1])?;
        Ok(gpu.read::<GpuHit>(&hits)?.into_iter().map(GpuHit::hit).collect())
    }
}
