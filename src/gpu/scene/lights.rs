//! Emitters, what chooses from them, and environments.

use super::textures::{GpuImage, Textures};
use super::{NONE, Words};
use crate::gpu::spec::{StructLayout, layout};
use crate::scene::Emitter;
use crate::transport::World;
use crate::transport::light_tree::WIDTH;
use crate::transport::lights::{Environment, Near};
use crate::transport::outlook::Outlook;
use bytemuck::{Pod, Zeroable, bytes_of, pod_collect_to_vec};
use glam::{Mat3, Vec3};

/// An emitter, as the constants `EMITTER_...` of scene.wgsl have it.
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

pub(crate) const AREA: u32 = 0;
pub(crate) const POINT: u32 = 1;
pub(crate) const SPOT: u32 = 2;
pub(crate) const DIRECTIONAL: u32 = 3;
pub(crate) const AT_INFINITY: u32 = 4;

/// `Near` of scene.wgsl.
#[repr(C)]
#[derive(Clone, Copy, Default, Pod, Zeroable)]
pub(crate) struct GpuNear {
    triangle: u32,
    emitter: u32,
    area: f32,
    place: u32,
}

pub(crate) const NEAR: StructLayout = layout!(GpuNear as "Near" { triangle, emitter, area, place });
#[cfg(test)]
pub(crate) const EMITTER: StructLayout = layout!(GpuEmitter as "EMITTER" {
    position, kind, direction, texture, color, cutoff, beam, first, start
});
/// The light tree's nodes are uploaded as they are.
#[cfg(test)]
pub(crate) const LIGHT_NODE: StructLayout = layout!(crate::transport::light_tree::Node as "LIGHT_NODE" {
    centre, radius_sq, axis, cos_spread, sin_spread, cos_reach, power, children, parent
});
#[cfg(test)]
pub(crate) const ENVIRONMENT: StructLayout = layout!(GpuEnvironment as "ENVIRONMENT" {
    world_from_local, local_from_world, color, scale, image, row_sums, column_sums, sines, mean
});

/// An environment, as the constants `ENVIRONMENT_...` of scene.wgsl have it.
#[repr(C)]
#[derive(Clone, Copy, Default, Pod, Zeroable)]
pub(crate) struct GpuEnvironment {
    world_from_local: [[f32; 4]; 3],
    local_from_world: [[f32; 4]; 3],
    color: [f32; 3],
    scale: f32,
    image: GpuImage,
    row_sums: u32,
    column_sums: u32,
    sines: u32,
    mean: f32,
}

/// Words before the cells of an outlook.
pub(crate) const OUTLOOK_HEADER: usize = 8;

/// What of the environments is seen from where, as outlook.wgsl reads it; [`NONE`] where that is not known.
pub(crate) fn outlook(world: &World, words: &mut Words) -> u32 {
    let Some(Outlook { grid, which, shares, .. }) = world.lights.outlook.as_deref() else { return NONE };
    let at = words.floats(grid.corner.to_array());
    words.floats([grid.per_metre]);
    words.extend(grid.size.to_array());
    words.extend([at + (OUTLOOK_HEADER + which.len()) as u32]);
    words.extend(which.iter().copied());
    words.extend(shares.iter().flat_map(|shares| pod_collect_to_vec::<u8, u32>(bytes_of(shares))));
    at
}

pub(crate) fn emitters(world: &World, textures: &mut Textures, words: &mut Words) -> Vec<GpuEmitter> {
    let of = |(i, emitter): (usize, &Emitter)| match emitter {
        Emitter::Area { object, radiance } => GpuEmitter {
            kind: AREA,
            texture: textures.add(radiance, words),
            first: world.lights.first[i].unwrap_or(NONE),
            start: world.scene.geometry.objects[*object as usize].triangles.start,
            ..GpuEmitter::default()
        },
        Emitter::Point { position, intensity } => {
            GpuEmitter { kind: POINT, position: position.to_array(), color: intensity.to_array(), ..GpuEmitter::default() }
        }
        Emitter::Spot { position, direction, intensity, cutoff_rad, beam_rad, .. } => GpuEmitter {
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
        // Refused before it comes here.
        Emitter::Projector { .. } => GpuEmitter::default(),
        Emitter::Envmap { .. } | Emitter::Constant { .. } | Emitter::Sun { .. } => {
            GpuEmitter { kind: AT_INFINITY, ..GpuEmitter::default() }
        }
    };
    world.scene.emitters.iter().enumerate().map(of).collect()
}

pub(crate) fn near(world: &World) -> Vec<GpuNear> {
    let of = |(near, [node, slot]): (&Near, &[u32; 2])| {
        let place = node * WIDTH as u32 + slot;
        match near {
            Near::Triangle(t) => {
                let area = if t.parallelogram { -t.area } else { t.area };
                GpuNear { triangle: t.index, emitter: t.emitter, area, place }
            }
            // Refused before it comes here.
            Near::Round(_) => GpuNear { triangle: NONE, emitter: NONE, area: 0.0, place },
            Near::Delta(emitter) => GpuNear { triangle: NONE, emitter: *emitter, area: 0.0, place },
        }
    };
    world.lights.near.iter().zip(&world.lights.tree.place).map(of).collect()
}

pub(crate) fn environments(world: &World, textures: &mut Textures, words: &mut Words) -> Vec<GpuEnvironment> {
    let columns = |m: &Mat3| m.to_cols_array_2d().map(|[x, y, z]| [x, y, z, 0.0]);
    let of = |environment: &Environment| match environment {
        Environment::Constant(color) => GpuEnvironment { color: color.to_array(), ..GpuEnvironment::default() },
        Environment::Sun(sun) => GpuEnvironment {
            world_from_local: columns(&Mat3::from_cols(Vec3::ZERO, sun.up, sun.direction())),
            color: sun.radiance.to_array(),
            scale: sun.height,
            ..GpuEnvironment::default()
        },
        Environment::Map(map) => GpuEnvironment {
            world_from_local: columns(&map.world_from_local),
            local_from_world: columns(&map.local_from_world),
            scale: map.scale,
            image: textures.image(&map.image, words),
            row_sums: words.floats(map.rows.sums.iter().copied()),
            column_sums: words.floats(map.columns.iter().flat_map(|row| row.sums.iter().copied())),
            sines: words.floats(map.sines.iter().copied()),
            mean: map.mean,
            ..GpuEnvironment::default()
        },
    };
    world.lights.environments.iter().map(of).collect()
}
