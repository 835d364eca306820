// Burley's principled model. Twin: src/material/bsdf/principled.rs. Values: base colour, roughness, anisotropic, metallic, spec_trans,
// spec_tint, sheen, sheen_tint, flatness, clearcoat, clearcoat_gloss.

// #include "shared/models.wgsl"

const SPECULAR_ALPHA_MIN: f32 = 1e-3;
const CLEARCOAT_STRENGTH: f32 = 0.25;
const CLEARCOAT_SHADOWING_ALPHA: f32 = 0.25;
const CLEARCOAT_F0: f32 = 0.04;

// The parameters at a point, and what follows from them.
struct Principled {
    base: vec3<f32>,
    roughness: f32,
    metallic: f32,
    opaque_share: f32,
    glass: f32,
    spec_tint: f32,
    clearcoat: f32,
    coat_alpha: f32,
    tint: vec3<f32>,
    facets: Microfacets,
    eta: f32,
}

fn principled_at(m: u32, query: Query) -> Principled {
    let base = values[0];
    let roughness = luminance(values[1]);
    let metallic = luminance(values[3]);
    let spec_trans = luminance(values[4]);
    let aspect = sqrt(max(1.0 - 0.9 * luminance(values[2]), 0.0));
    let alpha = max(roughness * roughness * vec2(1.0 / aspect, aspect), vec2(SPECULAR_ALPHA_MIN)) * query.roughness_scale;
    let gloss = luminance(values[10]);
    let brightness = luminance(base);
    return Principled(
        base,
        roughness,
        metallic,
        (1.0 - metallic) * (1.0 - spec_trans),
        (1.0 - metallic) * spec_trans,
        luminance(values[5]),
        luminance(values[9]),
        clamp((0.1 + (0.001 - 0.1) * gloss) * query.roughness_scale, ALPHA_MIN, 0.99),
        select(vec3(1.0), base / brightness, brightness > 0.0),
        microfacets(GGX, alpha),
        model_f32(m, MODEL_ETA),
    );
}

// f · |cos wo| of the diffuse lobes, for directions on the front side.
fn principled_diffuse(p: Principled, wi: vec3<f32>, wo: vec3<f32>) -> vec3<f32> {
    let h = normalize_or(wi + wo, vec3(0.0));
    let f_i = schlick(wi.z);
    let f_o = schlick(wo.z);
    let cos_d = dot(h, wo);
    let retro_90 = 2.0 * p.roughness * cos_d * cos_d;
    var shape = (1.0 - 0.5 * f_i) * (1.0 - 0.5 * f_o) + retro_90 * (f_o + f_i + f_o * f_i * (retro_90 - 1.0));
    let flatness = luminance(values[8]);
    if flatness > 0.0 {
        let fade = (1.0 + (0.5 * retro_90 - 1.0) * f_i) * (1.0 + (0.5 * retro_90 - 1.0) * f_o);
        shape = mix(shape, 1.25 * (fade * (1.0 / (wi.z + wo.z) - 0.5) + 0.5), flatness);
    }
    var value = p.base * (p.opaque_share * FRAC_1_PI * shape);
    let sheen = luminance(values[6]) * (1.0 - p.metallic);
    if sheen > 0.0 {
        value += mix(vec3(1.0), p.tint, luminance(values[7])) * (sheen * schlick(abs(cos_d)));
    }
    return value * wo.z;
}

// Fresnel term of the main lobe, seen from the front.
fn principled_fresnel(p: Principled, dielectric: f32, cosine: f32) -> vec3<f32> {
    var f = vec3((1.0 - p.metallic) * (1.0 - p.spec_tint) * dielectric);
    if p.metallic > 0.0 {
        f += p.metallic * schlick_from(p.eta, p.base, cosine);
    }
    if p.spec_tint > 0.0 {
        let r = (p.eta - 1.0) / (p.eta + 1.0);
        f += (1.0 - p.metallic) * p.spec_tint * schlick_from(p.eta, p.tint * (r * r), cosine);
    }
    return f;
}

fn schlick_from(eta: f32, f0: vec3<f32>, cosine: f32) -> vec3<f32> {
    var c = cosine;
    if eta <= 1.0 {
        c = abs(fresnel_dielectric(cosine, eta).cos_t);
    }
    return f0 + (1.0 - f0) * schlick(c);
}

fn schlick(cosine: f32) -> f32 {
    let x = clamp(1.0 - cosine, 0.0, 1.0);
    return x * x * x * x * x;
}

// Probabilities of the diffuse lobe and of the clearcoat.
fn principled_probabilities(p: Principled, wi: vec3<f32>, query: Query) -> vec2<f32> {
    if query.lobes == DIFFUSE {
        return vec2(1.0, 0.0);
    }
    if wi.z < 0.0 {
        return vec2(0.0);
    }
    let diffuse = select(0.0, p.opaque_share, (query.lobes & DIFFUSE) != 0u);
    let coat = CLEARCOAT_STRENGTH * p.clearcoat;
    return vec2(diffuse, coat) / (1.0 + diffuse + coat);
}

