//! What surfaces are made of: images and textures, scattering models, and the point on a surface that they are asked about.

pub mod bsdf;
pub mod image;
pub mod opacity;
pub mod surface;
pub mod texture;

use bsdf::Bsdf;

pub use opacity::Opacity;
pub use surface::Surface;
pub use texture::Texture;

/// What a shape is made of.
#[derive(Debug, Clone, serde::Serialize)]
pub struct Material {
    /// The `id` of the scene file, or a made-up name.
    #[serde(skip)]
    pub name: String,
    /// How it scatters light.
    pub bsdf: Bsdf,
    /// Coverage from `mask` and `null`: rays pass where a hash of the ray exceeds it. Fully opaque where `None`.
    pub opacity: Option<Opacity>,
}
