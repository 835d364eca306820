//! Emitters of the scene file.

use crate::base::math::Rgb;
use crate::material::Texture;
use crate::material::image::Image;
use glam::{Affine3A, Vec3};
use std::sync::Arc;

/// A light source.
#[derive(Debug, Clone)]
pub enum Emitter {
    /// Radiance leaving the front (`area_normal`) side of an object.
    Area {
        /// Index into `Geometry::objects`.
        object: u32,
        /// Emitted radiance over the object's uv.
        radiance: Texture,
    },
    /// Lat-long image at infinity.
    Envmap {
        /// Radiance; row 0 is up.
        image: Arc<Image>,
        /// Multiplies the image.
        scale: f32,
        /// Local to world rotation.
        to_world: Affine3A,
    },
    /// The same radiance from every direction.
    Constant {
        /// Radiance.
        radiance: Rgb,
    },
    /// A point of radiant intensity (W/sr) in all directions.
    Point {
        /// World position.
        position: Vec3,
        /// Radiant intensity.
        intensity: Rgb,
    },
    /// A point with a cone (Mitsuba's linear falloff between the two angles).
    Spot {
        /// World position.
        position: Vec3,
        /// Unit axis.
        direction: Vec3,
        /// Radiant intensity on the axis.
        intensity: Rgb,
        /// Angle where the light ends, radians.
        cutoff_rad: f32,
        /// Angle up to which it is full, radians.
        beam_rad: f32,
    },
    /// Parallel light.
    Directional {
        /// Unit direction in which the light travels.
        direction: Vec3,
        /// Irradiance on a facing surface.
        irradiance: Rgb,
    },
}
