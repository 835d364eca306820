//! The camera as kernels read it.

use super::spec::{StructLayout, layout};
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

pub(crate) const CAMERA: StructLayout = layout!(GpuCamera as "Camera" {
    x, focal_px, y, aperture_radius, z, focus_distance, position, width, height
});

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
