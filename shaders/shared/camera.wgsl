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

// World to camera, for directions.
fn camera_local(camera: Camera, v: vec3<f32>) -> vec3<f32> {
    return vec3(dot(camera.x, v), dot(camera.y, v), dot(camera.z, v));
}

// The pixel that the camera sees p at in x and y; z is negative behind the camera.
fn project(camera: Camera, p: vec3<f32>) -> vec3<f32> {
    let local = camera_local(camera, p - camera.position);
    let half_size = 0.5 * vec2(f32(camera.width), f32(camera.height));
    return vec3(half_size - local.xy * (camera.focal_px / max(local.z, 1e-30)), select(-1.0, 1.0, local.z > 0.0));
}
