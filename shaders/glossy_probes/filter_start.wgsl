// Twin of src/method/glossy_probes/filter/planes.rs: four_pass.

// #include "glossy_probes/filter.wgsl"

@group(0) @binding(2) var<storage, read> covariances: array<vec4<f32>>;
// Colour and energy.
@group(0) @binding(3) var<storage, read> gathered: array<vec4<f32>>;
// Direction of the major axis, standard deviations of one pass along both.
@group(0) @binding(4) var<storage, read_write> axes: array<vec4<f32>>;
// Colour times weight, and the weight.
@group(0) @binding(5) var<storage, read_write> values: array<vec4<f32>>;

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
    params = filter_params;
    if id.x >= params.width || id.y >= params.height {
        return;
    }
    let i = id.y * params.width + id.x;
    let e = eigen(covariances[i].xyz);
    axes[i] = vec4(e.axis, standard_deviation(e.major), standard_deviation(e.minor));
    let w = confidence(gathered[i], view[i].material);
    values[i] = select(vec4(0.0), vec4(gathered[i].rgb * w, w), w > 0.0);
}

