// Twin of src/method/many_light/emit.rs: direct.
// Light straight from emitters that a run of lights sends on.

// #include "many_light/reflected.wgsl"
// #include "shared/lights.wgsl"
// #include "shared/traverse.wgsl"

@group(0) @binding(1) var<storage, read> sites: array<Site>;
// Of light straight from emitters, and then of all light.
@group(0) @binding(2) var<storage, read_write> emissions: array<Emission>;

@compute @workgroup_size(64)
fn sample_lights(@builtin(global_invocation_id) id: vec3<u32>) {
    scene = scene_params;
    if id.x >= params.count {
        return;
    }
    let i = params.first + id.x;
    stand_at(sites[i]);
    let stream = hash_end(hash_next(hash_next(hash_start(), params.seed), sites[i].number));
    var sum = dark();
    for (var k = 0u; k < params.samples; k++) {
        var s = sampler_new(stream, k);
        let u = next_4d(&s);
        let light = light_sample(Receiver(here.p, here_n), u.z, u.xy);
        if light.pdf <= 0.0 || dot(light.wi, here_n) <= 0.0 || all(light.weight == vec3(0.0)) || !all_finite(light.weight) {
            continue;
        }
        var ray = spawn(here, light.wi);
        if light.distance < FAR {
            ray = spawn_to(here, light.point);
        }
        if traverse(ray, true).triangle == NO_TRIANGLE {
            sum = merged(sum, reflected(light.wi, light.weight / f32(params.samples)), 1.0);
        }
    }
    emissions[i] = sum;
    emissions[params.lights + i] = sum;
}
