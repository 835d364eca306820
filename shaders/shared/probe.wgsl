// A probe in a frame, and its parameterisation. Twin: src/probe/parameter_map.rs. What a method keeps of a probe says how `mesh_vertex` finds the
// vertices of the lat-long mesh in the probe.

// #include "shared/math.wgsl"

struct Probe {
    position: vec3<f32>,
    // At equal energy.
    weight: f32,
    size: vec2<i32>,
    mesh: vec2<i32>,
    index: u32,
    // Where the second list begins in a buffer of two.
    second: u32,
    padding0: u32,
    padding1: u32,
}

@group(0) @binding(1) var<uniform> probe_params: Probe;
var<private> probe: Probe;

// Index of an integer texel coordinate: wraps in x, clamps in y.
fn texel_index(x: i32, y: i32) -> u32 {
    let column = ((x % probe.size.x) + probe.size.x) % probe.size.x;
    return u32(clamp(y, 0, probe.size.y - 1) * probe.size.x + column);
}

// Twin: probe::qhmap::ParameterMap::texel_from_direction.
fn texel_from_direction(d: vec3<f32>) -> vec2<f32> {
    let mesh = vec2<f32>(probe.mesh);
    let p = lat_long_from_direction(d) * mesh;
    let cell = min(vec2<i32>(p), probe.mesh - 1);
    let t = p - vec2<f32>(cell);
    let row = probe.mesh.x + 1;
    let i = cell.y * row + cell.x;
    let at = mix(mix(mesh_vertex(i), mesh_vertex(i + 1), t.x), mix(mesh_vertex(i + row), mesh_vertex(i + row + 1), t.x), t.y);
    let size = vec2<f32>(probe.size);
    let x = (at.x - floor(at.x)) * size.x;
    return vec2(select(0.0, x, x < size.x), clamp(at.y, 0.0, 1.0) * size.y);
}
