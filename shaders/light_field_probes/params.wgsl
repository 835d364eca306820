// What all passes of light field probes know. Twins: src/method/light_field_probes/{mod,shade,store}.rs.

// #include "shared/camera.wgsl"

// The probes, and how they are asked.
struct Field {
    // Of a grid: its first probe, and the distance of neighbours.
    origin: vec3<f32>,
    probes: u32,
    spacing: vec3<f32>,
    // Texels along an edge of the maps.
    size: u32,
    // Probes along each axis of a grid; 0 where they stand in none.
    counts: vec3<u32>,
    ambient_size: u32,
    // The octree's cube, and the first rows of its sets and nodes in `places`.
    lower: vec3<f32>,
    edge: f32,
    sets: u32,
    nodes: u32,
    // TWO_SCALE or HI_Z.
    search: u32,
    thickness: f32,
    footprint: f32,
    // Length of rays, metres.
    far: f32,
    padding0: u32,
    padding1: u32,
}

struct Params {
    camera: Camera,
    field: Field,
    seed: u32,
    frame: u32,
    // A run of the view's pixels.
    first_pixel: u32,
    pixels: u32,
    // Of each of them: the first sample of this dispatch, how many it has, and how many there are in all.
    first_sample: u32,
    samples: u32,
    all_samples: u32,
    // DIFFUSE_LIGHT, GLOSSY_LIGHT or RAYS.
    what: u32,
}

// What is sampled: direct light of either layer, or rays along the glossy lobes.
const DIFFUSE_LIGHT: u32 = 0u;
const GLOSSY_LIGHT: u32 = 1u;
const RAYS: u32 = 2u;

// Kernels begin with a copy: see scene.wgsl.
@group(0) @binding(0) var<uniform> field_params: Params;
var<private> params: Params;
