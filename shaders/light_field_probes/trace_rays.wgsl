// Twin of src/method/light_field_probes/trace.rs: trace.
// The rays of lobe_rays.wgsl through the probes, and the light that they meet (the end of along_lobe).

// #include "light_field_probes/lobe_ray.wgsl"
// #include "light_field_probes/places.wgsl"
// #include "light_field_probes/march.wgsl"

const MOST_PROBES: u32 = 32u;
// Edge of the coarsest level of radiance.
const LEAST_LIGHT: u32 = 4u;

// Radiance of all probes, three halves a texel, the finest level first.
@group(0) @binding(4) var<storage, read> light: array<u32>;
@group(0) @binding(5) var<storage, read> rays: array<LobeRay>;
@group(0) @binding(6) var<storage, read_write> values: array<vec4<f32>>;

// Probes that have been asked for the ray, and how many.
var<private> asked: array<u32, MOST_PROBES>;
var<private> asked_count: u32;

fn is_new(probe: u32) -> bool {
    for (var k = 0u; k < asked_count; k++) {
        if asked[k] == probe {
            return false;
        }
    }
    return true;
}

// The first probe about a place that has not been asked. Twin: trace::next.
fn next_probe(p: vec3<f32>) -> u32 {
    let leaf = octree_at(p);
    for (var k = 0u; k < 4u; k++) {
        if leaf[k] != NO_PROBE && is_new(leaf[k]) {
            return leaf[k];
        }
    }
    let near = around(p);
    var nearest = NO_PROBE;
    var least = FAR;
    for (var k = 0u; k < 8u; k++) {
        let probe = near.probes[k];
        let to = probe_position(probe) - p;
        let squared = dot(to, to);
        if probe_slot(probe) != NO_PROBE && is_new(probe) && (nearest == NO_PROBE || squared < least) {
            nearest = probe;
            least = squared;
        }
    }
    return nearest;
}

fn light_texel(first: u32, i: u32) -> vec3<f32> {
    let at = 3u * (first + i);
    let a = unpack2x16float(light[at >> 1u]);
    let b = unpack2x16float(light[(at >> 1u) + 1u]);
    return select(vec3(a, b.x), vec3(a.y, b), (at & 1u) != 0u);
}

fn light_within(slot: u32, d: vec3<f32>, level: u32) -> vec3<f32> {
    let edge = params.field.size >> level;
    let first = slot * texels_before(LEAST_LIGHT / 2u) + texels_before(edge);
    let taps = taps_about(d, edge);
    var sum = vec3(0.0);
    for (var k = 0u; k < 4u; k++) {
        sum += light_texel(first, taps.texels[k]) * taps.weights[k];
    }
    return sum;
}

// Twin: probe::Light::about.
fn light_about(slot: u32, d: vec3<f32>, level: f32) -> vec3<f32> {
    let coarsest = level_count() - firstTrailingBit(LEAST_LIGHT);
    let at = clamp(level, 0.0, f32(coarsest));
    let low = u32(at);
    let f = at - floor(at);
    let fine = light_within(slot, d, low);
    if f == 0.0 {
        return fine;
    }
    return fine + (light_within(slot, d, low + 1u) - fine) * f;
}

@compute @workgroup_size(64)
fn trace_rays(@builtin(global_invocation_id) id: vec3<u32>) {
    params = field_params;
    if id.x >= params.pixels * params.samples {
        return;
    }
    values[id.x] = vec4(0.0);
    let ray = rays[id.x];
    if ray.lives == 0u {
        return;
    }
    asked_count = 0u;
    var t = 0.0;
    // The probe that saw it farthest, and how far; NO_PROBE where there is no light to look up.
    var seeing = NO_PROBE;
    var end = 0.0;
    var is_lost = true;
    while asked_count < MOST_PROBES {
        let probe = next_probe(ray.origin + ray.direction * t);
        if probe == NO_PROBE {
            break;
        }
        asked[asked_count] = probe;
        asked_count++;
        let local = LocalRay(ray.origin - probe_position(probe), probe_slot(probe), ray.direction);
        let found = march(local, vec2(t, params.field.far));
        if found.kind == FREE {
            return;
        }
        if found.kind == HIT {
            seeing = probe;
            end = found.t;
            is_lost = false;
            break;
        }
        if seeing == NO_PROBE || found.t > end {
            seeing = probe;
            end = found.t;
        }
        t = max(t, found.t);
    }
    if seeing == NO_PROBE {
        return;
    }
    let to_end = ray.origin + ray.direction * end - probe_position(seeing);
    var level = 0.0;
    if !is_lost && ray.omega > 0.0 {
        // What the sample covers at its end, as the probe sees it.
        let covered = ray.omega * end * end / max(dot(to_end, to_end), MIN_POSITIVE);
        let texel = 4.0 * PI / f32(params.field.size * params.field.size);
        level = 0.5 * log2(max(covered / texel, 1.0));
    }
    let value = ray.weight * light_about(probe_slot(seeing), to_end, level);
    if all_finite(value) {
        values[id.x] = vec4(value, 0.0);
    }
}
