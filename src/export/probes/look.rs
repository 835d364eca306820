//! What a probe sees of a scene by its light map, for sets that hold no radiance by direction.

use super::{Around, Probe};
use crate::base::math::Rgb;
use crate::base::octahedral::{middle, solid_angle};
use crate::base::ray::Ray;
use crate::lightmap::LightMap;
use crate::method::light_field_probes::probe::Light;
use crate::probe::file::Probe as Glossy;
use crate::transport::World;
use glam::Vec3;
use rayon::prelude::*;

/// Texels along an edge of the map of radiance.
const SIZE: usize = 256;
/// Texels along an edge of that of irradiance.
const AMBIENT: usize = 16;

/// A probe at `position` of diffuse light, and of what the texels of a glossy probe hold, where it has been baked. Lamps and the sky are dark, as in light field
/// probes.
pub fn look(world: &World, map: &LightMap, position: Vec3, glossy: Option<&Glossy>) -> Probe {
    let seen = |d: Vec3| {
        let diffuse =
            world.intersect(&Ray::new(position, d)).map_or(Rgb::ZERO, |surface| map.diffuse_radiance(&world.scene, &surface, -d));
        diffuse + glossy.map_or(Rgb::ZERO, |probe| probe.texel(probe.map.texel_from_direction(d)).glossy())
    };
    let radiance: Vec<Rgb> = (0..SIZE * SIZE).into_par_iter().with_min_len(SIZE).map(|i| seen(middle(i, SIZE))).collect();
    let arriving: Vec<(Vec3, Rgb)> =
        radiance.iter().enumerate().map(|(i, l)| (middle(i, SIZE), *l * solid_angle(i % SIZE, i / SIZE, SIZE))).collect();
    let irradiance = |k: usize| {
        let normal = middle(k, AMBIENT);
        arriving.iter().map(|(d, light)| *light * normal.dot(*d).max(0.0)).sum()
    };
    let around = Around { irradiance: (0..AMBIENT * AMBIENT).into_par_iter().map(irradiance).collect(), size: AMBIENT };
    Probe { light: Light::new(&radiance, SIZE), around }
}
