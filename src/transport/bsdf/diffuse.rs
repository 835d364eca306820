//! Lambertian reflection (Mitsuba's `diffuse`).

use crate::scene::Texture;

/// A Lambertian reflector, black from behind.
#[derive(Debug, Clone)]
pub struct Diffuse {
    /// Albedo.
    pub reflectance: Texture,
}
