//! The camera as kernels read it.

use crate::scene::Camera;
use bytemuck::{Pod, Zeroable};

/// `Camera` of camera.wgsl.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
pub(crate) struct GpuCamera {
    x: [f32; 3],
    focal_px: f32,
    y: [f32; 3],
    aperture_radius: f32,
    z: [f32; 3],
    focus_distance: f32,
    position: [f32; 3],
    width: u32,
    height: u32,
    padding: [u32; 3],
}

impl From<&Camera> for GpuCamera {
    fn from(camera: &Camera) -> Self {
        let [x, y, z] = camera.to_world.matrix3.to_cols_array_2d();
        Self {
            x,
            focal_px: camera.focal_px(),
            y,
            aperture_radius: camera.aperture_radius,
            z,
            focus_distance: camera.focus_distance,
            position: camera.position().to_array(),
            width: camera.size[0],
            height: camera.size[1],
            padding: [0; 3],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gpu::kernel::shader;
    use crate::gpu::layout::check;

    #[test]
    fn structs_are_laid_out_as_in_the_shader() {
        check!(shader!("camera"), GpuCamera as "Camera" {
            x, focal_px, y, aperture_radius, z, focus_distance, position, width, height
        });
    }
}
