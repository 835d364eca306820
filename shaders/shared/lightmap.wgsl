// Lookups in the light map. Twin: src/lightmap/lookup.rs.

// #include "shared/math.wgsl"
// #include "shared/scene.wgsl"

// Transmitted irradiance at a point of a triangle.
fn lightmap_lookup(triangle: u32, barycentric: vec2<f32>, back: bool) -> vec3<f32> {
    return lightmap_lookup_in(0u, triangle, barycentric, back);
}

// The same in one of several light maps that lie behind each other.
fn lightmap_lookup_in(map: u32, triangle: u32, barycentric: vec2<f32>, back: bool) -> vec3<f32> {
    if is_added(triangle) {
        return vec3(0.0);
    }
    let a = light_corner(3u * triangle);
    if (back && scene.light_back == NONE) || !is_finite(a.x) {
        return vec3(0.0);
    }
    let b = light_corner(3u * triangle + 1u);
    let c = light_corner(3u * triangle + 2u);
    let p = a + (b - a) * barycentric.x + (c - a) * barycentric.y;
    let size = vec2(scene.light_width, scene.light_height);
    let q = clamp(p - 0.5, vec2(0.0), vec2<f32>(size - 1u));
    let low = min(vec2<u32>(q), size - 1u);
    let high = min(low + 1u, size - 1u);
    let f = q - vec2<f32>(low);
    let above = mix(light_texel(map, low.x, low.y, back), light_texel(map, high.x, low.y, back), f.x);
    let below = mix(light_texel(map, low.x, high.y, back), light_texel(map, high.x, high.y, back), f.x);
    return mix(above, below, f.y);
}

fn light_texel(map: u32, x: u32, y: u32, back: bool) -> vec3<f32> {
    let row = map * scene.light_height + y;
    let at = select(scene.light_front, scene.light_back, back) + 3u * (row * scene.light_width + x);
    return vec3(word_f32(at), word_f32(at + 1u), word_f32(at + 2u));
}

// A triangle's corner in the light map; not finite where it has no light.
fn light_corner(i: u32) -> vec2<f32> {
    let at = scene.light_corners + 2u * i;
    return vec2(word_f32(at), word_f32(at + 1u));
}
