// The denoiser of path-traced layers: an edge-avoiding a-trous wavelet filter. Twin: src/render/baseline/denoise.rs.
// Follows math.wgsl and guide.wgsl.
//
// `denoise_start` divides a layer by its albedo, `despeckle` cuts rare paths, `with_variance` finds the noise, `smooth` is a level of the
// wavelet and `denoise_end` multiplies the albedo in again.

// Struct: gpu::denoise::Params.
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

@group(0) @binding(0) var<storage, read> params: Params;
@group(0) @binding(1) var<storage, read> guides: array<Guide>;
// Light, albedo divided out, and the variance of its luminance.
@group(0) @binding(2) var<storage, read> source: array<vec4<f32>>;
@group(0) @binding(3) var<storage, read_write> result: array<vec4<f32>>;
// Change of depth from a pixel to the next, along each axis.
@group(0) @binding(4) var<storage, read> slopes: array<vec2<f32>>;
@group(0) @binding(4) var<storage, read_write> out_slopes: array<vec2<f32>>;

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

// The lesser of the changes of depth towards both neighbours along an axis.
fn slope_along(x: i32, y: i32, axis: vec2<i32>) -> f32 {
    let own = guides[pixel_index(x, y)].depth;
    var least = FAR;
    for (var side = -1; side <= 1; side += 2) {
        let at = vec2(x, y) + axis * side;
        if is_inside(at.x, at.y) {
            least = min(least, abs(guides[pixel_index(at.x, at.y)].depth - own));
        }
    }
    return select(0.0, least, least < FAR);
}

@compute @workgroup_size(16, 4)
fn denoise_start(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= params.width || id.y >= params.height {
        return;
    }
    let x = i32(id.x);
    let y = i32(id.y);
    let i = pixel_index(x, y);
    out_slopes[i] = vec2(slope_along(x, y, vec2(1, 0)), slope_along(x, y, vec2(0, 1)));
    result[i] = vec4(source[i].rgb / divisor(guides[i]), 0.0);
}

@compute @workgroup_size(16, 4)
fn denoise_end(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= params.width || id.y >= params.height {
        return;
    }
    let i = id.y * params.width + id.x;
    result[i] = vec4(source[i].rgb * divisor(guides[i]), 0.0);
}

// Twin: Image::despeckled.
@compute @workgroup_size(16, 4)
fn despeckle(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= params.width || id.y >= params.height {
        return;
    }
    let i = id.y * params.width + id.x;
    var light = source[i].rgb;
    if is_lit(guides[i]) {
        // The brightest around, in descending order.
        var brightest: array<f32, 24>;
        var count = 0u;
        for (var k = 0; k < 25; k++) {
            let x = i32(id.x) + k % 5 - 2;
            let y = i32(id.y) + k / 5 - 2;
            if k == 12 || !is_inside(x, y) {
                continue;
            }
            let value = luminance(source[pixel_index(x, y)].rgb);
            var at = count;
            for (; at > 0u && brightest[at - 1u] < value; at--) {
                if at < params.despeckle {
                    brightest[at] = brightest[at - 1u];
                }
            }
            if at < params.despeckle {
                brightest[at] = value;
                count = min(count + 1u, params.despeckle);
            }
        }
        let own = luminance(light);
        if count == params.despeckle && own > brightest[count - 1u] {
            light *= brightest[count - 1u] / own;
        }
    }
    result[i] = vec4(light, 0.0);
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

// Twin: Image::with_variance.
@compute @workgroup_size(16, 4)
fn with_variance(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= params.width || id.y >= params.height {
        return;
    }
    let i = id.y * params.width + id.x;
    let own = guides[i];
    var variance = 0.0;
    if is_lit(own) {
        // Of the luminance, its square, and the weights.
        var sums = vec3(0.0);
        for (var k = 0; k < 49; k++) {
            let offset = vec2(k % 7, k / 7) - 3;
            let x = i32(id.x) + offset.x;
            let y = i32(id.y) + offset.y;
            if is_inside(x, y) {
                let j = pixel_index(x, y);
                let weight = exp(-difference(own, guides[j], slopes[i], vec2<f32>(offset)));
                let value = luminance(source[j].rgb);
                sums += weight * vec3(value, value * value, 1.0);
            }
        }
        let mean = sums.x / sums.z;
        variance = max(sums.y / sums.z - mean * mean, 0.0);
    }
    result[i] = vec4(source[i].rgb, variance);
}

// The variance about a pixel, over 3 x 3.
fn blurred_variance(x: i32, y: i32) -> f32 {
    var sum = 0.0;
    var total = 0.0;
    for (var k = 0; k < 9; k++) {
        let offset = vec2(k % 3, k / 3) - 1;
        if is_inside(x + offset.x, y + offset.y) {
            let weight = select(0.25, 0.5, offset.x == 0) * select(0.25, 0.5, offset.y == 0);
            sum += weight * source[pixel_index(x + offset.x, y + offset.y)].w;
            total += weight;
        }
    }
    return sum / total;
}

// Twin: Image::smoothed.
@compute @workgroup_size(16, 4)
fn smooth_level(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= params.width || id.y >= params.height {
        return;
    }
    let i = id.y * params.width + id.x;
    let own = guides[i];
    var out = source[i];
    if is_lit(own) {
        var spline = array(1.0 / 16.0, 1.0 / 4.0, 3.0 / 8.0, 1.0 / 4.0, 1.0 / 16.0);
        let noise = params.luminance_sigma * sqrt(blurred_variance(i32(id.x), i32(id.y))) + 1e-6;
        let own_light = luminance(source[i].rgb);
        var sum = vec4(0.0);
        var total = 0.0;
        for (var k = 0; k < 25; k++) {
            let offset = (vec2(k % 5, k / 5) - 2) * params.step;
            let x = i32(id.x) + offset.x;
            let y = i32(id.y) + offset.y;
            if !is_inside(x, y) {
                continue;
            }
            let j = pixel_index(x, y);
            var weight = spline[k % 5] * spline[k / 5];
            if j != i {
                let bright = abs(luminance(source[j].rgb) - own_light) / noise;
                weight *= exp(-difference(own, guides[j], slopes[i], vec2<f32>(offset)) - bright);
            }
            sum += source[j] * vec4(vec3(weight), weight * weight);
            total += weight;
        }
        out = sum / vec4(vec3(total), total * total);
    }
    result[i] = out;
}
