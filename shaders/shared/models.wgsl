// The scattering models without nesting, each the twin of src/material/bsdf/NAME.rs. `m` is an index into `models`; directions are local to
// the model's own frame.
//
// A shader has no calls: every function is put in where it is used. So a model's textures are looked up once, into `values`, for all that is
// asked of it, and sampling yields a direction alone, whose value and density come from the same place as any other's.

// #include "shared/texture.wgsl"
// #include "shared/fresnel.wgsl"
// #include "shared/microfacet.wgsl"

// Kinds of models.
const DIFFUSE_MODEL: u32 = 0u;
const PLASTIC: u32 = 1u;
const ROUGH_PLASTIC: u32 = 2u;
const CONDUCTOR: u32 = 3u;
const ROUGH_CONDUCTOR: u32 = 4u;
const DIELECTRIC: u32 = 5u;
const THIN_DIELECTRIC: u32 = 6u;
const ROUGH_DIELECTRIC: u32 = 7u;
const PRINCIPLED: u32 = 8u;
const TWO_SIDED: u32 = 9u;
const BUMP_MAP: u32 = 10u;
const NORMAL_MAP: u32 = 11u;
const BLEND: u32 = 12u;

// Twin: material::bsdf::roughplastic::COSINES.
const PLASTIC_COSINES: u32 = 64u;

const DIFFUSE: u32 = 1u;
const NON_DIFFUSE: u32 = 2u;
const ALL_LOBES: u32 = 3u;
const UP = vec3(0.0, 0.0, 1.0); // Own.

struct Query {
    lobes: u32,
    roughness_scale: f32,
}

struct Scatter {
    value: vec3<f32>,
    pdf: f32,
}

const NO_SCATTER = Scatter(vec3(0.0), 0.0); // Own.

// A sampled direction. Of a delta lobe weight and pdf are known; elsewhere a pdf of 1 says only that there is a direction, 0 that there is none.
struct Sample {
    wo: vec3<f32>,
    weight: vec3<f32>,
    pdf: f32,
    delta: bool,
    eta: f32,
}

const NO_SAMPLE = Sample(vec3(0.0), vec3(0.0), 0.0, false, 1.0); // Own.

// What the textures of the model at hand say. Which slot holds what is said in src/gpu/scene/materials.rs.
var<private> values: array<vec3<f32>, 12>;

fn look_up(m: u32, uv: vec2<f32>) {
    for (var slot = 0u; slot < model_u32(m, MODEL_SLOTS); slot++) {
        values[slot] = texture_eval(model_u32(m, MODEL_TEXTURES + slot), uv);
    }
}

fn towards(wo: vec3<f32>) -> Sample {
    return Sample(wo, vec3(0.0), 1.0, false, 1.0);
}

fn mirrored(wi: vec3<f32>, weight: vec3<f32>, pdf: f32) -> Sample {
    return Sample(vec3(-wi.xy, wi.z), weight, pdf, true, 1.0);
}

fn sum3(v: vec3<f32>) -> f32 {
    return v.x + v.y + v.z;
}

// diffuse

fn diffuse_eval_pdf(wi: vec3<f32>, wo: vec3<f32>, query: Query) -> Scatter {
    if wi.z <= 0.0 || wo.z <= 0.0 || (query.lobes & DIFFUSE) == 0u {
        return NO_SCATTER;
    }
    let pdf = cosine_hemisphere_pdf(wo);
    return Scatter(values[0] * pdf, pdf);
}

fn diffuse_sample(wi: vec3<f32>, v: vec2<f32>, query: Query) -> Sample {
    if wi.z <= 0.0 || (query.lobes & DIFFUSE) == 0u {
        return NO_SAMPLE;
    }
    return towards(cosine_hemisphere(v));
}

// plastic and roughplastic: values hold the base's albedo and the factor on the reflection.

// Radiance of the base, per irradiance that reaches it through the coating and over the two transmissions.
fn plastic_base(m: u32) -> vec3<f32> {
    let internal = model_f32(m, MODEL_A);
    let eta = model_f32(m, MODEL_ETA);
    let lost = select(vec3(internal), values[0] * internal, model_u32(m, MODEL_OPTION) != 0u);
    return values[0] / ((1.0 - lost) * (eta * eta));
}

fn plastic_specular_probability(reflected: f32, query: Query) -> f32 {
    if query.lobes != ALL_LOBES {
        return select(0.0, 1.0, (query.lobes & NON_DIFFUSE) != 0u);
    }
    let s = sum3(values[1]) * reflected;
    let d = sum3(values[0]) * (1.0 - reflected);
    return select(0.0, s / (s + d), s > 0.0);
}

