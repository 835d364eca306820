//! Models with another albedo or another roughness than their scene file gives them.

use super::{Bsdf, RoughPlastic};
use crate::base::math::Rgb;
use crate::material::Texture;

impl Bsdf {
    /// Gives every diffuse part the same reflectance all over, in [0, 1], in the place of its texture; of the principled model, the base
    /// colour. Whether there was such a part.
    pub fn set_albedo(&mut self, albedo: Rgb) -> bool {
        let reflectance = match self {
            Self::Diffuse(m) => &mut m.reflectance,
            Self::Plastic(m) => &mut m.params.diffuse_reflectance,
            Self::RoughPlastic(m) => &mut m.params.diffuse_reflectance,
            Self::Principled(m) => &mut m.params.base_color,
            Self::Conductor(_)
            | Self::RoughConductor(_)
            | Self::Dielectric(_)
            | Self::ThinDielectric(_)
            | Self::RoughDielectric(_) => return false,
            _ => return self.any_nested(&|nested| nested.set_albedo(albedo)),
        };
        *reflectance = Texture::Constant(albedo);
        true
    }

    /// Gives every rough part this microfacet alpha, in [0, 1], in all directions but for what the principled model says of its
    /// anisotropy. Whether there was such a part: smooth models have none.
    pub fn set_roughness(&mut self, alpha: f32) -> bool {
        let constant = |v: f32| Texture::Constant(Rgb::splat(v));
        match self {
            Self::RoughPlastic(m) => match RoughPlastic::new(m.params.clone(), alpha, m.distribution) {
                Ok(other) => **m = other,
                Err(_) => return false,
            },
            Self::RoughConductor(m) => (m.alpha_u, m.alpha_v) = (constant(alpha), constant(alpha)),
            Self::RoughDielectric(m) => (m.alpha_u, m.alpha_v) = (constant(alpha), constant(alpha)),
            // Burley's roughness is the root of alpha.
            Self::Principled(m) => m.params.roughness = constant(alpha.sqrt()),
            Self::Diffuse(_) | Self::Plastic(_) | Self::Conductor(_) | Self::Dielectric(_) | Self::ThinDielectric(_) => {
                return false;
            }
            _ => return self.any_nested(&|nested| nested.set_roughness(alpha)),
        }
        true
    }

    /// Changes all models within this one; whether any was changed.
    fn any_nested(&mut self, change: &dyn Fn(&mut Bsdf) -> bool) -> bool {
        match self {
            Self::TwoSided(m) => change(&mut m.front) | change(&mut m.back),
            Self::Blend(m) => change(&mut m.a) | change(&mut m.b),
            Self::BumpMap(m) => change(&mut m.nested),
            Self::NormalMap(m) => change(&mut m.nested),
            _ => false,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::material::Surface;
    use crate::material::bsdf::{
        Blend, Conductor, Diffuse, Distribution, PlasticParams, Principled, PrincipledParams, RoughConductor, TwoSided,
    };
    use glam::Vec3;

    fn surface() -> Surface {
        Surface::flat(Vec3::ZERO, Vec3::Z)
    }

    fn grey(v: f32) -> Texture {
        Texture::Constant(Rgb::splat(v))
    }

    fn plastic(reflectance: f32, alpha: f32) -> Bsdf {
        let params = PlasticParams {
            int_ior: 1.5,
            ext_ior: 1.0,
            nonlinear: true,
            diffuse_reflectance: grey(reflectance),
            specular_reflectance: grey(1.0),
        };
        Bsdf::RoughPlastic(Box::new(RoughPlastic::new(params, alpha, Distribution::Ggx).unwrap()))
    }

    fn metal(alpha: f32) -> Bsdf {
        let metal = Conductor { eta: Rgb::ZERO, k: Rgb::ONE, specular_reflectance: grey(1.0) };
        let (alpha_u, alpha_v) = (grey(alpha), grey(alpha));
        Bsdf::RoughConductor(Box::new(RoughConductor { metal, alpha_u, alpha_v, distribution: Distribution::Beckmann }))
    }

    fn principled(base: f32, roughness: f32) -> Bsdf {
        let params = PrincipledParams { base_color: grey(base), roughness: grey(roughness), ..PrincipledParams::default() };
        Bsdf::Principled(Box::new(Principled::new(params).unwrap()))
    }

    fn two_sided(bsdf: Bsdf) -> Bsdf {
        Bsdf::TwoSided(TwoSided::new(bsdf.clone(), bsdf).unwrap())
    }

    fn blend(a: Bsdf, b: Bsdf) -> Bsdf {
        Bsdf::Blend(Blend { weight: grey(0.4), a: Box::new(a), b: Box::new(b), coverage: None })
    }

    /// A changed model scatters as one that was made so, all it has precomputed included.
    #[test]
    fn changed_models_are_those_of_the_new_numbers() {
        let diffuse = |v: f32| Bsdf::Diffuse(Diffuse { reflectance: grey(v) });
        let (s, wi) = (surface(), Vec3::new(0.3, 0.1, 0.9).normalize());
        for (mut model, expected, has_albedo, has_roughness) in [
            (diffuse(0.2), diffuse(0.7), true, false),
            (plastic(0.2, 0.4), plastic(0.7, 0.1), true, true),
            (two_sided(plastic(0.2, 0.4)), two_sided(plastic(0.7, 0.1)), true, true),
            (metal(0.4), metal(0.1), false, true),
            (blend(metal(0.4), diffuse(0.2)), blend(metal(0.1), diffuse(0.7)), true, true),
            (principled(0.2, 0.5), principled(0.7, 0.1f32.sqrt()), true, true),
        ] {
            assert_eq!(model.set_albedo(Rgb::splat(0.7)), has_albedo, "{model:?}");
            assert_eq!(model.set_roughness(0.1), has_roughness, "{model:?}");
            for wo in [Vec3::new(-0.3, -0.1, 0.9), Vec3::new(0.6, -0.4, 0.3), Vec3::new(-0.2, -0.15, 0.7)] {
                let [found, wanted] = [&model, &expected].map(|m| m.eval(&s, wi, wo.normalize(), Default::default()));
                assert_eq!(found, wanted, "{model:?}");
            }
        }
    }
}
