// Microfacet normal distributions, shadowing and visible-normal sampling, and maps from the unit square to directions.
// Twins: src/material/bsdf/microfacet.rs and warp.rs.

// #include "shared/math.wgsl"

const ALPHA_MIN: f32 = 1e-4;
const BECKMANN: u32 = 0u;
const GGX: u32 = 1u;

struct Microfacets {
    distribution: u32,
    alpha: vec2<f32>,
}

fn microfacets(distribution: u32, alpha: vec2<f32>) -> Microfacets {
    return Microfacets(distribution, max(alpha, vec2(ALPHA_MIN)));
}

fn facets_d(f: Microfacets, m: vec3<f32>) -> f32 {
    if m.z <= 0.0 {
        return 0.0;
    }
    let slope = m.xy / f.alpha;
    let slope2 = dot(slope, slope);
    let area = PI * f.alpha.x * f.alpha.y;
    let z2 = m.z * m.z;
    var d = 1.0 / (area * (slope2 + z2) * (slope2 + z2));
    if f.distribution == BECKMANN {
        d = exp(-slope2 / z2) / (area * z2 * z2);
    }
    return select(0.0, d, d * m.z > 1e-20);
}

fn facets_g1(f: Microfacets, v: vec3<f32>, m: vec3<f32>) -> f32 {
    return facets_g1_over_cos(f, v, m) * abs(v.z);
}

fn facets_g1_over_cos(f: Microfacets, v: vec3<f32>, m: vec3<f32>) -> f32 {
    if dot(v, m) * v.z <= 0.0 {
        return 0.0;
    }
    let cosine = abs(v.z);
    let stretched = length(v.xy * f.alpha);
    if f.distribution == GGX {
        return 2.0 / (cosine + sqrt(cosine * cosine + stretched * stretched));
    }
    let a = cosine / stretched;
    if stretched == 0.0 || a >= 1.6 {
        return 1.0 / cosine;
    }
    return (3.535 + 2.181 * a) / ((1.0 + 2.276 * a + 2.577 * a * a) * stretched);
}

// A normal among those visible from `wi` (wi.z > 0).
fn facets_sample(f: Microfacets, wi: vec3<f32>, v: vec2<f32>) -> vec3<f32> {
    let w = normalize_or(vec3(wi.xy * f.alpha, wi.z), vec3(0.0, 0.0, 1.0));
    if f.distribution == GGX {
        let h = direction((1.0 - v.y) * (1.0 + w.z) - w.z, v.x) + w;
        return normalize_or(vec3(h.xy * f.alpha, max(h.z, 0.0)), vec3(0.0, 0.0, 1.0));
    }
    let sine = length(w.xy);
    let azimuth = select(vec2(1.0, 0.0), w.xy / sine, sine > 0.0);
    let x = beckmann_slope(sine / w.z, v.x);
    let y = erf_inv(centred(v.y));
    let slope = vec2(azimuth.x * x - azimuth.y * y, azimuth.y * x + azimuth.x * y) * f.alpha;
    return normalize(vec3(-slope, 1.0));
}

fn facets_alpha_towards(f: Microfacets, w: vec3<f32>) -> f32 {
    let along = f.alpha * w.xy;
    return sqrt(dot(along, along) + f.alpha.x * f.alpha.y * w.z * w.z);
}

fn facets_mean_alpha(f: Microfacets) -> f32 {
    return sqrt(f.alpha.x * f.alpha.y);
}

fn centred(u: f32) -> f32 {
    return clamp(2.0 * u - 1.0, -1.0 + 1e-6, 1.0 - 1e-6);
}

const FRAC_1_SQRT_PI: f32 = 0.5641896;

fn beckmann_cdf(b: f32, x: f32, tangent: f32) -> f32 {
    return 1.0 + b + FRAC_1_SQRT_PI * tangent * exp(-x * x);
}

// Slope along the view of a visible facet (alpha = 1) seen under the angle with this tangent.
fn beckmann_slope(tangent: f32, u: f32) -> f32 {
    if tangent < 1e-5 {
        return erf_inv(centred(u));
    }
    let x_max = 1.0 / tangent;
    let b_max = min(erf(x_max), 1.0 - 1e-6);
    let goal = clamp(u, 1e-6, 1.0 - 1e-6) * beckmann_cdf(erf(x_max), x_max, tangent);
    var low = -1.0 + 1e-6;
    var high = b_max;
    var b = clamp(b_max - (1.0 + b_max) * erf(sqrt(max(-log(max(u, 1e-6)), 0.0))), low, high);
    for (var i = 0; i < 12; i++) {
        let x = erf_inv(b);
        let error = beckmann_cdf(b, x, tangent) - goal;
        if abs(error) < 1e-6 {
            break;
        }
        if error > 0.0 {
            high = b;
        } else {
            low = b;
        }
        let newton = b - error / (1.0 - x * tangent);
        b = select(0.5 * (low + high), newton, newton > low && newton < high);
    }
    return erf_inv(b);
}

// To 1.5e-7 (Abramowitz and Stegun 7.1.26).
fn erf(x: f32) -> f32 {
    let t = 1.0 / (1.0 + 0.3275911 * abs(x));
    let poly = ((((1.0614054 * t - 1.4531521) * t + 1.4214137) * t - 0.28449674) * t + 0.2548296) * t;
    return (1.0 - poly * exp(-x * x)) * sign_of(x);
}

// On (-1, 1), to a few 1e-6 relative (Giles 2010, single precision).
fn erf_inv(y: f32) -> f32 {
    let w = -log((1.0 - y) * (1.0 + y));
    if w < 5.0 {
        let x = w - 2.5;
        var p = 2.8102264e-8 * x + 3.4327394e-7;
        p = (p * x - 3.5233877e-6) * x - 4.3915065e-6;
        p = (p * x + 2.1858087e-4) * x - 1.253725e-3;
        p = (p * x - 4.1776816e-3) * x + 0.24664073;
        return y * (p * x + 1.5014094);
    }
    let x = sqrt(w) - 3.0;
    var p = -2.0021426e-4 * x + 1.0095056e-4;
    p = (p * x + 1.3493432e-3) * x - 3.6734284e-3;
    p = (p * x + 5.7395077e-3) * x - 7.6224613e-3;
    p = (p * x + 9.4388705e-3) * x + 1.001674;
    return y * (p * x + 2.8329768);
}

// Area-preserving, and neighbours stay neighbours (Shirley and Chiu 1997).
fn disk(v: vec2<f32>) -> vec2<f32> {
    let o = v * 2.0 - 1.0;
    if all(o == vec2(0.0)) {
        return o;
    }
    var r = o.y;
    var phi = 0.5 * PI - 0.25 * PI * (o.x / o.y);
    if abs(o.x) > abs(o.y) {
        r = o.x;
        phi = 0.25 * PI * (o.y / o.x);
    }
    return vec2(cos(phi), sin(phi)) * r;
}

fn cosine_hemisphere(v: vec2<f32>) -> vec3<f32> {
    let d = disk(v);
    return vec3(d, sqrt(max(1.0 - dot(d, d), 0.0)));
}

fn cosine_hemisphere_pdf(w: vec3<f32>) -> f32 {
    return max(w.z, 0.0) * FRAC_1_PI;
}

// The unit direction with cosine `z` at the azimuth `turn` (in turns).
fn direction(z: f32, turn: f32) -> vec3<f32> {
    let r = sqrt(max(1.0 - z * z, 0.0));
    return vec3(r * cos(turn * TAU), r * sin(turn * TAU), z);
}
