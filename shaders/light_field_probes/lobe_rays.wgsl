// Twin of src/method/light_field_probes/lobe.rs: along_lobe.
// Rays along the glossy lobes of a run of pixels: the first sample of all pixels, then the next.

// #include "light_field_probes/params.wgsl"
// #include "light_field_probes/lobe_ray.wgsl"
// #include "shared/bsdf.wgsl"
// #include "shared/random.wgsl"
// #include "shared/camera_ray.wgsl"
// #include "shared/view.wgsl"

// Branch of a pixel's random stream.
const LOBE_BRANCH: u32 = 3u;

@group(0) @binding(1) var<storage, read> view: array<Pixel>;
@group(0) @binding(2) var<storage, read_write> rays: array<LobeRay>;

@compute @workgroup_size(64)
fn lobe_rays(@builtin(global_invocation_id) id: vec3<u32>) {
    scene = scene_params;
    params = field_params;
    if id.x >= params.pixels * params.samples {
        return;
    }
    let pixel = params.first_pixel + id.x % params.pixels;
    let seen = view[pixel];
    if seen.material == NOT_GLOSSY {
        rays[id.x].lives = 0u;
        return;
    }
    let wo = towards_camera(params.camera, pixel);
    let s = surface_at(hit_of(seen.triangle, seen.u, seen.v));
    let stream = hash3(params.seed, params.frame, pixel);
    var draws = branch(sampler_new(stream, params.first_sample + id.x / params.pixels), LOBE_BRANCH);
    let v = next_4d(&draws);
    let wi = to_local(s.frame, wo);
    // Nothing is asked towards a light; the mirror direction is as good as any.
    let drawn = scatter(s, wi, vec3(-wi.xy, wi.z), v.z, v.xy, Query(NON_DIFFUSE, 1.0)).sample;
    let ray = spawn(s, to_world(s.frame, drawn.wo));
    var omega = 0.0;
    if !drawn.delta && drawn.pdf > 0.0 {
        omega = params.field.footprint / (drawn.pdf * f32(params.all_samples));
    }
    rays[id.x] = LobeRay(ray.origin, omega, ray.direction, select(0u, 1u, drawn.pdf > 0.0), drawn.weight, 0u);
}
