//! Placement on skeletons: in rooms with closed boxes, open meshes and an outside; coverage against brute force; refinement.

use super::coverage::{Sides, bits};
use super::nonuniform::{Bounds, NonuniformParams, Placed, Reachable, place};
use super::placement::Placement;
use super::refine::{RefineParams, Refined, refine};
use super::select::{Enough, choose};
use super::skeleton::ridge;
use super::skeleton::space::clear;
use crate::base::math::Rgb;
use crate::base::progress::Silent;
use crate::base::ray::Ray;
use crate::lightmap::testing;
use crate::material::bsdf::{Bsdf, Diffuse};
use crate::material::{Material, Texture};
use crate::scene::{Geometry, Scene};
use crate::transport::World;
use glam::Vec3;

pub(super) const CAMERA: Vec3 = Vec3::new(-1.5, 0.3, 1.0);
pub(super) const ROOM: (Vec3, Vec3) = (Vec3::new(-2.0, -1.0, -1.5), Vec3::new(2.0, 1.0, 1.5));
pub(super) const BOX: (Vec3, Vec3) = (Vec3::new(0.3, -1.0, -0.6), Vec3::new(1.3, 0.1, 0.5));
/// More than the room.
pub(super) const AROUND: (Vec3, Vec3) = (Vec3::new(-2.7, -1.6, -2.2), Vec3::new(2.8, 1.7, 2.1));

pub(super) fn world(fill: impl FnOnce(&mut Geometry)) -> World {
    let mut geometry = Geometry::default();
    fill(&mut geometry);
    let bsdf = Bsdf::Diffuse(Diffuse { reflectance: Texture::Constant(Rgb::splat(0.5)) });
    let material = Material { name: "wall".into(), bsdf, opacity: None };
    World::new(Scene { geometry: geometry.into(), materials: vec![material], ..Default::default() })
}

/// A closed room with a closed box on its floor, a sheet on a wall, and something far outside.
pub(super) fn room() -> World {
    world(|g| {
        testing::cuboid(g, ROOM.0, ROOM.1);
        testing::cuboid(g, BOX.0, BOX.1);
        testing::quad(g, Vec3::new(-2.0, 0.0, -1.5), Vec3::X * 0.9, Vec3::Z * 0.8);
        testing::cuboid(g, Vec3::new(2.3, -1.0, -1.0), Vec3::new(2.6, 1.0, 1.0));
    })
}

pub(super) fn within(p: Vec3, (lower, upper): (Vec3, Vec3)) -> bool {
    p.cmpgt(lower).all() && p.cmplt(upper).all()
}

fn params(method: Placement) -> NonuniformParams {
    NonuniformParams { method, resolution: 40, texels: 2000, candidates: 96, ..NonuniformParams::default() }
}

pub(super) fn reachable(
    world: &World,
    filled: (Vec3, Vec3),
    camera: Vec3,
    params: &NonuniformParams,
) -> crate::Result<Reachable> {
    Reachable::new(world, &Bounds { filled, seen: ROOM }, &[camera], params)
}

fn placed(world: &World, bounds: (Vec3, Vec3), params: &NonuniformParams) -> (Reachable, Placed) {
    let reachable = reachable(world, bounds, CAMERA, params).unwrap();
    let placed = place(world, &reachable, params, (1, &Silent)).unwrap();
    (reachable, placed)
}

/// The share of the sides that a ray from some probe meets first, walked from the probe's end.
pub(super) fn coverage_by_force(world: &World, sides: &Sides, probes: &[Vec3]) -> f64 {
    let meets = |probe: Vec3, p: Vec3, n: Vec3| {
        let way = p - probe;
        let hit = world.closest(&Ray::new(probe, way.normalize()));
        way.dot(n) < 0.0 && hit.is_none_or(|hit| hit.t > way.length() * (1.0 - 1e-3))
    };
    let seen = sides.list.iter().filter(|s| probes.iter().any(|&probe| meets(probe, s.p, s.n)));
    seen.map(|s| f64::from(s.area)).sum::<f64>() / sides.area
}

