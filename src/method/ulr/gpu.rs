//! Unstructured lumigraph rendering, a dispatch a probe: the twin of [`crate::method::ulr`].

use super::{UlrParams, nearest};
use crate::Result;
use crate::base::clock::Clock;
use crate::gpu::Gpu;
use crate::gpu::commands::Commands;
use crate::gpu::kernel::{Kernel, area};
use crate::gpu::resident::{PLACE, Place, Resident, room_for_probes};
use crate::gpu::scene::GpuScene;
use crate::gpu::spec::Access::{Read, ReadWrite, Uniform};
use crate::gpu::spec::{KernelSpec, StructLayout, layout};
use crate::gpu::view::composite::{Composite, Layers};
use crate::gpu::view::gbuffer::GBuffer;
use crate::gpu::view::{PIXEL, REFLECTED, ViewBuffers};
use crate::lightmap::LightMap;
use crate::probe::file::{Probe, Texel};
use crate::probe::store::ProbeStore;
use crate::scene::Camera;
use crate::surface::CurvatureMap;
use crate::transport::World;
use crate::view::layers::LayerImages;
use bytemuck::{Pod, Zeroable};
use glam::Vec4;
use serde::de::DeserializeOwned;
use std::sync::Arc;

/// A sample that a pixel keeps, and how many these are.
type Sample = [f32; 4];
type Counts = [u32; 2];

/// `UlrParams` of ulr.wgsl.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct Params {
    eye: [f32; 3],
    width: u32,
    height: u32,
    blend: u32,
    angle: f32,
    resolution: f32,
    hidden: f32,
    plane_tolerance: f32,
    padding: [u32; 2],
}

/// Asks one probe at every pixel.
pub(crate) const ULR_LOOK: KernelSpec = KernelSpec {
    file: "ulr/ulr_look.wgsl",
    twin: "src/method/ulr/mod.rs: look",
    workgroup: [8, 8],
    scene: true,
    bindings: &[
        ("ulr_params", Uniform),
        ("probe_params", Uniform),
        ("view", Read),
        ("probe_words", Read),
        ("kept", ReadWrite),
        ("counts", ReadWrite),
    ],
    structs: &[&PARAMS, &PLACE, &PIXEL, &REFLECTED],
};
/// Weighs what the pixels keep.
pub(crate) const ULR_BLEND: KernelSpec = KernelSpec {
    file: "ulr/ulr_blend.wgsl",
    twin: "src/method/ulr/mod.rs: weights",
    workgroup: [8, 8],
    scene: false,
    bindings: &[
        ("ulr_params", Uniform),
        ("view", Read),
        ("kept", Read),
        ("counts", Read),
        ("glossy", ReadWrite),
        ("unserved", ReadWrite),
    ],
    structs: &[&PARAMS, &PIXEL, &REFLECTED],
};
const PARAMS: StructLayout = layout!(Params as "UlrParams" {
    eye, width, height, blend, angle, resolution, hidden, plane_tolerance
});

/// A probe as its file has it: its texels, then the vertices of its map.
struct GpuProbe(wgpu::Buffer);

impl GpuProbe {
    fn upload(gpu: &Gpu, probe: &Probe) -> Result<Self> {
        let lists: [&[u8]; 2] = [bytemuck::cast_slice(&probe.texels), bytemuck::cast_slice(&probe.map.forward)];
        Ok(Self(gpu.upload("a probe", &lists.concat())?))
    }

    fn bytes(probe: &Probe) -> u64 {
        (size_of_val(probe.map.forward.as_slice()) + size_of_val(probe.texels.as_slice())) as u64
    }
}

/// The buffers of frames of one size.
struct Target {
    view: ViewBuffers,
    /// The samples of least penalty, so many a pixel.
    kept: wgpu::Buffer,
    counts: wgpu::Buffer,
    glossy: wgpu::Buffer,
    layers: Layers,
}

/// A frame, read back.
pub struct UlrFrame {
    /// Its layers.
    pub layers: LayerImages,
    /// Milliseconds a pass.
    pub passes: Vec<(&'static str, f64)>,
    /// Sub-pixels that no probe served.
    pub unserved: usize,
}

/// The method on a device.
pub struct Ulr {
    gpu: Arc<Gpu>,
    scene: GpuScene,
    params: UlrParams,
    memory: u64,
    gbuffer: GBuffer,
    look: Kernel,
    blend: Kernel,
    composite: Composite,
    resident: Resident<GpuProbe>,
    target: Option<Target>,
}

impl Ulr {
    /// Compiles the passes. Without a light map the diffuse layer is black. `memory` is what all of it may take on the device, bytes.
    pub fn new(gpu: Arc<Gpu>, world: &World, lightmap: Option<&LightMap>, params: &UlrParams, memory: u64) -> Result<Self> {
        let scene = GpuScene::lit(gpu.clone(), world, lightmap)?;
        let flat = CurvatureMap::flat(world.scene.geometry.positions.len());
        Ok(Self {
            gbuffer: GBuffer::new(&scene, world, &flat)?,
            look: Kernel::in_scene(&scene, &ULR_LOOK, &[])?,
            blend: Kernel::new(&gpu, &ULR_BLEND)?,
            composite: Composite::new(&gpu, params.supersample)?,
            resident: Resident::new(0),
            target: None,
            params: UlrParams { blend: params.blend.max(1), ..*params },
            memory,
            scene,
            gpu,
        })
    }

