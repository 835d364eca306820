// What the glossy filter's kernels (§6.3) share. Twin: src/method/glossy_probes/filter/four_pass.rs.
//
// filter_start.wgsl weighs the colours by their confidence and finds each pixel's axes, filter_pass.wgsl makes of each value the mean over its
// line, filter_end.wgsl divides the weights out and adds one Gaussian's share.

// #include "shared/view.wgsl"

struct Params {
    width: u32,
    height: u32,
    // The line is the major axis, or else the minor one.
    along_major: u32,
    // Of the standard deviations.
    scale: f32,
    depth_threshold: f32,
    min_normal_cos: f32,
    radius_sigmas: f32,
    max_radius: f32,
    steps: f32,
    min_sigma: f32,
    // Lower clamp of the energy; FAR for no confidence.
    min_energy: f32,
    // A pass's share of the variance.
    split: f32,
    // Of the kernel's volume.
    share: f32,
    // Whether the share is the first.
    is_first: u32,
}

// The kernel begins with a copy: see scene.wgsl.
@group(0) @binding(0) var<uniform> filter_params: Params;
var<private> params: Params;
@group(0) @binding(1) var<storage, read> view: array<Pixel>;
