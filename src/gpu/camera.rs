//! The camera as kernels read it.

use super::spec::{StructLayout, layout};
use crate::scene::camera::ALL_DEPTHS;
use crate::scene::{Camera, Scene};
use crate::{Error, Result};
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

/// An error where the GPU's cameras cannot show what these do.
pub fn check<'a>(scene: &Scene, cameras: impl IntoIterator<Item = &'a Camera>) -> Result<()> {
    let missing = |what: &str| Err(Error::Request(format!("the GPU's cameras have no {what}; use --device cpu")));
    if scene.hide_emitters {
        return missing("hidden emitters (hide_emitters)");
    }
    for camera in cameras {
        if camera.orthographic.is_some() {
            return missing("parallel rays (orthographic)");
        }
        if camera.shift != glam::Vec2::ZERO {
            return missing("shifted axis (principal_point_offset_x and _y, or a crop window)");
        }
        if camera.clip != ALL_DEPTHS {
            return missing("clipping planes, and near_clip or far_clip cuts something off here");
        }
    }
    Ok(())
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
