// Light at a point: a traversal of the nodes by solid angle, and what each sends there. Twin: src/method/many_light/gather.rs.
//
// Who includes it says what a receiver makes of light: the type `Received`, and the functions `nothing`, `added`, `weight_of` and `receive`; and
// at which surface `here` it is, with the normal `here_n` on its side.

// #include "many_light/lobe.wgsl"
// #include "many_light/node.wgsl"
// #include "many_light/params.wgsl"
// #include "many_light/site.wgsl"
// #include "shared/traverse.wgsl"

const MOST_SHADOW_RAYS: u32 = 16u;
// Directions within a spherical light's cone.
const CONE: u32 = 8u;
// Solid angle below which a spherical light is a point.
const SMALL: f32 = 1e-3;
// Entries of the table each way.
const DISC_SIZE: u32 = 64u;
// How many radii away a disc is a distant patch.
const DISC_FAR: f32 = 8.0;

// Shadow rays a gather; 0 leaves out what blocks indirect light.
override SHADOW_RAYS: u32 = 0u;

// Solid angles of a disc, four to a vector. Twin: method::many_light::disc.
@group(0) @binding(1) var<uniform> disc: array<vec4<f32>, 1024>;
@group(0) @binding(2) var<storage, read> sites: array<Site>;
@group(0) @binding(3) var<storage, read> nodes: array<Node>;

// Light that arrives from a node, or from a part of it.
struct Arrival {
    direction: vec3<f32>,
    // Its cosine included.
    solid_angle: f32,
    radiance: vec3<f32>,
}

// Where a receiver's lobe is. Twin: method::many_light::descend::Cone.
struct Cone {
    axis: vec3<f32>,
    cosine: f32,
    sine: f32,
    // Solid angle beyond which a node in it has to be taken apart.
    most: f32,
}

const NO_CONE = Cone(vec3(0.0), 1.0, 0.0, FAR); // Own.

// A node that stands for all, by chance.
struct Held {
    received: Received,
    weight: f32,
    node: u32,
}

struct Gathered {
    received: Received,
    // Nodes.
    visited: u32,
}

fn disc_entry(i: u32) -> f32 {
    return disc[i / 4u][i % 4u];
}

// Solid angle of a disc of radius 1 from `far` away, in a direction at `cosine` from its axis.
fn disc_solid_angle(far: f32, cosine: f32) -> f32 {
    let last = f32(DISC_SIZE - 1u);
    let x = clamp(far / (1.0 + far) * (1.0 + DISC_FAR) / DISC_FAR * last, 0.0, last);
    let y = clamp(cosine, 0.0, 1.0) * last;
    let i = min(u32(x), DISC_SIZE - 2u);
    let j = min(u32(y), DISC_SIZE - 2u);
    let at = j * DISC_SIZE + i;
    let part = x - f32(i);
    let low = mix(disc_entry(at), disc_entry(at + 1u), part);
    let high = mix(disc_entry(at + DISC_SIZE), disc_entry(at + DISC_SIZE + 1u), part);
    return mix(low, high, y - f32(j));
}

// Radiance of a node in the unit direction `w`.
fn node_radiance(node: u32, w: vec3<f32>) -> vec3<f32> {
    return nodes[node].diffuse + nodes[node].magnitude * density(nodes[node].exponent, dot(nodes[node].direction, w));
}

// Light that a node sends along `-to`, which ends at the receiver.
fn arriving(node: u32, to: vec3<f32>, d2: f32) -> Received {
    let far = sqrt(d2);
    if far <= MIN_POSITIVE {
        return nothing();
    }
    let w = to / far;
    let area = nodes[node].area;
    let radius = sqrt(area * FRAC_1_PI);
    let sine = min(radius * params.sphere / far, 1.0);
    let cone = TAU * (1.0 - sqrt(1.0 - sine * sine));
    if cone > SMALL {
        return arriving_from_sphere(node, w, cone);
    }
    let n = nodes[node].n;
    let cosine = -dot(n, w);
    if cosine <= 0.0 {
        return nothing();
    }
    var solid_angle = area * cosine / d2;
    if far < DISC_FAR * radius {
        let short = length(n);
        solid_angle = short * disc_solid_angle(far / radius, cosine / short);
    }
    return receive(Arrival(w, solid_angle, node_radiance(node, -w)));
}

