//! Sparse radiance probes: next to walls and evenly, never inside, seen and supported by brute force; moves that see more.

use super::coverage::bits;
use super::nonuniform::{NonuniformParams, Reachable};
use super::nonuniform_tests::{AROUND, BOX, CAMERA, ROOM, coverage_by_force, reachable, room, within, world};
use super::placement::{Density, PROBES_MAX};
use super::shift::{Watch, shift};
use super::sparse::{Sparse, SparseParams, candidates, place};
use super::support::weight;
use crate::base::progress::Silent;
use crate::lightmap::testing;
use crate::transport::World;
use glam::{IVec3, Vec3};

fn params(bounds: (Vec3, Vec3), density: Density) -> SparseParams {
    SparseParams { resolution: 40, texels: 2000, ..SparseParams::new(bounds, density).unwrap() }
}

fn free(world: &World, bounds: (Vec3, Vec3)) -> Reachable {
    let surfaces = NonuniformParams { resolution: 40, texels: 2000, ..NonuniformParams::default() };
    reachable(world, bounds, CAMERA, &surfaces).unwrap()
}

fn placed(world: &World, bounds: (Vec3, Vec3), density: Density) -> (Reachable, Sparse) {
    let reachable = free(world, bounds);
    let placed = place(world, &reachable, &params(bounds, density), &[], &Silent).unwrap();
    (reachable, placed)
}

#[test]
fn there_are_as_many_probes_as_a_grid_of_the_spacing_has_points() {
    for (spacing, count) in [(1.0, 4 * 2 * 3), (0.5, 8 * 4 * 6), (0.3, 13 * 7 * 10), (90.0, 1)] {
        let params = SparseParams::new(ROOM, Density::Spacing(spacing)).unwrap();
        assert_eq!((params.count, params.spacing), (count, spacing));
        let edge = 4.0 / params.resolution as f32;
        assert!(params.resolution >= 96 && edge <= spacing / 4.0 * 1.001, "{params:?}");
    }
    let counted = SparseParams::new(ROOM, Density::Count(24)).unwrap();
    assert!(counted.count == 24 && (counted.spacing - 1.0).abs() < 1e-6, "{counted:?}");
    for nonsense in [Density::Spacing(0.0), Density::Spacing(f32::NAN), Density::Spacing(1e-3), Density::Count(0)] {
        assert!(SparseParams::new(ROOM, nonsense).is_err(), "{nonsense:?}");
    }
    assert!(SparseParams::new(ROOM, Density::Count(PROBES_MAX as u32 + 1)).is_err());
}

#[test]
fn candidates_are_the_empty_voxels_next_to_others() {
    let world = room();
    let space = free(&world, AROUND).space;
    let voxels = &space.field.voxels;
    let found: std::collections::BTreeSet<usize> =
        candidates(&space).into_iter().map(|p| voxels.index(voxels.nearest(p))).collect();
    let is_near = |i: usize, voxels_away: f32| space.field.distance[i] <= voxels_away * voxels.edge;
    let mut inner = 0;
    for i in (0..voxels.len()).filter(|&i| space.is_open(voxels.centre(i))) {
        let c = voxels.coordinates(i);
        let faces = [IVec3::X, IVec3::Y, IVec3::Z].into_iter().flat_map(|step| [step, -step]);
        let face = faces.map(|step| voxels.index((c.as_ivec3() + step).as_uvec3())).any(|j| is_near(j, 0.87));
        assert!(!face || found.contains(&i), "{}", voxels.centre(i));
        // A point 1.87 voxels away is at most this far from the middle of some neighbour: in the direction (1.73, 0.5, 0.5).
        assert!(!found.contains(&i) || voxels.around(c, 1).any(|j| is_near(j, 1.02)), "{}", voxels.centre(i));
        inner += usize::from(!found.contains(&i));
    }
    assert!(found.len() > 1000 && inner > 1000, "{} of {inner}", found.len());
    // In mid-air, where no surface is near: any empty voxel.
    let air = free(&world, (Vec3::new(-1.4, 0.2, 0.3), Vec3::new(-1.2, 0.4, 0.5))).space;
    assert_eq!(candidates(&air).len(), air.field.voxels.len());
}

