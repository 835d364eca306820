//! Materials: a BSDF tree, its opacity and its name.

use Texture;
use bsdf::Bsdf;

/// What a shape is made of.
#[derive(Debug, Clone)]
pub struct Material {
    /// The `id` of the scene file, or a made-up name.
    pub name: String,
    /// How it scatters light.
    pub bsdf: Bsdf,
    /// Coverage from `mask`: rays pass where a hash of the ray exceeds it. Fully opaque where `None`.
    pub opacity: Option<Texture>,
}