// The same from a sphere (Hasan et al. 2009).
fn arriving_from_sphere(node: u32, w: vec3<f32>, cone: f32) -> Received {
    let frame = frame_from_normal(w);
    let share = cone / (f32(CONE) * params.sphere * params.sphere);
    var sum = nothing();
    for (var k = 0u; k < CONE; k++) {
        let height = 1.0 - cone / TAU * (f32(k) + 0.5) / f32(CONE);
        let d = to_world(frame, direction(height, fract(f32(k) * 0.618034)));
        let cosine = -dot(nodes[node].n, d);
        if cosine > 0.0 {
            sum = added(sum, receive(Arrival(d, share * cosine, node_radiance(node, -d))), 1.0);
        }
    }
    return sum;
}

// Whether a sphere of `radius` at `to` from the lobe's apex reaches into it.
fn meets(cone: Cone, to: vec3<f32>, far: f32, radius: f32) -> bool {
    let sine = min(radius / far, 1.0);
    let cosine = sqrt(1.0 - sine * sine);
    return dot(cone.axis, to) > far * (cone.cosine * cosine - cone.sine * sine);
}

// Whether a traversal goes on to a node's children. Twin: method::many_light::descend::Descent::goes_on.
fn goes_on(node: u32, to: vec3<f32>, d2: f32, cone: Cone) -> bool {
    if d2 < nodes[node].reach {
        return true;
    }
    let area = nodes[node].area;
    let r2 = area * FRAC_1_PI;
    if d2 < nodes[node].horizon {
        let height = dot(to, here_n);
        let along = dot(nodes[node].n, here_n);
        if height * height < (1.0 - along * along) * r2 {
            return true;
        }
    }
    return d2 < nodes[node].in_lobe && area > cone.most * d2 && meets(cone, to, sqrt(d2), sqrt(r2));
}

// All that arrives here, with this lobe. Random numbers, where there are any, are hashes of `stream`.
fn gather(cone: Cone, stream: u32) -> Gathered {
    var sum = nothing();
    var held: array<Held, MOST_SHADOW_RAYS>;
    var total = 0.0;
    var visited = 0u;
    var place = 0u;
    while place < params.nodes {
        visited++;
        let to = nodes[place].p - here.p;
        let d2 = dot(to, to);
        if goes_on(place, to, d2, cone) {
            place++;
            continue;
        }
        let received = arriving(place, to, d2);
        if SHADOW_RAYS == 0u {
            sum = added(sum, received, 1.0);
        } else {
            let weight = weight_of(received);
            if weight > 0.0 && is_finite(weight) {
                total += weight;
                for (var ray = 0u; ray < SHADOW_RAYS; ray++) {
                    if drawn(place, ray, stream) * total < weight {
                        held[ray] = Held(received, weight, place);
                    }
                }
            }
        }
        place = nodes[place].skip;
    }
    for (var ray = 0u; ray < SHADOW_RAYS; ray++) {
        let chosen = held[ray];
        if chosen.weight > 0.0 {
            let count = nodes[chosen.node].count;
            let light = nodes[chosen.node].first + min(u32(drawn(params.nodes, ray, stream) * f32(count)), count - 1u);
            if traverse(spawn_to(here, sites[light].p), true).triangle == NO_TRIANGLE {
                sum = added(sum, chosen.received, total / (chosen.weight * f32(SHADOW_RAYS)));
            }
        }
    }
    return Gathered(sum, visited);
}

// Twin: method::many_light::gather::Choice::drawn.
fn drawn(place: u32, ray: u32, stream: u32) -> f32 {
    return unit(hash64(vec2(MOST_SHADOW_RAYS * place + ray, stream)).y);
}
