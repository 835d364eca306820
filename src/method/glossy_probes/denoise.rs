//! The noise of a probe's glossy texels, taken out along the reflectors that they show.
//!
//! *Ours*: the filter is the light map's ([`crate::lightmap::denoise`]), a fit of first order whose neighbours are weighed by how far they differ beside
//! the noise that their own paths have measured. Its sites are the probe's texels, at their places in the map, and its links join texels that are next to each
//! other there and show one smooth surface of one material. How far they share light is bounded by how soon their lobes part: where a lobe is narrow, what it
//! reflects may change from texel to texel, and what a mirror shows stays as sharp as it is.
//!
//! In: texels, what they hit, and their light. Out: radiance a texel. A texel's value depends on its probe alone.

use crate::base::math::{Rgb, reflect};
use crate::base::progress::Silent;
use crate::base::ray::Hit;
use crate::lightmap::DenoiseParams;
use crate::lightmap::denoise::{Light, Surfaces};
use crate::lightmap::links::{Links, Site};
use crate::lightmap::texels::Point;
use crate::material::Surface;
use crate::probe::file::Probe;
use crate::transport::World;
use glam::Vec3;
use rayon::prelude::*;

/// Least cosine between the normals of texels that are linked (25 degrees).
const ALIGNED_COS: f32 = 0.9;
/// Greatest cosine between a normal and the way to a linked texel's point (60 degrees off the plane's normal).
const RISE_COS: f32 = 0.5;

/// How far lobes may part, in units of alpha. *Ours*, by the error of four scenes' probes of 16 paths (docs/experiments.md); nearer texels are told apart by what
/// they show.
const PART: f32 = 8.0;
/// Least reach, texels: none.
const LEAST_REACH: f32 = 1e-3;

/// Radiance of texels, whose rays hit what stands beside them, without most of their noise; `roughness_scale` as in the bake.
pub(super) fn denoised(
    world: &World,
    probe: &Probe,
    texels: &[(u32, Hit)],
    light: &[Light],
    (params, roughness_scale): (&DenoiseParams, f32),
) -> Vec<Rgb> {
    let size = probe.size;
    let seen: Vec<Surface> = texels.par_iter().map(|(_, hit)| world.surface(hit)).collect();
    let sites: Vec<Site> = texels.iter().zip(&seen).map(|(&(texel, _), surface)| site(texel, surface, size[0])).collect();
    let links = links(texels, &seen, size);
    let lobe = |(&(texel, _), surface)| Lobe::new(world, probe, texel, surface, roughness_scale);
    let lobes: Vec<Lobe> = texels.iter().zip(&seen).map(lobe).collect();
    let reach: Vec<f32> = (0..sites.len()).map(|i| reach(i, &sites, &links, &lobes)).collect();
    let surfaces = Surfaces { sites: &sites, links: &links, texel: 1.0, params, reach: Some(&reach) };
    let clean = surfaces.denoise(light, &Silent);
    clean.into_iter().map(|light| light.color).collect()
}

/// Where a texel's reflected light comes from.
struct Lobe {
    p: Vec3,
    /// Its axis: where a mirror would look.
    axis: Vec3,
    /// How far a mirror would look, m.
    distance: f32,
    alpha: f32,
}

impl Lobe {
    fn new(world: &World, probe: &Probe, texel: u32, surface: &Surface, roughness_scale: f32) -> Self {
        let axis = reflect((probe.position - surface.p).normalize_or_zero(), surface.frame.n);
        let alpha = world.scene.bsdf(surface).alpha(surface).unwrap_or(0.0) * roughness_scale;
        let distance = probe.texels[texel as usize].reflected().distance_from(surface.p);
        Self { p: surface.p, axis, distance, alpha }
    }

    /// Angle between what two lobes reflect, as one of them sees it, radians.
    fn parting(&self, other: &Self) -> f32 {
        self.axis.distance(other.axis) + self.p.distance(other.p) / self.distance.min(other.distance)
    }
}

/// How far a texel may share its light, texels: until lobes have parted.
fn reach(i: usize, sites: &[Site], links: &Links, lobes: &[Lobe]) -> f32 {
    let step = |&j: &u32| {
        let j = j as usize;
        lobes[i].parting(&lobes[j]) / sites[i].position.distance(sites[j].position)
    };
    let largest = links.at(i).iter().map(step).fold(0.0, f32::max);
    (PART * lobes[i].alpha / largest).max(LEAST_REACH)
}

/// A texel as a site of a plane: the map itself.
fn site(texel: u32, surface: &Surface, width: u32) -> Site {
    Site {
        item: texel,
        point: Point { triangle: surface.triangle, barycentric: surface.barycentric },
        position: Vec3::new((texel % width) as f32, (texel / width) as f32, 0.0),
        normal: Vec3::Z,
        material: surface.material,
        in_part: false,
    }
}

/// Texels beside one another that show one smooth surface. The map's left and right border are not joined: a fit of first order does well on one side.
fn links(texels: &[(u32, Hit)], seen: &[Surface], [width, height]: [u32; 2]) -> Links {
    let mut at = vec![u32::MAX; (width * height) as usize];
    texels.iter().enumerate().for_each(|(i, (texel, _))| at[*texel as usize] = i as u32);
    let of = |i: usize| {
        let (x, y) = ((texels[i].0 % width) as i64, (texels[i].0 / width) as i64);
        // Straight neighbours first: the nearest.
        let around = [(1, 0), (-1, 0), (0, 1), (0, -1), (1, 1), (1, -1), (-1, 1), (-1, -1)];
        let inside = around.into_iter().map(|(dx, dy)| (x + dx, y + dy));
        let inside = inside.filter(|&(x, y)| (0..i64::from(width)).contains(&x) && (0..i64::from(height)).contains(&y));
        let neighbours = inside.map(|(x, y)| at[(y * i64::from(width) + x) as usize]).filter(|&j| j != u32::MAX);
        neighbours.filter(|&j| are_one(&seen[i], &seen[j as usize])).collect()
    };
    Links::of((0..texels.len()).into_par_iter().map(of).collect())
}

/// Whether two points lie on one smooth surface of one material.
fn are_one(a: &Surface, b: &Surface) -> bool {
    let way = (b.p - a.p).normalize_or_zero();
    let rises = |s: &Surface| s.frame.n.dot(way).abs() > RISE_COS;
    a.material == b.material && a.frame.n.dot(b.frame.n) >= ALIGNED_COS && !rises(a) && !rises(b)
}