#[test]
fn the_free_space_ends_at_walls_and_boxes_and_not_at_the_bounds() {
    let world = room();
    let space = reachable(&world, AROUND, CAMERA, &params(Placement::Sdf)).unwrap().space;
    for i in 0..space.free.len() {
        let p = space.field.voxels.centre(i);
        if space.field.distance[i] > 0.01 {
            assert_eq!(space.free[i], within(p, ROOM) && !within(p, BOX), "{p}");
        }
    }
    // Walls of the room: the analytic distance, with its sign.
    let at = |p: Vec3| space.signed(space.field.voxels.index(space.field.voxels.nearest(p)));
    let middle = space.field.voxels.centre_at(space.field.voxels.nearest(Vec3::new(-1.0, 0.6, 0.9)));
    assert!((at(middle) - (1.0 - middle.y).min(1.5 - middle.z)).abs() < 1e-4);
    assert!(at(Vec3::new(0.8, -0.5, 0.0)) < -0.3 && at(Vec3::new(-2.5, 0.0, 0.0)) < -0.3);
}

#[test]
fn open_meshes_have_an_inside_that_is_free_and_two_sides() {
    // A box without a lid, and a sheet across the room.
    let world = world(|g| {
        testing::cuboid(g, ROOM.0, ROOM.1);
        for k in 0..2 {
            let far = k as f32;
            testing::quad(g, Vec3::new(-0.5 + far, -0.9, -0.5), Vec3::Y, Vec3::Z);
            testing::quad(g, Vec3::new(-0.5, -0.9, -0.5 + far), Vec3::X, Vec3::Y);
        }
        testing::quad(g, Vec3::new(-0.5, -0.9, -0.5), Vec3::X, Vec3::Z);
    });
    let reachable = reachable(&world, AROUND, CAMERA, &params(Placement::Sdf)).unwrap();
    let space = &reachable.space;
    assert!(space.has(&world, Vec3::new(0.0, -0.5, 0.0)) && !space.has(&world, Vec3::new(0.0, 1.3, 0.0)));
    let inner = |s: &&super::coverage::Side| s.p.x.abs() < 0.501 && s.p.z.abs() < 0.501 && s.p.y > -0.91 && s.p.y < 0.11;
    let area: f32 = reachable.sides.list.iter().filter(inner).map(|s| s.area).sum();
    assert!((area - 10.0).abs() < 0.3, "five sheets of 1 m² with two sides: {area}");
    let probes = [Vec3::new(0.0, -0.4, 0.0)];
    let row = reachable.sides.row(&world, probes[0]);
    assert!(bits(row.iter().copied()).any(|i| inner(&&reachable.sides.list[i])));
    let (share, force) = (reachable.sides.share(&row), coverage_by_force(&world, &reachable.sides, &probes));
    assert!((share - force).abs() < 1e-3, "{share} not {force}");
}

#[test]
fn no_probe_is_inside_or_outside_and_almost_all_is_seen() {
    let world = room();
    for method in [Placement::Sdf, Placement::MedialAxis] {
        let params =
            NonuniformParams { refine: RefineParams { passes: 2, samples: 256, ..Default::default() }, ..params(method) };
        let (reachable, placed) = placed(&world, AROUND, &params);
        assert!(placed.positions.len() < 40, "{method}: {}", placed.positions.len());
        for &p in &placed.positions {
            assert!(within(p, ROOM) && !within(p, BOX) && reachable.space.has(&world, p), "{method}: {p}");
        }
        assert!(placed.before.coverage >= 0.999, "{method}: {:?}", placed.before);
        assert!(placed.after.coverage >= placed.before.coverage && placed.after.fitness >= placed.before.fitness);
        let force = coverage_by_force(&world, &reachable.sides, &placed.positions);
        assert!((placed.after.coverage - force).abs() < 1e-3, "{method}: {} not {force}", placed.after.coverage);
        // What counts as reachable: the room without what the box stands on, the box but its base, and the sheet's two sides.
        let expected = 52.0 - 1.1 + (2.0 * 2.31 + 1.1) + 2.0 * 0.72;
        for s in &reachable.sides.list {
            let hidden = s.p.cmpge(BOX.0 + 0.01 * Vec3::new(1.0, -1.0, 1.0)).all() && s.p.cmple(BOX.1 - 0.01).all();
            assert!(!hidden, "{s:?}");
        }
        assert!((reachable.sides.area - expected).abs() < 0.6, "{} m² not {expected}", reachable.sides.area);
    }
}

