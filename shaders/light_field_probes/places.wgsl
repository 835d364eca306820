// Where the probes stand, and which are asked about a place. Twins: src/probe/{placement,neighbors}.rs and octree.rs.

// #include "light_field_probes/params.wgsl"
// #include "shared/math.wgsl"

// A row each: the probes' positions and the numbers of their maps (NO_PROBE where one is blocked), the octree's sets, and its nodes in fours.
@group(0) @binding(1) var<storage, read> places: array<vec4<u32>>;

const NO_PROBE: u32 = 0xffffffffu;
const LEAF: u32 = 0x80000000u;
const LEAST_NEAR: f32 = 1e-3;
// Probes that take part where they stand in no grid.
const COUNT: u32 = 8u;

// The eight probes about a place, and their weights.
struct Around {
    probes: array<u32, 8>,
    weights: array<f32, 8>,
}

fn probe_position(probe: u32) -> vec3<f32> {
    return bitcast<vec3<f32>>(places[probe].xyz);
}

// Number of its maps.
fn probe_slot(probe: u32) -> u32 {
    return places[probe].w;
}

// Twin: probe::placement::ProbeGrid::around.
fn around_in_grid(p: vec3<f32>) -> Around {
    let counts = params.field.counts;
    let last = counts - 1u;
    let spacing = max(params.field.spacing, vec3(MIN_POSITIVE));
    let at = clamp((p - params.field.origin) / spacing, vec3(0.0), vec3<f32>(last));
    let low = min(vec3<u32>(at), max(counts, vec3(2u)) - 2u);
    let t = at - vec3<f32>(low);
    var result: Around;
    var sum = 0.0;
    for (var k = 0u; k < 8u; k++) {
        let side = vec3(k & 1u, (k >> 1u) & 1u, k >> 2u);
        let cell = min(low + side, last);
        let shares = select(1.0 - t, t, side == vec3(1u));
        let probe = (cell.z * counts.y + cell.y) * counts.x + cell.x;
        let weight = select(shares.x * shares.y * shares.z, 0.0, probe_slot(probe) == NO_PROBE);
        result.probes[k] = probe;
        result.weights[k] = weight;
        sum += weight;
    }
    for (var k = 0u; k < 8u && sum > 0.0; k++) {
        result.weights[k] /= sum;
    }
    return result;
}

// Twin: probe::neighbors::around.
fn around_in_list(p: vec3<f32>) -> Around {
    // Squared distances, the least first, of one more than take part.
    var near: array<f32, 9>;
    var probes: array<u32, 9>;
    for (var k = 0u; k <= COUNT; k++) {
        near[k] = FAR;
        probes[k] = 0u;
    }
    for (var i = 0u; i < params.field.probes; i++) {
        let to = probe_position(i) - p;
        var squared = dot(to, to);
        var probe = i;
        for (var k = 0u; k <= COUNT; k++) {
            if squared < near[k] {
                let other = near[k];
                let other_probe = probes[k];
                near[k] = squared;
                probes[k] = probe;
                squared = other;
                probe = other_probe;
            }
        }
    }
    var farthest = 1.0;
    for (var k = 0u; k <= COUNT; k++) {
        if near[k] < FAR {
            farthest = sqrt(near[k]);
        }
    }
    let end = select(2.0 * farthest, farthest, near[COUNT] < FAR);
    var result: Around;
    var sum = 0.0;
    for (var k = 0u; k < COUNT; k++) {
        let d = sqrt(near[k]);
        let raw = max(end - d, 0.0) / max(end * max(d, 1e-6 * end), MIN_POSITIVE);
        let weight = select(0.0, raw * raw, near[k] < FAR);
        result.probes[k] = probes[k];
        result.weights[k] = weight;
        sum += weight;
    }
    if sum > 0.0 {
        for (var k = 0u; k < COUNT; k++) {
            result.weights[k] /= sum;
        }
    } else {
        result.weights[0] = 1.0;
    }
    return result;
}

fn around(p: vec3<f32>) -> Around {
    if params.field.counts.x > 0u {
        return around_in_grid(p);
    }
    return around_in_list(p);
}

// Twin: octree::Octree::at. Probes that see a place, the best first; NO_PROBE fills the rest.
fn octree_at(p: vec3<f32>) -> vec4<u32> {
    var q = (p - params.field.lower) / params.field.edge;
    if params.field.counts.x > 0u || !(all(q >= vec3(0.0)) && all(q < vec3(1.0))) {
        return vec4(NO_PROBE);
    }
    var at = 0u;
    // The tree is no deeper than coordinates have bits.
    for (var depth = 0u; depth < 32u; depth++) {
        let node = places[params.field.nodes + (at >> 2u)][at & 3u];
        if (node & LEAF) != 0u {
            return places[params.field.sets + (node & ~LEAF)];
        }
        q *= 2.0;
        let upper = q >= vec3(1.0);
        q -= select(vec3(0.0), vec3(1.0), upper);
        at = node + dot(select(vec3(0u), vec3(1u, 2u, 4u), upper), vec3(1u));
    }
    return vec4(NO_PROBE);
}
