//! A frame's light map on a device: the twin of [`super::super::frame_map`].

use crate::Result;
use crate::gpu::Gpu;
use crate::gpu::commands::Commands;
use crate::gpu::kernel::Kernel;
use crate::gpu::scene::GpuScene;
use crate::gpu::spec::Access::{Read, ReadWrite, Uniform};
use crate::gpu::spec::{KernelSpec, StructLayout, layout};
use crate::lightmap::fill::Rings;
use crate::method::radiance_probes::frame_map::FrameMap;
use bytemuck::{Pod, Zeroable, cast_slice};

/// `Params` of map_light.wgsl.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct MapParams {
    map: u32,
    texels: u32,
    number: u32,
    numbers: u32,
}

/// `Params` of fill_ring.wgsl.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct RingParams {
    map: u32,
    first: u32,
    end: u32,
}

/// The receivers' texels.
pub(crate) const MAP_LIGHT: KernelSpec = KernelSpec {
    file: "radiance_probes/map_light.wgsl",
    twin: "src/method/radiance_probes/frame_map.rs: lit",
    workgroup: [64, 1],
    scene: false,
    bindings: &[("params", Uniform), ("places", Read), ("indirect", Read), ("light", ReadWrite)],
    structs: &[&MAP_PARAMS],
};
/// The others.
pub(crate) const FILL_RING: KernelSpec = KernelSpec {
    file: "radiance_probes/fill_ring.wgsl",
    twin: "src/lightmap/fill.rs: mean",
    workgroup: [64, 1],
    scene: false,
    bindings: &[("params", Uniform), ("pixels", Read), ("firsts", Read), ("neighbours", Read), ("light", ReadWrite)],
    structs: &[&RING_PARAMS],
};
const MAP_PARAMS: StructLayout = layout!(MapParams as "Params" { map, texels, number, numbers });
const RING_PARAMS: StructLayout = layout!(RingParams as "Params" { map, first, end });

/// Rings of one side on the device.
struct GpuRings {
    pixels: wgpu::Buffer,
    firsts: wgpu::Buffer,
    neighbours: wgpu::Buffer,
    /// Of each ring its parameters and how many pixels it has.
    rings: Vec<(wgpu::Buffer, u32)>,
}

/// What writes a frame's light into the light map of a scene, or of each of the receivers' numbers into one of several.
pub(super) struct MapLight {
    map: Kernel,
    fill: Kernel,
    /// Of each number that receivers keep.
    params: Vec<wgpu::Buffer>,
    places: wgpu::Buffer,
    receivers: u32,
    sides: Vec<GpuRings>,
}

impl MapLight {
    /// For a scene that has [`FrameMap::dark`], `numbers` times behind each other.
    pub(super) fn new(scene: &GpuScene, map: &FrameMap, numbers: u32) -> Result<Self> {
        let gpu = &scene.gpu;
        let first = scene.light_words().1;
        let texels = (map.dark.size[0] * map.dark.size[1]).max(1);
        let params = |number| {
            let params = MapParams { map: first, texels, number, numbers };
            gpu.uniform("parameters of the light map", &params)
        };
        let all = (0..2).flat_map(|side| (0..numbers).map(move |number| (side, number)));
        let sides = all.map(|(side, number)| (first + 3 * (side * numbers + number) * texels, &map.rings[side as usize]));
        let sides = sides.filter(|(_, rings)| !rings.pixels.is_empty());
        Ok(Self {
            map: Kernel::new(gpu, &MAP_LIGHT)?,
            fill: Kernel::new(gpu, &FILL_RING)?,
            params: (0..numbers).map(params).collect::<Result<_>>()?,
            places: gpu.upload("texels of receivers", cast_slice(&map.places))?,
            receivers: map.places.len() as u32,
            sides: sides.map(|(at, rings)| GpuRings::new(gpu, rings, at)).collect::<Result<_>>()?,
        })
    }

    /// Puts the receivers' light there.
    pub(super) fn run(&self, scene: &GpuScene, commands: &mut Commands, indirect: &wgpu::Buffer) {
        let light = scene.light_words().0;
        for params in &self.params {
            commands.run("light map", &self.map, &[params, &self.places, indirect, light], [self.receivers, 1]);
        }
        for side in &self.sides {
            for (params, count) in &side.rings {
                let buffers = [params, &side.pixels, &side.firsts, &side.neighbours, light];
                commands.run("light map", &self.fill, &buffers, [*count, 1]);
            }
        }
    }
}

impl GpuRings {
    fn new(gpu: &Gpu, rings: &Rings, map: u32) -> Result<Self> {
        // As many pixels as WebGPU lets a dispatch have.
        const MOST: usize = 65_535 * 64;
        let dispatches = rings.starts.windows(2).flat_map(|ring| {
            let end = ring[1];
            (ring[0]..end).step_by(MOST).map(move |first| (first, end.min(first + MOST as u32)))
        });
        let params = |(first, end)| Ok((gpu.uniform("parameters of a ring", &RingParams { map, first, end })?, end - first));
        Ok(Self {
            rings: dispatches.map(params).collect::<Result<_>>()?,
            pixels: gpu.upload("texels without receivers", cast_slice(&rings.pixels))?,
            firsts: gpu.upload("where their neighbours begin", cast_slice(&rings.firsts))?,
            neighbours: gpu.upload("their neighbours", cast_slice(&rings.neighbours))?,
        })
    }
}