#[test]
fn a_count_is_kept_and_coverage_grows_with_it() {
    let world = room();
    for method in [Placement::Sdf, Placement::MedialAxis] {
        let mut last = 0.0;
        for count in [1, 4, 30] {
            let (_, placed) = placed(&world, ROOM, &NonuniformParams { count: Some(count), ..params(method) });
            assert_eq!(placed.positions.len(), count as usize, "{method}");
            assert!(placed.after.coverage >= last, "{method}, {count}: {:?}", placed.after);
            last = placed.after.coverage;
        }
    }
    let (_, some) = placed(&world, ROOM, &NonuniformParams { coverage: Some(0.8), ..params(Placement::Sdf) });
    assert!((0.8..1.0).contains(&some.after.coverage) && some.positions.len() < 4, "{:?}", some.after);
}

#[test]
fn the_ridge_of_a_room_is_equally_far_from_several_walls() {
    let world = world(|g| testing::cuboid(g, ROOM.0, ROOM.1));
    let space = reachable(&world, ROOM, CAMERA, &params(Placement::Sdf)).unwrap().space;
    let edge = space.field.voxels.edge;
    let ridge = ridge::ridge(&space, 2.0 * edge);
    assert!(ridge.len() > 300);
    for &i in &ridge {
        let p = space.field.voxels.centre(i);
        let mut walls = [p - ROOM.0, ROOM.1 - p].map(|v| v.to_array()).concat();
        walls.sort_by(f32::total_cmp);
        assert!(walls[1] - walls[0] < 1.5 * edge, "{p}: {walls:?}");
    }
    let candidates = ridge::candidates(&world, &space, 2.0 * edge, 20);
    assert!((4..=20).contains(&candidates.len()), "{}", candidates.len());
}

#[test]
fn the_greedy_choice_takes_what_sees_most_first() {
    let world = room();
    let reachable = reachable(&world, ROOM, CAMERA, &params(Placement::Sdf)).unwrap();
    let candidates = vec![Vec3::new(1.7, -0.9, 0.0), Vec3::new(-0.5, 0.7, 0.0), Vec3::new(0.0, 0.5, 0.3)];
    let shares: Vec<f64> = candidates.iter().map(|&p| reachable.sides.share(&reachable.sides.row(&world, p))).collect();
    let chosen = choose(&world, &reachable.sides, candidates.clone(), &Enough::Coverage { share: 0.999, most: 3 });
    let most = (0..3).max_by(|&a, &b| shares[a].total_cmp(&shares[b])).unwrap();
    assert_eq!(chosen.positions[0], candidates[most]);
    assert_eq!(chosen.positions.len(), 3);
}

/// Of a number of probes, none stands in a nook that sees a little more while another place sees all of the rest better; and the choice, which asks
/// few candidates again, is that of asking all of them.
#[test]
fn a_count_of_probes_is_chosen_by_how_well_they_see() {
    let world = room();
    let reachable = reachable(&world, ROOM, CAMERA, &params(Placement::Sdf)).unwrap();
    let (sides, near) = (&reachable.sides, reachable.space.spacing(4));
    let random = |i: u32, k: u32| crate::base::math::unit(crate::base::math::hash_words(&[i, k]));
    let candidates: Vec<Vec3> = (0..100)
        .map(|i| ROOM.0 + (ROOM.1 - ROOM.0) * Vec3::new(random(i, 0), random(i, 1), random(i, 2)))
        .filter(|&p| reachable.space.has(&world, p))
        .collect();
    let chosen = choose(&world, sides, candidates.clone(), &Enough::Count { count: 4, near });
    let seen_by = |probes: &[Vec3]| -> f64 {
        let best = |side: &super::coverage::Side| {
            let well = |&p: &Vec3| side.seen_from(&world, p).map_or(0.0, |(cos, d)| cos / (1.0 + d * d / (near * near)));
            f64::from(side.weight) * f64::from(probes.iter().map(well).fold(0.0, f32::max))
        };
        sides.list.iter().map(best).sum()
    };
    let mut probes: Vec<Vec3> = Vec::new();
    for _ in 0..4 {
        let with = |p: &Vec3| seen_by(&[&probes[..], &[*p]].concat());
        let next = candidates.iter().map(|p| (with(p), *p)).max_by(|a, b| a.0.total_cmp(&b.0)).unwrap();
        probes.push(next.1);
    }
    assert!(seen_by(&chosen.positions) > 0.995 * seen_by(&probes), "{:?} not {probes:?}", chosen.positions);
}

