// What a view's planes hold, a pixel an entry. Twins: render::gbuffer::Pixel and render::mirror::Reflected. Planes: gpu::render::View.
//
// positions: the surface seen, and alpha. normals: the shading normal on the camera's side, and the distance to the camera.
// materials: NOT_GLOSSY where the pixel has no glossy lobe.

const NOT_GLOSSY: u32 = 0xffffffffu;
// Among the materials of reflected hits: the mirror ray left the scene; there is no reflector.
const SKY: u32 = 0xfffeu;
const NOTHING: u32 = 0xffffu;

struct Reflected {
    // World position of the reflected hit; the unit direction towards it for SKY.
    point: vec3<f32>,
    material: u32,
}

// Unit direction of the reflected ray that leaves the reflector.
fn direction_from(r: Reflected, reflector: vec3<f32>) -> vec3<f32> {
    if r.material == SKY {
        return r.point;
    }
    return normalize_or(r.point - reflector, vec3(0.0, 1.0, 0.0));
}

// Distance d_r from the reflector to the reflected hit.
fn distance_from(r: Reflected, reflector: vec3<f32>) -> f32 {
    return select(distance(r.point, reflector), FAR, r.material == SKY);
}
