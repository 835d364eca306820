// Twin of src/method/glossy_probes/gather.rs: view_albedo.
// Light that the diffuse lobe sends to the camera (lightmap::LightMap::diffuse_radiance), and the glossy lobe's directional albedo.

// #include "shared/camera_ray.wgsl"
// #include "shared/factors.wgsl"
// #include "shared/view.wgsl"

struct Params {
    camera: Camera,
    // Of the probes; negative where nobody asks for the view's albedo.
    roughness_scale: f32,
    padding0: u32,
    padding1: u32,
    padding2: u32,
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> view: array<Pixel>;
@group(0) @binding(2) var<storage, read_write> shading: array<Shading>;

@compute @workgroup_size(8, 8)
fn view_factors(@builtin(global_invocation_id) id: vec3<u32>) {
    scene = scene_params;
    let camera = params.camera;
    if id.x >= camera.width || id.y >= camera.height {
        return;
    }
    let i = id.y * camera.width + id.x;
    var factors = Factors(vec3(0.0), vec3(0.0));
    if view[i].triangle != NO_TRIANGLE {
        let ray = camera_ray(camera, vec2<f32>(id.xy) + 0.5, vec2(0.5));
        let s = surface_at(hit_of(view[i].triangle, view[i].u, view[i].v));
        let wants_albedo = view[i].material != NOT_GLOSSY;
        factors = factors_of(s, to_local(s.frame, -ray.direction), select(-1.0, params.roughness_scale, wants_albedo));
    }
    shading[i].diffuse = factors.diffuse;
    shading[i].albedo = factors.albedo;
}
