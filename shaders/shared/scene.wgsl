// The scene on the device: what every kernel that follows light paths binds as its group 1. Twin of src/gpu/scene/mod.rs: GpuScene.
//
// Four buffers. `tree` holds the nodes and, from `scene.corners` on, the primitives; `facets` the surfaces; `words` all tables, textures and
// the light map; `records` lists of structs in rows of four words. A record is read a member at a time: the constants below are the
// members' places in words, and ..._ROWS the rows of a record, as src/gpu/scene/ lays them out.

const NONE: u32 = 0xffffffffu;

// Pixels of an image.
struct Image {
    // First in `words`: one word a pixel (bytes), or three (floats).
    offset: u32,
    width: u32,
    height: u32,
    // Where in `words` the linear values of the 256 bytes are; NONE for floats.
    bytes: u32,
}

const CONSTANT: u32 = 0u;
const BITMAP: u32 = 1u;
const CHECKERBOARD: u32 = 2u;
// A checkerboard whose colours are the textures `image.offset` and `image.width`.
const CHECKERED: u32 = 3u;

const REPEAT: u32 = 0u;
const MIRROR: u32 = 1u;
const CLAMP: u32 = 2u;

const TEXTURE_ROWS: u32 = 5u;
// Rows of the affine map from the surface's uv to the texture's.
const TEXTURE_TO_U: u32 = 0u;
const TEXTURE_KIND: u32 = 3u;
const TEXTURE_TO_V: u32 = 4u;
const TEXTURE_WRAP: u32 = 7u;
// The constant, or the checkerboard's first colour.
const TEXTURE_COLOR0: u32 = 8u;
const TEXTURE_SCALE: u32 = 11u;
const TEXTURE_COLOR1: u32 = 12u;
const TEXTURE_NEAREST: u32 = 15u;
const TEXTURE_IMAGE: u32 = 16u;

// A scattering model; see models.wgsl for its kinds.
const MODEL_ROWS: u32 = 8u;
const MODEL_KIND: u32 = 0u;
// Microfacet family. Blend: whether the back scatters like the front.
const MODEL_DISTRIBUTION: u32 = 1u;
const MODEL_LOBES: u32 = 2u;
// Leaves of the tree that hangs from it.
const MODEL_LEAVES: u32 = 3u;
// Children: front and back, the nested model, or the two that are blended.
const MODEL_FIRST: u32 = 4u;
const MODEL_SECOND: u32 = 5u;
// Roughplastic: where its transmittance lies in `words`.
const MODEL_TABLE: u32 = 6u;
// Plastics: whether the base's colour saturates. Blend: which child alone has a diffuse lobe (0 or 1), or NONE.
const MODEL_OPTION: u32 = 7u;
// Of a metal; elsewhere x is the relative index of refraction.
const MODEL_ETA: u32 = 8u;
// Plastics: internal reflectance. Bump map: scale.
const MODEL_A: u32 = 11u;
const MODEL_K: u32 = 12u;
// Roughplastic: mean transmittance.
const MODEL_B: u32 = 15u;
// Twelve, of which there are so many as it has slots.
const MODEL_TEXTURES: u32 = 16u;
const MODEL_ALPHA: u32 = 28u;
const MODEL_SLOTS: u32 = 29u;

const TRANSMISSIVE: u32 = 1u;
const TWO_SIDED_FLAG: u32 = 2u;

const MATERIAL_ROWS: u32 = 1u;
const MATERIAL_MODEL: u32 = 0u;
// Texture of the opacity; NONE where there is none.
const MATERIAL_OPACITY: u32 = 1u;
const MATERIAL_LOBES: u32 = 2u;
const MATERIAL_FLAGS: u32 = 3u;

const AREA: u32 = 0u;
const POINT: u32 = 1u;
const SPOT: u32 = 2u;
const DIRECTIONAL: u32 = 3u;
const AT_INFINITY: u32 = 4u;

