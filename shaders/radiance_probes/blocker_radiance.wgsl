// Twin of src/method/radiance_probes/light.rs: radiance.
// What each blocker sends to its probe, behind what the receivers send on.

// #include "radiance_probes/blocker.wgsl"
// #include "radiance_probes/volume_light.wgsl"

struct Params {
    receivers: u32,
    blockers: u32,
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> list: array<Blocker>;
@group(0) @binding(2) var<storage, read> volume_light: array<vec4<f32>>;
@group(0) @binding(3) var<storage, read_write> radiance: array<vec4<f32>>;

@compute @workgroup_size(64)
fn blocker_radiance(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x < params.blockers {
        let light = list[id.x].direct + irradiance_of(list[id.x].taps);
        radiance[params.receivers + id.x] = vec4(list[id.x].sent * light, 0.0);
    }
}
