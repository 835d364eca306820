// Twin of src/method/light_field_probes/shade.rs: direct.
// Where the paths of follow.wgsl begin that bring light straight from emitters to a run of pixels. Of the diffuse layer also the albedo
// is noted.

// #include "light_field_probes/params.wgsl"
// #include "shared/bsdf.wgsl"
// #include "shared/random.wgsl"
// #include "shared/camera_ray.wgsl"
// #include "shared/view.wgsl"
// #include "shared/start.wgsl"

@group(0) @binding(1) var<storage, read> view: array<Pixel>;
// Its diffuse light is the albedo until lit_diffuse.wgsl has lit it.
@group(0) @binding(2) var<storage, read_write> shading: array<Shading>;
@group(0) @binding(3) var<storage, read_write> starts: array<PathStart>;

@compute @workgroup_size(64)
fn direct_starts(@builtin(global_invocation_id) id: vec3<u32>) {
    scene = scene_params;
    params = field_params;
    if id.x >= params.pixels {
        return;
    }
    let pixel = params.first_pixel + id.x;
    let wo = towards_camera(params.camera, pixel);
    let seen = view[pixel];
    var is_lit = seen.material != NOT_GLOSSY;
    if params.what == DIFFUSE_LIGHT {
        var albedo = vec3(0.0);
        if seen.triangle != NO_TRIANGLE {
            let s = surface_at(hit_of(seen.triangle, seen.u, seen.v));
            albedo = bsdf_diffuse_albedo(s, to_local(s.frame, wo));
        }
        shading[pixel].diffuse = albedo;
        is_lit = any(albedo != vec3(0.0));
    }
    let stream = hash3(params.seed, params.frame, pixel);
    starts[id.x] = PathStart(select(NO_TRIANGLE, seen.triangle, is_lit), seen.u, seen.v, stream, wo, 0u, params.all_samples);
}
