// The path tracer. Twin: src/transport/path.rs, whose recursion from the first vertex to the rest of the path is one loop here, with one place
// where rays are traced.

// #include "shared/traverse.wgsl"
// #include "shared/bsdf.wgsl"
// #include "shared/lights.wgsl"
// #include "shared/lightmap.wgsl"

const ROULETTE_CAP: f32 = 0.98;
const ROULETTE_MERCY: f32 = 4.0;

// What the first vertex integrates incident radiance against: transmission into the diffuse layer times cosine, in place of its scattering.
override IRRADIANCE: bool = false;
// Whether emitters are sampled at each vertex. If not, paths find light by their own rays alone, draw one set of dimensions a vertex, and
// end where they meet their last one, whose light is known as far as it ever will be. Twin: method::lightmap_rt.
override NEXT_EVENT: bool = true;

struct PathParams {
    max_depth: u32,
    rr_depth: u32,
}

// Where a path begins.
struct Start {
    hit: Hit,
    // Towards the viewer, world.
    wo: vec3<f32>,
    query: Query,
    // IRRADIANCE: on the side of the frame's normal (1) or behind it (-1).
    side: f32,
    // It is one half of a pixel, so that the roulette leaves its weight out.
    split: bool,
}

fn irradiance(s: Surface, side: f32, wl: vec3<f32>, v: vec2<f32>) -> Scattered {
    var sum = Scattered(NO_SCATTER, NO_SAMPLE, vec3(0.0));
    let cosine = sqrt(1.0 - v.y);
    let drawn = vec3(sqrt(v.y) * cos(v.x * TAU), sqrt(v.y) * sin(v.x * TAU), cosine * side);
    for (var k = 0u; k < 2u; k++) {
        let wo = select(drawn, wl, k == 0u);
        let pdf = wo.z * side * FRAC_1_PI;
        if pdf > 0.0 {
            let factor = bsdf_diffuse_in(s, wo);
            if k == 0u {
                sum.light = Scatter(vec3(factor * pdf * PI), pdf);
            } else {
                sum.sample = Sample(wo, vec3(factor * PI), pdf, false, 1.0);
            }
        }
    }
    return sum;
}

// Weight of a sample of density `a` where another technique would have found it with density `b`.
fn power_heuristic(a: f32, b: f32) -> f32 {
    let ratio = b / a;
    return 1.0 / (1.0 + ratio * ratio);
}

fn keep_finite(c: vec3<f32>) -> vec3<f32> {
    return select(vec3(0.0), c, all_finite(c));
}

// One sample of the integral of incident radiance at a path's first vertex.
fn integrate(start: Start, params: PathParams, s: ptr<function, Sampler>) -> vec3<f32> {
    var sum = vec3(0.0);
    // Their product is what the path has lost; the roulette looks at the second alone.
    var weight = vec3(1.0);
    var throughput = vec3(1.0);
    var eta = 1.0;
    var hit = start.hit;
    var wo = start.wo;
    var query = start.query;
    var receiver: Receiver;
    var sample = NO_SAMPLE;
    for (var depth = 0u; depth <= params.max_depth; depth++) {
        let surface = surface_at(hit);
        let wi = to_local(surface.frame, wo);
        if depth > 0u && surface.emitter != NONE && wi.z > 0.0 {
            let light = emitted(surface);
            let other = select(pdf_surface(receiver, surface), 0.0, sample.delta || !NEXT_EVENT);
            sum += weight * throughput * light * power_heuristic(sample.pdf, other);
        }
        if depth == params.max_depth {
            break;
        }
        var l = vec4(0.0);
        if NEXT_EVENT {
            l = next_4d(s);
        }
        let b = next_4d(s);
        let is_irradiance = IRRADIANCE && depth == 0u;
        var side = select(sign_of(wi.z), 0.0, (material_u32(surface.material, MATERIAL_FLAGS) & TRANSMISSIVE) != 0u);
        side = select(side, start.side, is_irradiance);
        receiver = Receiver(surface.p, surface.frame.n * side);
        var light = NO_LIGHT;
        if NEXT_EVENT {
            light = light_sample(receiver, l.z, l.xy);
        }
        let wl = to_local(surface.frame, light.wi);
        var at: Scattered;
        if is_irradiance {
            at = irradiance(surface, side, wl, b.xy);
        } else {
            at = scatter(surface, wi, wl, b.z, b.xy, query);
        }
        if HAS_LIGHTMAP && depth > 0u {
            let known = at.diffuse_out * lightmap_lookup(surface.triangle, surface.barycentric, wi.z < 0.0) * FRAC_1_PI;
            sum += weight * throughput * known;
            if (material_u32(surface.material, MATERIAL_LOBES) & NON_DIFFUSE) == 0u {
                break;
            }
        }
        // Next-event estimation; zero where there is nothing to ask a shadow ray for.
        var direct = vec3(0.0);
        if light.pdf > 0.0 && any(at.light.value != vec3(0.0)) {
            let heuristic = power_heuristic(light.pdf, select(at.light.pdf, 0.0, light.delta));
            direct = weight * throughput * light.weight * at.light.value * heuristic;
        }
        sample = at.sample;
        var lives = sample.pdf > 0.0 && any(sample.weight != vec3(0.0));
        eta *= sample.eta;
        let is_split = start.split && depth == 0u;
        weight *= select(vec3(1.0), sample.weight, is_split);
        throughput *= select(sample.weight, vec3(1.0), is_split);
        if depth + 1u >= params.rr_depth && !is_split {
            let survival = min(max3(throughput) * eta * eta * ROULETTE_MERCY, ROULETTE_CAP);
            lives = lives && l.w < survival;
            throughput /= survival;
        }
        lives = lives && (NEXT_EVENT || depth + 1u < params.max_depth);
        wo = -to_world(surface.frame, sample.wo);
        for (var k = 0u; k < 2u; k++) {
            let is_shadow = k == 0u;
            if !select(lives, any(direct != vec3(0.0)), is_shadow) {
                continue;
            }
            var ray = spawn(surface, select(-wo, light.wi, is_shadow));
            if is_shadow && light.distance < FAR {
                ray = spawn_to(surface, light.point);
            }
            let met = traverse(ray, is_shadow);
            if !is_shadow {
                hit = met;
            } else if met.triangle == NO_TRIANGLE {
                sum += direct;
            }
        }
        if !lives {
            break;
        }
        if hit.triangle == NO_TRIANGLE {
            if scene.environment_count > 0u {
                let other = select(pdf_environment(receiver, -wo), 0.0, sample.delta || !NEXT_EVENT);
                sum += weight * throughput * environment(-wo) * power_heuristic(sample.pdf, other);
            }
            break;
        }
        query = Query(select(ALL_LOBES, NON_DIFFUSE, HAS_LIGHTMAP), 1.0);
    }
    return keep_finite(sum);
}
