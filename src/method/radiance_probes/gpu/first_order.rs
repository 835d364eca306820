//! Views lit by radiance of first order on a device: the twin of what [`super::super::shade`] makes of sh1.

use crate::gpu::camera::CAMERA;
use crate::gpu::spec::Access::{Read, ReadWrite, Uniform};
use crate::gpu::spec::KernelSpec;
use crate::gpu::view::pixel_run::PIXEL_RUN;
use crate::gpu::view::{PIXEL, REFLECTED, SHADING};

/// The glossy layer, and the diffuse one but for light straight from emitters.
pub(crate) const FIRST_ORDER: KernelSpec = KernelSpec {
    file: "radiance_probes/first_order.wgsl",
    twin: "src/method/radiance_probes/shade.rs: taken_in",
    workgroup: [64, 1],
    scene: true,
    bindings: &[("params", Uniform), ("view", Read), ("shading", ReadWrite), ("glossy", ReadWrite)],
    structs: &[&PIXEL_RUN, &CAMERA, &PIXEL, &REFLECTED, &SHADING],
};
