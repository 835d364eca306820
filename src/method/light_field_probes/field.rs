//! Light field probes in memory: where they stand, what they see, and the light that they hold.

use super::ambient::irradiance;
use super::march::Map;
use super::octree::Octree;
use super::probe::{Ambient, Light, Surfels};
use crate::base::math::Rgb;
use crate::probe::places::Places;
use glam::Vec3;
use rayon::prelude::*;

/// Light field probes in memory, by their index; blocked ones hold nothing.
#[derive(Debug, Clone)]
pub struct LightField {
    /// Where they stand.
    pub places: Places,
    /// Which of them see a place; none where they stand in a grid.
    pub octree: Option<Octree>,
    /// Surfaces.
    pub maps: Vec<Map>,
    /// Radiance.
    pub light: Vec<Light>,
    /// Irradiance and moments.
    pub ambient: Vec<Ambient>,
}

impl LightField {
    /// Surfaces without light: `surfels` by index, blocked probes' as [`no_surfels`]. Makes the octree.
    pub fn unlit(places: Places, surfels: Vec<Surfels>) -> Self {
        let octree = places.grid().is_none().then(|| Octree::of(&places, &surfels));
        let count = surfels.len();
        Self {
            places,
            octree,
            maps: surfels.into_par_iter().map(Map::new).collect(),
            light: vec![Light::new(&[Rgb::ZERO], 1); count],
            ambient: vec![Ambient::dark(); count],
        }
    }

    /// Whether the probes hold light.
    pub fn is_lit(&self) -> bool {
        self.ambient.iter().any(|a| a.size > 1)
    }

    /// Irradiance at a point with a unit normal, without light straight from emitters.
    pub fn irradiance(&self, p: Vec3, normal: Vec3) -> Rgb {
        irradiance(&self.places, self.octree.as_ref(), &self.ambient, p, normal)
    }

    /// Memory that the probes take.
    pub fn bytes(&self) -> usize {
        let maps: usize = self.maps.iter().map(|m| m.surfels.bytes() + m.pyramid.bytes()).sum();
        let ambient: usize =
            self.ambient.iter().map(|a| size_of_val(a.irradiance.as_slice()) + size_of_val(a.moments.as_slice())).sum();
        let octree = self.octree.as_ref().map_or(0, Octree::bytes);
        maps + ambient + octree + self.light.iter().map(Light::bytes).sum::<usize>()
    }
}

/// What stands for the surfaces of a blocked probe, which nobody asks.
pub fn no_surfels() -> Surfels {
    Surfels { size: 1, distance: vec![f32::INFINITY], normal: vec![0] }
}