const EMITTER_ROWS: u32 = 4u;
const EMITTER_POSITION: u32 = 0u;
const EMITTER_KIND: u32 = 3u;
const EMITTER_DIRECTION: u32 = 4u;
// Area lights: texture of the radiance.
const EMITTER_TEXTURE: u32 = 7u;
// Intensity or irradiance.
const EMITTER_COLOR: u32 = 8u;
const EMITTER_CUTOFF: u32 = 11u;
const EMITTER_BEAM: u32 = 12u;
// Area lights: the first of its triangles among the lamps, and in the scene; NONE where it is never sampled.
const EMITTER_FIRST: u32 = 13u;
const EMITTER_START: u32 = 14u;

// What the light tree chooses from: a triangle of an area light, or (triangle NONE) a point or spot.
struct Near {
    triangle: u32,
    emitter: u32,
    // Of the whole, and negative, where the triangle stands for a parallelogram.
    area: f32,
    // Where it hangs in the light tree: eight times the node, plus the slot.
    place: u32,
}

// Twin: transport::light_tree::Node. Lists of eight, one after the other.
const LIGHT_NODE_ROWS: u32 = 25u;
const LIGHT_NODE_CENTRE: u32 = 0u;
const LIGHT_NODE_RADIUS_SQ: u32 = 24u;
const LIGHT_NODE_AXIS: u32 = 32u;
const LIGHT_NODE_COS_SPREAD: u32 = 56u;
const LIGHT_NODE_SIN_SPREAD: u32 = 64u;
const LIGHT_NODE_COS_REACH: u32 = 72u;
const LIGHT_NODE_POWER: u32 = 80u;
const LIGHT_NODE_CHILDREN: u32 = 88u;
const LIGHT_NODE_PARENT: u32 = 96u;

const ENVIRONMENT_ROWS: u32 = 9u;
// Columns of both rotations, a row each.
const ENVIRONMENT_WORLD_FROM_LOCAL: u32 = 0u;
const ENVIRONMENT_LOCAL_FROM_WORLD: u32 = 12u;
// Of a constant environment and of a sun, which have images without width. A sun has a scale, 1 - cos of its radius; columns 1 and 2 of
// its first rotation are up and the direction to its middle.
const ENVIRONMENT_COLOR: u32 = 24u;
const ENVIRONMENT_SCALE: u32 = 27u;
const ENVIRONMENT_IMAGE: u32 = 28u;
// Where the running sums over rows, those along each row, and the rows' sines lie in `words`.
const ENVIRONMENT_ROW_SUMS: u32 = 32u;
const ENVIRONMENT_COLUMN_SUMS: u32 = 33u;
const ENVIRONMENT_SINES: u32 = 34u;
const ENVIRONMENT_MEAN: u32 = 35u;

struct SceneParams {
    // The first row of each list in `records`.
    materials: u32,
    models: u32,
    textures: u32,
    emitters: u32,
    near: u32,
    light_nodes: u32,
    environments: u32,
    environment_count: u32,
    // Whether there is anything near to choose from.
    has_near: u32,
    suns: u32,
    // The first entry in `tree` of the primitives.
    corners: u32,
    // How many triangles are the scene's own; those that a frame adds come after them. The root of their tree; NONE where there are none.
    triangles: u32,
    added: u32,
    // Where in `words` lie the suns' emitters, the Sobol directions and the two tables of albedos.
    sun_list: u32,
    sobol: u32,
    albedo: u32,
    // Width and height of the light map; 0 where there is none. Where its sides begin in `words` (NONE where it has no back), three floats a
    // texel, and the triangles' corners in it.
    light_width: u32,
    light_height: u32,
    light_front: u32,
    light_back: u32,
    light_corners: u32,
    // Where in `words` it lies what of the environments is seen from where; NONE where that is not known.
    outlook: u32,
}

// Kernels begin with a copy, `scene = scene_params`: lavapipe loads a uniform anew wherever it is read, in the innermost loops too.
@group(1) @binding(0) var<uniform> scene_params: SceneParams;
var<private> scene: SceneParams;
// Five a node, then three a primitive, in the order of the tree's leaves. Their w hold the triangle, its material if that lets rays through,
// and its object. What a frame adds comes after, nodes and primitives numbered as the scene's own.
@group(1) @binding(1) var<storage, read> tree: array<vec4<u32>>;
// Seven a triangle: see surface.wgsl.
@group(1) @binding(2) var<storage, read> facets: array<vec4<u32>>;
@group(1) @binding(3) var<storage, read> words: array<u32>;
@group(1) @binding(4) var<storage, read> records: array<vec4<u32>>;

