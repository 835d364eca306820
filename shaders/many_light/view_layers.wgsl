// Twin of src/method/many_light/shade.rs: layers.
// The layers of a run of pixels: indirect light by its albedos, and of the glossy one also light straight from emitters.

// #include "many_light/lit_pixel.wgsl"
// #include "shared/glossy_direct.wgsl"
// #include "shared/view.wgsl"

@group(0) @binding(1) var<storage, read> view: array<Pixel>;
@group(0) @binding(2) var<storage, read_write> shading: array<Shading>;
@group(0) @binding(3) var<storage, read_write> glossy: array<vec4<f32>>;
@group(0) @binding(4) var<storage, read> lit: array<LitPixel>;

@compute @workgroup_size(64)
fn view_layers(@builtin(global_invocation_id) id: vec3<u32>) {
    scene = scene_params;
    let i = params.first_pixel + id.x;
    if id.x >= params.pixels {
        return;
    }
    glossy[i] = vec4(0.0);
    let pixel = view[i];
    if pixel.triangle == NO_TRIANGLE {
        return;
    }
    let hit = hit_of(pixel.triangle, pixel.u, pixel.v);
    let s = surface_at(hit);
    let wo = towards_camera(params.camera, i);
    shading[i].diffuse = lit[i].irradiance * bsdf_diffuse_out(s, to_local(s.frame, wo)) * FRAC_1_PI;
    if pixel.material != NOT_GLOSSY {
        glossy[i] = vec4(lit[i].glossy * shading[i].albedo + glossy_direct(hit, wo, i), 0.0);
    }
}
