// Twin of src/method/many_light/row.rs: counts.
// How many pixels were lit, and the least, the most and the sum of the nodes that were visited for them; a part a lane.

// #include "many_light/lit_pixel.wgsl"

const LANES: u32 = 256u; // Own.

@group(0) @binding(0) var<storage, read> lit: array<LitPixel>;
@group(0) @binding(1) var<storage, read_write> tallies: array<vec4<u32>>;

@compute @workgroup_size(256)
fn tally(@builtin(local_invocation_index) lane: u32) {
    var sum = vec4(0u, 0xffffffffu, 0u, 0u);
    for (var i = lane; i < arrayLength(&lit); i += LANES) {
        let visited = lit[i].visited;
        if visited > 0u {
            sum = vec4(sum.x + 1u, min(sum.y, visited), max(sum.z, visited), sum.w + visited);
        }
    }
    tallies[lane] = sum;
}
