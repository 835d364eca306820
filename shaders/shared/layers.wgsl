// Twin of src/view/composite.rs: downsample.
// The frame's layers: the means of their sub-pixels, what perfect mirrors show (mirror_light::add_mirrored) included.

// #include "shared/view.wgsl"
// #include "shared/layer_pixel.wgsl"

struct Params {
    width: u32,
    height: u32,
    // Sub-pixels of a pixel each way.
    supersample: u32,
    // Whether `glossy` lacks what perfect mirrors show.
    mirrors: u32,
}

// The kernel begins with a copy: see scene.wgsl.
@group(0) @binding(0) var<uniform> layer_params: Params;
var<private> params: Params;
@group(0) @binding(1) var<storage, read> shading: array<Shading>;
@group(0) @binding(2) var<storage, read> glossy: array<vec4<f32>>;
// What perfect mirrors show: see mirror_light.wgsl.
@group(0) @binding(3) var<storage, read> mirrored_light: array<vec4<f32>>;
@group(0) @binding(4) var<storage, read_write> frame: array<LayerPixel>;

@compute @workgroup_size(16, 4)
fn layers(@builtin(global_invocation_id) id: vec3<u32>) {
    params = layer_params;
    let n = params.supersample;
    if id.x >= params.width / n || id.y >= params.height / n {
        return;
    }
    var emission = vec3(0.0);
    var diffuse = vec3(0.0);
    var sum = vec3(0.0);
    for (var k = 0u; k < n * n; k++) {
        let i = (id.y * n + k / n) * params.width + id.x * n + k % n;
        emission += shading[i].emission;
        diffuse += shading[i].diffuse;
        var shown = glossy[i].rgb;
        if params.mirrors != 0u {
            shown = max(shown + mirrored_light[i].rgb * shading[i].albedo, vec3(0.0));
        }
        sum += shown;
    }
    let scale = 1.0 / f32(n * n);
    let out = id.y * (params.width / n) + id.x;
    frame[out] = LayerPixel(vec4(emission * scale, 0.0), vec4(diffuse * scale, 0.0), vec4(sum * scale, 0.0));
}
