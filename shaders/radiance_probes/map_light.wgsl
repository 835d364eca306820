// Twin of src/method/radiance_probes/frame_map.rs: lit.
// Puts the light of receivers into their texels.

struct Params {
    // Where the light map begins.
    map: u32,
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> places: array<u32>;
@group(0) @binding(2) var<storage, read> indirect: array<vec4<f32>>;
// Three a texel.
@group(0) @binding(3) var<storage, read_write> light: array<f32>;

@compute @workgroup_size(64)
fn map_light(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= arrayLength(&places) {
        return;
    }
    let at = params.map + 3u * places[id.x];
    let value = max(indirect[id.x], vec4(0.0));
    light[at] = value.x;
    light[at + 1u] = value.y;
    light[at + 2u] = value.z;
}
