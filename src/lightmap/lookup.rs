//! The light map's file, and the lookup that a renderer does for every pixel.
//!
//! `lightmap.exr` holds `irradiance.{R,G,B}` (E_T on the side of the shading normal, as halves), `back.{R,G,B}`
//! where some surface's back is lit, and the integer channel `atlas`. That is a table, not a picture: word `i` is
//! pixel `i` in row order. It starts with [`MAGIC`], the number of triangles and of charts; then come each
//! triangle's chart (2³²-1: none), and eight floats (as bits) a chart, the affine map from a world position
//! to texels: column = (x, y, z, w) · (p, 1), then the row's four.
//!
//! A map of ambient occlusion has the channels `ao` and `ao_back` in their place, 1 in the open and 0 where all is blocked.
//!
//! *Ours*: the charts are planar projections, so a chart's eight floats say what else would be six a triangle.

use super::Atlas;
use super::adjacency::NONE;
use crate::base::math::Rgb;
use crate::io::{ExrImage, Provenance};
use crate::material::Surface;
use crate::scene::{Geometry, Scene};
use crate::{Error, Result};
use glam::{Vec2, Vec3, Vec4};
use std::f32::consts::FRAC_1_PI;
use std::path::Path;

/// First word of the table; changes with its layout.
pub const MAGIC: u32 = 0x4c4d_0001;
/// Layers of light, front and back.
const IRRADIANCE: [&str; 2] = ["irradiance", "back"];
/// Channels of ambient occlusion, front and back.
const OPENNESS: [&str; 2] = ["ao", "ao_back"];
/// Farthest that a corner may lie beyond the image, texels.
const SLACK: f32 = 0.25;

/// A light map ready for lookups.
#[derive(Debug, Clone, PartialEq)]
pub struct LightMap {
    /// Width and height, texels.
    pub size: [u32; 2],
    /// E_T on the side of the shading normal, rows from the top.
    pub front: Vec<Rgb>,
    /// E_T behind, where any surface has a lit back.
    pub back: Option<Vec<Rgb>>,
    /// Each triangle's corners in texels; NaN for triangles without light.
    pub(crate) corners: Vec<[Vec2; 3]>,
}

impl LightMap {
    /// Reads the file that `bake-lightmap` wrote for this very scene.
    pub fn load(path: &Path, scene: &Scene) -> Result<Self> {
        let image = ExrImage::read(path)?;
        if image.has(OPENNESS[0]) {
            return Err(Error::input(path, "holds ambient occlusion, written with --ao: expected light"));
        }
        let front = image.rgb(path, IRRADIANCE[0])?;
        let has_back = image.channels.iter().any(|(n, _)| n.starts_with("back."));
        let back = if has_back { Some(image.rgb(path, IRRADIANCE[1])?) } else { None };
        Self::placed(path, &image, scene, front, back)
    }

    /// Reads the ambient occlusion that `bake-lightmap --ao` wrote for this very scene: 1 in the open, 0 where all is blocked.
    pub fn load_openness(path: &Path, scene: &Scene) -> Result<Self> {
        let image = ExrImage::read(path)?;
        let side = |name: &str| -> Result<Vec<Rgb>> { Ok(image.f32(path, name)?.into_iter().map(Rgb::splat).collect()) };
        let front = side(OPENNESS[0])?;
        let back = image.has(OPENNESS[1]).then(|| side(OPENNESS[1])).transpose()?;
        Self::placed(path, &image, scene, front, back)
    }

    fn placed(path: &Path, image: &ExrImage, scene: &Scene, front: Vec<Rgb>, back: Option<Vec<Rgb>>) -> Result<Self> {
        image.provenance(path)?.check_scene(path, &scene.hash)?;
        let size = [image.width as u32, image.height as u32];
        let corners = decode(&image.u32(path, "atlas")?, &scene.geometry, size)
            .map_err(|m| Error::input(path, format!("channel \"atlas\": {m}")))?;
        Ok(Self { size, front, back, corners })
    }

    /// Whether another map has its texels at the same places.
    pub fn is_laid_out_as(&self, other: &Self) -> bool {
        let bits = |map: &Self| map.corners.iter().flatten().flat_map(|p| p.to_array().map(f32::to_bits)).collect::<Vec<_>>();
        self.size == other.size && bits(self) == bits(other)
    }

    /// E_T at a point of a triangle (barycentric weights of its second and third vertex), bilinear inside the chart.
    /// `back`: the viewer is on the side that the shading normal points away from. Zero for surfaces without a diffuse lobe.
    pub fn lookup(&self, triangle: u32, barycentric: Vec2, back: bool) -> Rgb {
        let pixels = match (back, &self.back) {
            (false, _) => &self.front,
            (true, Some(b)) => b,
            (true, None) => return Rgb::ZERO,
        };
        let Some([a, b, c]) = self.corners.get(triangle as usize) else { return Rgb::ZERO };
        let p = *a + (*b - *a) * barycentric.x + (*c - *a) * barycentric.y;
        bilinear(p, self.size).map_or(Rgb::ZERO, |taps| taps.iter().map(|&(i, w)| pixels[i] * w).sum())
    }