// Share of light that the coating lets through.
fn plastic_transmitted(m: u32, w: vec3<f32>) -> f32 {
    if model_u32(m, MODEL_KIND) == PLASTIC {
        return 1.0 - fresnel_dielectric(w.z, model_f32(m, MODEL_ETA)).r;
    }
    let x = clamp(w.z, 0.0, 1.0) * f32(PLASTIC_COSINES - 1u);
    let i = min(u32(x), PLASTIC_COSINES - 2u);
    let a = word_f32(model_u32(m, MODEL_TABLE) + i);
    return a + (word_f32(model_u32(m, MODEL_TABLE) + i + 1u) - a) * (x - f32(i));
}

fn plastic_facets(m: u32, query: Query) -> Microfacets {
    return microfacets(model_u32(m, MODEL_DISTRIBUTION), vec2(model_f32(m, MODEL_ALPHA) * query.roughness_scale));
}

fn plastic_eval_pdf(m: u32, wi: vec3<f32>, wo: vec3<f32>, query: Query) -> Scatter {
    if wi.z <= 0.0 || wo.z <= 0.0 {
        return NO_SCATTER;
    }
    let t_i = plastic_transmitted(m, wi);
    let p = plastic_specular_probability(1.0 - t_i, query);
    var sum = NO_SCATTER;
    if (query.lobes & NON_DIFFUSE) != 0u && model_u32(m, MODEL_KIND) == ROUGH_PLASTIC {
        let facets = plastic_facets(m, query);
        let h = normalize_or(wi + wo, vec3(0.0));
        let visible = 0.25 * facets_d(facets, h) * facets_g1_over_cos(facets, wi, h);
        if visible > 0.0 {
            let f = fresnel_dielectric(dot(wi, h), model_f32(m, MODEL_ETA)).r;
            sum.value += values[1] * (f * visible * facets_g1(facets, wo, h));
            sum.pdf += p * visible;
        }
    }
    if (query.lobes & DIFFUSE) != 0u {
        let cosine = cosine_hemisphere_pdf(wo);
        sum.value += plastic_base(m) * (t_i * plastic_transmitted(m, wo) * cosine);
        sum.pdf += (1.0 - p) * cosine;
    }
    return sum;
}

fn plastic_sample(m: u32, wi: vec3<f32>, u: f32, v: vec2<f32>, query: Query) -> Sample {
    if wi.z <= 0.0 {
        return NO_SAMPLE;
    }
    let reflected = 1.0 - plastic_transmitted(m, wi);
    let p = plastic_specular_probability(reflected, query);
    if u >= p {
        return towards(cosine_hemisphere(v));
    }
    if model_u32(m, MODEL_KIND) == PLASTIC {
        return mirrored(wi, values[1] * (reflected / p), p);
    }
    return towards(mirror(wi, facets_sample(plastic_facets(m, query), wi, v)));
}

// conductor and roughconductor: values hold the factor on the reflection and both alphas.

fn conductor_fresnel(m: u32, cosine: f32) -> vec3<f32> {
    return values[0] * fresnel_conductor(cosine, model_vec3(m, MODEL_ETA), model_vec3(m, MODEL_K));
}

fn rough_facets(m: u32, slot: u32, query: Query) -> Microfacets {
    let alpha = vec2(luminance(values[slot]), luminance(values[slot + 1u]));
    return microfacets(model_u32(m, MODEL_DISTRIBUTION), alpha * query.roughness_scale);
}

fn conductor_eval_pdf(m: u32, wi: vec3<f32>, wo: vec3<f32>, query: Query) -> Scatter {
    if wi.z <= 0.0 || wo.z <= 0.0 || (query.lobes & NON_DIFFUSE) == 0u {
        return NO_SCATTER;
    }
    let facets = rough_facets(m, 1u, query);
    let h = normalize_or(wi + wo, vec3(0.0));
    let pdf = 0.25 * facets_d(facets, h) * facets_g1_over_cos(facets, wi, h);
    return Scatter(conductor_fresnel(m, dot(wi, h)) * (pdf * facets_g1(facets, wo, h)), pdf);
}

fn conductor_sample(m: u32, wi: vec3<f32>, v: vec2<f32>, query: Query) -> Sample {
    if wi.z <= 0.0 || (query.lobes & NON_DIFFUSE) == 0u {
        return NO_SAMPLE;
    }
    if model_u32(m, MODEL_KIND) == CONDUCTOR {
        return mirrored(wi, conductor_fresnel(m, wi.z), 1.0);
    }
    return towards(mirror(wi, facets_sample(rough_facets(m, 1u, query), wi, v)));
}

