//! Probes on the device: those around the camera, as many as the memory that they are given holds.

use crate::Result;
use crate::gpu::Gpu;
use crate::method::glossy_probes::candidates::{Candidates, Directions, Light, ReflectedTexel};
use crate::probe::file::Probe;

/// A probe's texels and parameterisation, as the gather reads them.
pub(crate) struct GpuProbe {
    /// The mesh's vertices as bits, then two pixels of the derivatives an entry.
    pub(crate) map: wgpu::Buffer,
    pub(crate) seen: wgpu::Buffer,
    pub(crate) directions: wgpu::Buffer,
    pub(crate) light: wgpu::Buffer,
}

impl GpuProbe {
    /// Where the derivatives begin in the map.
    pub(crate) fn second(probe: &Probe) -> usize {
        probe.map.forward.len()
    }

    pub(crate) fn upload(gpu: &Gpu, probe: &Probe, candidates: &Candidates) -> Result<Self> {
        let (vertices, derivative): (&[u8], &[u8]) =
            (bytemuck::cast_slice(&probe.map.forward), bytemuck::cast_slice(&probe.map.derivative));
        let mut map = [vertices, derivative].concat();
        map.resize(map.len().next_multiple_of(size_of::<[u32; 2]>()), 0);
        Ok(Self {
            map: gpu.upload("a probe's map", &map)?,
            seen: gpu.upload("a probe's reflected hits", bytemuck::cast_slice(&candidates.seen))?,
            directions: gpu.upload("a probe's directions", bytemuck::cast_slice(&candidates.directions))?,
            light: gpu.upload("a probe's colours", bytemuck::cast_slice(&candidates.light))?,
        })
    }
}

/// Bytes a texel, but for the map.
pub(crate) const TEXEL: u64 = (size_of::<ReflectedTexel>() + size_of::<Directions>() + size_of::<Light>()) as u64;

/// What a gathered probe takes on a device, bytes.
pub(crate) fn bytes(probe: &Probe) -> u64 {
    let map = size_of_val(probe.map.forward.as_slice()) + size_of_val(probe.map.derivative.as_slice());
    probe.texels.len() as u64 * TEXEL + map as u64
}
