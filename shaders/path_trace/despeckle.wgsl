// Twin of src/view/denoise.rs: despeckled.

// #include "path_trace/denoise.wgsl"

@compute @workgroup_size(16, 4)
fn despeckle(@builtin(global_invocation_id) id: vec3<u32>) {
    params = denoise_params;
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