    /// The device's name.
    pub fn device(&self) -> &str {
        &self.gpu.adapter.name
    }

    /// Whether passes are timed by the device's own clock.
    pub fn has_clock(&self) -> bool {
        self.gpu.adapter.timestamps
    }

    /// Bytes of the probes on the device.
    pub fn probe_bytes(&self) -> u64 {
        self.resident.bytes()
    }

    /// Makes room for frames of `size` and for at least one probe of so many texels. An error where memory does not suffice.
    pub fn reserve(&mut self, size: [u32; 2], probe: [u32; 2]) -> Result<()> {
        self.target = Some(self.reserved(size, probe)?);
        Ok(())
    }

    /// The buffers for frames of `size`, taken out.
    fn reserved(&mut self, size: [u32; 2], probe: [u32; 2]) -> Result<Target> {
        let fine = size.map(|s| s * self.params.supersample);
        if let Some(target) = self.target.take().filter(|t| t.view.size == fine) {
            return Ok(target);
        }
        let kept = size_of::<Sample>() as u64 * u64::from(self.params.blend);
        let (counts, glossy) = (size_of::<Counts>() as u64, size_of::<Vec4>() as u64);
        let a_sub_pixel = ViewBuffers::BYTES + kept + counts + glossy;
        let frame = area(fine) * a_sub_pixel + area(size) * Layers::BYTES + self.scene.bytes() + self.gbuffer.bytes();
        self.resident.set_budget(room_for_probes(self.memory, size, frame, area(probe) * size_of::<Texel>() as u64)?);
        let gpu = &self.gpu;
        Ok(Target {
            view: ViewBuffers::new(gpu, fine)?,
            kept: gpu.output("the samples that pixels blend", area(fine) * kept)?,
            counts: gpu.output("their numbers", area(fine) * counts)?,
            glossy: gpu.output("blended colours", area(fine) * glossy)?,
            layers: Layers::new(gpu, area(size))?,
        })
    }

    /// Renders a frame.
    pub fn frame(&mut self, camera: &Camera, probes: &mut ProbeStore<impl DeserializeOwned>) -> Result<UlrFrame> {
        let (gpu, target) = (self.gpu.clone(), self.reserved(camera.size, probes.set.size)?);
        let frame = gpu.checked(|| self.passes(&target, camera, probes))??;
        self.target = Some(target);
        Ok(frame)
    }

    fn passes(&mut self, t: &Target, camera: &Camera, probes: &mut ProbeStore<impl DeserializeOwned>) -> Result<UlrFrame> {
        let (gpu, view, eye) = (&*self.gpu, &t.view, camera.position());
        let fine = Camera { size: view.size, ..camera.clone() };
        let mut clock = Clock::start();
        let mut commands = Commands::new(gpu);

        self.gbuffer.run(&self.scene, &mut commands, &fine, view, None)?;
        gpu.clear(&t.counts);
        gpu.clear(&t.layers.unserved);
        let params = gpu.uniform("the parameters of ulr", &self.kernel_params(eye.to_array(), view.size))?;
        let is_baked = |i: usize| !probes.set.files[i].is_empty();
        for index in nearest(&probes.set.places, eye, self.params.probes as usize, is_baked) {
            clock.restart();
            let probe = probes.probe(index)?;
            let there = self.resident.get(gpu, index, GpuProbe::bytes(&probe), || GpuProbe::upload(gpu, &probe))?;
            clock.lap("load");
            let words = size_of_val(probe.texels.as_slice()) / size_of::<u32>();
            let place = gpu.uniform("a probe's place", &Place::new(index, &probe, 1.0, words))?;
            commands.run("gather", &self.look, &[&params, &place, &view.pixels, &there.0, &t.kept, &t.counts], view.size);
        }
        let buffers = [&params, &view.pixels, &t.kept, &t.counts, &t.glossy, &t.layers.unserved];
        commands.run("gather", &self.blend, &buffers, view.size);
        self.composite.layers(gpu, &mut commands, view, (&t.glossy, None), &t.layers)?;
        let passes = commands.finish()?;

        clock.restart();
        let ([emission, diffuse, glossy], unserved) = t.layers.read(gpu)?;
        clock.lap("read");
        let layers = LayerImages { emission, diffuse, glossy };
        Ok(UlrFrame { layers, passes: [clock.laps, passes].concat(), unserved })
    }

    fn kernel_params(&self, eye: [f32; 3], [width, height]: [u32; 2]) -> Params {
        let UlrParams { blend, angle, resolution, hidden, plane_tolerance, .. } = self.params;
        Params { eye, width, height, blend, angle, resolution, hidden, plane_tolerance, padding: [0; 2] }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::mem::offset_of;

    /// The seven words that ulr_look.wgsl reads.
    #[test]
    fn a_texel_lies_as_the_shader_reads_it() {
        assert_eq!(size_of::<Texel>(), 7 * 4);
        assert_eq!(
            [offset_of!(Texel, glossy), offset_of!(Texel, barycentric), offset_of!(Texel, triangle)],
            [0, 3 * 4 + 2, 6 * 4]
        );
    }
}
