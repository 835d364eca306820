//! The models of scripts/bsdf_reference.py, by name, and the surface that they lie on.

use glam::{Affine2, Vec2, Vec3};
use reprobe::base::math::{Basis, Rgb};
use reprobe::material::bsdf::*;
use reprobe::material::image::Image;
use reprobe::material::texture::{Bitmap, Wrap};
use reprobe::material::{Surface, Texture};
use std::sync::Arc;

pub fn grey(v: f32) -> Texture {
    Texture::Constant(Rgb::splat(v))
}

pub const ORANGE: Texture = Texture::Constant(Rgb::new(0.8, 0.4, 0.1));
pub const PINK: Texture = Texture::Constant(Rgb::new(0.9, 0.6, 0.7));

/// The surface of the script's `interaction`.
pub fn surface(uv: [f32; 2]) -> Surface {
    let (dp_du, dp_dv) = (Vec3::new(1.3, 0.2, 0.0), Vec3::new(-0.1, 0.9, 0.0));
    let n = Vec3::new(0.1, 0.2, 1.0).normalize();
    let frame = Basis::from_normal_and_tangent(n, dp_du);
    Surface { frame, uv: uv.into(), dp_du, dp_dv, ..Surface::flat(Vec3::ZERO, Vec3::Z) }
}

pub fn bitmap(offset: f32, wrap: Wrap, to_uv: Affine2) -> Texture {
    let value = |x: usize, y: usize, c: usize| ((3 * x + 5 * y + 2 * c) % 7) as f32 / 10.0 + offset;
    let pixels = (0..12).map(|i| (i % 4, i / 4)).map(|(x, y)| Vec3::new(value(x, y, 0), value(x, y, 1), value(x, y, 2)));
    let image = Arc::new(Image::new(4, 3, pixels.collect()));
    Texture::Bitmap(Bitmap { image, to_uv, nearest: false, wrap, scale: 1.0 })
}

pub fn plastic_params(nonlinear: bool) -> PlasticParams {
    PlasticParams { int_ior: 1.5, ext_ior: 1.0, nonlinear, diffuse_reflectance: ORANGE, specular_reflectance: PINK }
}

pub fn plastic(nonlinear: bool) -> Bsdf {
    Bsdf::Plastic(Box::new(Plastic::new(plastic_params(nonlinear)).unwrap()))
}

pub fn roughplastic(alpha: f32, distribution: Distribution, nonlinear: bool) -> Bsdf {
    Bsdf::RoughPlastic(Box::new(RoughPlastic::new(plastic_params(nonlinear), alpha, distribution).unwrap()))
}

pub fn metal(specular_reflectance: Texture) -> Conductor {
    Conductor { eta: Rgb::new(0.2, 0.92, 1.1), k: Rgb::new(3.9, 2.45, 2.1), specular_reflectance }
}

pub fn roughconductor(alpha: [f32; 2], distribution: Distribution, specular: Texture) -> Bsdf {
    let [alpha_u, alpha_v] = alpha.map(grey);
    Bsdf::RoughConductor(Box::new(RoughConductor { metal: metal(specular), alpha_u, alpha_v, distribution }))
}

pub fn glass(specular_transmittance: Texture) -> DielectricParams {
    DielectricParams { int_ior: 1.5, ext_ior: 1.0, specular_reflectance: grey(1.0), specular_transmittance }
}

pub fn roughdielectric(alpha: f32, distribution: Distribution, transmittance: Texture) -> Bsdf {
    let model = RoughDielectric::new(glass(transmittance), grey(alpha), grey(alpha), distribution);
    Bsdf::RoughDielectric(Box::new(model.unwrap()))
}

pub fn principled(params: PrincipledParams) -> Bsdf {
    Bsdf::Principled(Box::new(Principled::new(PrincipledParams { base_color: ORANGE, ..params }).unwrap()))
}

pub fn bump(texture: Texture, scale: f32, nested: Bsdf) -> Bsdf {
    Bsdf::BumpMap(BumpMap { texture, scale, nested: Box::new(nested) })
}

pub fn normal(texture: Texture, nested: Bsdf) -> Bsdf {
    Bsdf::NormalMap(NormalMap { texture, nested: Box::new(nested) })
}

