// Twin of src/method/glossy_probes/search.rs: best_samples.
// Searches for one pixel in so many in full; gather.wgsl does those between, from where these ended.

// #include "glossy_probes/search.wgsl"

@group(0) @binding(7) var<storage, read_write> anchors: array<Anchor>;

@compute @workgroup_size(8, 8)
fn find_anchors(@builtin(global_invocation_id) id: vec3<u32>) {
    params = gather_params;
    probe = probe_params;
    let side = anchors_a_side();
    let tiles = (vec2(params.width, params.height) + TILE - 1u) / TILE;
    if any(id.xy >= tiles * side) {
        return;
    }
    let pixel = id.xy / side * TILE + id.xy % side * params.anchors;
    var anchor = Anchor(vec2(0.0), vec2(0.0), FAR, 0u, 0u, 0u);
    let i = pixel.y * params.width + pixel.x;
    if pixel.x < params.width && pixel.y < params.height && reflects(i) {
        let centre = predicted(i);
        let found = search(Sample(FAR, centre), 0u, wanted_at(i));
        anchor = Anchor(found.texel, found.texel - centre, found.energy, 0u, 0u, 0u);
    }
    anchors[anchor_index(pixel / TILE, pixel % TILE)] = anchor;
}

