// The glossy filter (§6.3). Twin: render::filter::four_pass. Follows math.wgsl and view.wgsl.
//
// `filter_start` weighs the colours by their confidence and finds each pixel's axes, `filter_pass` makes of each value the mean over
// its line, `filter_end` divides the weights out and adds one Gaussian's share.

// Struct: gpu::render::filter::Params.
struct Params {
    width: u32,
    height: u32,
    // The line is the major axis, or else the minor one.
    along_major: u32,
    // Of the standard deviations.
    scale: f32,
    depth_threshold: f32,
    min_normal_cos: f32,
    radius_sigmas: f32,
    max_radius: f32,
    steps: f32,
    min_sigma: f32,
    // Lower clamp of the energy; FAR for no confidence.
    min_energy: f32,
    // A pass's share of the variance.
    split: f32,
    // Of the kernel's volume.
    share: f32,
    // Whether the share is the first.
    is_first: u32,
}

@group(0) @binding(0) var<storage, read> params: Params;
// Direction of the major axis, standard deviations of one pass along both.
@group(0) @binding(1) var<storage, read> axes: array<vec4<f32>>;
// Normal and depth.
@group(0) @binding(2) var<storage, read> guides: array<vec4<f32>>;
@group(0) @binding(3) var<storage, read> materials: array<u32>;
// Colour times weight, and the weight.
@group(0) @binding(4) var<storage, read> source: array<vec4<f32>>;
@group(0) @binding(5) var<storage, read_write> target_values: array<vec4<f32>>;

// What `filter_start` reads and writes.
@group(0) @binding(1) var<storage, read> start_materials: array<u32>;
@group(0) @binding(2) var<storage, read> covariances: array<vec4<f32>>;
// Colour and energy.
@group(0) @binding(3) var<storage, read> gathered: array<vec4<f32>>;
@group(0) @binding(4) var<storage, read_write> start_axes: array<vec4<f32>>;
@group(0) @binding(5) var<storage, read_write> start_values: array<vec4<f32>>;

// What `filter_end` reads and writes.
@group(0) @binding(2) var<storage, read> end_materials: array<u32>;
@group(0) @binding(3) var<storage, read> end_gathered: array<vec4<f32>>;
@group(0) @binding(4) var<storage, read> end_values: array<vec4<f32>>;
@group(0) @binding(5) var<storage, read_write> glossy: array<vec4<f32>>;

fn confidence(color_energy: vec4<f32>, material: u32) -> f32 {
    if material == NOT_GLOSSY || !all_finite(color_energy.rgb) {
        return 0.0;
    }
    if params.min_energy >= FAR {
        return 1.0;
    }
    return 1.0 / min(max(color_energy.w, max(params.min_energy, 1e-6)), 1e6);
}

fn standard_deviation(variance: f32) -> f32 {
    return select(0.0, sqrt(max(variance, 0.0) * params.split), is_finite(variance));
}

@compute @workgroup_size(16, 4)
fn filter_start(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= params.width || id.y >= params.height {
        return;
    }
    let i = id.y * params.width + id.x;
    let e = eigen(covariances[i].xyz);
    start_axes[i] = vec4(e.axis, standard_deviation(e.major), standard_deviation(e.minor));
    let w = confidence(gathered[i], start_materials[i]);
    start_values[i] = select(vec4(0.0), vec4(gathered[i].rgb * w, w), w > 0.0);
}

fn line_mean(x: i32, y: i32, i: i32) -> vec4<f32> {
    let own = source[i];
    let axis = axes[i];
    let is_major = params.along_major != 0u;
    let direction = select(vec2(-axis.y, axis.x), axis.xy, is_major);
    let sigma = min(select(axis.w, axis.z, is_major) * params.scale, params.max_radius / params.radius_sigmas);
    let material = materials[i];
    if material == NOT_GLOSSY || sigma < params.min_sigma {
        return own;
    }
    let guide = guides[i];
    let w = i32(params.width);
    let h = i32(params.height);
    // Place, extent and stride in the buffer: along the axis nearest the line, and along the other one.
    let upright = abs(direction.y) > abs(direction.x);
    let along = select(vec3(x, w, 1), vec3(y, h, w), upright);
    let across = select(vec3(y, h, w), vec3(x, w, 1), upright);
    let slope = select(direction.y / direction.x, direction.x / direction.y, upright);
    let stride = max(i32(sigma / params.steps), 1);
    let step = f32(stride) * sqrt(1.0 + slope * slope);
    let reach = i32(params.radius_sigmas * sigma / step);
    let relative = step / sigma;
    let ratio = exp(-relative * relative);
    let first = exp(-0.5 * relative * relative);
    var sum = own;
    var total = 1.0;
    for (var side = -1; side <= 1; side += 2) {
        let room = select(along.y - 1 - along.x, along.x, side < 0);
        var g = 1.0;
        var factor = first;
        for (var k = 1; k <= min(reach, room / stride); k++) {
            g *= factor;
            factor *= ratio;
            let ahead = side * k * stride;
            let aside = f32(ahead) * slope;
            let low = floor(aside);
            let fraction = aside - low;
            let on_axis = i + ahead * along.z;
            for (var tap = 0; tap < 2; tap++) {
                let offset = i32(low) + tap;
                let place = across.x + offset;
                if place < 0 || place >= across.y {
                    continue;
                }
                let j = on_axis + offset * across.z;
                let other = guides[j];
                let near = abs(guide.w - other.w) < params.depth_threshold;
                if near && dot(guide.xyz, other.xyz) > params.min_normal_cos && materials[j] == material {
                    let weight = g * select(1.0 - fraction, fraction, tap == 1);
                    sum += source[j] * weight;
                    total += weight;
                }
            }
        }
    }
    return sum / total;
}

@compute @workgroup_size(16, 4)
fn filter_pass(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x < params.width && id.y < params.height {
        let i = id.y * params.width + id.x;
        target_values[i] = line_mean(i32(id.x), i32(id.y), i32(i));
    }
}

@compute @workgroup_size(16, 4)
fn filter_end(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= params.width || id.y >= params.height {
        return;
    }
    let i = id.y * params.width + id.x;
    let own = end_gathered[i].rgb;
    // Bit for bit what came in, where nothing was to be filtered.
    if end_materials[i] == NOT_GLOSSY || axes[i].z < params.min_sigma * 0.5 {
        glossy[i] = vec4(own, 0.0);
        return;
    }
    let value = end_values[i];
    var mean = own;
    if value.w > 0.0 {
        mean = value.rgb / value.w;
    }
    let before = select(glossy[i].rgb, vec3(0.0), params.is_first != 0u);
    glossy[i] = vec4(before + mean * params.share, 0.0);
}
