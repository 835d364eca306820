//! The atlas: every chart's place in one image, and the way from a triangle to its texels.
//!
//! *Ours*: each chart has a gutter of [`GUTTER`] texels on every side, the reach of a bilinear filter, so that
//! no lookup inside a chart's rectangle ever reads a texel of another. Charts are stretched to whole texels,
//! so that the border of a rectangular wall is a border between texels.

use super::adjacency;
use super::adjacency::{Adjacency, NONE};
use super::chart::{Chart, charts_of};
use super::pack::pack;
use crate::scene::Geometry;
use crate::{Error, Result};
use glam::{Vec2, Vec4};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// Texels around a chart that repeat its border.
pub const GUTTER: u32 = 1;

/// Most texels an atlas may have, gutters and gaps included.
pub const MAX_TEXELS: u64 = 1 << 26;

/// How often the texel grows when small charts take the atlas past its budget.
const MORE_TRIES: u32 = 3;

/// How finely surfaces are covered.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct AtlasParams {
    /// Edge of a texel, metres; by default what spends `budget`.
    pub texel: Option<f32>,
    /// About how many texels the surfaces get in all when `texel` is not given; backs come on top. *Ours*: 2 million,
    /// a texel of some 8 mm in a room of 130 m² of surfaces.
    pub budget: u32,
}

impl Default for AtlasParams {
    fn default() -> Self {
        Self { texel: None, budget: 2 << 20 }
    }
}

/// Two edges of different charts that are one on a smooth surface, each a triangle and an edge from corner `e` to `e + 1`.
/// They run in opposite directions.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Seam {
    /// One side.
    pub a: (u32, u8),
    /// The other.
    pub b: (u32, u8),
}

/// Charts packed into an image.
#[derive(Debug, Clone, PartialEq)]
pub struct Atlas {
    /// Width and height, texels.
    pub size: [u32; 2],
    /// Edge of a texel, metres (charts are stretched to slightly smaller ones).
    pub texel: f32,
    /// The charts; their `column` and `row` give places in the whole image.
    pub charts: Vec<Chart>,
    /// Chart of each triangle; [`NONE`] for those that need no light.
    pub triangle_chart: Vec<u32>,
    /// Where charts of a smooth surface meet.
    pub seams: Vec<Seam>,
}

impl Atlas {
    /// An atlas over the objects for which `keep` holds.
    pub fn build(geometry: &Geometry, keep: &(dyn Fn(usize) -> bool + Sync), params: &AtlasParams) -> Result<Self> {
        let adjacencies: Vec<Option<Adjacency>> =
            (0..geometry.objects.len()).into_par_iter().map(|o| keep(o).then(|| adjacency::adjacency(geometry, o))).collect();
        // Summed in file order: the same bits for any number of threads.
        let area: f64 = adjacencies.iter().flatten().flat_map(|a| &a.areas).map(|&a| f64::from(a)).sum();
        let mut texel = texel_size(area, params)?;
        let mut charts = cut(geometry, &adjacencies, area, texel)?;
        for _ in 0..MORE_TRIES {
            // Charts are whole texels wide, which counts where they are small.
            let texels = texels_of(&charts);
            let excess = texels / f64::from(params.budget);
            if params.texel.is_some() || excess < 1.25 {
                break;
            }
            let larger = two_digits(f64::from(texel) * excess.sqrt());
            let fewer = cut(geometry, &adjacencies, area, larger)?;
            if texels_of(&fewer) > 0.9 * texels {
                // As small as they get: larger texels would only be emptier.
                break;
            }
            (texel, charts) = (larger, fewer);
        }
        let size = place(&mut charts, texel)?;
        let mut triangle_chart = vec![NONE; geometry.triangles.len()];
        for (i, chart) in charts.iter().enumerate() {
            for &t in &chart.triangles {
                triangle_chart[t as usize] = i as u32;
            }
        }
        let seams = adjacencies.iter().flatten().flat_map(|a| seams_of(a, &triangle_chart)).collect();
        Ok(Self { size, texel, charts, triangle_chart, seams })
    }

