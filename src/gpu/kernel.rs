//! A compute shader's entry point, and what runs it.

use super::Gpu;
use super::scene::{GpuScene, layout};
use crate::{Error, Result};
use bytemuck::Pod;

/// Pixels of a picture.
pub(crate) fn area([width, height]: [u32; 2]) -> u64 {
    u64::from(width) * u64::from(height)
}

/// Workgroups that cover a picture.
pub(crate) fn groups(size: [u32; 2], workgroup: [u32; 2]) -> [u32; 2] {
    [size[0].div_ceil(workgroup[0]), size[1].div_ceil(workgroup[1])]
}

/// A compiled entry point. Its bindings are buffers of group 0, numbered from 0; group 1 is the scene, for kernels that follow its light.
#[derive(Clone)]
pub(crate) struct Kernel {
    pipeline: wgpu::ComputePipeline,
    scene: Option<wgpu::BindGroup>,
}

impl Kernel {
    /// Compiles `source`; the name of its entry point names the kernel.
    pub(crate) fn new(gpu: &Gpu, source: &str, entry: &'static str) -> Result<Self> {
        Ok(Self { pipeline: pipeline(gpu, (source, checked), entry, None, &[])?, scene: None })
    }

    /// A kernel in a scene, of `reads` buffers to read and then `writes` to write. `source` holds the files that `entry` needs; `constants`
    /// are its own overrides.
    pub(crate) fn in_scene(
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
        let compile = if cfg!(debug_assertions) { checked } else { unchecked };
        let pipeline = pipeline(gpu, (source, compile), entry, Some(&layout), &constants)?;
        Ok(Self { pipeline, scene: Some(scene.group.clone()) })
    }
}

type Compile = fn(&Gpu, &str, &'static str) -> wgpu::ShaderModule;

/// A module that tests every index and bounds every loop.
fn checked(gpu: &Gpu, source: &str, entry: &'static str) -> wgpu::ShaderModule {
    let source = wgpu::ShaderSource::Wgsl(source.into());
    gpu.device.create_shader_module(wgpu::ShaderModuleDescriptor { label: Some(entry), source })
}

/// A module that does neither: some per cent of a path's time. For kernels in a scene, which read what [`GpuScene`] has written.
fn unchecked(gpu: &Gpu, source: &str, entry: &'static str) -> wgpu::ShaderModule {
    let source = wgpu::ShaderSource::Wgsl(source.into());
    let descriptor = wgpu::ShaderModuleDescriptor { label: Some(entry), source };
    // SAFETY: every index is one of four kinds. Invocations past a list's end return first. Numbers of nodes, triangles, materials, models,
    // textures, emitters and tables come from the buffers that `GpuScene` fills, whose numbers name entries that are there; those of triangles
    // at which paths start come from hits of the same scene, and those of probes' texels were tested when the probe was read. Samples that a pixel
    // keeps are numbered below their most. Pixels, texels and table entries that are computed from coordinates are wrapped
    // or clamped to their image or table, after the coordinates were tested for numbers. The traversal's stack is no deeper than `STACK`,
    // which `GpuScene` tests the tree for. Loops end: they count, or follow trees from the root down or up, or end with a path's depth, which
    // the roulette bounds or its limit. Builds with debug assertions, so all tests, run the same kernels checked.
    unsafe { gpu.device.create_shader_module_trusted(descriptor, wgpu::ShaderRuntimeChecks::unchecked()) }
}

fn pipeline(
    gpu: &Gpu,
    (source, compile): (&str, Compile),
    entry: &'static str,
    layout: Option<&wgpu::PipelineLayout>,
    constants: &[(&str, f64)],
) -> Result<wgpu::ComputePipeline> {
    gpu.checked(|| {
        let module = compile(gpu, source, entry);
        gpu.device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: Some(entry),
            layout,
            module: &module,
            entry_point: Some(entry),
            compilation_options: wgpu::PipelineCompilationOptions { constants, ..Default::default() },
            cache: None,
        })
    })
}

/// The source of shaders that lie in `shaders/`, one after the other.
macro_rules! shader {
    ($($name:literal),+) => { concat!($(include_str!(concat!(env!("CARGO_MANIFEST_DIR"), "/shaders/", $name, ".wgsl"))),+) };
}
pub(crate) use shader;

impl Gpu {
    /// A buffer for kernels to write.
    pub(crate) fn output(&self, label: &'static str, size: u64) -> Result<wgpu::Buffer> {
        self.fits(label, size)?;
        let usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC | wgpu::BufferUsages::COPY_DST;
        let (label, mapped_at_creation) = (Some(label), false);
        self.checked(|| self.device.create_buffer(&wgpu::BufferDescriptor { label, size, usage, mapped_at_creation }))
    }

    /// Fills a buffer with zeros.
    pub(crate) fn clear(&self, buffer: &wgpu::Buffer) {
        let mut encoder = self.device.create_command_encoder(&Default::default());
        encoder.clear_buffer(buffer, 0, None);
        self.queue.submit([encoder.finish()]);
    }

    /// Buffers as the bindings of a group, numbered from 0.
    pub(crate) fn group(&self, layout: &wgpu::BindGroupLayout, buffers: &[&wgpu::Buffer]) -> wgpu::BindGroup {
        let bindings = buffers.iter().enumerate();
        let entries: Vec<_> =
            bindings.map(|(i, b)| wgpu::BindGroupEntry { binding: i as u32, resource: b.as_entire_binding() }).collect();
        self.device.create_bind_group(&wgpu::BindGroupDescriptor { label: None, layout, entries: &entries })
    }

    /// Hands a kernel's run on `groups` workgroups to the device.
    pub(crate) fn submit(
        &self,
        kernel: &Kernel,
        buffers: &[&wgpu::Buffer],
        groups: [u32; 2],
        timestamp_writes: Option<wgpu::ComputePassTimestampWrites>,
    ) {
        let group = self.group(&kernel.pipeline.get_bind_group_layout(0), buffers);
        let mut encoder = self.device.create_command_encoder(&Default::default());
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor { label: None, timestamp_writes });
        pass.set_pipeline(&kernel.pipeline);
        pass.set_bind_group(0, &group, &[]);
        if let Some(scene) = &kernel.scene {
            pass.set_bind_group(1, scene, &[]);
        }
        pass.dispatch_workgroups(groups[0], groups[1], 1);
        drop(pass);
        self.queue.submit([encoder.finish()]);
    }

    /// Runs a kernel on `groups` workgroups and waits for it.
    pub(crate) fn dispatch(&self, kernel: &Kernel, buffers: &[&wgpu::Buffer], groups: [u32; 2]) -> Result<()> {
        self.checked(|| {
            self.submit(kernel, buffers, groups, None);
            self.wait();
        })
    }

    /// What a buffer of [`Gpu::output`] holds.
    pub(crate) fn read<T: Pod>(&self, buffer: &wgpu::Buffer) -> Result<Vec<T>> {
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
