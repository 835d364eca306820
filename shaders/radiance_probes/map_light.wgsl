// Twin of src/method/radiance_probes/frame_map.rs: lit.
// Puts one of the numbers that receivers keep into their texels.

struct Params {
    // Where the light maps begin, first all of the front and then all of the back, and how many texels one of them has.
    map: u32,
    texels: u32,
    // Which of the receivers' numbers; each has a light map.
    number: u32,
    numbers: u32,
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
    let side = places[id.x] / params.texels;
    let texel = places[id.x] % params.texels;
    let at = params.map + 3u * ((side * params.numbers + params.number) * params.texels + texel);
    var value = indirect[id.x * params.numbers + params.number];
    if params.numbers == 1u {
        value = max(value, vec4(0.0));
    }
    light[at] = value.x;
    light[at + 1u] = value.y;
    light[at + 2u] = value.z;
}