#[test]
fn in_an_empty_box_probes_stand_at_the_walls_and_evenly() {
    let world = world(|g| testing::cuboid(g, ROOM.0, ROOM.1));
    let (reachable, placed) = placed(&world, ROOM, Density::Count(60));
    let edge = reachable.space.field.voxels.edge;
    assert_eq!((placed.positions.len(), placed.before, placed.seen, placed.supported), (60, 1.0, 1.0, 1.0));
    let walls = |p: Vec3| (p - ROOM.0).min(ROOM.1 - p);
    // An even set of 60 points on 52 m² has them about a metre apart.
    for (i, &p) in placed.positions.iter().enumerate() {
        assert!(walls(p).min_element() < 2.0 * edge && within(p, ROOM), "{p}");
        let others = placed.positions.iter().enumerate().filter(|(j, _)| *j != i);
        let gap = others.map(|(_, q)| p.distance(*q)).fold(9.0, f32::min);
        assert!((0.5..1.3).contains(&gap), "{p}: {gap} m to the next");
    }
    // No point on a wall is far from all of them.
    for side in &reachable.sides.list {
        let gap = placed.positions.iter().map(|p| p.distance(side.p)).fold(9.0, f32::min);
        assert!(gap < 1.0, "{}: {gap} m to the next probe", side.p);
    }
}

#[test]
fn no_probe_is_in_a_solid_and_every_surface_is_supported() {
    let world = room();
    for density in [Density::Count(6), Density::Count(40), Density::Spacing(0.6)] {
        let (reachable, placed) = placed(&world, AROUND, density);
        assert_eq!(placed.positions.len(), params(AROUND, density).count as usize);
        for &p in &placed.positions {
            assert!(within(p, ROOM) && !within(p, BOX) && reachable.space.has(&world, p), "{p}");
        }
        let sides = &reachable.sides;
        let supports = |p: Vec3| placed.positions.iter().filter(|q| weight(q.distance(p) / placed.radius) > 0.0).count();
        assert!(sides.list.iter().all(|side| supports(side.p) > 0) && placed.supported == 1.0);
        let mean = sides.list.iter().map(|side| supports(side.p)).sum::<usize>() as f64 / sides.list.len() as f64;
        assert!((mean - placed.overlap).abs() < 0.01, "{mean} not {}", placed.overlap);
        assert!(placed.positions.len() > 10 || placed.overlap == 6.0);
        let force = coverage_by_force(&world, sides, &placed.positions);
        assert!((placed.seen - force).abs() < 1e-3, "{} not {force}", placed.seen);
        assert!(placed.seen >= placed.before && placed.seen > 0.99, "{} after {}", placed.seen, placed.before);
    }
}

#[test]
fn probes_move_to_candidates_where_they_see_more() {
    let world = room();
    let reachable = free(&world, ROOM);
    let (sides, candidates) = (&reachable.sides, candidates(&reachable.space));
    // Two of them almost in one place, neither of which sees behind the box.
    let start = [Vec3::new(0.0, 0.6, 1.2), Vec3::new(0.1, 0.6, 1.2)];
    let (mut last, mut first) = (0.0, 0.0);
    for reach in [0.0, 0.5, 3.0] {
        let mut watch = Watch { positions: start.to_vec(), rows: sides.rows(&world, &start) };
        shift(&world, sides, &candidates, reach, &mut watch);
        assert_eq!(watch.rows, sides.rows(&world, &watch.positions));
        let union: Vec<u64> = (0..watch.rows[0].len()).map(|k| watch.rows.iter().fold(0, |u, row| u | row[k])).collect();
        let seen = sides.share(&union);
        assert!(seen >= last, "{reach}: {seen} after {last}");
        last = seen;
        if reach == 0.0 {
            first = seen;
            assert_eq!(watch.positions, start);
            assert!((0.5..0.95).contains(&seen) && bits(union.into_iter()).count() > 100, "{seen}");
        }
        for p in &watch.positions {
            assert!(start.contains(p) || candidates.contains(p), "{p}");
        }
    }
    assert!(last > first + 0.02, "{last} after {first}");
}

#[test]
fn one_thread_equals_many() {
    let world = room();
    let run = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let placed = placed(&world, AROUND, Density::Count(12)).1;
            (placed.positions, placed.radius, placed.seen, placed.supported)
        })
    };
    assert_eq!(run(1), run(3));
}
