//! All light of a frame: light straight from emitters at the virtual point lights, and what they send one another (§2.2).
//!
//! *Paper*: for more bounces, light is gathered at the lights as at a view's points, and the lobes that come of it are filtered to one.

use super::arrival::Received;
use super::cuts::Forest;
use super::descend::Receiver;
use super::emit::{Emission, Site, direct};
use super::gather::Gather;
use super::params::ManyLightParams;
use super::points::Places;
use super::tree::{Spot, Tree};
use crate::base::clock::Clock;
use crate::base::math::hash_words;
use crate::transport::World;
use rayon::prelude::*;

/// Marks random numbers of gathers at lights.
pub(crate) const BOUNCE: u32 = 0x626f_756e;

/// Lights in the order that the tree has them, and the tree.
pub struct Structure {
    /// The tree.
    pub tree: Tree,
    /// Its nodes that traversals see.
    pub forest: Forest,
}

impl Structure {
    /// Over lights at their sites.
    pub fn new(sites: &[Site], params: &ManyLightParams, seed: u32) -> Self {
        let spots: Vec<Spot> = sites.iter().map(Site::spot).collect();
        let tree = Tree::new(&spots, seed);
        let forest = Forest::new(&tree, params);
        Self { tree, forest }
    }
}

/// The surfaces of all lights in a frame's world.
pub fn sites<'w>(world: &'w World, places: &Places, params: &ManyLightParams) -> Vec<Site<'w>> {
    let all = places.list.par_iter().zip(&places.areas).with_min_len(64);
    all.map(|(place, area)| Site::new(world, place, *area, params)).collect()
}

/// The light of a frame after all bounces, ready to be gathered.
pub fn light(
    world: &World,
    (sites, structure): (&[Site], &Structure),
    params: &ManyLightParams,
    seed: u32,
    clock: &mut Clock,
) -> Gather {
    let Structure { tree, forest } = structure;
    let direct = direct(world, sites, params.light_samples, seed);
    clock.lap("light sampling");
    let mut all = direct.clone();
    for bounce in 1..params.bounces {
        let gather = Gather::new(tree, forest, &all, params);
        let of = |(i, site): (usize, &Site)| {
            let is_seen =
                |light: u32| !world.occluded(&site.surface.spawn_to(sites[tree.order[light as usize] as usize].surface.p));
            let stream = hash_words(&[seed, BOUNCE, bounce, i as u32]);
            let (gathered, _): (Emission, u32) =
                gather.at(&Receiver { p: site.surface.p, n: site.n, lobe: None }, |a| site.receive(a), is_seen, stream);
            let mut sum = direct[i];
            sum.add(&gathered, 1.0);
            sum
        };
        all = sites.par_iter().enumerate().with_min_len(64).map(of).collect();
        clock.lap("bounces");
    }
    let gather = Gather::new(tree, forest, &all, params);
    clock.lap("filtering");
    gather
}
