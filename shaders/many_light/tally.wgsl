// Twin of src/method/many_light/row.rs: counts.
// What a frame's sampling came to, a part a lane.

// #include "many_light/lit_pixel.wgsl"
// #include "many_light/params.wgsl"
// #include "shared/view.wgsl"

const LANES: u32 = 256u; // Own.

struct Part {
    // Pixels that were lit, and the least, the most and the sum of the nodes that were visited for them.
    points: u32,
    least: u32,
    most: u32,
    sum: u32,
    // Pixels whose lobes rays follow.
    mirrors: u32,
}

@group(0) @binding(1) var<storage, read> view: array<Pixel>;
@group(0) @binding(2) var<storage, read> lit: array<LitPixel>;
@group(0) @binding(3) var<storage, read_write> parts: array<Part>;

@compute @workgroup_size(256)
fn tally(@builtin(local_invocation_index) lane: u32) {
    var part = Part(0u, 0xffffffffu, 0u, 0u, 0u);
    for (var i = lane; i < params.count; i += LANES) {
        let visited = lit[i].visited;
        if visited > 0u {
            part.points++;
            part.least = min(part.least, visited);
            part.most = max(part.most, visited);
            part.sum += visited;
        }
        if view[i].material != NOT_GLOSSY && is_followed(view[i].alpha) {
            part.mirrors++;
        }
    }
    parts[lane] = part;
}
