//! Energy and reciprocity, and the albedos.

use super::models::*;
use glam::Vec3;
use reprobe::base::math::Rgb;
use reprobe::material::bsdf::warp::direction;
use reprobe::material::bsdf::*;
use reprobe::transport::Sampler;

const VIEWS: [f32; 5] = [1.0, 0.8, 0.4, 0.15, 0.04];

/// Share of uniform light that goes to `wi`, from samples; refracted radiance is taken back to one side of the interface.
fn albedo(bsdf: &Bsdf, wi: Vec3, query: Query) -> Rgb {
    let n = 16_384;
    let mut sum = Rgb::ZERO;
    for i in 0..n {
        let mut sampler = Sampler::new(5, i);
        let (u, v) = (sampler.next_1d(), sampler.next_2d());
        if let Some(sample) = bsdf.sample(&surface([0.3, 0.6]), wi, u, v, query) {
            sum += sample.weight * (sample.eta * sample.eta);
        }
    }
    sum / n as f32
}

fn only(lobes: Lobes) -> Query {
    Query { lobes, ..Query::default() }
}

#[test]
fn nothing_sends_back_more_than_it_receives() {
    let white = || PlasticParams { diffuse_reflectance: grey(1.0), specular_reflectance: grey(1.0), ..plastic_params(true) };
    let mirror = || Conductor { eta: Rgb::ZERO, k: Rgb::ZERO, specular_reflectance: grey(1.0) };
    let rough = |distribution, alpha: f32| {
        let (alpha_u, alpha_v) = (grey(alpha), grey(alpha));
        Bsdf::RoughConductor(Box::new(RoughConductor { metal: mirror(), alpha_u, alpha_v, distribution }))
    };
    let coated = |alpha, d| Bsdf::RoughPlastic(Box::new(RoughPlastic::new(white(), alpha, d).unwrap()));
    let models = [
        ("diffuse", Bsdf::Diffuse(Diffuse { reflectance: grey(1.0) })),
        ("plastic", Bsdf::Plastic(Box::new(Plastic::new(white()).unwrap()))),
        ("roughplastic 0.05", coated(0.05, Distribution::Ggx)),
        ("roughplastic 0.4", coated(0.4, Distribution::Beckmann)),
        ("mirror", Bsdf::Conductor(mirror())),
        ("rough mirror 0.05", rough(Distribution::Ggx, 0.05)),
        ("rough mirror 0.5", rough(Distribution::Beckmann, 0.5)),
        ("roughdielectric", roughdielectric(0.2, Distribution::Ggx, grey(1.0))),
        ("dielectric", model("dielectric")),
        ("thindielectric", model("thindielectric")),
    ];
    for (name, bsdf) in &models {
        for cos in VIEWS {
            let albedo = albedo(bsdf, direction(cos, 0.1), Query::default()).max_element();
            // The white plastics keep all light but for their fits and tables (0.5 %).
            assert!(albedo < 1.006, "{name} {cos}: {albedo}");
            let lossless = ["diffuse", "mirror"].contains(name);
            assert!(!lossless || albedo > 0.999, "{name} {cos}: {albedo}");
        }
    }
}

#[test]
fn light_may_travel_either_way() {
    let names = ["diffuse", "plastic", "roughplastic_ggx_0.3", "roughconductor_ggx_anisotropic", "roughconductor_beckmann_0.4"];
    for name in names.iter().chain(&["principled_cloth", "principled_metal", "principled_coat", "blend"]) {
        let (bsdf, s) = (model(name), surface([0.3, 0.6]));
        for i in 0..200 {
            let mut sampler = Sampler::new(11, i);
            let (a, b) = (direction(sampler.next_1d(), sampler.next_1d()), direction(sampler.next_1d(), sampler.next_1d()));
            let (there, back) = (bsdf.eval(&s, a, b, Query::default()) / b.z, bsdf.eval(&s, b, a, Query::default()) / a.z);
            assert!((there - back).abs().max_element() <= 1e-3 * there.max_element(), "{name}: {a} {b}: {there} {back}");
        }
    }
    // Through an interface, radiance over the squared index is what is kept.
    let (bsdf, s) = (model("roughdielectric_ggx_0.2"), surface([0.3, 0.6]));
    let mut seen = 0;
    for i in 0..200 {
        let mut sampler = Sampler::new(13, i);
        let (a, b) = (direction(sampler.next_1d(), sampler.next_1d()), direction(-sampler.next_1d(), sampler.next_1d()));
        let there = bsdf.eval(&s, a, b, Query::default()).x / b.z.abs();
        let back = bsdf.eval(&s, b, a, Query::default()).x / a.z.abs();
        assert!((there * 2.25 - back).abs() < 2e-3 * back.max(1e-4), "{a} {b}: {there} {back}");
        seen += u32::from(there > 1e-3);
    }
    assert!(seen > 20);
}

#[test]
fn diffuse_albedo_is_the_integral_of_the_diffuse_lobe() {
    let names = ["diffuse", "plastic_nonlinear", "roughplastic_ggx_0.3", "roughplastic_beckmann_0.5_nonlinear", "blend"];
    for name in names.iter().chain(&["principled_default", "principled_cloth", "twosided_plastic"]) {
        let bsdf = model(name);
        for cos in VIEWS {
            let wi = direction(cos, 0.1);
            let exact = albedo(&bsdf, wi, only(Lobes::DIFFUSE));
            let ours = bsdf.diffuse_albedo(&surface([0.3, 0.6]), wi);
            // The fit of the diffuse Fresnel term; for principled, 32 directions.
            let tolerance = if name.starts_with("principled") { 0.02 } else { 0.005 };
            let error = ((ours - exact) / exact).abs().max_element();
            assert!(error < tolerance, "{name} {cos}: {ours} {exact}");
        }
    }
}

#[test]
fn glossy_albedo_is_near_the_integral_of_the_other_lobes() {
    let names = ["plastic", "roughplastic_ggx_0.3", "roughplastic_beckmann_0.1", "roughconductor_ggx_0.1", "conductor"];
    for name in names.iter().chain(&["roughconductor_ggx_anisotropic", "blend", "principled_default", "principled_metal"]) {
        let bsdf = model(name);
        for cos in VIEWS {
            for roughness_scale in [1.0, 0.5] {
                let (wi, query) = (direction(cos, 0.1), Query { lobes: Lobes::NON_DIFFUSE, roughness_scale });
                let (ours, exact) = (bsdf.glossy_albedo(&surface([0.3, 0.6]), wi, query), albedo(&bsdf, wi, query));
                // One alpha stands for an anisotropic pair.
                let error = ((ours - exact) / exact).abs().max_element();
                // One alpha stands for an anisotropic pair; the Fresnel term is taken at one cosine.
                assert!(error < 0.05, "{name} {cos} x {roughness_scale}: {ours} {exact}");
            }
        }
    }
}
