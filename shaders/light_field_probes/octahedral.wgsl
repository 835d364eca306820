// The octahedral map of directions. Twin: src/base/octahedral.rs.

// #include "shared/math.wgsl"

fn signs_of(p: vec3<f32>) -> vec3<f32> {
    return vec3(sign_of(p.x), sign_of(p.y), sign_of(p.z));
}

// The place in [-1, 1]² of a point of the octant with these signs, its borders included.
fn within_octant(at: vec3<f32>, signs: vec3<f32>) -> vec2<f32> {
    let p = at / dot(at, signs);
    return select(vec2(signs.x * (1.0 - signs.z * p.z), signs.z * (1.0 - signs.x * p.x)), p.xz, signs.y > 0.0);
}

// The place of a direction (of any length but 0) in [0, 1]².
fn octahedral_encode(d: vec3<f32>) -> vec2<f32> {
    return within_octant(d, signs_of(d)) * 0.5 + 0.5;
}

// The unit direction of a place in [0, 1]².
fn octahedral_decode(place: vec2<f32>) -> vec3<f32> {
    let p = place * 2.0 - 1.0;
    let y = 1.0 - abs(p.x) - abs(p.y);
    let fold = max(-y, 0.0);
    return normalize(vec3(p.x - fold * sign_of(p.x), y, p.y - fold * sign_of(p.y)));
}

// The unit direction of the middle of texel `i` of an n x n map.
fn texel_middle(i: u32, n: u32) -> vec3<f32> {
    return octahedral_decode((vec2(f32(i % n), f32(i / n)) + 0.5) / f32(n));
}

// A direction in four bytes.
fn unpack_direction(bits: u32) -> vec3<f32> {
    return octahedral_decode(vec2(f32(bits & 0xffffu), f32(bits >> 16u)) / 65535.0);
}

// The texel that stands at `at` of an n x n map, also beyond its edges: there the map goes on mirrored at the edge's middle.
fn wrapped_texel(at: vec2<i32>, n: i32) -> u32 {
    var p = at;
    if p.x < 0 || p.x >= n {
        p = vec2(clamp(select(2 * n - 1 - p.x, -1 - p.x, p.x < 0), 0, n - 1), n - 1 - p.y);
    }
    if p.y < 0 || p.y >= n {
        p = vec2(n - 1 - p.x, clamp(select(2 * n - 1 - p.y, -1 - p.y, p.y < 0), 0, n - 1));
    }
    p = clamp(p, vec2(0), vec2(n - 1));
    return u32(p.y * n + p.x);
}

// The four texels about a direction in an n x n map, across its seams, and their weights.
struct Taps {
    texels: vec4<u32>,
    weights: vec4<f32>,
}

fn taps_about(d: vec3<f32>, n: u32) -> Taps {
    let at = octahedral_encode(d) * f32(n) - 0.5;
    let f = at - floor(at);
    let low = vec2<i32>(floor(at));
    let size = i32(n);
    return Taps(
        vec4(
            wrapped_texel(low, size),
            wrapped_texel(low + vec2(1, 0), size),
            wrapped_texel(low + vec2(0, 1), size),
            wrapped_texel(low + vec2(1, 1), size),
        ),
        vec4((1.0 - f.x) * (1.0 - f.y), f.x * (1.0 - f.y), (1.0 - f.x) * f.y, f.x * f.y),
    );
}
