// Light straight from emitters at a surface that is seen. Twin: src/view/direct.rs: direct_at.

// #include "shared/path.wgsl"

// What the lobes of `query` send to `wo` of it: the mean of `count` samples of a random stream, 0 for none.
fn direct_at(hit: Hit, wo: vec3<f32>, query: Query, count: u32, stream: u32) -> vec3<f32> {
    var sum = vec3(0.0);
    for (var k = 0u; k < count; k++) {
        var s = sampler_new(stream, k);
        sum += integrate(Start(hit, wo, query, 0.0, true), PathParams(1u, NONE), &s);
    }
    return sum / f32(max(count, 1u));
}
