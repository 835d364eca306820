//! Burley's principled model, as Mitsuba's `principled` has it.

use crate::Result;
use crate::math::Rgb;
use crate::scene::Texture;

/// Parameters as in a scene file; all but `eta` and `base_color` lie in [0, 1].
#[derive(Debug, Clone)]
pub struct PrincipledParams {
    /// Colour. Mitsuba: 0.5.
    pub base_color: Texture,
    /// Burley's roughness, the square root of alpha. Mitsuba: 0.5.
    pub roughness: Texture,
    /// Stretch of the specular lobe. Mitsuba: 0.
    pub anisotropic: Texture,
    /// From dielectric to metal. Mitsuba: 0.
    pub metallic: Texture,
    /// From opaque to glass. Mitsuba: 0.
    pub spec_trans: Texture,
    /// Index of refraction, inside over outside; at `specular` = 0.5 it is 1.5. Mitsuba: 1.5.
    pub eta: f32,
    /// From white to coloured dielectric reflection. Mitsuba: 0.
    pub spec_tint: Texture,
    /// Grazing cloth-like light. Mitsuba: 0.
    pub sheen: Texture,
    /// From white to coloured sheen. Mitsuba: 0.
    pub sheen_tint: Texture,
    /// From diffuse to fake subsurface scattering. Mitsuba: 0.
    pub flatness: Texture,
    /// Strength of the second specular lobe. Mitsuba: 0.
    pub clearcoat: Texture,
    /// Gloss of the second specular lobe, 1 is sharp. Mitsuba: 0.
    pub clearcoat_gloss: Texture,
}

impl Default for PrincipledParams {
    fn default() -> Self {
        let constant = |v: f32| Texture::Constant(Rgb::splat(v));
        Self {
            base_color: constant(0.5),
            roughness: constant(0.5),
            anisotropic: constant(0.0),
            metallic: constant(0.0),
            spec_trans: constant(0.0),
            eta: 1.5,
            spec_tint: constant(0.0),
            sheen: constant(0.0),
            sheen_tint: constant(0.0),
            flatness: constant(0.0),
            clearcoat: constant(0.0),
            clearcoat_gloss: constant(0.0),
        }
    }
}

/// The model.
#[derive(Debug, Clone)]
pub struct Principled {
    /// Parameters as given.
    pub params: PrincipledParams,
}

impl Principled {
    /// Refuses an `eta` that is not positive and finite.
    pub fn new(params: PrincipledParams) -> Result<Self> {
        Ok(Self { params })
    }

    /// `eta` of a scene file's `specular` in [0, 1].
    pub fn eta_from_specular(specular: f32) -> f32 {
        2.0 / (1.0 - (0.08 * specular.clamp(0.0, 1.0)).sqrt()) - 1.0
    }
}
