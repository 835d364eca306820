// Twin of src/method/glossy_probes/filter/four_pass.rs: line_mean.

// #include "glossy_probes/filter.wgsl"

// Direction of the major axis, standard deviations of one pass along both.
@group(0) @binding(2) var<storage, read> axes: array<vec4<f32>>;
// Colour times weight, and the weight.
@group(0) @binding(3) var<storage, read> source: array<vec4<f32>>;
@group(0) @binding(4) var<storage, read_write> target_values: array<vec4<f32>>;

fn line_mean(x: i32, y: i32, i: i32) -> vec4<f32> {
    let own = source[i];
    let axis = axes[i];
    let is_major = params.along_major != 0u;
    let direction = select(vec2(-axis.y, axis.x), axis.xy, is_major);
    let sigma = min(select(axis.w, axis.z, is_major) * params.scale, params.max_radius / params.radius_sigmas);
    let material = view[i].material;
    if material == NOT_GLOSSY || sigma < params.min_sigma {
        return own;
    }
    let normal = view[i].n;
    let depth = view[i].depth;
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
                let near = abs(depth - view[j].depth) < params.depth_threshold;
                if near && dot(normal, view[j].n) > params.min_normal_cos && view[j].material == material {
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
    params = filter_params;
    if id.x < params.width && id.y < params.height {
        let i = id.y * params.width + id.x;
        target_values[i] = line_mean(i32(id.x), i32(id.y), i32(i));
    }
}

