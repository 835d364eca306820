// What the kernels of the denoiser of path-traced layers share, an edge-avoiding a-trous wavelet filter. Twin: src/view/denoise.rs.
//
// denoise_start.wgsl divides a layer by its albedo, despeckle.wgsl cuts rare paths, with_variance.wgsl finds the noise, smooth_level.wgsl is a
// level of the wavelet and denoise_end.wgsl multiplies the albedo in again.

// #include "shared/math.wgsl"
// #include "path_trace/guide.wgsl"

struct Params {
    width: u32,
    height: u32,
    // Pixels between taps.
    step: i32,
    despeckle: u32,
    luminance_sigma: f32,
    normal_power: f32,
    depth_sigma: f32,
    albedo_sigma: f32,
}

const MIN_ALBEDO: f32 = 0.02;

// The kernel begins with a copy: see scene.wgsl.
@group(0) @binding(0) var<uniform> denoise_params: Params;
var<private> params: Params;
@group(0) @binding(1) var<storage, read> guides: array<Guide>;
// Light, albedo divided out, and the variance of its luminance.
@group(0) @binding(2) var<storage, read> source: array<vec4<f32>>;
@group(0) @binding(3) var<storage, read_write> result: array<vec4<f32>>;

fn pixel_index(x: i32, y: i32) -> u32 {
    return u32(y) * params.width + u32(x);
}

fn is_inside(x: i32, y: i32) -> bool {
    return x >= 0 && y >= 0 && x < i32(params.width) && y < i32(params.height);
}

fn divisor(g: Guide) -> vec3<f32> {
    return max(g.factor, vec3(MIN_ALBEDO));
}

// Whether a pixel's surface has the layer at all.
fn is_lit(g: Guide) -> bool {
    return any(g.factor != vec3(0.0));
}

// Minus the logarithm of a weight: how little the surfaces of two pixels agree, `offset` pixels apart.
fn difference(a: Guide, b: Guide, slope: vec2<f32>, offset: vec2<f32>) -> f32 {
    let lengths = sqrt(dot(a.normal, a.normal) * dot(b.normal, b.normal));
    // Two pixels of sky agree.
    var cosine = select(0.0, 1.0, all(a.normal == b.normal));
    if lengths > 1e-6 {
        cosine = dot(a.normal, b.normal) / lengths;
    }
    let expected = dot(slope, abs(offset)) + 1e-3 * a.depth;
    let depth = abs(a.depth - b.depth) / (params.depth_sigma * expected + MIN_POSITIVE);
    let apart = a.albedo - b.albedo;
    let albedo = dot(apart, apart) / (params.albedo_sigma * params.albedo_sigma);
    return params.normal_power * (1.0 - cosine) + depth + albedo;
}

