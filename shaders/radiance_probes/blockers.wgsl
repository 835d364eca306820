// Twin of src/method/radiance_probes/light.rs: all.
// What surfaces that a frame adds in the way of relight rays send back along them.

// #include "shared/path.wgsl"
// #include "radiance_probes/volume.wgsl"
// #include "radiance_probes/blocker.wgsl"

struct Params {
    // A run of them.
    first: u32,
    blockers: u32,
    seed: u32,
}

// Where a ray ends.
struct Blocked {
    triangle: u32,
    u: f32,
    v: f32,
    padding0: u32,
    // Towards the probe.
    wo: vec3<f32>,
    padding1: u32,
}

// Of the random stream.
const BLOCKER: u32 = 2u;

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(3) var<storage, read> blocked: array<Blocked>;
@group(0) @binding(4) var<storage, read_write> list: array<Blocker>;

@compute @workgroup_size(64)
fn blockers(@builtin(global_invocation_id) id: vec3<u32>) {
    scene = scene_params;
    if id.x >= params.blockers {
        return;
    }
    let i = params.first + id.x;
    let end = blocked[i];
    let hit = hit_of(end.triangle, end.u, end.v);
    let surface = surface_at(hit);
    let wi = to_local(surface.frame, end.wo);
    let side = select(1.0, -1.0, wi.z < 0.0);
    var s = sampler_new(hash3(params.seed, i, BLOCKER), 0u);
    let start = Start(hit, vec3(side, 0.0, 0.0), Query(ALL_LOBES, 1.0), side, true);
    list[i].sent = bsdf_diffuse_out(surface, wi) * FRAC_1_PI;
    list[i].direct = integrate(start, PathParams(1u, NONE), &s);
    list[i].taps = taps_of(surface, end.wo);
}