fn principled_reflection_probability(p: Principled, wi: vec3<f32>, f: f32) -> f32 {
    return select(f, 1.0 - p.glass * (1.0 - f), wi.z > 0.0);
}

fn principled_eval_pdf(m: u32, wi: vec3<f32>, wo: vec3<f32>, query: Query) -> Scatter {
    let p = principled_at(m, query);
    let reflection = wi.z * wo.z > 0.0;
    if wi.z * wo.z == 0.0 || (wi.z < 0.0 && p.glass <= 0.0) {
        return NO_SCATTER;
    }
    let chances = principled_probabilities(p, wi, query);
    var sum = NO_SCATTER;
    if (query.lobes & DIFFUSE) != 0u && reflection && wi.z > 0.0 {
        sum.value += principled_diffuse(p, wi, wo);
        sum.pdf += chances.x * cosine_hemisphere_pdf(wo);
    }
    if (query.lobes & NON_DIFFUSE) == 0u {
        return sum;
    }
    let facet = dielectric_facet(wi, wo, p.eta);
    if facet.w == 0.0 {
        return sum;
    }
    let h = facet.xyz;
    let f = fresnel_dielectric(dot(wi, h), p.eta);
    let d = facets_d(p.facets, h);
    let g_i = facets_g1_over_cos(p.facets, wi, h);
    let g_o = facets_g1(p.facets, wo, h);
    let visible = (1.0 - chances.x - chances.y) * d * g_i * abs(dot(wi, h)) * facet.w;
    let p_reflect = principled_reflection_probability(p, wi, f.r);
    if !reflection {
        sum.pdf += visible * (1.0 - p_reflect);
        let transmitted = p.glass * (1.0 - f.r) * f.eta_ti * f.eta_ti;
        sum.value += sqrt(max(p.base, vec3(0.0))) * (transmitted * d * g_i * g_o * abs(dot(wi, h)) * facet.w);
        return sum;
    }
    sum.pdf += visible * p_reflect;
    if f.r > 0.0 {
        var colour = vec3(p.glass * f.r);
        if wi.z > 0.0 {
            colour = principled_fresnel(p, f.r, dot(wi, h));
        }
        sum.value += colour * (0.25 * d * g_i * g_o);
    }
    if wi.z > 0.0 && p.clearcoat > 0.0 {
        let coat = gtr1(p.coat_alpha, h);
        sum.pdf += chances.y * coat * h.z * facet.w;
        let shadowing = microfacets(GGX, vec2(CLEARCOAT_SHADOWING_ALPHA));
        let g = facets_g1(shadowing, wi, h) * facets_g1(shadowing, wo, h);
        let colour = schlick_from(p.eta, vec3(CLEARCOAT_F0), dot(wi, h));
        sum.value += colour * (p.clearcoat * CLEARCOAT_STRENGTH * coat * g * wo.z);
    }
    return sum;
}

fn principled_sample(m: u32, wi: vec3<f32>, u: f32, v: vec2<f32>, query: Query) -> Sample {
    let p = principled_at(m, query);
    if wi.z == 0.0 || (wi.z < 0.0 && (p.glass <= 0.0 || (query.lobes & NON_DIFFUSE) == 0u)) {
        return NO_SAMPLE;
    }
    let chances = principled_probabilities(p, wi, query);
    if u < chances.x {
        return towards(cosine_hemisphere(v));
    }
    if u < chances.x + chances.y {
        return towards(mirror(wi, sample_gtr1(p.coat_alpha, v)));
    }
    let rest = (u - chances.x - chances.y) / (1.0 - chances.x - chances.y);
    return through_facet(wi, facets_sample(p.facets, select(-wi, wi, wi.z > 0.0), v), p.eta, rest, p.glass);
}

fn gtr1(alpha: f32, h: vec3<f32>) -> f32 {
    let a2 = alpha * alpha;
    return (a2 - 1.0) / (PI * log(a2) * (dot(h.xy, h.xy) + a2 * h.z * h.z));
}

fn sample_gtr1(alpha: f32, v: vec2<f32>) -> vec3<f32> {
    let a2 = alpha * alpha;
    let cos2 = (1.0 - pow(a2, 1.0 - v.y)) / (1.0 - a2);
    return direction(sqrt(clamp(cos2, 0.0, 1.0)), v.x);
}

// By quadrature: 4 Gauss-Legendre nodes in cos², even in projected solid angle, by 8 azimuths.
fn principled_diffuse_albedo(m: u32, wi: vec3<f32>) -> vec3<f32> {
    if wi.z <= 0.0 {
        return vec3(0.0);
    }
    let p = principled_at(m, Query(ALL_LOBES, 1.0));
    var squares = array(0.06943184, 0.3300095, 0.6699905, 0.9305682);
    var weights = array(0.1739274, 0.3260726, 0.3260726, 0.1739274);
    var sum = vec3(0.0);
    for (var i = 0u; i < 32u; i++) {
        let wo = direction(sqrt(squares[i >> 3u]), (f32(i & 7u) + 0.5) / 8.0);
        sum += principled_diffuse(p, wi, wo) * (weights[i >> 3u] / wo.z);
    }
    return sum * (PI / 8.0);
}
