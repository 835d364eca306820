// Twin of src/method/light_field_probes/shade.rs: glossy.
// Adds samples of a run of pixels, the first of all pixels and then the next, to the glossy layer: direct light, which comes first, and what
// rays have met.

// #include "light_field_probes/params.wgsl"

@group(0) @binding(1) var<storage, read> values: array<vec4<f32>>;
@group(0) @binding(2) var<storage, read_write> glossy: array<vec4<f32>>;

@compute @workgroup_size(64)
fn add_glossy(@builtin(global_invocation_id) id: vec3<u32>) {
    params = field_params;
    if id.x >= params.pixels {
        return;
    }
    var sum = vec3(0.0);
    for (var k = 0u; k < params.samples; k++) {
        sum += values[k * params.pixels + id.x].rgb;
    }
    let mean = vec4(sum / f32(max(params.all_samples, 1u)), 0.0);
    let pixel = params.first_pixel + id.x;
    if params.what == RAYS {
        glossy[pixel] += mean;
    } else {
        glossy[pixel] = mean;
    }
}
