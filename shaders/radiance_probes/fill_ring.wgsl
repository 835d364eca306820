// Twin of src/lightmap/fill.rs: mean.
// Fills a ring of texels with the means of their neighbours.

struct Params {
    // Where the light map begins.
    map: u32,
    // The ring's pixels.
    first: u32,
    end: u32,
}

const CORNER: f32 = 0.25;

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> pixels: array<u32>;
@group(0) @binding(2) var<storage, read> firsts: array<u32>;
@group(0) @binding(3) var<storage, read> neighbours: array<u32>;
// Three a texel.
@group(0) @binding(4) var<storage, read_write> light: array<f32>;

@compute @workgroup_size(64)
fn fill_ring(@builtin(global_invocation_id) id: vec3<u32>) {
    let i = params.first + id.x;
    if i >= params.end {
        return;
    }
    var sum = vec4(0.0);
    for (var k = firsts[i]; k < firsts[i + 1u]; k++) {
        let next = params.map + 3u * (neighbours[k] >> 1u);
        let weight = select(1.0, CORNER, (neighbours[k] & 1u) != 0u);
        sum += weight * vec4(light[next], light[next + 1u], light[next + 2u], 1.0);
    }
    let at = params.map + 3u * pixels[i];
    light[at] = sum.x / sum.w;
    light[at + 1u] = sum.y / sum.w;
    light[at + 2u] = sum.z / sum.w;
}
