//! Emitters of the scene file.

use crate::base::math::Rgb;
use crate::material::Texture;
use crate::material::image::Image;
use glam::{Affine3A, Vec2, Vec3};
use std::sync::Arc;

/// A texture thrown from a point.
#[derive(Debug, Clone, serde::Serialize)]
pub struct Pattern {
    /// The colours.
    pub texture: Texture,
    /// From the world to a space in which the light starts at the origin and goes along +Z.
    pub to_local: Affine3A,
    /// What half the texture's width and height span at z = 1; a negative one turns the texture round.
    pub half: Vec2,
}

impl Pattern {
    /// Texture coordinate in the direction of a point of the pattern's own space.
    pub fn uv(&self, local: Vec3) -> Vec2 {
        local.truncate() / (self.half * (2.0 * local.z)) + 0.5
    }
}

/// A light source.
#[derive(Debug, Clone, serde::Serialize)]
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
        /// Colours over the cone's cross-section, and what they are placed with.
        pattern: Option<Box<Pattern>>,
    },
    /// A point that throws an image, as a pinhole camera would take it.
    Projector {
        /// World position.
        position: Vec3,
        /// Unit direction to the image's middle.
        direction: Vec3,
        /// Irradiance, over π, of a surface at distance 1 along the axis that faces the projector.
        image: Box<Pattern>,
        /// Largest angle between `direction` and light, radians.
        cutoff_rad: f32,
    },
    /// A disc at infinity.
    Sun {
        /// Unit direction to its middle.
        direction: Vec3,
        /// Unit; nothing shines from below the plane that it stands on.
        up: Vec3,
        /// Angle from its middle to its rim, radians.
        angle_rad: f32,
        /// Radiance, the same all over.
        radiance: Rgb,
    },
    /// Parallel light.
    Directional {
        /// Unit direction in which the light travels.
        direction: Vec3,
        /// Irradiance on a facing surface.
        irradiance: Rgb,
    },
}
