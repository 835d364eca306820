// Twin of src/view/denoise.rs: smoothed.

// #include "path_trace/denoise.wgsl"

// Change of depth from a pixel to the next, along each axis.
@group(0) @binding(4) var<storage, read> slopes: array<vec2<f32>>;

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

@compute @workgroup_size(16, 4)
fn smooth_level(@builtin(global_invocation_id) id: vec3<u32>) {
    params = denoise_params;
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
