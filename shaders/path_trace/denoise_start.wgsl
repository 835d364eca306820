// Twin of src/view/denoise.rs: slopes.

// #include "path_trace/denoise.wgsl"

// Change of depth from a pixel to the next, along each axis.
@group(0) @binding(4) var<storage, read_write> slopes: array<vec2<f32>>;

// The lesser of the changes of depth towards both neighbours along an axis.
fn slope_along(x: i32, y: i32, axis: vec2<i32>) -> f32 {
    let own = guides[pixel_index(x, y)].depth;
    var least = FAR;
    for (var side = -1; side <= 1; side += 2) {
        let at = vec2(x, y) + axis * side;
        if is_inside(at.x, at.y) {
            least = min(least, abs(guides[pixel_index(at.x, at.y)].depth - own));
        }
    }
    return select(0.0, least, least < FAR);
}

@compute @workgroup_size(16, 4)
fn denoise_start(@builtin(global_invocation_id) id: vec3<u32>) {
    params = denoise_params;
    if id.x >= params.width || id.y >= params.height {
        return;
    }
    let x = i32(id.x);
    let y = i32(id.y);
    let i = pixel_index(x, y);
    slopes[i] = vec2(slope_along(x, y, vec2(1, 0)), slope_along(x, y, vec2(0, 1)));
    result[i] = vec4(source[i].rgb / divisor(guides[i]), 0.0);
}

