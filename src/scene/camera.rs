//! Perspective and thin-lens cameras.

use crate::transport::Ray;
use glam::{Affine3A, Vec2, Vec3};

/// A pinhole or thin-lens camera that looks along local +Z, with +X to the left of the image (Mitsuba's convention).
#[derive(Debug, Clone, PartialEq)]
pub struct Camera {
    /// Camera to world, rigid.
    pub to_world: Affine3A,
    /// Horizontal field of view, radians.
    pub fov_x: f32,
    /// Image width and height, pixels.
    pub size: [u32; 2],
    /// Lens radius; 0 for a pinhole.
    pub aperture_radius: f32,
    /// Distance of the plane in focus.
    pub focus_distance: f32,
}

impl Camera {
    /// A pinhole at `origin` that looks at `target`.
    pub fn look_at(origin: Vec3, target: Vec3, up: Vec3, fov_x: f32, size: [u32; 2]) -> Self {
        let z = (target - origin).try_normalize().unwrap_or(Vec3::Z);
        let x = up.cross(z).try_normalize().unwrap_or_else(|| crate::math::Frame::from_normal(z).s);
        let y = z.cross(x);
        let to_world = Affine3A { matrix3: glam::Mat3A::from_cols(x.into(), y.into(), z.into()), translation: origin.into() };
        Self { to_world, fov_x, size, aperture_radius: 0.0, focus_distance: 1.0 }
    }

    /// Where the camera stands.
    pub fn position(&self) -> Vec3 {
        self.to_world.translation.into()
    }

    /// Focal length in pixels.
    pub fn focal_px(&self) -> f32 {
        0.5 * self.size[0] as f32 / (0.5 * self.fov_x).tan()
    }

    /// Ray through `pixel` (pixels, (0, 0) the upper left corner of the image) and the point
    /// of the lens that `lens` in [0, 1)² maps to.
    pub fn ray(&self, pixel: Vec2, lens: Vec2) -> Ray {
        let _ = lens;
        let f = self.focal_px();
        let half = Vec2::new(self.size[0] as f32, self.size[1] as f32) * 0.5;
        let d = Vec3::new(half.x - pixel.x, half.y - pixel.y, f);
        Ray::new(self.position(), self.to_world.transform_vector3(d).normalize())
    }

    /// Pixel that a pinhole at this place sees `p` at; `None` behind the camera. Inverse of [`Camera::ray`].
    pub fn project(&self, p: Vec3) -> Option<Vec2> {
        let local = self.to_world.inverse().transform_point3(p);
        let half = Vec2::new(self.size[0] as f32, self.size[1] as f32) * 0.5;
        (local.z > 0.0).then(|| half - Vec2::new(local.x, local.y) * (self.focal_px() / local.z))
    }
}