    /// Corners of a triangle in texels of the image; `None` for a triangle without a chart, as those are that came later.
    pub fn corners(&self, geometry: &Geometry, triangle: u32) -> Option<[Vec2; 3]> {
        let chart = self.charts.get(*self.triangle_chart.get(triangle as usize)? as usize)?;
        Some(geometry.corners(triangle).map(|p| chart.project(p)))
    }

    /// Those of all triangles; NaN for triangles without a chart.
    pub fn all_corners(&self, geometry: &Geometry) -> Vec<[Vec2; 3]> {
        (0..geometry.triangles.len() as u32).map(|t| self.corners(geometry, t).unwrap_or([Vec2::NAN; 3])).collect()
    }
}

/// How many texels charts take.
fn texels_of(charts: &[Chart]) -> f64 {
    charts.iter().map(|c| f64::from(c.size[0]) * f64::from(c.size[1])).sum()
}

/// The texel's edge: as given, or what spends the budget, rounded up to two digits.
fn texel_size(area: f64, params: &AtlasParams) -> Result<f32> {
    if let Some(texel) = params.texel {
        return if texel.is_finite() && texel > 0.0 {
            Ok(texel)
        } else {
            Err(Error::Request(format!("--texel {texel}: expected a positive length in metres")))
        };
    }
    if !(area.is_finite() && area > 0.0) {
        return Ok(1.0);
    }
    Ok(two_digits((area / f64::from(params.budget.max(1))).sqrt()))
}

/// Rounds up to two digits.
fn two_digits(x: f64) -> f32 {
    let digit = 10f64.powf(x.log10().floor() - 1.0);
    ((x / digit - 1e-6).ceil() * digit) as f32
}

/// The charts of all objects, in their order.
fn cut(geometry: &Geometry, adjacencies: &[Option<Adjacency>], area: f64, texel: f32) -> Result<Vec<Chart>> {
    let texels = area / f64::from(texel).powi(2);
    if texels > MAX_TEXELS as f64 {
        return Err(too_many(texel, texels));
    }
    let per_object: Vec<Vec<Chart>> =
        adjacencies.par_iter().map(|a| a.as_ref().map_or_else(Vec::new, |a| charts_of(geometry, a, texel))).collect();
    Ok(per_object.into_iter().flatten().collect())
}

fn too_many(texel: f32, texels: f64) -> Error {
    let larger = f64::from(texel) * (texels / MAX_TEXELS as f64).sqrt() * 1.2;
    Error::Request(format!(
        "--texel {texel}: the light map would have {:.0} million texels, at most {} million are allowed; try --texel {larger:.2e}",
        texels / 1e6,
        MAX_TEXELS / 1_000_000
    ))
}

/// Packs the charts and moves their projections to their places; returns the image's size.
fn place(charts: &mut [Chart], texel: f32) -> Result<[u32; 2]> {
    let sizes: Vec<_> = charts.iter().map(|c| (c.size[0] + 2 * GUTTER, c.size[1] + 2 * GUTTER)).collect();
    let total: u64 = sizes.iter().map(|s| u64::from(s.0) * u64::from(s.1)).sum();
    if total > MAX_TEXELS {
        return Err(too_many(texel, total as f64));
    }
    let widest = sizes.iter().map(|s| s.0).max().unwrap_or(0);
    let width = (((total as f64 * 1.05).sqrt() as u32).max(widest).max(1)).next_multiple_of(64);
    let (places, height) = pack(&sizes, width).expect("the strip is as wide as the widest chart");
    let height = height.max(1);
    if u64::from(width) * u64::from(height) > 2 * MAX_TEXELS {
        return Err(too_many(texel, f64::from(width) * f64::from(height)));
    }
    for (chart, (x, y)) in charts.iter_mut().zip(places) {
        chart.corner = [x + GUTTER, y + GUTTER];
        chart.column += Vec4::W * chart.corner[0] as f32;
        chart.row += Vec4::W * chart.corner[1] as f32;
    }
    Ok([width, height])
}