pub fn twosided(model: Bsdf) -> Bsdf {
    Bsdf::TwoSided(TwoSided::new(model.clone(), model).unwrap())
}

/// The script's model of that name.
pub fn model(name: &str) -> Bsdf {
    use Distribution::{Beckmann, Ggx};
    let diffuse = || Bsdf::Diffuse(Diffuse { reflectance: ORANGE });
    let anisotropic = || roughconductor([0.3, 0.1], Ggx, grey(1.0));
    let defaults = PrincipledParams::default;
    match name {
        "diffuse" => diffuse(),
        "plastic" => plastic(false),
        "plastic_nonlinear" => plastic(true),
        "twosided_plastic" => twosided(plastic(false)),
        "roughplastic_ggx_0.3" => roughplastic(0.3, Ggx, false),
        "roughplastic_ggx_0.1_nonlinear" => roughplastic(0.1, Ggx, true),
        "roughplastic_ggx_0.01" => roughplastic(0.01, Ggx, false),
        "roughplastic_beckmann_0.1" => roughplastic(0.1, Beckmann, false),
        "roughplastic_beckmann_0.5_nonlinear" => roughplastic(0.5, Beckmann, true),
        "roughconductor_ggx_0.1" => roughconductor([0.1, 0.1], Ggx, grey(1.0)),
        "roughconductor_ggx_anisotropic" => anisotropic(),
        "roughconductor_beckmann_0.4" => roughconductor([0.4, 0.4], Beckmann, PINK),
        "roughdielectric_ggx_0.2" => roughdielectric(0.2, Ggx, grey(1.0)),
        "roughdielectric_beckmann_0.3" => roughdielectric(0.3, Beckmann, PINK),
        "blend" => Bsdf::Blend(Blend { weight: grey(0.3), a: Box::new(diffuse()), b: Box::new(anisotropic()), coverage: None }),
        "bumpmap_diffuse" => bump(bitmap(0.0, Wrap::Repeat, Affine2::IDENTITY), 0.4, diffuse()),
        "bumpmap_rough" => bump(bitmap(0.0, Wrap::Mirror, Affine2::IDENTITY), 0.1, model("roughconductor_ggx_0.1")),
        "bumpmap_turned" => {
            let to_uv = Affine2::from_angle(20f32.to_radians()) * Affine2::from_scale(Vec2::new(0.6, 0.4));
            bump(bitmap(0.0, Wrap::Clamp, to_uv), 0.2, twosided(diffuse()))
        }
        "normalmap_diffuse" => normal(bitmap(0.3, Wrap::Repeat, Affine2::IDENTITY), diffuse()),
        "normalmap_anisotropic" => normal(bitmap(0.3, Wrap::Repeat, Affine2::IDENTITY), anisotropic()),
        "principled_default" => principled(defaults()),
        "principled_cloth" => principled(PrincipledParams {
            roughness: grey(0.7),
            sheen: grey(0.8),
            sheen_tint: grey(0.6),
            flatness: grey(0.5),
            ..defaults()
        }),
        "principled_metal" => principled(PrincipledParams {
            roughness: grey(0.4),
            metallic: grey(0.7),
            anisotropic: grey(0.8),
            spec_tint: grey(0.5),
            ..defaults()
        }),
        "principled_coat" => principled(PrincipledParams {
            roughness: grey(0.6),
            clearcoat: grey(0.9),
            clearcoat_gloss: grey(0.3),
            eta: Principled::eta_from_specular(0.8),
            ..defaults()
        }),
        "principled_glass" => principled(PrincipledParams {
            roughness: grey(0.5),
            spec_trans: grey(0.6),
            eta: 1.4,
            spec_tint: grey(0.3),
            metallic: grey(0.2),
            ..defaults()
        }),
        "conductor" => Bsdf::Conductor(metal(PINK)),
        "conductor_none" => Bsdf::Conductor(Conductor { eta: Rgb::ZERO, k: Rgb::ZERO, specular_reflectance: grey(1.0) }),
        "dielectric" => Bsdf::Dielectric(Box::new(Dielectric::new(glass(PINK)).unwrap())),
        "thindielectric" => Bsdf::ThinDielectric(Box::new(ThinDielectric::new(glass(PINK)).unwrap())),
        _ => panic!("unknown model {name}"),
    }
}
