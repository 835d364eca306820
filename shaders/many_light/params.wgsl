// What the passes of a frame by many lights are told. Twins: method::many_light::params, and gpu::Params beside it.

// #include "shared/camera.wgsl"

struct Params {
    camera: Camera,
    seed: u32,
    frame: u32,
    // A run of lights, of clusters, of a grid's pixels or of the list of those to be lit.
    first: u32,
    count: u32,
    lights: u32,
    // Nodes that a traversal sees.
    nodes: u32,
    // Samples of emitters, a light.
    samples: u32,
    // Reflections so far.
    bounce: u32,
    sphere: f32,
    clamp: f32,
    min_exponent: f32,
    max_exponent: f32,
    // Whether lights have glossy lobes.
    lobes: u32,
    // Clusters of the tree; the last is that of all lights.
    clusters: u32,
    // Of all lights.
    area: f32,
    solid_angle: f32,
    near: f32,
    horizon: f32,
    fill: f32,
    mirror_alpha: f32,
    mirror_rays: u32,
    direct_samples: u32,
    // Distance of a grid's pixels, and how many grids are coarser.
    step: u32,
    level: u32,
    // Whether pixels of a finer grid are interpolated whatever they show.
    bilateral: u32,
    lambda: f32,
    threshold: f32,
    // Of the scene's bounding box, metres.
    diagonal: f32,
}

@group(0) @binding(0) var<uniform> params: Params;

// Whether rays follow a lobe of this alpha.
fn is_followed(alpha: f32) -> bool {
    return params.mirror_rays > 0u && alpha <= params.mirror_alpha;
}
