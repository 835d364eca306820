// Twin of src/method/glossy_probes/filter/planes.rs: four_pass.

// #include "glossy_probes/filter.wgsl"

@group(0) @binding(2) var<storage, read> axes: array<vec4<f32>>;
// Colour and energy.
@group(0) @binding(3) var<storage, read> gathered: array<vec4<f32>>;
// Colour times weight, and the weight.
@group(0) @binding(4) var<storage, read> values: array<vec4<f32>>;
@group(0) @binding(5) var<storage, read_write> glossy: array<vec4<f32>>;

@compute @workgroup_size(16, 4)
fn filter_end(@builtin(global_invocation_id) id: vec3<u32>) {
    params = filter_params;
    if id.x >= params.width || id.y >= params.height {
        return;
    }
    let i = id.y * params.width + id.x;
    let own = gathered[i].rgb;
    // Bit for bit what came in, where nothing was to be filtered.
    if view[i].material == NOT_GLOSSY || axes[i].z < params.min_sigma * 0.5 {
        glossy[i] = vec4(own, 0.0);
        return;
    }
    let value = values[i];
    var mean = own;
    if value.w > 0.0 {
        mean = value.rgb / value.w;
    }
    let before = select(glossy[i].rgb, vec3(0.0), params.is_first != 0u);
    glossy[i] = vec4(before + mean * params.share, 0.0);
}