// Whether a triangle is of a shape that a frame adds. Twin: transport::World::is_added.
fn is_added(triangle: u32) -> bool {
    return triangle >= scene.triangles;
}

fn word_f32(i: u32) -> f32 {
    return bitcast<f32>(words[i]);
}

fn sobol_vector(i: u32) -> vec4<u32> {
    let at = scene.sobol + 4u * i;
    return vec4(words[at], words[at + 1u], words[at + 2u], words[at + 3u]);
}

// A member of the record that begins at a row.
fn record_u32(row: u32, member: u32) -> u32 {
    return records[row + (member >> 2u)][member & 3u];
}

fn record_f32(row: u32, member: u32) -> f32 {
    return bitcast<f32>(record_u32(row, member));
}

// Vectors begin rows.
fn record_vec3(row: u32, member: u32) -> vec3<f32> {
    return bitcast<vec3<f32>>(records[row + (member >> 2u)].xyz);
}

fn record_image(row: u32, member: u32) -> Image {
    let image = records[row + (member >> 2u)];
    return Image(image.x, image.y, image.z, image.w);
}

fn material_u32(i: u32, member: u32) -> u32 {
    return record_u32(scene.materials + MATERIAL_ROWS * i, member);
}

fn model_u32(i: u32, member: u32) -> u32 {
    return record_u32(scene.models + MODEL_ROWS * i, member);
}

fn model_f32(i: u32, member: u32) -> f32 {
    return record_f32(scene.models + MODEL_ROWS * i, member);
}

fn model_vec3(i: u32, member: u32) -> vec3<f32> {
    return record_vec3(scene.models + MODEL_ROWS * i, member);
}

fn texture_u32(i: u32, member: u32) -> u32 {
    return record_u32(scene.textures + TEXTURE_ROWS * i, member);
}

fn texture_f32(i: u32, member: u32) -> f32 {
    return record_f32(scene.textures + TEXTURE_ROWS * i, member);
}

fn texture_vec3(i: u32, member: u32) -> vec3<f32> {
    return record_vec3(scene.textures + TEXTURE_ROWS * i, member);
}

fn texture_image(i: u32) -> Image {
    return record_image(scene.textures + TEXTURE_ROWS * i, TEXTURE_IMAGE);
}

fn emitter_u32(i: u32, member: u32) -> u32 {
    return record_u32(scene.emitters + EMITTER_ROWS * i, member);
}

fn emitter_f32(i: u32, member: u32) -> f32 {
    return record_f32(scene.emitters + EMITTER_ROWS * i, member);
}

fn emitter_vec3(i: u32, member: u32) -> vec3<f32> {
    return record_vec3(scene.emitters + EMITTER_ROWS * i, member);
}

fn near_at(i: u32) -> Near {
    let near = records[scene.near + i];
    return Near(near.x, near.y, bitcast<f32>(near.z), near.w);
}

fn environment_u32(i: u32, member: u32) -> u32 {
    return record_u32(scene.environments + ENVIRONMENT_ROWS * i, member);
}

fn environment_f32(i: u32, member: u32) -> f32 {
    return record_f32(scene.environments + ENVIRONMENT_ROWS * i, member);
}

fn environment_vec3(i: u32, member: u32) -> vec3<f32> {
    return record_vec3(scene.environments + ENVIRONMENT_ROWS * i, member);
}

fn environment_image(i: u32) -> Image {
    return record_image(scene.environments + ENVIRONMENT_ROWS * i, ENVIRONMENT_IMAGE);
}

fn environment_rotation(i: u32, member: u32) -> mat3x3<f32> {
    return mat3x3(environment_vec3(i, member), environment_vec3(i, member + 4u), environment_vec3(i, member + 8u));
}
