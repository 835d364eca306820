// Twin of src/view/mirror.rs: mirror_pass.
// Mirror hits of the pixels with a glossy lobe.

// #include "shared/camera_ray.wgsl"
// #include "shared/mirror.wgsl"

@group(0) @binding(0) var<uniform> camera: Camera;
@group(0) @binding(1) var<storage, read_write> view: array<Pixel>;

@compute @workgroup_size(8, 8)
fn mirror_pass(@builtin(global_invocation_id) id: vec3<u32>) {
    scene = scene_params;
    if id.x >= camera.width || id.y >= camera.height {
        return;
    }
    let i = id.y * camera.width + id.x;
    var reflected = Reflected(vec3(0.0), NOTHING);
    if view[i].material != NOT_GLOSSY {
        let ray = camera_ray(camera, vec2<f32>(id.xy) + 0.5, vec2(0.5));
        reflected = mirror_hit(surface_at(hit_of(view[i].triangle, view[i].u, view[i].v)), -ray.direction);
    }
    view[i].reflected = reflected;
}
