//! Candidates from the distance field: its ridge, cut into clusters ([Wang et al. 2019] §3.1, Figure 2).
//!
//! *Paper*: voxels outside the scene and those with small distances are excluded; the rest is clustered, and each cluster's average position
//! is a candidate. *Reading*: "an approximate skeleton topology" is what stays of the rest where several surfaces are equally far, so that
//! the distance's gradient is short. *Ours*: a cluster is what a walk along the ridge reaches from its widest voxel that is in no cluster
//! yet, as far as a share of the distance there: wide spaces have few candidates, narrow ones many.

use super::space::Space;
use crate::transport::World;
use glam::Vec3;

/// Gradients below this length are on the ridge: surfaces in directions that differ by 75 degrees or more are equally near.
const RIDGE: f32 = 0.8;
/// A cluster's reach, as a share of the distance at its widest voxel.
const REACH: f32 = 0.35;
/// The least reach of a cluster, voxels.
const LEAST_REACH: f32 = 2.0;
/// How much wider clusters get where there are too many.
const WIDER: f32 = 1.2;

/// Free voxels on the ridge that are at least `cull` metres from all surfaces, in index order.
pub fn ridge(space: &Space, cull: f32) -> Vec<usize> {
    let field = &space.field;
    (0..field.voxels.len())
        .filter(|&i| space.free[i] && field.distance[i] >= cull && field.gradient(i).length() < RIDGE)
        .collect()
}

/// One candidate a cluster of the ridge, at most `most`; in the order of their width, the widest first.
pub fn candidates(world: &World, space: &Space, cull: f32, most: usize) -> Vec<Vec3> {
    let ridge = ridge(space, cull);
    let mut reach = REACH;
    loop {
        let clusters = clusters(space, &ridge, reach);
        if clusters.len() <= most.max(1) {
            return clusters.iter().map(|cluster| middle(world, space, cluster)).collect();
        }
        reach *= WIDER;
    }
}

/// The ridge cut into clusters, each of them connected and led by its widest voxel.
fn clusters(space: &Space, ridge: &[usize], reach: f32) -> Vec<Vec<usize>> {
    let (voxels, distance) = (&space.field.voxels, &space.field.distance);
    let mut open = vec![false; voxels.len()];
    ridge.iter().for_each(|&i| open[i] = true);
    let mut by_width = ridge.to_vec();
    by_width.sort_by(|&a, &b| distance[b].total_cmp(&distance[a]).then(a.cmp(&b)));
    let mut found = Vec::new();
    for seed in by_width {
        if !open[seed] {
            continue;
        }
        let (centre, radius) = (voxels.centre(seed), (reach * distance[seed]).max(LEAST_REACH * reach / REACH * voxels.edge));
        let mut cluster = vec![seed];
        open[seed] = false;
        let mut next = 0;
        while next < cluster.len() {
            for i in voxels.around(voxels.coordinates(cluster[next]), 1) {
                if open[i] && voxels.centre(i).distance(centre) <= radius {
                    open[i] = false;
                    cluster.push(i);
                }
            }
            next += 1;
        }
        found.push(cluster);
    }
    found
}

/// The average position of a cluster; where that is not free, or sees nothing of the cluster's lead, the voxel nearest to it.
fn middle(world: &World, space: &Space, cluster: &[usize]) -> Vec3 {
    let voxels = &space.field.voxels;
    let sum: glam::DVec3 = cluster.iter().map(|&i| voxels.centre(i).as_dvec3()).sum();
    let mean = (sum / cluster.len() as f64).as_vec3();
    if space.has(world, mean) && super::space::clear(world, voxels.centre(cluster[0]), mean) {
        return mean;
    }
    let square = |i: usize| voxels.centre(i).distance_squared(mean);
    let nearest = cluster.iter().copied().min_by(|&a, &b| square(a).total_cmp(&square(b)).then(a.cmp(&b)));
    voxels.centre(nearest.unwrap_or(cluster[0]))
}