fn seams_of(adjacency: &Adjacency, triangle_chart: &[u32]) -> Vec<Seam> {
    let mut seams = Vec::new();
    for (local, across) in adjacency.across.iter().enumerate() {
        let t = adjacency.first + local as u32;
        for (e, &(t2, e2)) in across.iter().enumerate() {
            if t < t2
                && t2 != NONE
                && adjacency.smooth[local][e]
                && triangle_chart[t as usize] != triangle_chart[t2 as usize]
                && triangle_chart[t as usize] != NONE
                && triangle_chart[t2 as usize] != NONE
            {
                seams.push(Seam { a: (t, e as u8), b: (t2, e2) });
            }
        }
    }
    seams
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::math::Rgb;
    use crate::lightmap::lookup::sides;
    use crate::lightmap::testing;
    use glam::Vec3;

    fn build(geometry: &Geometry, texel: f32) -> Atlas {
        Atlas::build(geometry, &|_| true, &AtlasParams { texel: Some(texel), ..Default::default() }).unwrap()
    }

    /// Every triangle lies inside its chart's rectangle, faces the same way and keeps its area within the allowed obliqueness.
    fn check(geometry: &Geometry, atlas: &Atlas) {
        for t in 0..geometry.triangles.len() as u32 {
            let chart = &atlas.charts[atlas.triangle_chart[t as usize] as usize];
            let [a, b, c] = atlas.corners(geometry, t).unwrap();
            let lo = Vec2::new(chart.corner[0] as f32, chart.corner[1] as f32);
            let hi = lo + Vec2::new(chart.size[0] as f32, chart.size[1] as f32);
            for p in [a, b, c] {
                assert!(p.cmpge(lo - 1e-2).all() && p.cmple(hi + 1e-2).all(), "{p} in {lo} .. {hi}");
            }
            assert!((b - a).perp_dot(c - a) >= 0.0, "triangle {t} faces away");
        }
    }

    /// No texel centre lies half a texel inside two triangles.
    fn check_folds(geometry: &Geometry, atlas: &Atlas) {
        let mut owner = vec![NONE; (atlas.size[0] * atlas.size[1]) as usize];
        for t in 0..geometry.triangles.len() as u32 {
            let [a, b, c] = atlas.corners(geometry, t).unwrap();
            for (i, o) in owner.iter_mut().enumerate() {
                let p = Vec2::new((i as u32 % atlas.size[0]) as f32 + 0.463, (i as u32 / atlas.size[0]) as f32 + 0.527);
                let inside = |a: Vec2, b: Vec2| (b - a).perp_dot(p - a) > 0.5 * (b - a).length();
                if inside(a, b) && inside(b, c) && inside(c, a) {
                    assert_eq!(*o, NONE, "triangle {t} lies on another");
                    *o = t;
                }
            }
        }
    }

    #[test]
    fn a_wall_is_one_chart_on_whole_texels() {
        let mut geometry = Geometry::default();
        testing::quad(&mut geometry, Vec3::new(0.3, 0.1, 0.7), Vec3::new(3.0, 0.0, 0.0), Vec3::new(0.0, 1.55, 0.0));
        let atlas = build(&geometry, 0.1);
        assert_eq!(atlas.charts.len(), 1);
        assert_eq!(atlas.charts[0].size, [30, 16], "15.5 texels are stretched to 16");
        check(&geometry, &atlas);
    }

    #[test]
    fn a_sphere_and_a_spiral_ramp_are_cut_into_charts_without_folds() {
        let mut geometry = Geometry::default();
        testing::sphere(&mut geometry, Vec3::ZERO, 1.0, 32);
        // Two and a half turns: seen from above the ramp covers itself.
        testing::spiral(&mut geometry, 2.5);
        let atlas = build(&geometry, 0.05);
        check(&geometry, &atlas);
        check_folds(&geometry, &atlas);
        let ramp = geometry.objects[1].triangles.clone().map(|t| atlas.triangle_chart[t as usize]);
        let charts: std::collections::BTreeSet<u32> = ramp.collect();
        assert!((2..8).contains(&charts.len()), "{charts:?}");
        assert!(atlas.charts.len() < 40, "{} charts", atlas.charts.len());
        assert!(!atlas.seams.is_empty());
    }

    #[test]
    fn creases_part_charts_and_the_sides_of_a_doubled_sheet_stay_apart() {
        let mut geometry = Geometry::default();
        testing::cuboid(&mut geometry, Vec3::ZERO, Vec3::ONE);
        assert_eq!(build(&geometry, 0.1).charts.len(), 6);
        assert!(build(&geometry, 0.1).seams.is_empty());
        let mut sheet = Geometry::default();
        testing::doubled_sheet(&mut sheet);
        assert_eq!(build(&sheet, 0.1).charts.len(), 2);
    }

    #[test]
    fn the_atlas_is_the_same_for_any_number_of_threads() {
        let mut geometry = Geometry::default();
        for i in 0..8 {
            testing::sphere(&mut geometry, Vec3::X * i as f32, 0.4, 12);
        }
        let run = |n| rayon::ThreadPoolBuilder::new().num_threads(n).build().unwrap().install(|| build(&geometry, 0.05));
        assert_eq!(run(1), run(3));
    }

    #[test]
    fn the_budget_sets_the_texel_and_too_fine_a_texel_is_an_error() {
        let mut geometry = Geometry::default();
        testing::quad(&mut geometry, Vec3::ZERO, Vec3::X * 10.0, Vec3::Y * 10.0);
        let atlas = Atlas::build(&geometry, &|_| true, &AtlasParams { texel: None, budget: 10_000 }).unwrap();
        assert_eq!(atlas.texel, 0.1);
        // The least that there is: one chart of one texel, filled by the wall.
        let atlas = Atlas::build(&geometry, &|_| true, &AtlasParams { texel: None, budget: 1 }).unwrap();
        let texels = crate::lightmap::texels::Texels::new(&geometry, &atlas);
        assert!(!texels.is_empty() && atlas.texel < 100.0, "{} texels of {} m", texels.len(), atlas.texel);
        for texel in [1e-4, 1e-30, 0.0, -1.0, f32::NAN] {
            let params = AtlasParams { texel: Some(texel), budget: 0 };
            assert!(Atlas::build(&geometry, &|_| true, &params).unwrap_err().to_string().contains("--texel"));
        }
    }

    #[test]
    fn bilinear_lookups_never_reach_another_chart() {
        let mut geometry = Geometry::default();
        testing::cuboid(&mut geometry, Vec3::ZERO, Vec3::new(1.0, 0.77, 0.31));
        testing::sphere(&mut geometry, Vec3::ZERO, 1.0, 16);
        let atlas = build(&geometry, 0.11);
        // Each chart in a colour of its own, everything between charts glaring.
        let texels = crate::lightmap::texels::Texels::new(&geometry, &atlas);
        let mut pixels = vec![Rgb::splat(1e6); (atlas.size[0] * atlas.size[1]) as usize];
        let mut valid = vec![false; pixels.len()];
        for i in 0..texels.len() {
            pixels[texels.pixel[i] as usize] = Rgb::splat(1.0 + texels.chart[i] as f32);
            valid[texels.pixel[i] as usize] = true;
        }
        crate::lightmap::fill::dilate(&atlas, &mut pixels, &valid);
        let map = sides(&geometry, &atlas, pixels, None);
        for t in 0..geometry.triangles.len() as u32 {
            let expected = 1.0 + atlas.triangle_chart[t as usize] as f32;
            for b in [Vec2::ZERO, Vec2::X, Vec2::Y, Vec2::splat(0.5), Vec2::new(0.5, 0.0), Vec2::new(0.2, 0.3)] {
                let found = map.lookup(t, b, false).x;
                assert!((found - expected).abs() < 1e-3, "triangle {t}: {found} in chart {expected}");
            }
        }
    }
}
