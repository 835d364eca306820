// Twin of src/method/light_field_probes/shade.rs: diffuse.
// The diffuse layer of a run of pixels: direct light, and the light of the probes around.

// #include "light_field_probes/places.wgsl"
// #include "light_field_probes/octahedral.wgsl"
// #include "shared/view.wgsl"

const LEAST_FACING: f32 = 0.05;
const LEAST_SEEN: f32 = 1e-6;
// Words of a texel: irradiance, and two moments of distance.
const AMBIENT_WORDS: u32 = 5u;

@group(0) @binding(2) var<storage, read> ambient: array<f32>;
@group(0) @binding(3) var<storage, read> view: array<Pixel>;
// Sums over direct light.
@group(0) @binding(4) var<storage, read> sums: array<vec4<f32>>;
@group(0) @binding(5) var<storage, read_write> shading: array<Shading>;

// Adds a probe's light at a point to a sum, with its weight as w. Twin: ambient::irradiance.
fn add_probe(sum: vec4<f32>, probe: u32, near: f32, p: vec3<f32>, normal: vec3<f32>) -> vec4<f32> {
    if near <= 0.0 {
        return sum;
    }
    let n = params.field.ambient_size;
    let first = probe_slot(probe) * n * n;
    let to_point = p - probe_position(probe);
    let far = length(to_point);
    let d = to_point / max(far, MIN_POSITIVE);
    let towards = taps_about(d, n);
    let facing = taps_about(normal, n);
    var mean = 0.0;
    var square = 0.0;
    var light = vec3(0.0);
    for (var k = 0u; k < 4u; k++) {
        let distances = AMBIENT_WORDS * (first + towards.texels[k]) + 3u;
        mean += ambient[distances] * towards.weights[k];
        square += ambient[distances + 1u] * towards.weights[k];
        let color = AMBIENT_WORDS * (first + facing.texels[k]);
        light += vec3(ambient[color], ambient[color + 1u], ambient[color + 2u]) * facing.weights[k];
    }
    var seen = 1.0;
    if far > mean {
        let variance = max(square - mean * mean, 1e-4 * mean * mean);
        seen = variance / (variance + (far - mean) * (far - mean));
    }
    let weight = near * max(-dot(d, normal), LEAST_FACING) * max(seen * seen * seen, LEAST_SEEN);
    return sum + vec4(light, 1.0) * weight;
}

fn irradiance_at(p: vec3<f32>, normal: vec3<f32>) -> vec3<f32> {
    var sum = vec4(0.0);
    let near = around(p);
    for (var k = 0u; k < 8u; k++) {
        sum = add_probe(sum, near.probes[k], near.weights[k], p, normal);
    }
    let leaf = octree_at(p);
    for (var k = 0u; k < 4u; k++) {
        if leaf[k] != NO_PROBE {
            sum = add_probe(sum, leaf[k], LEAST_NEAR, p, normal);
        }
    }
    return select(vec3(0.0), sum.rgb / sum.w, sum.w > 0.0);
}

@compute @workgroup_size(64)
fn lit_diffuse(@builtin(global_invocation_id) id: vec3<u32>) {
    params = field_params;
    if id.x >= params.pixels {
        return;
    }
    let pixel = params.first_pixel + id.x;
    let albedo = shading[pixel].diffuse;
    if any(albedo != vec3(0.0)) {
        let direct = sums[id.x].rgb / f32(max(params.all_samples, 1u));
        shading[pixel].diffuse = direct + albedo * irradiance_at(view[pixel].p, view[pixel].n) * FRAC_1_PI;
    }
}
