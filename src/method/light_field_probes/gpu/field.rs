//! All probes of a light field on a device, a buffer for each kind of what they hold.

use crate::gpu::Gpu;
use crate::gpu::kernel::FAR;
use crate::gpu::spec::{StructLayout, layout};
use crate::method::light_field_probes::LightFieldParams;
use crate::method::light_field_probes::field::LightField;
use crate::method::light_field_probes::octree::{LEAF, NO_PROBE};
use crate::{Error, Result};
use bytemuck::{Pod, Zeroable, cast_slice};

/// Words of a texel of ambient light: irradiance, and two moments of distance.
pub(crate) const AMBIENT_WORDS: u32 = 5;

/// `Field` of params.wgsl.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
pub(super) struct Field {
    origin: [f32; 3],
    probes: u32,
    spacing: [f32; 3],
    size: u32,
    counts: [u32; 3],
    ambient_size: u32,
    lower: [f32; 3],
    edge: f32,
    sets: u32,
    nodes: u32,
    search: u32,
    thickness: f32,
    footprint: f32,
    far: f32,
    padding: [u32; 2],
}

pub(super) const FIELD: StructLayout = layout!(Field as "Field" {
    origin, probes, spacing, size, counts, ambient_size, lower, edge, sets, nodes, search, thickness, footprint, far
});

/// The probes that are not blocked, in their order: a probe's place in it is the number of its maps.
pub(super) struct GpuField {
    pub(super) field: Field,
    /// Positions, sets and nodes.
    pub(super) places: wgpu::Buffer,
    pub(super) surfels: wgpu::Buffer,
    pub(super) bounds: wgpu::Buffer,
    pub(super) light: wgpu::Buffer,
    pub(super) ambient: wgpu::Buffer,
}

impl GpuField {
    /// Uploads the probes. An error where a kernel could not bind all of them.
    pub(super) fn new(gpu: &Gpu, field: &LightField, params: &LightFieldParams, far: f32) -> Result<Self> {
        let used = field.places.used();
        let Some(&first) = used.first() else {
            return Err(Error::Request("all light field probes are blocked: no frame can be made of them".into()));
        };
        let (size, ambient_size) = (field.light[first].size, field.ambient[first].size);
        let (rows, sets, nodes) = rows(field, &used);
        let buffer = |what: &'static str, of: &dyn Fn(usize) -> Vec<u8>| {
            let one = of(first).len() as u64;
            let (bytes, there) = (one * used.len() as u64, &gpu.adapter);
            fits((what, bytes), (used.len(), size), (&there.name, there.max_binding))?;
            let buffer = gpu.output(what, bytes)?;
            for (slot, &i) in used.iter().enumerate() {
                gpu.checked(|| {
                    gpu.queue.write_buffer(&buffer, slot as u64 * one, &of(i));
                    // Or what waits to be written would take as much memory again.
                    gpu.queue.submit([]);
                })?;
            }
            Ok(buffer)
        };
        let (grid, octree) = (field.places.grid(), field.octree.as_ref());
        let field_params = Field {
            origin: grid.map_or([0.0; 3], |g| g.origin),
            probes: field.places.len() as u32,
            spacing: grid.map_or([0.0; 3], |g| g.spacing),
            size: size as u32,
            counts: grid.map_or([0; 3], |g| g.counts),
            ambient_size: ambient_size as u32,
            lower: octree.map_or([0.0; 3], |o| o.lower),
            edge: octree.map_or(1.0, |o| o.edge),
            sets,
            nodes,
            search: params.search as u32,
            thickness: params.thickness,
            footprint: params.footprint,
            far,
            padding: [0; 2],
        };
        Ok(Self {
            field: field_params,
            places: gpu.upload("places of probes", cast_slice(&rows))?,
            surfels: buffer("surfaces", &|i| surfels(field, i))?,
            bounds: buffer("bounds of distances", &|i| bounds(field, i))?,
            light: buffer("radiance", &|i| light(field, i))?,
            ambient: buffer("ambient light", &|i| ambient(field, i))?,
        })
    }

    /// What the probes take on the device.
    pub(super) fn bytes(&self) -> u64 {
        [&self.places, &self.surfels, &self.bounds, &self.light, &self.ambient].map(wgpu::Buffer::size).iter().sum()
    }
}

/// An error where a kernel could not bind what `count` probes hold of one kind.
fn fits((what, bytes): (&str, u64), (count, size): (usize, usize), (device, most): (&str, u64)) -> Result<()> {
    if bytes <= most {
        return Ok(());
    }
    Err(Error::Request(format!(
        "{count} light field probes of {size} x {size} texels: their {what} take {} MiB, but a kernel on GPU \"{device}\" takes {} MiB at \
         the most; use --device cpu, or bake fewer probes (place-probes) or smaller ones (bake-lightfield --size)",
        bytes.div_ceil(1 << 20),
        most >> 20
    )))
}

/// A row for each probe, for each set and for four nodes of the octree; where the sets and the nodes begin.
fn rows(field: &LightField, used: &[usize]) -> (Vec<[u32; 4]>, u32, u32) {
    let slot = |i: usize| used.binary_search(&i).map_or(NO_PROBE, |slot| slot as u32);
    let row = |i: usize| {
        let [x, y, z] = field.places.position(i).to_array().map(f32::to_bits);
        [x, y, z, slot(i)]
    };
    let mut rows: Vec<[u32; 4]> = (0..field.places.len()).map(row).collect();
    let sets = rows.len() as u32;
    let Some(octree) = &field.octree else { return (rows, sets, sets) };
    rows.extend(&octree.sets);
    let nodes = rows.len() as u32;
    rows.extend(octree.nodes.chunks(4).map(|four| std::array::from_fn(|k| four.get(k).copied().unwrap_or(LEAF))));
    (rows, sets, nodes)
}

/// Distance and packed normal of each texel.
fn surfels(field: &LightField, i: usize) -> Vec<u8> {
    let surfels = &field.maps[i].surfels;
    let texels: Vec<[u32; 2]> = surfels.distance.iter().zip(&surfels.normal).map(|(d, &n)| [d.min(FAR).to_bits(), n]).collect();
    cast_slice(&texels).to_vec()
}

/// Least distances, the finest level first.
fn bounds(field: &LightField, i: usize) -> Vec<u8> {
    let least: Vec<f32> = field.maps[i].pyramid.levels.iter().flatten().map(|d| d.min(FAR)).collect();
    cast_slice(&least).to_vec()
}

/// Radiance as three half floats a texel, the finest level first.
fn light(field: &LightField, i: usize) -> Vec<u8> {
    field.light[i].levels.iter().flat_map(|level| cast_slice::<_, u8>(level)).copied().collect()
}

fn ambient(field: &LightField, i: usize) -> Vec<u8> {
    let ambient = &field.ambient[i];
    let texels = ambient.irradiance.iter().zip(&ambient.moments);
    let words: Vec<[f32; AMBIENT_WORDS as usize]> = texels.map(|(e, m)| [e.x, e.y, e.z, m.x, m.y]).collect();
    cast_slice(&words).to_vec()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_no_kernel_can_bind_is_refused_with_what_to_do() {
        let of = |most: u64| fits(("radiance", 300 << 20), (252, 512), ("A card", most));
        assert!(of(300 << 20).is_ok());
        let message = of(128 << 20).unwrap_err().to_string();
        for word in ["252", "512 x 512", "radiance", "300 MiB", "A card", "128 MiB", "--device cpu", "--size"] {
            assert!(message.contains(word), "{word}: {message}");
        }
    }
}
