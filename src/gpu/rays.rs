//! Closest hits of many rays: the twin of [`World::closest`].
//!
//! Alpha masks stay on the CPU: a hit that the ray passes through is sent again, to go on from there.

use super::Gpu;
use super::kernel::Kernel;
use crate::transport::bvh::passes;
use crate::transport::{Hit, Ray, World};
use crate::{Error, Result};
use bytemuck::{Pod, Zeroable};
use obvhs::cwbvh::CwBvh;
use std::sync::Arc;

/// Depth of the shader's stack. A node leaves at most one entry.
const STACK: usize = 32;

/// Rays a dispatch: well below a second even on a software adapter.
const BATCH: usize = 1 << 18;

const NO_TRIANGLE: u32 = u32::MAX;
const WORKGROUP: usize = 64;

/// A ray as the shader reads it.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct GpuRay {
    origin: [f32; 3],
    t_min: f32,
    direction: [f32; 3],
    t_max: f32,
    /// Hits at `t_min` count for triangles above this one alone; [`NO_TRIANGLE`]: for all.
    after: u32,
    padding: [u32; 3],
}

/// A hit as the shader writes it; [`NO_TRIANGLE`] for a ray that met nothing.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct GpuHit {
    t: f32,
    triangle: u32,
    u: f32,
    v: f32,
}

impl GpuRay {
    fn new(ray: &Ray) -> Self {
        let Ray { o, d, t_min, t_max } = *ray;
        Self { origin: o.into(), t_min, direction: d.into(), t_max, after: NO_TRIANGLE, padding: [0; 3] }
    }
}

/// A scene's triangles on a device, ready for rays.
pub struct RayTracer {
    gpu: Arc<Gpu>,
    kernel: Kernel,
    nodes: wgpu::Buffer,
    corners: wgpu::Buffer,
}

impl RayTracer {
    /// Uploads the triangles that `world` is made of.
    pub fn new(gpu: Arc<Gpu>, world: &World) -> Result<Self> {
        let geometry = &world.scene.geometry;
        let (tree, triangles) = world.bvh.compressed(geometry);
        if depth(&tree) > STACK {
            return Err(Error::Request(format!(
                "the scene's tree is more than {STACK} nodes deep, too deep for the GPU; use --device cpu"
            )));
        }
        let corners: Vec<[f32; 4]> = triangles
            .iter()
            .flat_map(|&t| {
                let [a, b, c] = geometry.corners(t);
                [a.extend(f32::from_bits(t)), b.extend(0.0), c.extend(0.0)].map(|v| v.to_array())
            })
            .collect();
        let nodes = gpu.upload("the scene's tree", bytemuck::cast_slice(&tree.nodes))?;
        let corners = gpu.upload("the scene's triangles", bytemuck::cast_slice(&corners))?;
        let source = concat!(include_str!("../../shaders/traverse.wgsl"), include_str!("../../shaders/closest.wgsl"));
        let kernel = Kernel::new(&gpu, source, "closest")?;
        Ok(Self { gpu, kernel, nodes, corners })
    }

    /// The device's name.
    pub fn device(&self) -> &str {
        &self.gpu.adapter.name
    }

    /// First hit of each of the rays, as [`World::closest`] would find it.
    pub fn closest(&self, world: &World, rays: &[Ray]) -> Result<Vec<Option<Hit>>> {
        let mut found = vec![None; rays.len()];
        let mut todo: Vec<(usize, GpuRay)> = rays.iter().map(GpuRay::new).enumerate().collect();
        while !todo.is_empty() {
            let mut again = Vec::new();
            for batch in todo.chunks(BATCH) {
                let sent: Vec<GpuRay> = batch.iter().map(|(_, ray)| *ray).collect();
                for (&(i, ray), hit) in batch.iter().zip(self.batch(&sent)?) {
                    if hit.triangle == NO_TRIANGLE {
                        continue;
                    }
                    let GpuHit { t, triangle, u, v } = hit;
                    let hit = Hit { t, triangle, u, v };
                    if passes(&world.scene, &rays[i], &hit) {
                        again.push((i, GpuRay { t_min: t, after: triangle, ..ray }));
                    } else {
                        found[i] = Some(hit);
                    }
                }
            }
            todo = again;
        }
        Ok(found)
    }

    fn batch(&self, rays: &[GpuRay]) -> Result<Vec<GpuHit>> {
        let sent = self.gpu.upload("rays", bytemuck::cast_slice(rays))?;
        let hits = self.gpu.output("hits", (rays.len() * size_of::<GpuHit>()) as u64)?;
        let groups = [rays.len().div_ceil(WORKGROUP) as u32, 1];
        self.gpu.dispatch(&self.kernel, &[&self.nodes, &self.corners, &sent, &hits], groups)?;
        self.gpu.read(&hits)
    }
}

/// Nodes from the root to the deepest leaf.
fn depth(tree: &CwBvh) -> usize {
    let mut deepest = 0;
    let mut todo = vec![(0, 1)];
    while let Some((node, level)) = todo.pop() {
        let Some(node) = tree.nodes.get(node) else { continue };
        deepest = deepest.max(level);
        let children = node.imask.count_ones();
        todo.extend((0..children).map(|i| ((node.child_base_idx + i) as usize, level + 1)));
    }
    deepest
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn structs_are_laid_out_as_wgsl_lays_them_out() {
        // vec3<f32> is aligned to 16 bytes; each is followed by a scalar.
        assert_eq!(
            (size_of::<GpuRay>(), std::mem::offset_of!(GpuRay, direction), std::mem::offset_of!(GpuRay, after)),
            (48, 16, 32)
        );
        assert_eq!((size_of::<GpuHit>(), std::mem::offset_of!(GpuHit, v)), (16, 12));
    }
}
