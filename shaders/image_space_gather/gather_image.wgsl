// Twin of src/method/image_space_gather/mod.rs: gather_image.
// A picture of perfect mirror reflections (mirror_light.wgsl), blurred until it looks glossy (Robison and Shirley 2009).

// #include "shared/random.wgsl"
// #include "shared/camera.wgsl"
// #include "shared/view.wgsl"

struct ImageSpaceGatherParams {
    camera: Camera,
    // Of this dispatch.
    first_row: u32,
    // Taps of the search, and of the gather; the former come first in the pattern.
    search_samples: u32,
    samples: u32,
    // Largest standard deviation, pixels.
    max_sigma: f32,
    min_normal_cos: f32,
    plane_sigma: f32,
    padding0: u32,
    padding1: u32,
}

// Twins: image_space_gather::{LOBE_SIGMA, REACH}.
const LOBE_SIGMA: f32 = 0.61;
const REACH: f32 = 2.5;

// The kernel begins with a copy: see scene.wgsl.
@group(0) @binding(0) var<uniform> gathering_params: ImageSpaceGatherParams;
var<private> gathering: ImageSpaceGatherParams;
@group(0) @binding(1) var<storage, read> view: array<Pixel>;
@group(0) @binding(2) var<storage, read> shading: array<Shading>;
// Radiance along the mirror direction, and distance to the first hit; FAR for the environment.
@group(0) @binding(3) var<storage, read> mirrored_light: array<vec4<f32>>;
// Spirals of taps for a standard deviation of 1.
@group(0) @binding(4) var<storage, read> pattern: array<vec2<f32>>;
@group(0) @binding(5) var<storage, read_write> glossy: array<vec4<f32>>;

// Standard deviation of a lobe's footprint in the image, pixels.
fn footprint_sigma(alpha: f32, d_c: f32, d_r: f32) -> f32 {
    let share = select(d_r / (d_c + d_r), 1.0, d_r >= FAR);
    return min(2.0 * LOBE_SIGMA * alpha * share * gathering.camera.focal_px, gathering.max_sigma);
}

// Whether, and how well, pixel `j` lies on the surface of pixel `i`.
fn range_weight(i: u32, j: u32) -> f32 {
    let n = view[i].n;
    if view[j].material != view[i].material || dot(view[j].n, n) < gathering.min_normal_cos {
        return 0.0;
    }
    let from_plane = dot(view[j].p - view[i].p, n);
    let off = from_plane / max(gathering.plane_sigma * view[i].depth, MIN_POSITIVE);
    return exp(-0.5 * off * off);
}

@compute @workgroup_size(16, 4)
fn gather_image(@builtin(global_invocation_id) id: vec3<u32>) {
    gathering = gathering_params;
    let size = vec2(i32(gathering.camera.width), i32(gathering.camera.height));
    let at = vec2(i32(id.x), i32(id.y + gathering.first_row));
    if any(at >= size) {
        return;
    }
    let i = u32(at.y * size.x + at.x);
    if view[i].material == NOT_GLOSSY {
        glossy[i] = vec4(0.0);
        return;
    }
    let alpha = view[i].alpha;
    let depth = view[i].depth;
    let own = mirrored_light[i];
    var light = own.rgb;
    if alpha > 0.0 {
        // First the search, whose mean is the gather's standard deviation, then the gather.
        var sigma = footprint_sigma(alpha, depth, FAR);
        var sum = vec4(footprint_sigma(alpha, depth, own.w), 0.0, 0.0, 1.0);
        for (var turn = 0u; turn < 2u; turn++) {
            let is_search = turn == 0u;
            let taps = select(gathering.samples, gathering.search_samples, is_search);
            let first = select(gathering.search_samples, 0u, is_search);
            let r = i32(REACH * sigma);
            let edge = 2 * r + 1;
            // A footprint of fewer pixels than taps is summed up whole.
            let is_whole = u32(edge * edge) <= taps;
            let q = -0.5 / max(sigma * sigma, 1e-6);
            let angle = unit(hash_end(hash_next(hash_next(hash_start(), i), taps))) * TAU;
            let along = vec2(cos(angle), sin(angle));
            for (var k = 0u; k < select(taps, u32(edge * edge), is_whole); k++) {
                var d = vec2(i32(k) % edge, i32(k) / edge) - r;
                var spatial = 1.0;
                if is_whole {
                    spatial = exp(q * f32(d.x * d.x + d.y * d.y));
                } else {
                    let tap = pattern[first + k];
                    d = vec2<i32>(round(vec2(along.x * tap.x - along.y * tap.y, along.y * tap.x + along.x * tap.y) * sigma));
                }
                let there = at + d;
                if any(there < vec2(0)) || any(there >= size) {
                    continue;
                }
                let j = u32(there.y * size.x + there.x);
                if view[j].material == NOT_GLOSSY {
                    continue;
                }
                let weight = spatial * range_weight(i, j);
                let seen = mirrored_light[j];
                if is_search {
                    sum += vec4(footprint_sigma(alpha, view[j].depth, seen.w), 0.0, 0.0, 1.0) * weight;
                } else {
                    sum += vec4(seen.rgb, 1.0) * weight;
                }
            }
            if is_search {
                sigma = sum.x / sum.w;
                sum = vec4(0.0);
            }
        }
        light = select(light, sum.rgb / sum.w, sum.w > 0.0);
    }
    glossy[i] = vec4(light * shading[i].albedo, 0.0);
}