    /// Places of a triangle's corners in the picture, in [0, 1]² from its upper left corner; `None` for triangles without light.
    pub fn places(&self, triangle: u32) -> Option<[Vec2; 3]> {
        let corners = self.corners.get(triangle as usize).filter(|corners| !corners[0].is_nan())?;
        let size = Vec2::new(self.size[0] as f32, self.size[1] as f32);
        Some(corners.map(|corner| corner / size))
    }

    /// L(S|D)*DE: what the diffuse lobe at `surface` sends towards `wo` (unit, world, away from it).
    pub fn diffuse_radiance(&self, scene: &Scene, surface: &Surface, wo: Vec3) -> Rgb {
        let wi = surface.frame.to_local(wo);
        let out = scene.bsdf(surface).diffuse_out(surface, wi);
        if out == Rgb::ZERO {
            return Rgb::ZERO;
        }
        out * self.lookup(surface.triangle, surface.barycentric, wi.z < 0.0) * FRAC_1_PI
    }
}

/// The four texels about `p` (texels) and their weights; `None` for a NaN.
pub(super) fn bilinear(p: Vec2, size: [u32; 2]) -> Option<[(usize, f32); 4]> {
    if p.is_nan() {
        return None;
    }
    let (w, h) = (size[0] as usize, size[1] as usize);
    let q = (p - 0.5).clamp(Vec2::ZERO, Vec2::new((w - 1) as f32, (h - 1) as f32));
    let (x, y) = (q.x as usize, q.y as usize);
    let (fx, fy) = (q.x - x as f32, q.y - y as f32);
    let (x1, y1) = ((x + 1).min(w - 1), (y + 1).min(h - 1));
    Some([
        (y * w + x, (1.0 - fx) * (1.0 - fy)),
        (y * w + x1, fx * (1.0 - fy)),
        (y1 * w + x, (1.0 - fx) * fy),
        (y1 * w + x1, fx * fy),
    ])
}

/// A light map from pixels in an atlas's layout.
pub fn sides(geometry: &Geometry, atlas: &Atlas, front: Vec<Rgb>, back: Option<Vec<Rgb>>) -> LightMap {
    LightMap { size: atlas.size, front, back, corners: atlas.all_corners(geometry) }
}

/// The file's image of light.
pub fn encode(geometry: &Geometry, atlas: &Atlas, front: &[Rgb], back: Option<&[Rgb]>, provenance: Provenance) -> ExrImage {
    let layer = |(name, pixels): (&str, Option<&[Rgb]>)| {
        let pixels = pixels.map(<[Rgb]>::to_vec).unwrap_or_default();
        let channels = if pixels.is_empty() { 0..0 } else { 0..3 };
        channels.map(|i| (format!("{name}.{}", ["R", "G", "B"][i]), channel(&pixels, i))).collect::<Vec<_>>()
    };
    let channels = IRRADIANCE.into_iter().zip([Some(front), back]).flat_map(layer).collect();
    laid_out(geometry, atlas, channels).with_provenance(provenance)
}

/// The file's image of ambient occlusion, whose three channels are alike.
pub fn encode_openness(
    geometry: &Geometry,
    atlas: &Atlas,
    front: &[Rgb],
    back: Option<&[Rgb]>,
    provenance: Provenance,
) -> ExrImage {
    let sides = OPENNESS.into_iter().zip([Some(front), back]);
    let channels = sides.filter_map(|(name, pixels)| Some((name.to_owned(), channel(pixels?, 0)))).collect();
    laid_out(geometry, atlas, channels).with_provenance(provenance)
}

fn channel(pixels: &[Rgb], i: usize) -> Vec<f32> {
    pixels.iter().map(|p| p[i]).collect()
}

/// Channels with the table of their places. Rows are added below the picture where the table needs more room.
fn laid_out(geometry: &Geometry, atlas: &Atlas, channels: Vec<(String, Vec<f32>)>) -> ExrImage {
    let mut table = vec![MAGIC, geometry.triangles.len() as u32, atlas.charts.len() as u32];
    table.extend(&atlas.triangle_chart);
    for chart in &atlas.charts {
        table.extend(chart.column.to_array().map(f32::to_bits));
        table.extend(chart.row.to_array().map(f32::to_bits));
    }
    let width = atlas.size[0] as usize;
    let height = (atlas.size[1] as usize).max(table.len().div_ceil(width));
    table.resize(width * height, 0);
    let filled = |values: Vec<f32>| values.into_iter().chain(std::iter::repeat(0.0)).take(width * height);
    let image = ExrImage::new(width, height);
    channels.into_iter().fold(image, |image, (name, values)| image.with_f16(&name, filled(values))).with_u32("atlas", table)
}

