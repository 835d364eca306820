// The scene on the device: what every kernel that follows light paths binds as its group 1. Twin: src/gpu/scene.rs.

const NONE: u32 = 0xffffffffu;

// Pixels of an image.
struct Image {
    // First word in `pixels`: one a pixel (bytes), or three (floats).
    offset: u32,
    width: u32,
    height: u32,
    // Where in `tables` the linear values of the 256 bytes are; NONE for floats.
    bytes: u32,
}

const CONSTANT: u32 = 0u;
const BITMAP: u32 = 1u;
const CHECKERBOARD: u32 = 2u;
const CHECKERED: u32 = 3u;

const REPEAT: u32 = 0u;
const MIRROR: u32 = 1u;
const CLAMP: u32 = 2u;

struct Texture {
    // Rows of the affine map from the surface's uv to the texture's.
    to_u: vec3<f32>,
    kind: u32,
    to_v: vec3<f32>,
    wrap: u32,
    // The constant, or the checkerboard's first colour.
    color0: vec3<f32>,
    scale: f32,
    color1: vec3<f32>,
    nearest: u32,
    image: Image,
}

// A scattering model; see bsdf.wgsl for its kinds.
struct Model {
    kind: u32,
    // Microfacet family. Blend: whether the back scatters like the front.
    distribution: u32,
    lobes: u32,
    // Leaves of the tree that hangs from it.
    leaves: u32,
    // Children: front and back, the nested model, or the two that are blended.
    first: u32,
    second: u32,
    // Roughplastic: where its transmittance lies in `tables`.
    table: u32,
    // Plastics: whether the base's colour saturates. Blend: which child alone has a diffuse lobe (0 or 1), or NONE.
    option: u32,
    // Of a metal; elsewhere x is the relative index of refraction.
    eta: vec3<f32>,
    // Plastics: internal reflectance. Bump map: scale.
    a: f32,
    k: vec3<f32>,
    // Roughplastic: mean transmittance.
    b: f32,
    textures: array<u32, 12>,
    alpha: f32,
    // How many of the textures there are.
    slots: u32,
    padding0: u32,
    padding1: u32,
}

const TRANSMISSIVE: u32 = 1u;
const TWO_SIDED_FLAG: u32 = 2u;

struct Material {
    model: u32,
    // Texture of the opacity; NONE where there is none.
    opacity: u32,
    lobes: u32,
    flags: u32,
}

const AREA: u32 = 0u;
const POINT: u32 = 1u;
const SPOT: u32 = 2u;
const DIRECTIONAL: u32 = 3u;
const AT_INFINITY: u32 = 4u;

struct Emitter {
    position: vec3<f32>,
    kind: u32,
    direction: vec3<f32>,
    // Area lights: texture of the radiance.
    texture: u32,
    // Intensity or irradiance.
    color: vec3<f32>,
    cutoff: f32,
    beam: f32,
    // Area lights: the first of its triangles in `near`, and in the scene; NONE where it is never sampled.
    first: u32,
    start: u32,
    padding: u32,
}

// What the light tree chooses from: a triangle of an area light, or (triangle NONE) a point or spot.
struct Near {
    triangle: u32,
    emitter: u32,
    area: f32,
    padding: u32,
}

// Twin: transport::light_tree::Node, byte for byte.
struct LightNode {
    centre: array<array<f32, 8>, 3>,
    radius_sq: array<f32, 8>,
    axis: array<array<f32, 8>, 3>,
    cos_spread: array<f32, 8>,
    sin_spread: array<f32, 8>,
    cos_reach: array<f32, 8>,
    power: array<f32, 8>,
    children: array<u32, 8>,
    parent: array<u32, 2>,
}

struct Environment {
    // Columns of both rotations.
    world_from_local: array<vec4<f32>, 3>,
    local_from_world: array<vec4<f32>, 3>,
    // Of a constant environment, which has an image without width.
    color: vec3<f32>,
    scale: f32,
    image: Image,
    // Where the running sums over rows, those along each row, and the rows' sines lie in `tables`.
    rows: u32,
    columns: u32,
    sines: u32,
    mean: f32,
}

struct SceneParams {
    environments: u32,
    suns: u32,
    // Where the suns' emitters are listed in `tables`.
    sun_list: u32,
    has_near: u32,
    // Where the Sobol directions and the two tables of albedos lie in `tables`.
    sobol: u32,
    albedo: u32,
    // Width and height of the light map; 0 where there is none. Where its back begins in `light_texels`, or NONE.
    light_width: u32,
    light_height: u32,
    light_back: u32,
}

// Five a node.
@group(1) @binding(0) var<storage, read> nodes: array<vec4<u32>>;
// Three a primitive, in the order of the tree's leaves. The w hold the triangle, its material if that lets rays through, and its object.
@group(1) @binding(1) var<storage, read> corners: array<vec4<u32>>;
// Seven a triangle: see surface.wgsl.
@group(1) @binding(2) var<storage, read> facets: array<vec4<u32>>;
@group(1) @binding(3) var<storage, read> materials: array<Material>;
@group(1) @binding(4) var<storage, read> models: array<Model>;
@group(1) @binding(5) var<storage, read> textures: array<Texture>;
@group(1) @binding(6) var<storage, read> pixels: array<u32>;
@group(1) @binding(7) var<storage, read> tables: array<u32>;
@group(1) @binding(8) var<storage, read> emitters: array<Emitter>;
@group(1) @binding(9) var<storage, read> near: array<Near>;
@group(1) @binding(10) var<storage, read> light_nodes: array<LightNode>;
// Node and slot of each entry of `near`.
@group(1) @binding(11) var<storage, read> light_places: array<vec2<u32>>;
@group(1) @binding(12) var<storage, read> environments: array<Environment>;
@group(1) @binding(13) var<storage, read> scene: SceneParams;
// Three floats a texel, the front and then the back.
@group(1) @binding(14) var<storage, read> light_texels: array<f32>;
// Three a triangle: its corners in the light map; NaN (as bits) where it has no light.
@group(1) @binding(15) var<storage, read> light_corners: array<vec2<f32>>;

fn table_f32(i: u32) -> f32 {
    return bitcast<f32>(tables[i]);
}

fn sobol_vector(i: u32) -> vec4<u32> {
    let at = scene.sobol + 4u * i;
    return vec4(tables[at], tables[at + 1u], tables[at + 2u], tables[at + 3u]);
}
