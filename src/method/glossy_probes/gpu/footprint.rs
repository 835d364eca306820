//! The filter's footprint (§6.1): the twin of [`crate::method::glossy_probes::footprint`].

use crate::gpu::Gpu;
use crate::gpu::camera::{CAMERA, GpuCamera};
use crate::gpu::commands::Commands;
use crate::gpu::kernel::Kernel;
use crate::gpu::spec::Access::{Read, ReadWrite, Uniform};
use crate::gpu::spec::{KernelSpec, StructLayout, layout};
use crate::gpu::view::{PIXEL, REFLECTED, SHADING, ViewBuffers};
use crate::method::glossy_probes::footprint;
use crate::method::glossy_probes::footprint::Foreshortening;
use crate::{Result, scene};
use bytemuck::{Pod, Zeroable};

/// Kinds of foreshortening, as the shader numbers them.
pub(crate) const NONE: u32 = 0;
pub(crate) const PAPER: u32 = 1;
pub(crate) const DERIVED: u32 = 2;
pub(crate) const CURVED: u32 = 3;

/// What the shader's `Params` holds.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct Params {
    camera: GpuCamera,
    roughness_scale: f32,
    small_d_r: f32,
    foreshortening: u32,
    padding: u32,
}

/// The kernel.
pub(crate) const FOOTPRINT: KernelSpec = KernelSpec {
    file: "glossy_probes/footprint.wgsl",
    twin: "src/method/glossy_probes/footprint/mod.rs: covariance",
    workgroup: [16, 4],
    scene: false,
    bindings: &[("footprint_params", Uniform), ("table", Read), ("view", Read), ("shading", Read), ("covariances", ReadWrite)],
    structs: &[&PARAMS, &CAMERA, &PIXEL, &REFLECTED, &SHADING],
};
const PARAMS: StructLayout = layout!(Params as "Params" { camera, roughness_scale, small_d_r, foreshortening });

/// The kernel with its table.
pub(crate) struct Footprint {
    kernel: Kernel,
    table: wgpu::Buffer,
    params: footprint::FootprintParams,
}

impl Footprint {
    pub(crate) fn new(gpu: &Gpu, footprint: &footprint::Footprint) -> Result<Self> {
        Ok(Self {
            kernel: Kernel::new(gpu, &FOOTPRINT)?,
            table: gpu.upload("the footprint's table", bytemuck::cast_slice(&footprint.table))?,
            params: footprint.params,
        })
    }

    /// Writes the view's covariances.
    pub(crate) fn run(
        &self,
        gpu: &Gpu,
        commands: &mut Commands,
        camera: &scene::Camera,
        view: &ViewBuffers,
        covariances: &wgpu::Buffer,
    ) -> Result<()> {
        let params = Params {
            camera: camera.into(),
            roughness_scale: self.params.roughness_scale,
            small_d_r: self.params.small_d_r,
            foreshortening: match self.params.foreshortening {
                Foreshortening::None => NONE,
                Foreshortening::Paper => PAPER,
                Foreshortening::Derived => DERIVED,
                Foreshortening::Curved => CURVED,
            },
            padding: 0,
        };
        let params = gpu.uniform("the footprint's parameters", &params)?;
        let buffers = [&params, &self.table, &view.pixels, &view.shading, covariances];
        commands.run("footprint", &self.kernel, &buffers, view.size);
        Ok(())
    }
}
