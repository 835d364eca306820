// Unstructured lumigraph rendering (Buehler et al. 2001) of the probes. Twin: src/render/baseline/ulr.rs.
// Follows surface.wgsl, view.wgsl and probe.wgsl.
//
// `ulr_look` asks one probe at every pixel and keeps the pixel's samples of least penalty, `ulr_blend` weighs them.

// Struct: gpu::render::ulr::Params.
struct UlrParams {
    eye: vec3<f32>,
    width: u32,
    height: u32,
    // Samples that a pixel keeps, k.
    blend: u32,
    angle: f32,
    resolution: f32,
    hidden: f32,
    plane_tolerance: f32,
    padding0: u32,
    padding1: u32,
}

const MIN_PENALTY: f32 = 1e-3;
const MAX_SPREAD: f32 = 0.2;

@group(0) @binding(0) var<storage, read> ulr: UlrParams;
// Struct: probe::file::Texel, in words.
@group(0) @binding(3) var<storage, read> texels: array<array<u32, 7>>;
// The planes of the view.
@group(0) @binding(4) var<storage, read> view_hits: array<Hit>;
@group(0) @binding(5) var<storage, read> view_positions: array<vec4<f32>>;
@group(0) @binding(6) var<storage, read> view_materials: array<u32>;
// k a pixel, colour and penalty: first those that see the pixel's point, then those that see its object, each in ascending order.
@group(0) @binding(7) var<storage, read_write> kept: array<vec4<f32>>;
// How many there are, and how many of them see the point.
@group(0) @binding(8) var<storage, read_write> counts: array<vec2<u32>>;

// What `ulr_blend` reads and writes.
@group(0) @binding(1) var<storage, read> blend_materials: array<u32>;
@group(0) @binding(2) var<storage, read> blend_kept: array<vec4<f32>>;
@group(0) @binding(3) var<storage, read> blend_counts: array<vec2<u32>>;
@group(0) @binding(4) var<storage, read_write> glossy: array<vec4<f32>>;
// Pixels that no probe serves.
@group(0) @binding(5) var<storage, read_write> unserved: atomic<u32>;

// The probe's penalty for the point, visibility left out.
fn penalty(p: vec3<f32>) -> f32 {
    let to_eye = ulr.eye - p;
    let to_probe = probe.position - p;
    let angle = angle_of(length(cross(to_eye, to_probe)), dot(to_eye, to_probe));
    let lost = 1.0 - length(to_eye) / max(length(to_probe), MIN_POSITIVE);
    return ulr.angle * angle + ulr.resolution * max(lost, 0.0);
}

struct Look {
    color: vec3<f32>,
    // Whether a texel sees the point, and whether one sees its object.
    sees: bool,
    found: bool,
}

// What the probe shows where it should see the point `p` of a facet.
fn look(p: vec3<f32>, f: Facet) -> Look {
    let far = distance(p, probe.position);
    let ng = unit_normal(f);
    let at = texel_from_direction(normalize_or(p - probe.position, vec3(0.0, 1.0, 0.0))) - 0.5;
    let low = floor(at);
    let t = at - low;
    // Colour times weight, and the weight: of texels that see the point, and of those that see its object.
    var seen = vec4(0.0);
    var same_object = vec4(0.0);
    for (var k = 0; k < 4; k++) {
        let texel = texels[texel_index(i32(low.x) + (k & 1), i32(low.y) + (k >> 1u))];
        // Halves that are no zero, of either sign.
        let is_lit = ((texel[0] | (texel[1] << 16u)) & 0x7fff7fffu) != 0u;
        if texel[6] == NO_TRIANGLE || !is_lit {
            continue;
        }
        let there = facet(texel[6]);
        if there.object != f.object {
            continue;
        }
        let u = unpack2x16float(texel[3]).y;
        let v = unpack2x16float(texel[4]).x;
        let off = there.corners[0] * (1.0 - u - v) + there.corners[1] * u + there.corners[2] * v - p;
        let share = select(1.0 - t.x, t.x, (k & 1) == 1) * select(1.0 - t.y, t.y, k >= 2) + 1e-4;
        let color = vec3(unpack2x16float(texel[0]), unpack2x16float(texel[1]).x);
        let sees = abs(dot(off, ng)) < ulr.plane_tolerance * far && length(off) < MAX_SPREAD * far;
        seen += select(vec4(0.0), vec4(color, 1.0) * share, sees);
        same_object += select(vec4(color, 1.0) * share, vec4(0.0), sees);
    }
    let sees = seen.w > 0.0;
    let sum = select(same_object, seen, sees);
    return Look(sum.rgb / sum.w, sees, sum.w > 0.0);
}

@compute @workgroup_size(8, 8)
fn ulr_look(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= ulr.width || id.y >= ulr.height {
        return;
    }
    let i = id.y * ulr.width + id.x;
    let p = view_positions[i].xyz;
    if view_materials[i] == NOT_GLOSSY || all(p == probe.position) {
        return;
    }
    let own = penalty(p);
    let first = i * ulr.blend;
    let last = first + ulr.blend - 1u;
    let count = counts[i];
    if count.y == ulr.blend && own >= kept[last].w {
        return;
    }
    let found = look(p, facet(view_hits[i].triangle));
    if !found.found {
        return;
    }
    // Where it belongs: after those of its kind that are no worse.
    let q = own + select(ulr.hidden, 0.0, found.sees);
    let end = first + select(count.x, count.y, found.sees);
    var at = first + select(count.y, 0u, found.sees);
    while at < end && kept[at].w <= q {
        at++;
    }
    if at > last {
        return;
    }
    for (var j = min(first + count.x, last); j > at; j--) {
        kept[j] = kept[j - 1u];
    }
    kept[at] = vec4(found.color, q);
    counts[i] = min(count + vec2(1u, select(0u, 1u, found.sees)), vec2(ulr.blend));
}

@compute @workgroup_size(8, 8)
fn ulr_blend(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= ulr.width || id.y >= ulr.height {
        return;
    }
    let i = id.y * ulr.width + id.x;
    let count = blend_counts[i].x;
    var sum = vec4(0.0);
    if count > 0u {
        let first = i * ulr.blend;
        let last = blend_kept[first + count - 1u].w * (1.0 + 1e-5) + MIN_PENALTY;
        for (var j = first; j < first + count; j++) {
            let q = blend_kept[j].w + MIN_PENALTY;
            sum += vec4(blend_kept[j].rgb, 1.0) * (max(1.0 - q / last, 1e-6) / q);
        }
        sum /= sum.w;
    } else if blend_materials[i] != NOT_GLOSSY {
        atomicAdd(&unserved, 1u);
    }
    glossy[i] = vec4(sum.rgb, 0.0);
}
