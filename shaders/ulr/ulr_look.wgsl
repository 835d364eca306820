// Twin of src/method/ulr/mod.rs: look.

// #include "ulr/ulr.wgsl"
// #include "shared/surface.wgsl"
// #include "shared/probe.wgsl"

const MAX_SPREAD: f32 = 0.2;

@group(0) @binding(2) var<storage, read> view: array<Pixel>;
// Texels (struct: probe::file::Texel) of seven words, then from `probe.second` on the vertices of the lat-long mesh in the probe, two each.
@group(0) @binding(3) var<storage, read> probe_words: array<u32>;
// k a pixel, colour and penalty: first those that see the pixel's point, then those that see its object, each in ascending order.
@group(0) @binding(4) var<storage, read_write> kept: array<vec4<f32>>;
// How many there are, and how many of them see the point.
@group(0) @binding(5) var<storage, read_write> counts: array<vec2<u32>>;

fn mesh_vertex(i: i32) -> vec2<f32> {
    let at = probe.second + 2u * u32(i);
    return vec2(bitcast<f32>(probe_words[at]), bitcast<f32>(probe_words[at + 1u]));
}

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
    let place = texel_from_direction(normalize_or(p - probe.position, vec3(0.0, 1.0, 0.0))) - 0.5;
    let low = floor(place);
    let t = place - low;
    // Colour times weight, and the weight: of texels that see the point, and of those that see its object.
    var seen = vec4(0.0);
    var same_object = vec4(0.0);
    for (var k = 0; k < 4; k++) {
        let at = 7u * texel_index(i32(low.x) + (k & 1), i32(low.y) + (k >> 1u));
        // Halves that are no zero, of either sign.
        let is_lit = ((probe_words[at] | (probe_words[at + 1u] << 16u)) & 0x7fff7fffu) != 0u;
        if probe_words[at + 6u] == NO_TRIANGLE || !is_lit {
            continue;
        }
        let there = facet(probe_words[at + 6u]);
        if there.object != f.object {
            continue;
        }
        let u = unpack2x16float(probe_words[at + 3u]).y;
        let v = unpack2x16float(probe_words[at + 4u]).x;
        let off = there.corners[0] * (1.0 - u - v) + there.corners[1] * u + there.corners[2] * v - p;
        let share = select(1.0 - t.x, t.x, (k & 1) == 1) * select(1.0 - t.y, t.y, k >= 2) + 1e-4;
        let color = vec3(unpack2x16float(probe_words[at]), unpack2x16float(probe_words[at + 1u]).x);
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
    ulr = ulr_params;
    probe = probe_params;
    if id.x >= ulr.width || id.y >= ulr.height {
        return;
    }
    let i = id.y * ulr.width + id.x;
    let p = view[i].p;
    if view[i].material == NOT_GLOSSY || all(p == probe.position) {
        return;
    }
    let own = penalty(p);
    let first = i * ulr.blend;
    let last = first + ulr.blend - 1u;
    let count = counts[i];
    if count.y == ulr.blend && own >= kept[last].w {
        return;
    }
    let found = look(p, facet(view[i].triangle));
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

