// Twin of src/view/mirror_light.rs: mirror_chain.
// What mirrors show of lamps, of the environment and of diffuse light.

// #include "shared/camera_ray.wgsl"
// #include "shared/factors.wgsl"
// #include "shared/lights.wgsl"
// #include "shared/mirror.wgsl"

struct MirrorLightParams {
    camera: Camera,
    // Of this dispatch.
    first_row: u32,
    // Mirror rays in a row.
    rays: u32,
    // Alpha up to which what a ray meets is taken for a mirror.
    max_alpha: f32,
    // Alpha up to which the pixel's own surface is.
    max_first_alpha: f32,
}

@group(0) @binding(0) var<uniform> chain: MirrorLightParams;
@group(0) @binding(1) var<storage, read> view: array<Pixel>;
// Radiance along the mirror direction, and distance to the first hit; FAR for the environment.
@group(0) @binding(2) var<storage, read_write> mirrored_light: array<vec4<f32>>;

@compute @workgroup_size(8, 8)
fn mirror_light(@builtin(global_invocation_id) id: vec3<u32>) {
    scene = scene_params;
    let camera = chain.camera;
    let y = id.y + chain.first_row;
    if id.x >= camera.width || y >= camera.height {
        return;
    }
    let i = y * camera.width + id.x;
    var light = vec3(0.0);
    var distance = FAR;
    if view[i].material != NOT_GLOSSY {
        var hit = hit_of(view[i].triangle, view[i].u, view[i].v);
        var wo = -camera_ray(camera, vec2(f32(id.x), f32(y)) + 0.5, vec2(0.5)).direction;
        var throughput = vec3(1.0);
        for (var bounce = 0u; bounce <= chain.rays; bounce++) {
            let s = surface_at(hit);
            let wi = to_local(s.frame, wo);
            let alpha = view_alpha(s, wi.z > 0.0);
            if bounce > 0u {
                if s.emitter != NONE && wi.z > 0.0 {
                    light += throughput * emitted(s);
                }
                let factors = factors_of(s, wi, 1.0);
                light += throughput * factors.diffuse;
                throughput *= factors.albedo;
            }
            if !(alpha >= 0.0 && alpha <= select(chain.max_alpha, chain.max_first_alpha, bounce == 0u)) || bounce == chain.rays {
                break;
            }
            let ray = spawn(s, mirror_direction(s, wo));
            hit = traverse(ray, false);
            if hit.triangle == NO_TRIANGLE {
                light += throughput * environment(ray.direction);
                break;
            }
            distance = select(distance, hit.t, bounce == 0u);
            wo = -ray.direction;
        }
    }
    mirrored_light[i] = vec4(light, distance);
}
