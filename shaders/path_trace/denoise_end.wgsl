// Twin of src/view/denoise.rs: filter_layer.

// #include "path_trace/denoise.wgsl"

@compute @workgroup_size(16, 4)
fn denoise_end(@builtin(global_invocation_id) id: vec3<u32>) {
    params = denoise_params;
    if id.x >= params.width || id.y >= params.height {
        return;
    }
    let i = id.y * params.width + id.x;
    result[i] = vec4(source[i].rgb * divisor(guides[i]), 0.0);
}

