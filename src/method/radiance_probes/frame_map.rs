//! The light map that a frame looks indirect light up in. What fills its gutters is the same in every frame.
//!
//! *Ours*: seams of charts are left as they are, in contrast to a light map that is written to a file: light that comes by way of a few
//! numbers a cluster has no noise, and hardly jumps there (closing them changes display values in the room, at texels of 8 cm, by 0.0007 RMS).

use super::operator::Transport;
use crate::base::math::Rgb;
use crate::lightmap::LightMap;
use crate::lightmap::fill::Rings;
use crate::lightmap::lookup::sides;
use crate::lightmap::texels::Texels;
use crate::scene::Geometry;

/// Where receivers lie in the light map, and what fills its other texels.
pub struct FrameMap {
    /// Of each receiver: its pixel, and for the back as many more as an image has.
    pub places: Vec<u32>,
    /// What fills either side.
    pub rings: [Rings; 2],
    /// The light map without light; without a back where no receiver is one.
    pub dark: LightMap,
}

impl FrameMap {
    /// Of an operator's receivers, on a scene's triangles.
    pub fn new(geometry: &Geometry, transport: &Transport) -> Self {
        let atlas = &transport.atlas;
        let [width, height] = atlas.size.map(|n| n as usize);
        let pixels = width * height;
        let mut valid = vec![false; 2 * pixels];
        let places = transport.receivers.iter().map(|r| r.pixel + if r.back { pixels as u32 } else { 0 });
        let places: Vec<u32> = places.inspect(|&place| valid[place as usize] = true).collect();
        // A lookup takes the four texels about a point of a covered one.
        let mut wanted = vec![false; pixels];
        for &pixel in &Texels::new(geometry, atlas).pixel {
            let (x, y) = (pixel as usize % width, pixel as usize / width);
            for y in y.saturating_sub(1)..(y + 2).min(height) {
                wanted[y * width + x.saturating_sub(1)..y * width + (x + 2).min(width)].fill(true);
            }
        }
        let (front, back) = valid.split_at(pixels);
        let rings = [front, back].map(|valid| Rings::new(atlas, valid, Some(&wanted)));
        let dark = || vec![Rgb::ZERO; pixels];
        let dark = sides(geometry, atlas, dark(), back.contains(&true).then(dark));
        Self { places, rings, dark }
    }

    /// The light map of irradiance.
    pub fn lit(&self, values: &[Rgb]) -> LightMap {
        self.filled(values.iter().map(|value| value.max(Rgb::ZERO)))
    }

    /// The same of any number a receiver.
    pub fn filled(&self, values: impl IntoIterator<Item = Rgb>) -> LightMap {
        let mut map = self.dark.clone();
        let pixels = map.front.len();
        for (&place, value) in self.places.iter().zip(values) {
            let place = place as usize;
            let side = if place < pixels { Some(&mut map.front) } else { map.back.as_mut() };
            if let Some(side) = side {
                side[place % pixels] = value;
            }
        }
        let [front, back] = &self.rings;
        front.fill(&mut map.front);
        if let Some(side) = &mut map.back {
            back.fill(side);
        }
        map
    }
}
