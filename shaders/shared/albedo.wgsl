// Directional albedo of the non-diffuse lobes, and the roughness that passes call alpha. Twins: src/material/bsdf/albedo.rs, and
// `glossy_albedo` and `alpha` of the models.

// #include "shared/bsdf.wgsl"

// Twins: transport::bsdf::albedo::{COSINES, ALPHAS}.
const ALBEDO_COSINES: u32 = 33u;
const ALBEDO_ALPHAS: u32 = 17u;

// Energy of a lobe with F = 1, and the cosine at which its Fresnel term is to be taken.
fn lobe_albedo(distribution: u32, alpha: f32, cosine: f32) -> vec2<f32> {
    let x = clamp(cosine, 0.0, 1.0) * f32(ALBEDO_COSINES - 1u);
    let y = sqrt(clamp(alpha, 0.0, 1.0)) * f32(ALBEDO_ALPHAS - 1u);
    let i = min(u32(x), ALBEDO_COSINES - 2u);
    let j = min(u32(y), ALBEDO_ALPHAS - 2u);
    let at = (distribution * ALBEDO_ALPHAS + j) * ALBEDO_COSINES + i;
    let low = mix(albedo_entry(at), albedo_entry(at + 1u), x - f32(i));
    let high = mix(albedo_entry(at + ALBEDO_COSINES), albedo_entry(at + ALBEDO_COSINES + 1u), x - f32(i));
    return mix(low, high, y - f32(j));
}

fn albedo_entry(i: u32) -> vec2<f32> {
    return vec2(word_f32(scene.albedo + 2u * i), word_f32(scene.albedo + 2u * i + 1u));
}

// The leaf's part of the albedo; its textures are in `values`.
fn leaf_glossy_albedo(m: u32, wi: vec3<f32>, query: Query) -> vec3<f32> {
    switch model_u32(m, MODEL_KIND) {
        case DIELECTRIC, THIN_DIELECTRIC, ROUGH_DIELECTRIC: { return mix(values[1], values[0], dielectric_reflected(m, wi)); }
        case PRINCIPLED: { return principled_glossy_albedo(m, wi, query); }
        default: {}
    }
    if wi.z <= 0.0 {
        return vec3(0.0);
    }
    switch model_u32(m, MODEL_KIND) {
        case PLASTIC: { return values[1] * fresnel_dielectric(wi.z, model_f32(m, MODEL_ETA)).r; }
        case ROUGH_PLASTIC: {
            let lobe = lobe_albedo(model_u32(m, MODEL_DISTRIBUTION), model_f32(m, MODEL_ALPHA) * query.roughness_scale, wi.z);
            return values[1] * (lobe.x * fresnel_dielectric(lobe.y, model_f32(m, MODEL_ETA)).r);
        }
        case CONDUCTOR: { return conductor_fresnel(m, wi.z); }
        case ROUGH_CONDUCTOR: {
            let alpha = facets_alpha_towards(rough_facets(m, 1u, query), wi);
            let lobe = lobe_albedo(model_u32(m, MODEL_DISTRIBUTION), alpha, wi.z);
            return conductor_fresnel(m, lobe.y) * lobe.x;
        }
        default: { return vec3(0.0); }
    }
}

// The albedo of all of them towards `wi`.
fn bsdf_glossy_albedo(s: Surface, wi: vec3<f32>) -> vec3<f32> {
    let root = material_u32(s.material, MATERIAL_MODEL);
    var sum = vec3(0.0);
    var u = 0.0;
    for (var i = 0u; i < model_u32(root, MODEL_LEAVES); i++) {
        let leaf = leaf_at(root, s, wi, i, &u, ALL_LOBES);
        if leaf.share > 0.0 {
            sum += leaf.share * leaf_glossy_albedo(leaf.model, leaf.wi, Query(NON_DIFFUSE, 1.0));
        }
    }
    return sum;
}

fn principled_glossy_albedo(m: u32, wi: vec3<f32>, query: Query) -> vec3<f32> {
    let p = principled_at(m, query);
    if wi.z <= 0.0 {
        return p.base * p.glass;
    }
    let lobe = lobe_albedo(GGX, facets_alpha_towards(p.facets, wi), wi.z);
    let f = fresnel_dielectric(lobe.y, p.eta).r;
    let coat = p.clearcoat * CLEARCOAT_STRENGTH * schlick_from(p.eta, vec3(CLEARCOAT_F0), wi.z);
    return principled_fresnel(p, f, lobe.y) * lobe.x + coat + sqrt(max(p.base, vec3(0.0))) * (p.glass * (1.0 - f));
}

// Alpha of the main non-diffuse lobe, unscaled: that of the front where it has one, the smaller of a blend; negative without such a lobe.
fn bsdf_alpha(s: Surface) -> f32 {
    let root = material_u32(s.material, MATERIAL_MODEL);
    let count = model_u32(root, MODEL_LEAVES);
    var least = -1.0;
    var u = 0.0;
    for (var i = 0u; i < 2u * count; i++) {
        if i == count && least >= 0.0 {
            break;
        }
        let leaf = leaf_at(root, s, select(-UP, UP, i < count), i % count, &u, ALL_LOBES);
        let alpha = leaf_alpha(leaf.model);
        if leaf.chance >= 0.0 && alpha >= 0.0 {
            least = select(min(least, alpha), alpha, least < 0.0);
        }
    }
    return least;
}

fn leaf_alpha(m: u32) -> f32 {
    let unscaled = Query(ALL_LOBES, 1.0);
    switch model_u32(m, MODEL_KIND) {
        case DIFFUSE_MODEL: { return -1.0; }
        case ROUGH_PLASTIC: { return model_f32(m, MODEL_ALPHA); }
        case ROUGH_CONDUCTOR: { return facets_mean_alpha(rough_facets(m, 1u, unscaled)); }
        case ROUGH_DIELECTRIC: { return facets_mean_alpha(rough_facets(m, 2u, unscaled)); }
        case PRINCIPLED: { return facets_mean_alpha(principled_at(m, unscaled).facets); }
        default: { return 0.0; }
    }
}
