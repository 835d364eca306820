// Twin of src/transport/world.rs: closest.
// The closest hits of a list of rays.

// #include "shared/traverse.wgsl"

@group(0) @binding(0) var<storage, read> rays: array<Ray>;
@group(0) @binding(1) var<storage, read_write> hits: array<Hit>;

@compute @workgroup_size(64)
fn closest(@builtin(global_invocation_id) id: vec3<u32>) {
    scene = scene_params;
    if id.x < arrayLength(&rays) {
        hits[id.x] = traverse(rays[id.x], false);
    }
}
