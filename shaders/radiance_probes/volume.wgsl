// Receivers in free space, and how surfaces take light from them. Twin: src/method/radiance_probes/volume.rs.

// #include "shared/traverse.wgsl"
// #include "shared/bsdf.wgsl"
// #include "radiance_probes/taps.wgsl"

// Directions by which light enters a coat.
const VOLUME_DIRECTIONS: u32 = 8u;

struct Volume {
    // The grid's point of least coordinates, and the distance between neighbours.
    low: vec3<f32>,
    spacing: f32,
    // Points along x, y and z.
    counts: vec3<u32>,
    // How many of them are receivers; 0 without any volume.
    receivers: u32,
}

@group(0) @binding(1) var<uniform> volume: Volume;
// The receivers' numbers in the grid, ascending.
@group(0) @binding(2) var<storage, read> cells: array<u32>;

// The receiver at a point of the grid; NONE where there is none.
fn receiver_at(cell: u32) -> u32 {
    var first = 0u;
    var end = volume.receivers;
    while first < end {
        let middle = (first + end) / 2u;
        if cells[middle] < cell {
            first = middle + 1u;
        } else {
            end = middle;
        }
    }
    if first < volume.receivers && cells[first] == cell {
        return first;
    }
    return NONE;
}

// Whether the scene's own shapes, those that a frame adds aside, stand between two points.
fn hidden(start: vec3<f32>, end: vec3<f32>) -> bool {
    let d = normalize_or(end - start, vec3(0.0));
    if all(d == vec3(0.0)) {
        return false;
    }
    return traverse_both(Ray(start, 0.0, d, distance(start, end) * (1.0 - 1e-4)), true, NONE).triangle != NO_TRIANGLE;
}

// T_in of light from all directions, on the side of the normal (1) or behind it (-1).
fn entering(s: Surface, side: f32) -> f32 {
    var sum = 0.0;
    for (var k = 0u; k < VOLUME_DIRECTIONS; k++) {
        let u = (f32(k) + 0.5) / f32(VOLUME_DIRECTIONS);
        let d = cosine_hemisphere(vec2(u, fract(0.618034 * (f32(k) + 0.5))));
        sum += bsdf_diffuse_in(s, vec3(d.xy, d.z * side));
    }
    return sum / f32(VOLUME_DIRECTIONS);
}

// Irradiance of each of a receiver's harmonics on a surface that faces `n`.
fn cosine_harmonics(n: vec3<f32>) -> array<f32, VOLUME_NUMBERS> {
    let y1 = sqrt(0.75 / PI) * (2.0 * PI / 3.0);
    let y2 = sqrt(15.0 / PI) * (PI / 4.0);
    return array(
        sqrt(0.25 / PI) * PI,
        y1 * n.y,
        y1 * n.z,
        y1 * n.x,
        0.5 * y2 * n.x * n.y,
        0.5 * y2 * n.y * n.z,
        0.25 * sqrt(5.0 / PI) * (PI / 4.0) * (3.0 * n.z * n.z - 1.0),
        0.5 * y2 * n.x * n.z,
        0.25 * y2 * (n.x * n.x - n.y * n.y),
    );
}

// Those that light a surface on the side that `wo` points to: of the eight around it the ones in sight, or all where none is.
fn taps_of(s: Surface, wo: vec3<f32>) -> Taps {
    var taps: Taps;
    if volume.receivers == 0u {
        return taps;
    }
    let q = clamp((s.p - volume.low) / volume.spacing, vec3(0.0), vec3<f32>(volume.counts - 1u));
    let low = floor(q);
    let share = q - low;
    // Of all, and of those in sight.
    var sums = vec2(0.0);
    var open = 0u;
    for (var k = 0u; k < 8u; k++) {
        let step = vec3(k & 1u, (k >> 1u) & 1u, k >> 2u);
        let at = min(vec3<u32>(low) + step, volume.counts - 1u);
        let weights = select(1.0 - share, share, step == vec3(1u));
        let weight = weights.x * weights.y * weights.z;
        let point = receiver_at((at.z * volume.counts.y + at.y) * volume.counts.x + at.x);
        if point == NONE || !(weight > 0.0) {
            continue;
        }
        taps.points[k] = point;
        taps.weights[k] = weight;
        sums.x += weight;
        if !hidden(s.p, volume.low + vec3<f32>(at) * volume.spacing) {
            sums.y += weight;
            open |= 1u << k;
        }
    }
    let sum = select(sums.x, sums.y, open != 0u);
    if sum == 0.0 {
        return taps;
    }
    for (var k = 0u; k < 8u; k++) {
        if open != 0u && (open & (1u << k)) == 0u {
            taps.weights[k] = 0.0;
        }
    }
    let side = select(1.0, -1.0, dot(s.frame.n, wo) < 0.0);
    taps.factors = cosine_harmonics(s.frame.n * side);
    let scale = entering(s, side) / sum;
    for (var j = 0u; j < VOLUME_NUMBERS; j++) {
        taps.factors[j] *= scale;
    }
    return taps;
}
