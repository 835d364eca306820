// Rays through a camera's pixels. Twin: scene::Camera::ray.

// #include "shared/surface.wgsl"
// #include "shared/microfacet.wgsl"
// #include "shared/camera.wgsl"

// The unit direction from what the middle of pixel number `pixel` shows towards the camera, whose lens is a point then.
fn towards_camera(camera: Camera, pixel: u32) -> vec3<f32> {
    let at = vec2(f32(pixel % camera.width), f32(pixel / camera.width)) + 0.5;
    return -camera_ray(camera, at, vec2(0.5)).direction;
}

fn camera_ray(camera: Camera, pixel: vec2<f32>, lens: vec2<f32>) -> Ray {
    let half_size = vec2(f32(camera.width), f32(camera.height)) * 0.5;
    let d = vec3(half_size - pixel, camera.focal_px);
    if camera.aperture_radius == 0.0 {
        return Ray(camera.position, 0.0, normalize(camera.x * d.x + camera.y * d.y + camera.z * d.z), FAR);
    }
    let o = vec3(disk(lens) * camera.aperture_radius, 0.0);
    let t = d * (camera.focus_distance / d.z) - o;
    let origin = camera.position + camera.x * o.x + camera.y * o.y;
    return Ray(origin, 0.0, normalize(camera.x * t.x + camera.y * t.y + camera.z * t.z), FAR);
}