fn refined(world: &World, reachable: &Reachable, start: &[Vec3], passes: u32, seed: u32) -> Refined {
    let params = RefineParams { passes, samples: 300, ..RefineParams::default() };
    refine((world, &reachable.space, &reachable.sides), start, 0.1, &params, (seed, &Silent))
}

#[test]
fn refinement_raises_the_fitness_and_stays_in_the_free_space() {
    let world = room();
    let reachable = reachable(&world, AROUND, CAMERA, &params(Placement::Sdf)).unwrap();
    // All in the corner behind the box, close to the floor.
    let start = [Vec3::new(1.7, -0.8, -1.2), Vec3::new(1.75, -0.7, -1.1), Vec3::new(1.6, -0.85, -1.3)];
    let mut gain = 0.0;
    for seed in 0..4 {
        let refined = refined(&world, &reachable, &start, 12, seed);
        assert!(refined.after.fitness >= refined.before.fitness && refined.after.coverage >= refined.before.coverage);
        gain += (refined.after.coverage - refined.before.coverage) / 4.0;
        for &p in &refined.positions {
            assert!(within(p, ROOM) && !within(p, BOX) && reachable.space.has(&world, p), "{p}");
        }
        let union = reachable.sides.share(
            &reachable
                .sides
                .list
                .chunks(64)
                .enumerate()
                .map(|(k, _)| refined.rows.iter().fold(0, |u, r| u | r[k]))
                .collect::<Vec<_>>(),
        );
        assert_eq!(union, refined.after.coverage);
    }
    assert!(gain > 0.02, "{gain}");
    assert!(start.iter().all(|&p| clear(&world, p, p + Vec3::Y * 0.1)));
}

#[test]
fn one_thread_equals_many_and_another_seed_differs() {
    let world = room();
    let run = |threads: usize, seed: u32| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let mut all = Vec::new();
            for method in [Placement::Sdf, Placement::MedialAxis] {
                let params = params(method);
                let reachable = reachable(&world, AROUND, CAMERA, &params).unwrap();
                let placed = place(&world, &reachable, &params, (seed, &Silent)).unwrap();
                let start = [Vec3::new(1.7, -0.8, -1.2), Vec3::new(-1.8, -0.8, -1.3)];
                let refined = refined(&world, &reachable, &start, 6, seed);
                all.push((placed.positions, placed.after, refined.positions, refined.after));
            }
            all
        })
    };
    assert_eq!(run(1, 5), run(3, 5));
    let (a, b) = (run(2, 5), run(2, 6));
    assert!(a[0].0 == b[0].0 && a[0].2 != b[0].2, "the choice has no seed, the refinement has");
}

#[test]
fn without_space_or_surfaces_there_is_one_line_that_says_so() {
    let failure = |world: &World, bounds: (Vec3, Vec3), camera: Vec3| {
        let message = reachable(world, bounds, camera, &params(Placement::Sdf)).err().unwrap().to_string();
        assert!(!message.contains('\n'), "{message}");
        message
    };
    let world = room();
    // A camera in the closed box, and bounds elsewhere in the room.
    let elsewhere = (Vec3::new(-1.5, -0.5, -1.0), Vec3::new(-0.5, 0.5, 1.0));
    assert!(failure(&world, elsewhere, Vec3::new(0.8, -0.5, 0.0)).contains("no camera reaches any free space"));
    assert!(failure(&world, (Vec3::ZERO, Vec3::ZERO), CAMERA).contains("no space for probes"));
    let empty = self::world(|_| ());
    assert!(failure(&empty, ROOM, CAMERA).contains("sees no opaque surface"));
}
