//! The split into diffuse and other lobes, the roughness scale, sides, and what constructors refuse.

use super::models::*;
use glam::{Vec2, Vec3};
use reprobe::base::math::Rgb;
use reprobe::material::bsdf::warp::direction;
use reprobe::material::bsdf::*;
use reprobe::transport::Sampler;
use std::f32::consts::FRAC_1_PI;

const ALL: [&str; 13] = [
    "diffuse",
    "plastic",
    "roughplastic_ggx_0.3",
    "roughplastic_beckmann_0.5_nonlinear",
    "roughconductor_ggx_anisotropic",
    "roughdielectric_ggx_0.2",
    "blend",
    "bumpmap_diffuse",
    "normalmap_anisotropic",
    "twosided_plastic",
    "principled_cloth",
    "principled_coat",
    "principled_glass",
];

fn only(lobes: Lobes) -> Query {
    Query { lobes, ..Query::default() }
}

/// Pairs of directions over the sphere.
fn pairs() -> impl Iterator<Item = (Vec3, Vec3)> {
    (0..200).map(|i| {
        let mut sampler = Sampler::new(17, i);
        let mut next = || direction(sampler.next_1d() * 2.0 - 1.0, sampler.next_1d());
        (next(), next())
    })
}

#[test]
fn diffuse_and_other_lobes_add_up() {
    for name in ALL {
        let (bsdf, s) = (model(name), surface([0.95, 0.1]));
        for (wi, wo) in pairs() {
            let parts = bsdf.eval(&s, wi, wo, only(Lobes::DIFFUSE)) + bsdf.eval(&s, wi, wo, only(Lobes::NON_DIFFUSE));
            let whole = bsdf.eval(&s, wi, wo, Query::default());
            assert!((parts - whole).abs().max_element() <= 1e-6 * whole.max_element(), "{name}: {parts} {whole}");
        }
    }
}

#[test]
fn models_without_a_lobe_are_black_in_it() {
    for name in ALL {
        let (bsdf, s) = (model(name), surface([0.95, 0.1]));
        for lobes in [Lobes::DIFFUSE, Lobes::NON_DIFFUSE] {
            let mut drawn = 0;
            for (i, (wi, wo)) in pairs().enumerate() {
                let sample = bsdf.sample(&s, wi, i as f32 / 200.0, Vec2::new(0.3, 0.6), only(lobes));
                drawn += u32::from(sample.is_some());
                let black = bsdf.eval(&s, wi, wo, only(lobes)) == Rgb::ZERO;
                assert!(bsdf.lobes().contains(lobes) || (sample.is_none() && black), "{name} {lobes:?}");
            }
            assert_eq!(drawn > 0, bsdf.lobes().contains(lobes), "{name} {lobes:?}");
        }
    }
}

#[test]
fn the_diffuse_lobe_factors() {
    let names = ["diffuse", "plastic", "plastic_nonlinear", "roughplastic_ggx_0.3", "roughplastic_beckmann_0.5_nonlinear"];
    for name in names.iter().chain(&["twosided_plastic", "blend", "bumpmap_diffuse", "normalmap_diffuse"]) {
        let (bsdf, s) = (model(name), surface([0.95, 0.1]));
        for (wi, wo) in pairs() {
            // A map turns its normal towards the viewer, which the light's factor cannot know: not at grazing views.
            if wi.z * wo.z <= 0.0 || (name.contains("map") && wi.z < 0.9) {
                continue;
            }
            let product = bsdf.diffuse_out(&s, wi) * (bsdf.diffuse_in(&s, wo) * wo.z.abs() * FRAC_1_PI);
            let value = bsdf.eval(&s, wi, wo, only(Lobes::DIFFUSE));
            assert!((product - value).abs().max_element() <= 1e-5 * value.max_element(), "{name}: {product} {value}");
        }
    }
}

#[test]
fn the_lights_factor_is_free_of_colour() {
    for nonlinear in [false, true] {
        let white = PlasticParams { diffuse_reflectance: grey(0.9), ..plastic_params(nonlinear) };
        let models = [plastic(nonlinear), Bsdf::Plastic(Box::new(Plastic::new(white).unwrap()))];
        for (_, wo) in pairs() {
            let [a, b] = models.each_ref().map(|m| m.diffuse_in(&surface([0.3, 0.6]), wo));
            assert_eq!(a, b);
        }
    }
}

