//! A compute shader's entry point, and what runs it.

use super::device::{Checks, Gpu};
use super::scene::GpuScene;
use super::source::assemble;
use super::spec::{Access, KernelSpec};
use crate::{Error, Result};
use bytemuck::Pod;

/// Pixels of a picture.
pub(crate) fn area([width, height]: [u32; 2]) -> u64 {
    u64::from(width) * u64::from(height)
}

/// Stands for infinity in shaders.
pub(crate) const FAR: f32 = f32::MAX;

/// First row and number of rows of parts of a picture that come to `most` steps, if each of its pixels takes `steps`; whole workgroups.
pub(crate) fn bands([width, height]: [u32; 2], most: u64, steps: u64) -> impl Iterator<Item = (u32, u32)> {
    const EDGE: u64 = 8;
    let rows = most / (u64::from(width) * steps.max(1)).max(1) / EDGE * EDGE;
    let rows = rows.clamp(EDGE, u64::from(height).max(EDGE)) as u32;
    (0..height).step_by(rows as usize).map(move |first| (first, rows))
}

/// A compiled kernel. Group 0 are its own buffers; group 1 is the scene, for kernels that follow its light.
#[derive(Clone)]
pub(crate) struct Kernel {
    spec: &'static KernelSpec,
    pipeline: wgpu::ComputePipeline,
    layout: wgpu::BindGroupLayout,
    scene: Option<wgpu::BindGroup>,
}

impl Kernel {
    /// Compiles a kernel without a scene.
    pub(crate) fn new(gpu: &Gpu, spec: &'static KernelSpec) -> Result<Self> {
        Self::with(gpu, spec, &[])
    }

    /// The same with values of its constants.
    pub(crate) fn with(gpu: &Gpu, spec: &'static KernelSpec, constants: &[(&str, f64)]) -> Result<Self> {
        Self::compile(gpu, spec, None, constants)
    }

    /// Compiles a kernel in a scene; `constants` are its own overrides.
    pub(crate) fn in_scene(scene: &GpuScene, spec: &'static KernelSpec, constants: &[(&str, f64)]) -> Result<Self> {
        Self::compile(&scene.gpu, spec, Some(scene), constants)
    }

    /// Puts another scene of the same layout in the place of its own.
    pub(crate) fn rebind(&mut self, scene: &GpuScene) {
        self.scene = Some(scene.group.clone());
    }

    fn compile(gpu: &Gpu, spec: &'static KernelSpec, scene: Option<&GpuScene>, constants: &[(&str, f64)]) -> Result<Self> {
        let source = assemble(spec.file)?;
        let mut constants = constants.to_vec();
        if let Some(scene) = scene.filter(|_| source.contains("override HAS_MASKS")) {
            constants.push(("HAS_MASKS", f64::from(u8::from(scene.has_masks))));
        }
        let (entry, device) = (spec.entry(), &gpu.device);
        let module = if spec.scene && gpu.checks == Checks::Off { unchecked } else { checked };
        let (pipeline, layout) = gpu.checked(|| {
            let layout = layout(device, entry, spec.bindings.iter().map(|(_, access)| *access));
            let groups = [Some(&layout), scene.map(|scene| &scene.layout)];
            let pipeline_layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
                label: Some(entry),
                bind_group_layouts: &groups[..1 + usize::from(spec.scene)],
                immediate_size: 0,
            });
            let pipeline = device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
                label: Some(entry),
                layout: Some(&pipeline_layout),
                module: &module(gpu, &source, entry),
                entry_point: Some(entry),
                compilation_options: wgpu::PipelineCompilationOptions { constants: &constants, ..Default::default() },
                cache: None,
            });
            (pipeline, layout)
        })?;
        Ok(Self { spec, pipeline, layout, scene: scene.map(|scene| scene.group.clone()) })
    }
}

/// The layout of a group.
pub(crate) fn layout(device: &wgpu::Device, label: &str, accesses: impl Iterator<Item = Access>) -> wgpu::BindGroupLayout {
    let ty = |access| match access {
        Access::Uniform => wgpu::BufferBindingType::Uniform,
        Access::Read => wgpu::BufferBindingType::Storage { read_only: true },
        Access::ReadWrite => wgpu::BufferBindingType::Storage { read_only: false },
    };
    let entries: Vec<_> = accesses
        .zip(0..)
        .map(|(access, binding)| wgpu::BindGroupLayoutEntry {
            binding,
            visibility: wgpu::ShaderStages::COMPUTE,
            ty: wgpu::BindingType::Buffer { ty: ty(access), has_dynamic_offset: false, min_binding_size: None },
            count: None,
        })
        .collect();
    device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor { label: Some(label), entries: &entries })
}

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
    // textures, emitters and tables come from the buffers that `GpuScene` fills, whose numbers name entries that are there: an entry's
    // place is its list's first row, which `SceneParams` holds, plus its number times the rows of a record, and a member lies within its
    // record by the constants of scene.wgsl, which the contract's test compares with the Rust types. What a frame adds is numbered on from
    // the scene's own, and tables of a triangle each that have its own alone are asked for no other (`is_added`). Numbers of triangles at
    // which paths start come from hits of the same scene or frame, and those of probes' texels and of receivers were tested when the file
    // was read. Links among the nodes of many lights lead forward and no further than their number, their lights are those of the tree, and
    // the list of pixels to be lit holds numbers of the view's pixels, plus 1, or 0 past its end; its places are counted, one a pixel at
    // the most. Samples that a pixel keeps are numbered below their most. Pixels, texels and table entries that are computed from
    // coordinates are wrapped or clamped to their image or table, after the coordinates were tested for numbers; where that lies in `words`
    // `GpuScene` has said. The traversal's stack is no deeper than `STACK`, which `GpuScene` tests trees for. Loops end: they count, or
    // follow trees from the root down or up, or end with a path's depth, which the roulette bounds or its limit. tests/gpu runs the same
    // kernels both ways.
    unsafe { gpu.device.create_shader_module_trusted(descriptor, wgpu::ShaderRuntimeChecks::unchecked()) }
}

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

    /// Hands a kernel's run on `size` invocations to the device, with its buffers in the order of its record.
    pub(crate) fn submit(
        &self,
        kernel: &Kernel,
        buffers: &[&wgpu::Buffer],
        size: [u32; 2],
        timestamp_writes: Option<wgpu::ComputePassTimestampWrites>,
    ) {
        let group = self.group(&kernel.layout, buffers);
        let mut encoder = self.device.create_command_encoder(&Default::default());
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor { label: None, timestamp_writes });
        pass.set_pipeline(&kernel.pipeline);
        pass.set_bind_group(0, &group, &[]);
        if let Some(scene) = &kernel.scene {
            pass.set_bind_group(1, scene, &[]);
        }
        let [x, y] = kernel.spec.groups(size);
        pass.dispatch_workgroups(x, y, 1);
        drop(pass);
        self.queue.submit([encoder.finish()]);
    }

    /// Runs a kernel on `size` invocations and waits for it.
    pub(crate) fn dispatch(&self, kernel: &Kernel, buffers: &[&wgpu::Buffer], size: [u32; 2]) -> Result<()> {
        self.checked(|| {
            self.submit(kernel, buffers, size, None);
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bands_cover_a_picture_once() {
        assert_eq!(bands([960, 540], 1 << 26, 80).collect::<Vec<_>>(), [(0, 540)]);
        let parts: Vec<_> = bands([100, 37], 1 << 10, 1).collect();
        assert_eq!(parts.iter().map(|p| p.0).collect::<Vec<_>>(), [0, 8, 16, 24, 32]);
    }
}
