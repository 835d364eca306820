// Twin of src/method/many_light/shade.rs: light.
// Indirect light at a run of the pixels that are listed.

// #include "many_light/lit_pixel.wgsl"
// #include "many_light/receive.wgsl"
// #include "shared/camera_ray.wgsl"
// #include "shared/view.wgsl"

// Marks random numbers of gathers at pixels.
const PIXEL: u32 = 0x70697865u;

@group(0) @binding(4) var<storage, read> view: array<Pixel>;
@group(0) @binding(5) var<storage, read_write> lit: array<LitPixel>;

@compute @workgroup_size(64)
fn light_pixels(@builtin(global_invocation_id) id: vec3<u32>) {
    scene = scene_params;
    let place = params.first + id.x;
    if id.x >= params.count || lit[place].listed == 0u {
        return;
    }
    let i = lit[place].listed - 1u;
    lit[place].listed = 0u;
    let pixel = view[i];
    let wo = towards_camera(params.camera, i);
    let is_gathered = pixel.material != NOT_GLOSSY && !is_followed(pixel.alpha);
    let marks = hash_next(hash_next(hash_next(hash_start(), params.seed), params.frame), PIXEL);
    let surface = surface_at(hit_of(pixel.triangle, pixel.u, pixel.v));
    let found = gathered(surface, wo, select(-1.0, pixel.alpha, is_gathered), hash_end(hash_next(marks, i)));
    lit[i].irradiance = found.received.irradiance;
    lit[i].glossy = found.received.glossy;
    lit[i].visited = found.visited;
}
