// Twin of src/method/many_light/follow.rs: followed.
// Adds what rays along the lobes of mirrors and polished surfaces bring back to the glossy layer of a run of pixels.

// #include "many_light/receive.wgsl"
// #include "shared/camera_ray.wgsl"
// #include "shared/direct_at.wgsl"
// #include "shared/factors.wgsl"
// #include "shared/mirror.wgsl"
// #include "shared/view.wgsl"

// Marks random numbers of rays along lobes.
const RAY: u32 = 0x6d697272u;
// Branch of a ray's stream: light straight from emitters where it ends.
const STRAIGHT: u32 = 1u;

// Rays of a pixel that are drawn from its lobe; 0 for one in the mirror direction.
override MIRROR_SAMPLES: u32 = 0u;

@group(0) @binding(4) var<storage, read> view: array<Pixel>;
@group(0) @binding(5) var<storage, read_write> glossy: array<vec4<f32>>;

// What a ray brings back that leaves a surface by its lobe, and those that follow it from mirror to mirror. Every function has one call, as
// functions are put in where they are called.
fn along(first: Hit, seen_from: vec3<f32>, straight: u32, stream: u32) -> vec3<f32> {
    var hit = first;
    var wo = seen_from;
    var sum = vec3(0.0);
    var throughput = vec3(1.0);
    var s = sampler_new(stream, 0u);
    for (var met = 0u; met <= params.mirror_rays; met++) {
        let surface = surface_at(hit);
        let wi = to_local(surface.frame, wo);
        let albedo = bsdf_glossy_albedo(surface, wi);
        if met > 0u {
            let alpha = view_alpha(surface, wi.z > 0.0);
            let goes_on = met < params.mirror_rays && alpha >= 0.0 && is_followed(alpha);
            let branch = hash_end(hash_next(hash_next(hash_start(), stream), params.mirror_rays - met));
            let light = gathered(surface, wo, select(alpha, -1.0, goes_on), branch).received;
            var sent = light.irradiance * bsdf_diffuse_out(surface, wi) * FRAC_1_PI;
            sent += select(vec3(0.0), light.glossy * albedo, alpha >= 0.0 && !goes_on);
            let of_direct = hash_end(hash_next(hash_next(hash_start(), branch), STRAIGHT));
            sum += throughput * (sent + direct_at(hit, wo, Query(ALL_LOBES, 1.0), straight, of_direct));
            if !goes_on {
                break;
            }
        }
        var d = vec3(0.0);
        if MIRROR_SAMPLES == 0u {
            d = mirror_direction(surface, wo);
            throughput *= albedo;
        } else {
            let u = next_4d(&s);
            let drawn = scatter(surface, wi, vec3(0.0), u.z, u.xy, Query(NON_DIFFUSE, 1.0)).sample;
            if !(drawn.pdf > 0.0) {
                break;
            }
            d = to_world(surface.frame, drawn.wo);
            throughput *= drawn.weight;
        }
        hit = traverse(spawn(surface, d), false);
        if hit.triangle == NO_TRIANGLE {
            break;
        }
        wo = -d;
    }
    return keep_finite(sum);
}

@compute @workgroup_size(64)
fn follow_lobes(@builtin(global_invocation_id) id: vec3<u32>) {
    scene = scene_params;
    let i = params.first + id.x;
    if id.x >= params.count {
        return;
    }
    let pixel = view[i];
    if pixel.material == NOT_GLOSSY || !is_followed(pixel.alpha) {
        return;
    }
    let wo = towards_camera(params.camera, i);
    let marks = hash_end(hash_next(hash_next(hash_start(), params.seed), RAY));
    let stream = hash3(marks, params.frame, i);
    // All rays of a perfect mirror are the same.
    let count = select(max(MIRROR_SAMPLES, 1u), 1u, pixel.alpha == 0.0);
    let straight = (params.direct_samples + count - 1u) / count;
    var sum = vec3(0.0);
    for (var k = 0u; k < count; k++) {
        let of_ray = hash_end(hash_next(hash_next(hash_start(), stream), k));
        sum += along(hit_of(pixel.triangle, pixel.u, pixel.v), wo, straight, of_ray);
    }
    glossy[i] += vec4(sum / f32(count), 0.0);
}
