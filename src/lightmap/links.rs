//! Links: which sites of a surface, each a texel side in the open, lie beside one another.
//!
//! *Ours*: two sites are linked that are near, face the same way on one surface of one material, and see each other just above
//! it. Charts and objects play no part: the light of a wall does not change where its texels do. What is linked is asked of the
//! nearest alone, so that the far side of a thin wall on a floor is reached around its end, if at all.

use super::texels::Point;
use glam::Vec3;
use rayon::prelude::*;
use std::collections::HashMap;

/// Most links of a site: those of a texel in a chart to all around it.
pub const LINKS: usize = 8;

/// Farthest that linked sites lie apart, texels: a little more than a diagonal.
const REACH: f32 = 1.6;

/// Farthest that one lies above the other's plane, texels.
const RISE: f32 = 0.4;

/// Least cosine between their normals (25 degrees).
const ALIGNED_COS: f32 = 0.9;

/// Most sites of a cell, `REACH` wide, that are considered. Where more than these crowd, texels are far finer than asked for.
const CROWD: usize = 64;

/// A texel side that has samples in the open.
#[derive(Debug, Clone, Copy)]
pub struct Site {
    /// Its number among the bake's texel sides.
    pub item: u32,
    /// A point of it.
    pub point: Point,
    /// Where its light was gathered: the mean of its place, world.
    pub position: Vec3,
    /// Unit shading normal, turned to the side that is meant.
    pub normal: Vec3,
    /// Material.
    pub material: u32,
    /// Whether a part of the texel is hidden, so that its light may be unlike its neighbours'.
    pub in_part: bool,
}

/// The links of each site, nearest first, as indices of sites.
#[derive(Debug, Clone, Default)]
pub struct Links {
    firsts: Vec<u32>,
    to: Vec<u32>,
}

impl Links {
    /// From a list for each site.
    pub fn of(lists: Vec<Vec<u32>>) -> Self {
        let mut links = Self { firsts: vec![0], to: Vec::new() };
        for list in lists {
            links.to.extend(list);
            links.firsts.push(links.to.len() as u32);
        }
        links
    }

    /// Those of a site.
    pub fn at(&self, site: usize) -> &[u32] {
        &self.to[self.firsts[site] as usize..self.firsts[site + 1] as usize]
    }
}

/// Links the nearest of `sites` on texels of `texel` metres that see each other.
pub(super) fn link(sites: &[Site], texel: f32, see: &(dyn Fn(usize, usize) -> bool + Sync)) -> Links {
    let reach = REACH * texel;
    let cell = |p: Vec3| (p / reach).floor().as_ivec3();
    let mut cells: HashMap<glam::IVec3, Vec<u32>> = HashMap::new();
    for (i, site) in sites.iter().enumerate() {
        let crowd = cells.entry(cell(site.position)).or_default();
        if crowd.len() < CROWD {
            crowd.push(i as u32);
        }
    }
    let of = |i: usize| {
        let a = &sites[i];
        let offset = |k: i32| glam::IVec3::new(k % 3 - 1, k / 3 % 3 - 1, k / 9 - 1);
        let around = (0..27).filter_map(|k| cells.get(&(cell(a.position) + offset(k)))).flatten();
        let mut near: Vec<(f32, u32)> = around
            .filter(|&&j| j as usize != i && are_beside(a, &sites[j as usize], texel))
            .map(|&j| (a.position.distance_squared(sites[j as usize].position), j))
            .collect();
        near.sort_unstable_by(|x, y| x.0.total_cmp(&y.0).then(x.1.cmp(&y.1)));
        // The same answer for both of a pair.
        let is_seen = |j: &u32| see(i.min(*j as usize), i.max(*j as usize));
        near.into_iter().map(|(_, j)| j).filter(is_seen).take(LINKS).collect::<Vec<u32>>()
    };
    Links::of((0..sites.len()).into_par_iter().map(of).collect())
}

fn are_beside(a: &Site, b: &Site, texel: f32) -> bool {
    let d = b.position - a.position;
    a.material == b.material
        && d.length_squared() <= (REACH * texel).powi(2)
        && a.normal.dot(b.normal) >= ALIGNED_COS
        && a.normal.dot(d).abs().max(b.normal.dot(d).abs()) <= RISE * texel
}