fn decode(words: &[u32], geometry: &Geometry, size: [u32; 2]) -> std::result::Result<Vec<[Vec2; 3]>, String> {
    let [magic, triangles, charts, rest @ ..] = words else { return Err("has no table".into()) };
    if *magic != MAGIC {
        return Err(format!("starts with {magic:#010x}, expected {MAGIC:#010x}: written by another version"));
    }
    if *triangles as usize != geometry.triangles.len() {
        return Err(format!("is for {triangles} triangles, the scene has {}", geometry.triangles.len()));
    }
    let needed = *triangles as usize + 8 * *charts as usize;
    if rest.len() < needed {
        return Err(format!("has {} words, expected {needed}", rest.len()));
    }
    let (of_triangle, maps) = rest.split_at(*triangles as usize);
    let floats = |i: usize| Vec4::from_array(std::array::from_fn(|k| f32::from_bits(maps[i + k])));
    let limit = Vec2::new(size[0] as f32, size[1] as f32);
    let mut corners = Vec::with_capacity(of_triangle.len());
    for (t, &chart) in of_triangle.iter().enumerate() {
        if chart == NONE {
            corners.push([Vec2::NAN; 3]);
            continue;
        }
        if chart >= *charts {
            return Err(format!("triangle {t} is in chart {chart} of {charts}"));
        }
        let (column, row) = (floats(8 * chart as usize), floats(8 * chart as usize + 4));
        let places = geometry.corners(t as u32).map(|p| Vec2::new(column.dot(p.extend(1.0)), row.dot(p.extend(1.0))));
        // Projecting world positions costs some bits: a corner on the image's border may come out a hair beyond it.
        let inside = |p: Vec2| p.cmpge(Vec2::splat(-SLACK)).all() && p.cmple(limit + SLACK).all();
        if !places.into_iter().all(inside) {
            return Err(format!("triangle {t} lies outside of the image"));
        }
        corners.push(places.map(|p| p.clamp(Vec2::ZERO, limit)));
    }
    Ok(corners)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lightmap::{AtlasParams, testing};
    use glam::Vec3;

    fn scene() -> Scene {
        let mut scene = Scene { hash: "this scene".into(), ..Default::default() };
        testing::cuboid(scene.geometry_mut(), Vec3::ZERO, Vec3::ONE);
        scene
    }

    fn image(scene: &Scene, atlas: &Atlas) -> ExrImage {
        // E = texel column, so that a lookup gives the column back.
        let front: Vec<Rgb> = (0..atlas.size[0] * atlas.size[1]).map(|i| Rgb::splat((i % atlas.size[0]) as f32 + 0.5)).collect();
        encode(&scene.geometry, atlas, &front, None, Provenance::new("bake-lightmap", &scene.hash, 0, &()))
    }

    #[test]
    fn a_written_map_gives_back_what_the_atlas_says() {
        let (dir, scene) = (tempfile::tempdir().unwrap(), scene());
        // Texels so large that the table needs rows of its own.
        for texel in [0.1, 2.0] {
            let params = AtlasParams { texel: Some(texel), ..Default::default() };
            let atlas = Atlas::build(&scene.geometry, &|_| true, &params).unwrap();
            let path = dir.path().join("lightmap.exr");
            image(&scene, &atlas).write(&path).unwrap();
            let map = LightMap::load(&path, &scene).unwrap();
            for t in 0..12 {
                let expected = atlas.corners(&scene.geometry, t).unwrap();
                let p = expected[0] * 0.5 + expected[1] * 0.3 + expected[2] * 0.2;
                let found = map.lookup(t, Vec2::new(0.3, 0.2), false).x;
                assert!((found - p.x).abs() < 1e-3 * p.x, "{found} at column {}", p.x);
                assert_eq!(map.lookup(t, Vec2::new(0.3, 0.2), true), Rgb::ZERO);
            }
            assert_eq!(map.lookup(999, Vec2::ZERO, false), Rgb::ZERO);
        }
    }

    #[test]
    fn another_scene_and_a_broken_table_are_refused() {
        let (dir, mut scene) = (tempfile::tempdir().unwrap(), scene());
        let atlas = Atlas::build(&scene.geometry, &|_| true, &AtlasParams { texel: Some(0.1), ..Default::default() }).unwrap();
        let path = dir.path().join("lightmap.exr");
        let fails = |image: &ExrImage, scene: &Scene, word: &str| {
            image.write(&path).unwrap();
            let message = LightMap::load(&path, scene).unwrap_err().to_string();
            assert!(message.contains(word) && message.contains("lightmap.exr"), "{message}");
        };
        for (word, value, expected) in [
            (0, 7, "another version"),
            (1, 11, "11 triangles"),
            (2, u32::MAX, "words"),
            (3, 77, "chart 77"),
            (20, 0x7f00_0000, "outside"),
        ] {
            let mut broken = image(&scene, &atlas);
            for (name, samples) in &mut broken.channels {
                if let ("atlas", crate::io::Samples::U32(v)) = (name.as_str(), samples) {
                    v[word] = value;
                }
            }
            fails(&broken, &scene, expected);
        }
        let good = image(&scene, &atlas);
        scene.hash = "that scene".into();
        fails(&good, &scene, "another scene");
    }
}
