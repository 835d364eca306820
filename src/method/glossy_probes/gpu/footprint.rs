//! The filter's footprint (§6.1): the twin of [`crate::method::glossy_probes::footprint`].

use crate::gpu::Gpu;
use crate::gpu::camera::GpuCamera;
use crate::gpu::commands::Commands;
use crate::gpu::kernel::{Kernel, groups, shader};
use crate::gpu::view::{View, WORKGROUP};
use crate::method::glossy_probes::footprint;
use crate::method::glossy_probes::footprint::Foreshortening;
use crate::{Result, scene};
use bytemuck::{Pod, Zeroable};

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

/// The kernel with its table.
pub(crate) struct Footprint {
    kernel: Kernel,
    table: wgpu::Buffer,
    params: footprint::FootprintParams,
}

impl Footprint {
    pub(crate) fn new(gpu: &Gpu, footprint: &footprint::Footprint) -> Result<Self> {
        Ok(Self {
            kernel: Kernel::new(gpu, shader!("math", "camera", "perturb", "view", "footprint"), "footprint")?,
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
        view: &View,
        covariances: &wgpu::Buffer,
    ) -> Result<()> {
        let params = Params {
            camera: camera.into(),
            roughness_scale: self.params.roughness_scale,
            small_d_r: self.params.small_d_r,
            foreshortening: match self.params.foreshortening {
                Foreshortening::None => 0,
                Foreshortening::Paper => 1,
                Foreshortening::Derived => 2,
                Foreshortening::Curved => 3,
            },
            padding: 0,
        };
        let params = gpu.upload("the footprint's parameters", bytemuck::bytes_of(&params))?;
        let buffers = [
            &params,
            &self.table,
            &view.positions,
            &view.guides.normals,
            &view.curvatures,
            &view.guides.materials,
            &view.reflected,
            covariances,
        ];
        commands.run("footprint", &self.kernel, &buffers, groups(view.size, WORKGROUP));
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gpu::layout::check;

    #[test]
    fn structs_are_laid_out_as_in_the_shader() {
        let source = shader!("math", "camera", "perturb", "view", "footprint");
        check!(source, Params as "Params" { camera, roughness_scale, small_d_r, foreshortening });
    }
}
