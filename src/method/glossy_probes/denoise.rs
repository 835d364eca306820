//! The noise of a probe's glossy texels, taken out along the reflectors that they show.
//!
//! *Ours*: the filter is the light map's ([`crate::lightmap::denoise`]), a fit of first order whose neighbours are weighed by how far they differ beside
//! the noise that their own paths have measured. Its sites are the probe's texels, at their places in the map, and its links join texels that are next to each
//! other there and show one smooth surface of one material. What a mirror shows has no noise, and stays as sharp as it is.
//!
//! In: the hits of texels and the sums over their paths. Out: radiance a texel. A texel's value depends on its probe alone.

use super::bake::{Centre, Sums};
use crate::base::math::Rgb;
use crate::base::progress::Silent;
use crate::lightmap::DenoiseParams;
use crate::lightmap::denoise::{Light, Surfaces};
use crate::lightmap::links::{Links, Site};
use crate::lightmap::texels::Point;
use crate::material::Surface;
use crate::transport::World;
use glam::{Vec2, Vec3};
use rayon::prelude::*;

/// Least cosine between the normals of texels that are linked (25 degrees).
const ALIGNED_COS: f32 = 0.9;
/// Greatest cosine between a normal and the way to a linked texel's point (60 degrees off the plane's normal).
const RISE_COS: f32 = 0.5;

/// Radiance of the texels of `centres`, in a map of `size`, without most of their noise.
pub(super) fn denoised(world: &World, centres: &[Centre], sums: &[Sums], size: [u32; 2], params: &DenoiseParams) -> Vec<Rgb> {
    let seen: Vec<Surface> = centres.par_iter().map(|centre| world.surface(&centre.hit)).collect();
    let sites: Vec<Site> = centres.iter().zip(&seen).map(|(centre, surface)| site(centre, surface, size[0])).collect();
    let links = links(centres, &seen, size);
    let light: Vec<Light> = sums.iter().map(Sums::light).collect();
    let clean = Surfaces { sites: &sites, links: &links, texel: 1.0, params }.denoise(&light, &Silent);
    clean.into_iter().map(|light| light.color).collect()
}

/// A texel as a site of a plane: the map itself.
fn site(centre: &Centre, surface: &Surface, width: u32) -> Site {
    Site {
        item: centre.texel,
        point: Point { triangle: centre.hit.triangle, barycentric: Vec2::new(centre.hit.u, centre.hit.v) },
        position: Vec3::new((centre.texel % width) as f32, (centre.texel / width) as f32, 0.0),
        normal: Vec3::Z,
        material: surface.material,
        in_part: false,
    }
}

/// Texels beside one another that show one smooth surface. The map's left and right border are not joined: a fit of first order does well on one side.
fn links(centres: &[Centre], seen: &[Surface], [width, height]: [u32; 2]) -> Links {
    let mut at = vec![u32::MAX; (width * height) as usize];
    centres.iter().enumerate().for_each(|(i, centre)| at[centre.texel as usize] = i as u32);
    let of = |i: usize| {
        let (x, y) = ((centres[i].texel % width) as i64, (centres[i].texel / width) as i64);
        // Straight neighbours first: the nearest.
        let around = [(1, 0), (-1, 0), (0, 1), (0, -1), (1, 1), (1, -1), (-1, 1), (-1, -1)];
        let inside = around.into_iter().map(|(dx, dy)| (x + dx, y + dy));
        let inside = inside.filter(|&(x, y)| (0..i64::from(width)).contains(&x) && (0..i64::from(height)).contains(&y));
        let neighbours = inside.map(|(x, y)| at[(y * i64::from(width) + x) as usize]).filter(|&j| j != u32::MAX);
        neighbours.filter(|&j| are_one(&seen[i], &seen[j as usize])).collect()
    };
    Links::of((0..centres.len()).into_par_iter().map(of).collect())
}

/// Whether two points lie on one smooth surface of one material.
fn are_one(a: &Surface, b: &Surface) -> bool {
    let way = (b.p - a.p).normalize_or_zero();
    let rises = |s: &Surface| s.frame.n.dot(way).abs() > RISE_COS;
    a.material == b.material && a.frame.n.dot(b.frame.n) >= ALIGNED_COS && !rises(a) && !rises(b)
}
