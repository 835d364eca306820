// Twin of src/transport/path.rs: scattered.
// Samples of the paths that begin at a list of points, added to their sums; also the twin of `transmitted_irradiance`.

// #include "shared/path.wgsl"
// #include "shared/start.wgsl"

struct Params {
    max_depth: u32,
    rr_depth: u32,
    lobes: u32,
    roughness_scale: f32,
    split: u32,
    starts: u32,
    // Of each start's samples, the first in this dispatch, and the most.
    skipped: u32,
    samples: u32,
    // Branch of each stream, or NONE, and the first set of dimensions.
    branch: u32,
    first_set: u32,
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> starts: array<PathStart>;
// Radiance, and the square of its luminance.
@group(0) @binding(2) var<storage, read_write> sums: array<vec4<f32>>;

@compute @workgroup_size(64)
fn follow(@builtin(global_invocation_id) id: vec3<u32>) {
    scene = scene_params;
    let i = id.x;
    if i >= params.starts {
        return;
    }
    let from_here = starts[i];
    if from_here.triangle == NO_TRIANGLE {
        return;
    }
    let hit = Hit(0.0, from_here.triangle, from_here.u, from_here.v);
    let start = Start(hit, from_here.wo, Query(params.lobes, params.roughness_scale), from_here.wo.x, params.split != 0u);
    var sum = vec4(0.0);
    let first = from_here.first + params.skipped;
    for (var k = first; k < min(first + params.samples, from_here.end); k++) {
        var s = sampler_new(from_here.stream, k);
        if params.branch != NONE {
            s = branch(s, params.branch);
        }
        s.next = params.first_set;
        let light = integrate(start, PathParams(params.max_depth, params.rr_depth), &s);
        let y = luminance(light);
        sum += vec4(light, y * y);
    }
    sums[i] += sum;
}
