// Twin of src/method/many_light/bounce.rs: light.
// What a run of lights sends on of light from all the others, and straight from emitters.

// #include "many_light/gather.wgsl"
// #include "many_light/reflected.wgsl"

// Marks random numbers of gathers at lights.
const BOUNCE: u32 = 0x626f756eu;

// Of light straight from emitters, and then of all light.
@group(0) @binding(4) var<storage, read_write> emissions: array<Emission>;

alias Received = Emission;

fn nothing() -> Emission {
    return dark();
}

fn added(a: Emission, b: Emission, scale: f32) -> Emission {
    return merged(a, b, scale);
}

fn weight_of(emission: Emission) -> f32 {
    return emission_weight(emission);
}

// A light that fills the hemisphere has an irradiance of pi.
fn receive(arrival: Arrival) -> Emission {
    let cosine = max(dot(arrival.direction, here_n), MIN_POSITIVE);
    let solid_angle = min(arrival.solid_angle, params.clamp / (cosine * FRAC_1_PI));
    return reflected(arrival.direction, arrival.radiance * solid_angle);
}

@compute @workgroup_size(64)
fn bounce(@builtin(global_invocation_id) id: vec3<u32>) {
    scene = scene_params;
    if id.x >= params.count {
        return;
    }
    let i = params.first + id.x;
    stand_at(sites[i]);
    let marks = hash_next(hash_next(hash_start(), params.seed), BOUNCE);
    let stream = hash_end(hash_next(hash_next(marks, params.bounce), sites[i].number));
    emissions[params.lights + i] = merged(emissions[i], gather(NO_CONE, stream).received, 1.0);
}