#[test]
fn a_scaled_roughness_is_that_roughness() {
    let s = surface([0.3, 0.6]);
    let half = Query { lobes: Lobes::NON_DIFFUSE, roughness_scale: 0.5 };
    let twins = [
        (roughconductor([0.4, 0.2], Distribution::Ggx, PINK), roughconductor([0.2, 0.1], Distribution::Ggx, PINK)),
        (roughplastic(0.4, Distribution::Beckmann, false), roughplastic(0.2, Distribution::Beckmann, false)),
        (roughdielectric(0.4, Distribution::Ggx, PINK), roughdielectric(0.2, Distribution::Ggx, PINK)),
    ];
    for (rough, smooth) in &twins {
        for (wi, wo) in pairs() {
            let (a, b) = (rough.eval(&s, wi, wo, half), smooth.eval(&s, wi, wo, only(Lobes::NON_DIFFUSE)));
            assert!((a - b).abs().max_element() <= 1e-5 * b.max_element(), "{a} {b}");
        }
        assert_eq!(rough.alpha(&s).unwrap(), 2.0 * smooth.alpha(&s).unwrap());
    }
    // The base under a coating does not change.
    let plastic = &twins[1].0;
    for (wi, wo) in pairs() {
        let scaled = Query { lobes: Lobes::DIFFUSE, roughness_scale: 0.5 };
        assert_eq!(plastic.eval(&s, wi, wo, scaled), plastic.eval(&s, wi, wo, only(Lobes::DIFFUSE)));
    }
    // Neither does a mirror.
    let sample = model("conductor").sample(&s, direction(0.5, 0.1), 0.5, Vec2::splat(0.5), half).unwrap();
    assert!(sample.delta && sample.weight != Rgb::ZERO);
}

#[test]
fn one_sided_models_are_black_behind_and_two_sided_ones_are_not() {
    let s = surface([0.3, 0.6]);
    let (one, two) = (model("plastic"), model("twosided_plastic"));
    assert!(!one.is_two_sided() && two.is_two_sided());
    fn down(v: Vec3) -> Vec3 {
        Vec3::new(v.x, v.y, -v.z)
    }
    for (wi, wo) in pairs() {
        let (wi, wo) = (wi.with_z(wi.z.abs()), wo.with_z(wo.z.abs()));
        assert_eq!(one.eval(&s, down(wi), down(wo), Query::default()), Rgb::ZERO);
        assert_eq!(two.eval(&s, down(wi), down(wo), Query::default()), one.eval(&s, wi, wo, Query::default()));
        assert_eq!(two.eval(&s, wi, down(wo), Query::default()), Rgb::ZERO);
        assert_eq!((one.diffuse_out(&s, down(wi)), one.diffuse_in(&s, down(wo))), (Rgb::ZERO, 0.0));
        assert_eq!(two.diffuse_in(&s, down(wo)), one.diffuse_in(&s, wo));
    }
}

#[test]
fn light_passes_through_dielectrics_alone() {
    for name in ["dielectric", "thindielectric", "roughdielectric_ggx_0.2", "principled_glass"] {
        assert!(model(name).is_transmissive(), "{name}");
        assert!(TwoSided::new(model(name), model("diffuse")).is_err(), "{name}");
    }
    for name in ["diffuse", "plastic", "roughplastic_ggx_0.3", "conductor", "blend", "principled_coat", "bumpmap_rough"] {
        assert!(!model(name).is_transmissive(), "{name}");
    }
}

#[test]
fn alphas_are_those_of_the_main_lobe() {
    let s = surface([0.3, 0.6]);
    assert_eq!(model("diffuse").alpha(&s), None);
    assert_eq!(model("plastic").alpha(&s), Some(0.0));
    assert_eq!(model("conductor_none").alpha(&s), Some(0.0));
    assert_eq!(model("roughplastic_ggx_0.3").alpha(&s), Some(0.3));
    assert!((model("blend").alpha(&s).unwrap() - (0.3f32 * 0.1).sqrt()).abs() < 1e-6);
    assert!((model("principled_default").alpha(&s).unwrap() - 0.25).abs() < 1e-6);
}

#[test]
fn impossible_indices_of_refraction_are_refused() {
    for (int_ior, ext_ior) in [(0.0, 1.0), (1.5, 0.0), (-1.5, 1.0), (f32::NAN, 1.0), (f32::INFINITY, 1.0), (1.5, f32::NAN)] {
        let params = || PlasticParams { int_ior, ext_ior, ..plastic_params(false) };
        assert!(Plastic::new(params()).is_err());
        assert!(RoughPlastic::new(params(), 0.1, Distribution::Ggx).is_err());
        assert!(Dielectric::new(DielectricParams { int_ior, ext_ior, ..glass(PINK) }).is_err());
    }
    assert!(RoughPlastic::new(plastic_params(false), f32::NAN, Distribution::Ggx).is_err());
    assert!(Principled::new(PrincipledParams { eta: f32::NAN, ..Default::default() }).is_err());
}
