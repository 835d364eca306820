// Twin of src/method/many_light/adaptive.rs: exposure.
// What the mean light of the coarsest grid counts for.

// #include "many_light/grid.wgsl"

const LANES: u32 = 256u; // Own.
// What the mean of the coarsest grid's light is taken for.
const MIDDLE_GREY: f32 = 0.18;

var<workgroup> sums: array<vec2<f32>, LANES>;

@compute @workgroup_size(256)
fn expose(@builtin(local_invocation_index) lane: u32) {
    var sum = vec2(0.0);
    for (var k = lane; k < params.count; k += LANES) {
        let i = index_of(grid_pixel(k));
        if is_surface(i) {
            sum += vec2(weight_at(i), 1.0);
        }
    }
    sums[lane] = sum;
    for (var half = LANES / 2u; half > 0u; half /= 2u) {
        workgroupBarrier();
        if lane < half {
            sums[lane] += sums[lane + half];
        }
    }
    if lane == 0u {
        let mean = sums[0].x / max(sums[0].y, 1.0);
        grids.exposure = MIDDLE_GREY / max(mean, MIN_POSITIVE);
    }
}
