// Perspective and thin-lens cameras. Twin: src/scene/camera.rs.

struct Camera {
    // Columns of the camera-to-world rotation, then where the camera stands.
    x: vec3<f32>,
    focal_px: f32,
    y: vec3<f32>,
    aperture_radius: f32,
    z: vec3<f32>,
    focus_distance: f32,
    position: vec3<f32>,
    width: u32,
    height: u32,
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
