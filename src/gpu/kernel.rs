//! A compute shader's entry point, and what runs it.

use super::Gpu;
use crate::{Error, Result};
use bytemuck::Pod;

/// A compiled entry point. Its bindings are buffers of group 0, numbered from 0.
pub(super) struct Kernel(wgpu::ComputePipeline);

impl Kernel {
    /// Compiles `source`; the name of its entry point names the kernel.
    pub(super) fn new(gpu: &Gpu, source: &str, entry: &'static str) -> Result<Self> {
        let label = Some(entry);
        gpu.checked(|| {
            let source = wgpu::ShaderSource::Wgsl(source.into());
            let module = gpu.device.create_shader_module(wgpu::ShaderModuleDescriptor { label, source });
            Self(gpu.device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
                label,
                layout: None,
                module: &module,
                entry_point: label,
                compilation_options: Default::default(),
                cache: None,
            }))
        })
    }
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
            let layout = &kernel.0.get_bind_group_layout(0);
            let group = self.device.create_bind_group(&wgpu::BindGroupDescriptor { label: None, layout, entries: &entries });
            let mut encoder = self.device.create_command_encoder(&Default::default());
            let mut pass = encoder.begin_compute_pass(&Default::default());
            pass.set_pipeline(&kernel.0);
            pass.set_bind_group(0, &group, &[]);
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
