//! Emitters, what chooses from them, and environments.

use super::textures::{GpuImage, Textures};
use super::{NONE, Tables};
use crate::scene::Emitter;
use crate::transport::World;
use crate::transport::lights::{Environment, Near};
use bytemuck::{Pod, Zeroable};
use glam::Mat3;

/// `Emitter` of scene.wgsl.
#[repr(C)]
#[derive(Clone, Copy, Default, Pod, Zeroable)]
pub(crate) struct GpuEmitter {
    position: [f32; 3],
    kind: u32,
    direction: [f32; 3],
    texture: u32,
    color: [f32; 3],
    cutoff: f32,
    beam: f32,
    first: u32,
    start: u32,
    padding: u32,
}

const AREA: u32 = 0;
const POINT: u32 = 1;
const SPOT: u32 = 2;
const DIRECTIONAL: u32 = 3;
const AT_INFINITY: u32 = 4;

/// `Near` of scene.wgsl.
#[repr(C)]
#[derive(Clone, Copy, Default, Pod, Zeroable)]
pub(crate) struct GpuNear {
    triangle: u32,
    emitter: u32,
    area: f32,
    padding: u32,
}

/// `Environment` of scene.wgsl.
#[repr(C)]
#[derive(Clone, Copy, Default, Pod, Zeroable)]
pub(crate) struct GpuEnvironment {
    world_from_local: [[f32; 4]; 3],
    local_from_world: [[f32; 4]; 3],
    color: [f32; 3],
    scale: f32,
    image: GpuImage,
    rows: u32,
    columns: u32,
    sines: u32,
    mean: f32,
}

pub(crate) fn emitters(world: &World, textures: &mut Textures, tables: &mut Tables) -> Vec<GpuEmitter> {
    let of = |(i, emitter): (usize, &Emitter)| match emitter {
        Emitter::Area { object, radiance } => GpuEmitter {
            kind: AREA,
            texture: textures.add(radiance, tables),
            first: world.lights.first[i].unwrap_or(NONE),
            start: world.scene.geometry.objects[*object as usize].triangles.start,
            ..GpuEmitter::default()
        },
        Emitter::Point { position, intensity } => {
            GpuEmitter { kind: POINT, position: position.to_array(), color: intensity.to_array(), ..GpuEmitter::default() }
        }
        Emitter::Spot { position, direction, intensity, cutoff_rad, beam_rad } => GpuEmitter {
            kind: SPOT,
            position: position.to_array(),
            direction: direction.to_array(),
            color: intensity.to_array(),
            cutoff: *cutoff_rad,
            beam: *beam_rad,
            ..GpuEmitter::default()
        },
        Emitter::Directional { direction, irradiance } => GpuEmitter {
            kind: DIRECTIONAL,
            direction: direction.to_array(),
            color: irradiance.to_array(),
            ..GpuEmitter::default()
        },
        Emitter::Envmap { .. } | Emitter::Constant { .. } => GpuEmitter { kind: AT_INFINITY, ..GpuEmitter::default() },
    };
    world.scene.emitters.iter().enumerate().map(of).collect()
}

pub(crate) fn near(world: &World) -> Vec<GpuNear> {
    let of = |near: &Near| match near {
        Near::Triangle(t) => GpuNear { triangle: t.index, emitter: t.emitter, area: t.area, padding: 0 },
        Near::Delta(emitter) => GpuNear { triangle: NONE, emitter: *emitter, ..GpuNear::default() },
    };
    world.lights.near.iter().map(of).collect()
}

pub(crate) fn environments(world: &World, textures: &mut Textures, tables: &mut Tables) -> Vec<GpuEnvironment> {
    let columns = |m: &Mat3| m.to_cols_array_2d().map(|[x, y, z]| [x, y, z, 0.0]);
    let of = |environment: &Environment| match environment {
        Environment::Constant(color) => GpuEnvironment { color: color.to_array(), ..GpuEnvironment::default() },
        Environment::Map(map) => GpuEnvironment {
            world_from_local: columns(&map.world_from_local),
            local_from_world: columns(&map.local_from_world),
            scale: map.scale,
            image: textures.image(&map.image, tables),
            rows: tables.floats(map.rows.sums.iter().copied()),
            columns: tables.floats(map.columns.iter().flat_map(|row| row.sums.iter().copied())),
            sines: tables.floats(map.sines.iter().copied()),
            mean: map.mean,
            ..GpuEnvironment::default()
        },
    };
    world.lights.environments.iter().map(of).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gpu::layout::check;
    use crate::gpu::scene::RAYS;

    #[test]
    fn structs_are_laid_out_as_in_the_shader() {
        check!(RAYS, GpuEmitter as "Emitter" {
            position, kind, direction, texture, color, cutoff, beam, first, start
        });
        check!(RAYS, GpuNear as "Near" { triangle, emitter, area });
        check!(RAYS, GpuEnvironment as "Environment" {
            world_from_local, local_from_world, color, scale, image, rows, columns, sines, mean
        });
    }
}
