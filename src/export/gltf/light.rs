//! Textures of light: of the map's own atlas, and of pages.

use super::Bakes;
use super::layout::{Layout, Place};
use super::pixels;
use super::points::Points;
use super::writer::Writer;
use crate::Result;
use crate::base::math::{Rgb, luminance};
use crate::lightmap::LightMap;
use crate::scene::Geometry;
use serde_json::{Value, json};

/// Share of the map's texels that are as bright as occlusion's white, or brighter.
const BRIGHT: f32 = 0.05;

/// The textures of each place.
pub struct Light {
    atlas: Textures,
    pages: Vec<Textures>,
    intensity: f32,
}

/// Numbers of textures.
#[derive(Default)]
struct Textures {
    front: Option<usize>,
    back: Option<usize>,
    occlusion: Option<usize>,
}

/// What is the same on all textures.
struct Scale<'a> {
    bakes: Bakes<'a>,
    /// What RGBM is multiplied by.
    intensity: f32,
    /// The light map's luminance that is no occlusion.
    white: f32,
}

impl Light {
    /// Writes them; `backs` has the triangles of each shape whose backs are lit.
    pub fn write(writer: &mut Writer, geometry: &Geometry, bakes: Bakes, layout: &Layout, backs: &[Vec<u32>]) -> Result<Self> {
        let scale = Scale::of(bakes);
        let has_back = |place| layout.places.iter().zip(backs).any(|(of, backs)| *of == place && !backs.is_empty());
        let mut light = Self { atlas: Textures::default(), pages: Vec::new(), intensity: scale.intensity };
        if let Some(map) = bakes.any().filter(|_| layout.places.contains(&Place::Atlas)) {
            let size = map.size.map(|n| n as usize);
            let sample = |map: &LightMap, back: bool| {
                let pixels = map.back.as_ref().filter(|_| back).unwrap_or(&map.front);
                pixels.iter().take(size[0] * size[1]).copied().collect()
            };
            light.atlas = scale.textures(writer, size, has_back(Place::Atlas), &sample)?;
        }
        for (i, page) in layout.pages.iter().enumerate() {
            let points = Points::new(geometry, &page.objects, page.size());
            let sample = |map: &LightMap, back: bool| points.light(map, back);
            light.pages.push(scale.textures(writer, [points.size; 2], has_back(Place::Page(i)), &sample)?);
        }
        Ok(light)
    }

    fn at(&self, place: Place) -> Option<&Textures> {
        match place {
            Place::Nowhere => None,
            Place::Atlas => Some(&self.atlas),
            Place::Page(page) => self.pages.get(page),
        }
    }

    /// What the extension says of a shape's front or back.
    pub fn of(&self, place: Place, turned: bool) -> Option<Value> {
        let textures = self.at(place)?;
        let index = textures.back.filter(|_| turned).or(textures.front)?;
        Some(json!({ "lightMapTexture": { "index": index, "texCoord": 1 }, "intensity": self.intensity }))
    }

    /// The texture of occlusion, for a material.
    pub fn occlusion(&self, place: Place) -> Option<Value> {
        Some(json!({ "index": self.at(place)?.occlusion?, "texCoord": 1 }))
    }
}

impl<'a> Scale<'a> {
    fn of(bakes: Bakes<'a>) -> Self {
        let all = bakes.light.iter().flat_map(|map| map.front.iter().chain(map.back.iter().flatten()));
        let largest = all.map(|p| p.max_element()).fold(0.0, f32::max);
        let fronts = bakes.light.iter().flat_map(|map| &map.front);
        let mut bright: Vec<f32> = fronts.map(|p| luminance(*p)).filter(|l| *l > 0.0).collect();
        bright.sort_unstable_by(f32::total_cmp);
        let white = bright.get((bright.len() as f32 * (1.0 - BRIGHT)) as usize).copied().unwrap_or(1.0);
        Self { bakes, intensity: (largest / pixels::RGBM_RANGE).max(1.0), white }
    }

    /// Writes the textures of a place; `sample` says what a map has for its texels.
    fn textures(
        &self,
        writer: &mut Writer,
        size: [usize; 2],
        has_back: bool,
        sample: &dyn Fn(&LightMap, bool) -> Vec<Rgb>,
    ) -> Result<Textures> {
        let mut textures = Textures::default();
        if let Some(map) = self.bakes.light {
            let mut side = |back: bool, name: &str| {
                let pixels: Vec<Rgb> = sample(map, back).into_iter().map(|p| p / self.intensity).collect();
                writer.texture(&pixels::rgbm(&pixels, size), name, sampler())
            };
            textures.front = Some(side(false, "irradiance")?);
            textures.back = has_back.then(|| side(true, "irradiance of backs")).transpose()?;
        }
        let (map, white, name) = match self.bakes {
            Bakes { openness: Some(map), .. } => (map, 1.0, "ambient occlusion"),
            Bakes { light: Some(map), .. } => (map, self.white, "relative irradiance"),
            _ => return Ok(textures),
        };
        let shares: Vec<f32> = sample(map, false).into_iter().map(|p| luminance(p) / white).collect();
        textures.occlusion = Some(writer.texture(&pixels::occlusion(&shares, size), name, sampler())?);
        Ok(textures)
    }
}

/// Of a texture whose charts must not mix with what lies beyond its edges.
fn sampler() -> Value {
    json!({ "magFilter": 9729, "minFilter": 9729, "wrapS": 33071, "wrapT": 33071 })
}