// dielectric, thindielectric and roughdielectric: values hold the factors on reflection and transmission, and both alphas.

// Share that a smooth interface or a thin sheet reflects.
fn dielectric_reflected(m: u32, w: vec3<f32>) -> f32 {
    if model_u32(m, MODEL_KIND) == THIN_DIELECTRIC {
        let r = fresnel_dielectric(abs(w.z), model_f32(m, MODEL_ETA)).r;
        return 2.0 * r / (1.0 + r);
    }
    return fresnel_dielectric(w.z, model_f32(m, MODEL_ETA)).r;
}

// The facet normal that turns `wi` into `wo`, on the side of +z, and d(its solid angle) / d(solid angle of wo); 0 where no facet does.
fn dielectric_facet(wi: vec3<f32>, wo: vec3<f32>, ratio: f32) -> vec4<f32> {
    let reflection = wi.z * wo.z > 0.0;
    let eta = select(1.0 / ratio, ratio, wi.z > 0.0);
    var h = normalize_or(wi + wo * select(eta, 1.0, reflection), vec3(0.0));
    h = select(h, -h, h.z < 0.0);
    let i = dot(wi, h);
    let o = dot(wo, h);
    if i * wi.z <= 0.0 || o * wo.z <= 0.0 {
        return vec4(0.0);
    }
    let across = i + eta * o;
    let jacobian = select(abs(eta * eta * o) / (across * across), 0.25 / abs(o), reflection);
    return select(vec4(0.0), vec4(h, jacobian), is_finite(jacobian));
}

fn dielectric_eval_pdf(m: u32, wi: vec3<f32>, wo: vec3<f32>, query: Query) -> Scatter {
    if wi.z == 0.0 || wo.z == 0.0 || (query.lobes & NON_DIFFUSE) == 0u {
        return NO_SCATTER;
    }
    let facet = dielectric_facet(wi, wo, model_f32(m, MODEL_ETA));
    if facet.w == 0.0 {
        return NO_SCATTER;
    }
    let h = facet.xyz;
    let facets = rough_facets(m, 2u, query);
    let f = fresnel_dielectric(dot(wi, h), model_f32(m, MODEL_ETA));
    let reflection = wi.z * wo.z > 0.0;
    let share = select(1.0 - f.r, f.r, reflection);
    let visible = share * facets_d(facets, h) * facets_g1_over_cos(facets, wi, h) * abs(dot(wi, h)) * facet.w;
    let colour = select(values[1] * (f.eta_ti * f.eta_ti), values[0], reflection);
    return Scatter(colour * (visible * facets_g1(facets, wo, h)), visible);
}

fn dielectric_sample(m: u32, wi: vec3<f32>, u: f32, v: vec2<f32>, query: Query) -> Sample {
    if (query.lobes & NON_DIFFUSE) == 0u || wi.z == 0.0 {
        return NO_SAMPLE;
    }
    if model_u32(m, MODEL_KIND) == ROUGH_DIELECTRIC {
        return through_facet(wi, facets_sample(rough_facets(m, 2u, query), select(-wi, wi, wi.z > 0.0), v), model_f32(m, MODEL_ETA), u, -1.0);
    }
    let r = dielectric_reflected(m, wi);
    if u < r {
        return mirrored(wi, values[0], r);
    }
    if model_u32(m, MODEL_KIND) == THIN_DIELECTRIC {
        return Sample(-wi, values[1], 1.0 - r, true, 1.0);
    }
    let f = fresnel_dielectric(wi.z, model_f32(m, MODEL_ETA));
    return Sample(refracted(wi, UP, f), values[1] * (f.eta_ti * f.eta_ti), 1.0 - f.r, true, f.eta_it);
}

// Reflection at the facet `h` where `u` is below its probability (negative `glass`: the Fresnel term), or else refraction.
fn through_facet(wi: vec3<f32>, h: vec3<f32>, eta: f32, u: f32, glass: f32) -> Sample {
    let f = fresnel_dielectric(dot(wi, h), eta);
    let reflection = u < select(f.r, 1.0 - glass * (1.0 - f.r), glass >= 0.0 && wi.z > 0.0);
    let wo = select(refracted(wi, h, f), mirror(wi, h), reflection);
    if reflection != (wi.z * wo.z > 0.0) {
        return NO_SAMPLE;
    }
    return Sample(wo, vec3(0.0), 1.0, false, select(f.eta_it, 1.0, reflection));
}
