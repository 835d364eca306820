// The last passes: filling what no probe served, adding the light map, averaging sub-pixels. Twin: render::composite.
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
    // Of the light map, texels; 0 without one.
    lightmap: vec2<u32>,
    has_back: u32,
    padding: u32,
}

const DEPTH_TOLERANCE: f32 = 0.02;
const NO_TRIANGLE: u32 = 0xffffffffu;

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
@group(0) @binding(1) var<storage, read> glossy: array<vec4<f32>>;
@group(0) @binding(2) var<storage, read> emission: array<vec4<f32>>;
// The view's factor of the diffuse lobe; w is 1 where the camera sees the shading normal's back.
@group(0) @binding(3) var<storage, read> diffuse: array<vec4<f32>>;
// Distance, triangle and barycentrics, all but the triangle as bits.
@group(0) @binding(4) var<storage, read> hits: array<vec4<u32>>;
// Three halves a texel: E on the side of the shading normal, then, where has_back, behind.
@group(0) @binding(5) var<storage, read> irradiance: array<vec2<u32>>;
// Each triangle's corners in texels.
@group(0) @binding(6) var<storage, read> corners: array<vec2<f32>>;
@group(0) @binding(7) var<storage, read_write> out_emission: array<vec4<f32>>;
@group(0) @binding(8) var<storage, read_write> out_diffuse: array<vec4<f32>>;
@group(0) @binding(9) var<storage, read_write> out_glossy: array<vec4<f32>>;

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

fn texel(at: vec2<u32>, back: bool) -> vec3<f32> {
    let offset = select(0u, params.lightmap.x * params.lightmap.y, back);
    let halves = irradiance[offset + at.y * params.lightmap.x + at.x];
    return vec3(unpack2x16float(halves.x), unpack2x16float(halves.y).x);
}

// Twin: lightmap::LightMap::lookup.
fn lookup(triangle: u32, barycentric: vec2<f32>, back: bool) -> vec3<f32> {
    if params.lightmap.x == 0u || (back && params.has_back == 0u) {
        return vec3(0.0);
    }
    let a = corners[3u * triangle];
    if !is_finite(a.x) {
        return vec3(0.0);
    }
    let p = a + (corners[3u * triangle + 1u] - a) * barycentric.x + (corners[3u * triangle + 2u] - a) * barycentric.y;
    let last = params.lightmap - 1u;
    let q = clamp(p - 0.5, vec2(0.0), vec2<f32>(last));
    let low = vec2<u32>(q);
    let high = min(low + 1u, last);
    let f = q - vec2<f32>(low);
    return texel(low, back) * ((1.0 - f.x) * (1.0 - f.y)) + texel(vec2(high.x, low.y), back) * (f.x * (1.0 - f.y))
        + texel(vec2(low.x, high.y), back) * ((1.0 - f.x) * f.y) + texel(high, back) * (f.x * f.y);
}

// Twins: diffuse_layer and downsample.
@compute @workgroup_size(16, 4)
fn layers(@builtin(global_invocation_id) id: vec3<u32>) {
    let n = params.supersample;
    if id.x >= params.width / n || id.y >= params.height / n {
        return;
    }
    var sums = array<vec3<f32>, 3>();
    for (var k = 0u; k < n * n; k++) {
        let i = (id.y * n + k / n) * params.width + id.x * n + k % n;
        sums[0] += emission[i].rgb;
        sums[2] += glossy[i].rgb;
        let hit = hits[i];
        if hit.y != NO_TRIANGLE && any(diffuse[i].rgb != vec3(0.0)) {
            let e = lookup(hit.y, bitcast<vec2<f32>>(hit.zw), diffuse[i].w > 0.0);
            sums[1] += diffuse[i].rgb * e * FRAC_1_PI;
        }
    }
    let scale = 1.0 / f32(n * n);
    let out = id.y * (params.width / n) + id.x;
    out_emission[out] = vec4(sums[0] * scale, 0.0);
    out_diffuse[out] = vec4(sums[1] * scale, 0.0);
    out_glossy[out] = vec4(sums[2] * scale, 0.0);
}
