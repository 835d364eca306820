// Twin of src/method/glossy_probes/previous.rs: reproject_previous.
// Divides the gathered sums by their weights, and fills what no probe served from the frame before.

// #include "shared/camera.wgsl"
// #include "shared/view.wgsl"
// #include "glossy_probes/gathered.wgsl"

struct Params {
    // The last frame's.
    previous: Camera,
    width: u32,
    height: u32,
    has_previous: u32,
    padding0: u32,
}

const DEPTH_TOLERANCE: f32 = 0.02;

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> view: array<Pixel>;
@group(0) @binding(2) var<storage, read> sums: array<Gathered>;
@group(0) @binding(3) var<storage, read> previous_view: array<Pixel>;
@group(0) @binding(4) var<storage, read> previous_glossy: array<vec4<f32>>;
// Colour and energy; FAR where there is no sample.
@group(0) @binding(5) var<storage, read_write> gathered: array<vec4<f32>>;
// Pixels without one.
@group(0) @binding(6) var<storage, read_write> unserved: atomic<u32>;

// The last frame's glossy colour at p where it saw the same surface; w is 0 where it did not.
fn lookup_previous(p: vec3<f32>, material: u32) -> vec4<f32> {
    let at = project(params.previous, p);
    let size = vec2(params.width, params.height);
    if at.z < 0.0 || !(at.x >= 0.0 && at.y >= 0.0 && at.x < f32(size.x) && at.y < f32(size.y)) {
        return vec4(0.0);
    }
    let i = u32(at.y) * size.x + u32(at.x);
    let depth = distance(params.previous.position, p);
    let same = previous_view[i].material == material && abs(previous_view[i].depth - depth) < DEPTH_TOLERANCE * depth;
    return select(vec4(0.0), vec4(previous_glossy[i].rgb, 1.0), same);
}

@compute @workgroup_size(16, 4)
fn fill(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= params.width || id.y >= params.height {
        return;
    }
    let i = id.y * params.width + id.x;
    var out = vec4(0.0, 0.0, 0.0, FAR);
    if view[i].material != NOT_GLOSSY {
        if sums[i].sum.w > 0.0 {
            out = vec4(sums[i].sum.rgb / sums[i].sum.w, bitcast<f32>(sums[i].best.x));
        } else {
            var before = vec4(0.0);
            if params.has_previous != 0u {
                before = lookup_previous(view[i].p, view[i].material);
            }
            if before.w > 0.0 {
                // It matches as well as anything at hand.
                out = before;
            } else {
                atomicAdd(&unserved, 1u);
            }
        }
    }
    gathered[i] = out;
}

