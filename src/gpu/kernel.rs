//! A compute shader's entry point, and what runs it.

use super::Gpu;
use super::scene::{GpuScene, layout};
use crate::{Error, Result};
use bytemuck::Pod;

/// A compiled entry point. Its bindings are buffers of group 0, numbered from 0; group 1 is the scene, for kernels that follow its light.
#[derive(Clone)]
pub(super) struct Kernel {
    pipeline: wgpu::ComputePipeline,
    scene: Option<wgpu::BindGroup>,
}

impl Kernel {
    /// Compiles `source`; the name of its entry point names the kernel.
    pub(super) fn new(gpu: &Gpu, source: &str, entry: &'static str) -> Result<Self> {
        Ok(Self { pipeline: pipeline(gpu, source, entry, None, &[])?, scene: None })
    }

    /// A kernel in a scene, of `reads` buffers to read and then `writes` to write. `source` holds the files that `entry` needs; `constants`
    /// are its own overrides.
    pub(super) fn in_scene(
        scene: &GpuScene,
        source: &str,
        entry: &'static str,
        [reads, writes]: [u32; 2],
        constants: &[(&str, f64)],
    ) -> Result<Self> {
        let gpu = &scene.gpu;
        let layout = gpu.checked(|| {
            let own = layout(&gpu.device, entry, reads, writes);
            gpu.device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
                label: Some(entry),
                bind_group_layouts: &[Some(&own), Some(&scene.layout)],
                immediate_size: 0,
            })
        })?;
        let constants = [constants, &[("HAS_MASKS", f64::from(u8::from(scene.has_masks)))]].concat();
        let pipeline = pipeline(gpu, source, entry, Some(&layout), &constants)?;
        Ok(Self { pipeline, scene: Some(scene.group.clone()) })
    }
}

fn pipeline(
    gpu: &Gpu,
    source: &str,
    entry: &'static str,
    layout: Option<&wgpu::PipelineLayout>,
    constants: &[(&str, f64)],
) -> Result<wgpu::ComputePipeline> {
    let label = Some(entry);
    gpu.checked(|| {
        let source = wgpu::ShaderSource::Wgsl(source.into());
        let module = gpu.device.create_shader_module(wgpu::ShaderModuleDescriptor { label, source });
        gpu.device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label,
            layout,
            module: &module,
            entry_point: label,
            compilation_options: wgpu::PipelineCompilationOptions { constants, ..Default::default() },
            cache: None,
        })
    })
}

impl Gpu {
    /// A buffer for a kernel to write.
    pub(super) fn output(&self, label: &'static str, size: u64) -> Result<wgpu::Buffer> {
        self.fits(label, size)?;
        let usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC;
        let (label, mapped_at_creation) = (Some(label), false);
        self.checked(|| self.device.create_buffer(&wgpu::BufferDescriptor { label, size, usage, mapped_at_creation }))
    }

    /// Runs a kernel on `groups` workgroups and waits for it.
    pub(super) fn dispatch(&self, kernel: &Kernel, buffers: &[&wgpu::Buffer], groups: [u32; 2]) -> Result<()> {
        self.checked(|| {
            let bindings = buffers.iter().enumerate();
            let entries: Vec<_> =
                bindings.map(|(i, b)| wgpu::BindGroupEntry { binding: i as u32, resource: b.as_entire_binding() }).collect();
            let layout = &kernel.pipeline.get_bind_group_layout(0);
            let group = self.device.create_bind_group(&wgpu::BindGroupDescriptor { label: None, layout, entries: &entries });
            let mut encoder = self.device.create_command_encoder(&Default::default());
            let mut pass = encoder.begin_compute_pass(&Default::default());
            pass.set_pipeline(&kernel.pipeline);
            pass.set_bind_group(0, &group, &[]);
            if let Some(scene) = &kernel.scene {
                pass.set_bind_group(1, scene, &[]);
            }
            pass.dispatch_workgroups(groups[0], groups[1], 1);
            drop(pass);
            self.queue.submit([encoder.finish()]);
            self.wait();
        })
    }

    /// What a buffer of [`Gpu::output`] holds.
    pub(super) fn read<T: Pod>(&self, buffer: &wgpu::Buffer) -> Result<Vec<T>> {
        let bytes = self.checked(|| {
            let back = self.device.create_buffer(&wgpu::BufferDescriptor {
                label: Some("read back"),
                size: buffer.size(),
                usage: wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST,
                mapped_at_creation: false,
            });
            let mut encoder = self.device.create_command_encoder(&Default::default());
            encoder.copy_buffer_to_buffer(buffer, 0, &back, 0, buffer.size());
            self.queue.submit([encoder.finish()]);
            back.map_async(wgpu::MapMode::Read, .., |_| ());
            self.wait();
            back.get_mapped_range(..).map(|view| bytemuck::pod_collect_to_vec(&view))
        })?;
        bytes.map_err(|e| Error::Request(format!("GPU \"{}\": {e}", self.adapter.name)))
    }
}
