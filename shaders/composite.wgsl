// The last passes: filling what no probe served, averaging sub-pixels. Twin: render::composite.
// Follows math.wgsl, camera.wgsl and view.wgsl.

// Struct: gpu::render::composite::Params.
struct Params {
    // The last frame's.
    previous: Camera,
    width: u32,
    height: u32,
    has_previous: u32,
    // Sub-pixels of a pixel each way.
    supersample: u32,
    // Whether `glossy` lacks what perfect mirrors show.
    mirrors: u32,
    padding0: u32,
    padding1: u32,
    padding2: u32,
}

const DEPTH_TOLERANCE: f32 = 0.02;

@group(0) @binding(0) var<storage, read> params: Params;

// What `fill` reads and writes.
@group(0) @binding(1) var<storage, read> positions: array<vec4<f32>>;
@group(0) @binding(2) var<storage, read> materials: array<u32>;
// The gather's: colour times weight and the weight; the best sample's energy.
@group(0) @binding(3) var<storage, read> sums: array<vec4<f32>>;
@group(0) @binding(4) var<storage, read> best: array<vec4<u32>>;
@group(0) @binding(5) var<storage, read> previous_normals: array<vec4<f32>>;
@group(0) @binding(6) var<storage, read> previous_materials: array<u32>;
@group(0) @binding(7) var<storage, read> previous_glossy: array<vec4<f32>>;
// Colour and energy; FAR where there is no sample.
@group(0) @binding(8) var<storage, read_write> gathered: array<vec4<f32>>;
// Pixels without one.
@group(0) @binding(9) var<storage, read_write> unserved: atomic<u32>;

// What `layers` reads and writes.
@group(0) @binding(1) var<storage, read> emission: array<vec4<f32>>;
@group(0) @binding(2) var<storage, read> diffuse: array<vec4<f32>>;
@group(0) @binding(3) var<storage, read> glossy: array<vec4<f32>>;
// What perfect mirrors show (mirror_light.wgsl), and the reflectors' albedos.
@group(0) @binding(4) var<storage, read> mirrored: array<vec4<f32>>;
@group(0) @binding(5) var<storage, read> albedos: array<vec4<f32>>;
@group(0) @binding(6) var<storage, read_write> out_emission: array<vec4<f32>>;
@group(0) @binding(7) var<storage, read_write> out_diffuse: array<vec4<f32>>;
@group(0) @binding(8) var<storage, read_write> out_glossy: array<vec4<f32>>;

// The last frame's glossy colour at p where it saw the same surface; w is 0 where it did not.
fn lookup_previous(p: vec3<f32>, material: u32) -> vec4<f32> {
    let at = project(params.previous, p);
    let size = vec2(params.width, params.height);
    if at.z < 0.0 || !(at.x >= 0.0 && at.y >= 0.0 && at.x < f32(size.x) && at.y < f32(size.y)) {
        return vec4(0.0);
    }
    let i = u32(at.y) * size.x + u32(at.x);
    let depth = distance(params.previous.position, p);
    let same = previous_materials[i] == material && abs(previous_normals[i].w - depth) < DEPTH_TOLERANCE * depth;
    return select(vec4(0.0), vec4(previous_glossy[i].rgb, 1.0), same);
}

// Twin: reproject_previous.
@compute @workgroup_size(16, 4)
fn fill(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= params.width || id.y >= params.height {
        return;
    }
    let i = id.y * params.width + id.x;
    var out = vec4(0.0, 0.0, 0.0, FAR);
    if materials[i] != NOT_GLOSSY {
        if sums[i].w > 0.0 {
            out = vec4(sums[i].rgb / sums[i].w, bitcast<f32>(best[i].x));
        } else {
            var before = vec4(0.0);
            if params.has_previous != 0u {
                before = lookup_previous(positions[i].xyz, materials[i]);
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

// Twins: mirror_light::add_mirrored and downsample.
@compute @workgroup_size(16, 4)
fn layers(@builtin(global_invocation_id) id: vec3<u32>) {
    let n = params.supersample;
    if id.x >= params.width / n || id.y >= params.height / n {
        return;
    }
    var sum_emission = vec4(0.0);
    var sum_diffuse = vec4(0.0);
    var sum_glossy = vec4(0.0);
    for (var k = 0u; k < n * n; k++) {
        let i = (id.y * n + k / n) * params.width + id.x * n + k % n;
        sum_emission += emission[i];
        sum_diffuse += diffuse[i];
        var shown = glossy[i];
        if params.mirrors != 0u {
            shown = max(shown + mirrored[i] * albedos[i], vec4(0.0));
        }
        sum_glossy += shown;
    }
    let scale = 1.0 / f32(n * n);
    let out = id.y * (params.width / n) + id.x;
    out_emission[out] = sum_emission * scale;
    out_diffuse[out] = sum_diffuse * scale;
    out_glossy[out] = sum_glossy * scale;
}
