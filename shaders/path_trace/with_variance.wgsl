// Twin of src/view/denoise.rs: with_variance.

// #include "path_trace/denoise.wgsl"

// Change of depth from a pixel to the next, along each axis.
@group(0) @binding(4) var<storage, read> slopes: array<vec2<f32>>;

@compute @workgroup_size(16, 4)
fn with_variance(@builtin(global_invocation_id) id: vec3<u32>) {
    params = denoise_params;
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

