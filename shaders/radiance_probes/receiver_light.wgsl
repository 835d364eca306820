// Twin of src/method/radiance_probes/light.rs: direct.
// Light straight from emitters at a run of receivers.

// #include "shared/path.wgsl"

struct Params {
    first: u32,
    receivers: u32,
    samples: u32,
    seed: u32,
}

// Points of a receiver.
const POINTS: u32 = 4u;
// Its words: the pixel and, in the highest bit, the side; then of each point the triangle and two barycentric weights.
const RECEIVER_WORDS: u32 = 13u;
const BACK_BIT: u32 = 0x80000000u;

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> receivers: array<u32>;
@group(0) @binding(2) var<storage, read_write> direct: array<vec4<f32>>;

@compute @workgroup_size(64)
fn receiver_light(@builtin(global_invocation_id) id: vec3<u32>) {
    scene = scene_params;
    if id.x >= params.receivers {
        return;
    }
    let first = RECEIVER_WORDS * (params.first + id.x);
    let back = receivers[first] / BACK_BIT;
    let stream = hash3(params.seed, receivers[first] % BACK_BIT, back);
    let side = 1.0 - 2.0 * f32(back);
    var sum = vec3(0.0);
    for (var k = 0u; k < params.samples; k++) {
        let at = first + 1u + 3u * (k % POINTS);
        let hit = Hit(0.0, receivers[at], bitcast<f32>(receivers[at + 1u]), bitcast<f32>(receivers[at + 2u]));
        var s = sampler_new(stream, k);
        let start = Start(hit, vec3(side, 0.0, 0.0), Query(ALL_LOBES, 1.0), side, true);
        sum += integrate(start, PathParams(1u, NONE), &s);
    }
    direct[params.first + id.x] = vec4(sum / f32(params.samples), 0.0);
}
