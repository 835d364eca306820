//! Rays through probes against rays in the scene, and light in closed rooms.

use super::bake::{LightFieldBakeParams, Seen, bounce, look};
use super::field::LightField;
use super::march::{LocalRay, Map, March, Search};
use super::octree::NO_PROBE;
use super::probe::Light;
use super::store::probe_bytes;
use super::trace::{Found, follow, trace};
use crate::base::math::{Rgb, hash_words, unit};
use crate::base::octahedral::{decode, encode, middle};
use crate::base::ray::Ray;
use crate::exchange::{LoadOptions, load};
use crate::io::Provenance;
use crate::probe::placement::{Density, Placement, ProbeGrid};
use crate::probe::places::{Places, ProbeList};
use crate::transport::World;
use glam::{Vec2, Vec3};

fn world(body: &str) -> World {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("s.xml");
    std::fs::write(&path, format!("<scene version='3.0.0'>{body}</scene>")).unwrap();
    World::new(load(&path, &LoadOptions::default()).unwrap())
}

/// A room of 4 x 4 x 4 m with a ball and a box in it.
const ROOM: &str = "<shape type='cube'><transform name='to_world'><scale value='2'/></transform>
    <bsdf type='twosided'><bsdf type='diffuse'><rgb name='reflectance' value='0.5'/></bsdf></bsdf></shape>
    <shape type='sphere'><point name='center' x='0.3' y='-1.2' z='0.2'/><float name='radius' value='0.6'/>
    <bsdf type='diffuse'/></shape>
    <shape type='cube'><transform name='to_world'><scale x='0.4' y='0.9' z='0.4'/><rotate y='1' angle='25'/>
    <translate x='-1' y='-1.1' z='-0.8'/></transform><bsdf type='diffuse'/></shape>
    <shape type='rectangle'><transform name='to_world'><rotate x='1' angle='90'/><scale value='0.7'/><translate y='1.98'/></transform>
    <emitter type='area'><rgb name='radiance' value='5'/></emitter></shape>";

fn random(i: u32, k: u32) -> f32 {
    unit(hash_words(&[i, k, 77]))
}

fn direction(i: u32) -> Vec3 {
    decode(Vec2::new(random(i, 0), random(i, 1)))
}

fn field(world: &World, counts: [u32; 3], half: f32, params: &LightFieldBakeParams) -> LightField {
    let provenance = Provenance::new("place-probes", "", 0, &0);
    let grid = ProbeGrid::in_box(Vec3::splat(-half), Vec3::splat(half), Density::Counts(counts), provenance).unwrap();
    lit(world, Places::Grid(grid), params)
}

fn lit(world: &World, places: Places, params: &LightFieldBakeParams) -> LightField {
    let seen: Vec<Seen> = (0..places.len()).map(|i| look(world, places.position(i), i as u32, params, 3)).collect();
    let mut field = LightField::unlit(places, seen.iter().map(|s| s.surfels.clone()).collect());
    for _ in 0..params.bounces {
        bounce((world, &mut field), &|i| Ok(seen[i].clone()), params, (20.0, 3), &mut |_, _, _| Ok(())).unwrap();
    }
    field
}

/// As many probes as positions, in no grid.
fn listed(positions: Vec<[f32; 3]>) -> Places {
    let provenance = Provenance::new("place-probes", "", 0, &0);
    Places::List(ProbeList { method: Placement::Sdf, positions, radius: None, provenance })
}

const FINE: LightFieldBakeParams = LightFieldBakeParams { size: 256, ambient_size: 8, spp: 1, lobe_samples: 1, bounces: 1 };
const SMALL: LightFieldBakeParams = LightFieldBakeParams { size: 128, ambient_size: 16, spp: 1, lobe_samples: 1, bounces: 1 };

/// Both searches find what a search through every texel finds, as they pass over nothing that a ray could meet.
#[test]
fn searches_agree_with_each_other_and_with_rays_in_the_scene() {
    let world = world(ROOM);
    let centre = Vec3::new(0.2, 0.3, -0.1);
    let map = Map::new(look(&world, centre, 0, &FINE, 1).surfels);
    let (mut hits, mut wrong, mut hidden) = (0, 0, 0);
    for i in 0..4000 {
        let o = Vec3::new(random(i, 2), random(i, 3), random(i, 4)) * 3.6 - 1.8;
        let ray = Ray::new(o, direction(i));
        // Seen from the probe: not within the ball or the box.
        let to = o - centre;
        let is_seen = |h: &crate::base::ray::Hit| h.t > to.length();
        if !world.closest(&Ray::new(centre, to.normalize())).is_some_and(|h| is_seen(&h)) {
            continue;
        }
        let local = LocalRay { o: to, d: ray.d };
        let [a, b] = [Search::HiZ, Search::TwoScale].map(|search| map.march(&local, [0.0, 20.0], search, 1.0));
        match (a, b) {
            (March::Hit { t, .. }, March::Hit { t: other, .. }) | (March::Hidden { t }, March::Hidden { t: other }) => {
                assert!((t - other).abs() < 1e-3 * t.max(1.0), "{a:?} {b:?}");
            }
            _ => assert_eq!(a, b),
        }
        let truth = world.closest(&ray).expect("a closed room").t;
        match a {
            March::Hit { t, .. } => {
                hits += 1;
                wrong += usize::from((t - truth).abs() > 0.06);
            }
            // It went behind something before it met anything, or at that place.
            March::Hidden { t } => {
                hidden += 1;
                assert!(t < truth + 0.1, "hidden at {t}, after {truth}");
            }
            March::Free => panic!("a ray left a closed room: {ray:?}"),
        }
    }
    assert!(hits > 2000 && hidden > 30, "{hits} hits, {hidden} hidden");
    // Those that pass within a texel of an edge: texels of 14 mrad, at edges of some 3 rad in all.
    assert!(wrong * 25 < hits, "{wrong} of {hits} hits are elsewhere");
}

/// Several probes find nearly all that rays in the scene find, in a grid and in none.
#[test]
fn rays_through_several_probes_meet_what_rays_in_the_scene_meet() {
    let world = world(ROOM);
    let grid = field(&world, [2, 2, 2], 2.0, &FINE);
    // The same probes without their order, and two more above the box and behind the ball.
    let mut positions: Vec<[f32; 3]> = grid.places.positions().iter().rev().map(|p| p.to_array()).collect();
    positions.extend([[-1.0, 0.6, -0.8], [1.4, -1.2, 0.9]]);
    let list = lit(&world, listed(positions), &FINE);
    assert!(list.octree.as_ref().is_some_and(|tree| tree.at(Vec3::ZERO)[0] != NO_PROBE && 4 * tree.bytes() < list.bytes()));
    for (field, least) in [(&grid, 92), (&list, 94)] {
        let [right, lost, count] = rays_met(&world, field);
        println!("{right} of {count} right, {lost} lost");
        assert!(count > 2500 && right * 100 > count * least, "{right} of {count} right, {lost} lost");
    }
}

/// Of rays from surfaces that a probe sees: how many meet what they meet in the scene, how many are lost, how many there are.
fn rays_met(world: &World, field: &LightField) -> [usize; 3] {
    let (mut right, mut lost, mut count) = (0, 0, 0);
    for i in 0..3000 {
        let from = Vec3::new(random(i, 2), random(i, 3), random(i, 4)) * 3.0 - 1.5;
        // Not within the ball or the box, of which no probe knows the inside.
        let sees = |probe| {
            let to = from - field.places.position(probe);
            world.closest(&Ray::new(field.places.position(probe), to.normalize())).is_some_and(|hit| hit.t > to.length())
        };
        if !(0..field.places.len()).any(sees) {
            continue;
        }
        // From a surface, as shading does.
        let towards = Ray::new(from, direction(i));
        let Some(surface) = world.intersect(&towards) else { continue };
        let d = direction(i + 10_000);
        let d = if d.dot(surface.ng) * towards.d.dot(surface.ng) < 0.0 { d } else { -d };
        let mut ray = surface.spawn(d);
        ray.t_max = 20.0;
        let Some(truth) = world.closest(&ray) else { continue };
        count += 1;
        match trace(field, &ray, Search::HiZ, 1.0) {
            Found::Surface { t, .. } => right += usize::from((t - truth.t).abs() < 0.05 + 0.02 * truth.t),
            Found::Lost { .. } => lost += 1,
            Found::Nothing => {}
        }
    }
    [right, lost, count]
}

#[test]
fn a_query_ends_whatever_a_map_holds() {
    let n = 32;
    for seed in 0..20 {
        let distance = (0..n * n).map(|i| match hash_words(&[seed, i as u32]) % 5 {
            0 => f32::INFINITY,
            1 => 1e-6,
            _ => 10.0 * random(i as u32, seed),
        });
        let normal = (0..n * n).map(|i| hash_words(&[seed, i as u32, 9])).collect();
        let map = Map::new(super::probe::Surfels { size: n, distance: distance.collect(), normal });
        for i in 0..200 {
            let o = if i % 7 == 0 { Vec3::ZERO } else { direction(i) * 5.0 * random(i, 5) };
            let d = if i % 5 == 0 { Vec3::X } else { direction(i + 500) };
            for search in [Search::HiZ, Search::TwoScale] {
                map.march(&LocalRay { o, d }, [0.0, 1e6], search, 1.0);
            }
        }
    }
}

/// Probes anywhere, who see anything: each is asked at most once, and places only go on along the ray.
#[test]
fn a_query_ends_whatever_a_set_holds() {
    let n = 16;
    for seed in 0..30 {
        let place = |k: u32| (direction(seed * 100 + k) * 3.0 * random(k, seed)).to_array();
        let surfels =
            |k: u32| super::probe::Surfels {
                size: n,
                distance: (0..n * n)
                    .map(|i| {
                        if hash_words(&[seed, k, i as u32]).is_multiple_of(4) { f32::INFINITY } else { 4.0 * random(i as u32, k) }
                    })
                    .collect(),
                normal: (0..n * n).map(|i| hash_words(&[seed, k, i as u32, 9])).collect(),
            };
        let count = 1 + seed % 20 * 3;
        let field = LightField::unlit(listed((0..count).map(place).collect()), (0..count).map(surfels).collect());
        field.octree.as_ref().unwrap().check(count as usize).unwrap();
        for i in 0..100 {
            let mut ray = Ray::new(direction(i) * 4.0 * random(i, 5), direction(i + 500));
            ray.t_max = 1e4;
            let mut steps = Vec::new();
            let found = follow(&field, &ray, Search::HiZ, 1.0, &mut |step| steps.push(step));
            let mut probes: Vec<usize> = steps.iter().map(|s| s.probe).collect();
            probes.sort_unstable();
            probes.dedup();
            assert!(probes.len() == steps.len() && (1..=32).contains(&steps.len()), "{found:?}: {steps:?}");
            assert!(steps.windows(2).all(|w| w[0].t <= w[1].t), "{steps:?}");
        }
    }
}

/// In a closed room with walls of one albedo, light of all bounces is that of one times 1 / (1 - albedo), where light is about even: a furnace.
#[test]
fn bounces_add_up_in_a_furnace() {
    let walls = "<shape type='cube'><transform name='to_world'><scale value='2'/></transform><boolean name='flip_normals' value='true'/>
        <bsdf type='diffuse'><rgb name='reflectance' value='0.5'/></bsdf><emitter type='area'><rgb name='radiance' value='1'/></emitter></shape>";
    let world = world(walls);
    let params = LightFieldBakeParams { size: 64, ambient_size: 16, spp: 64, lobe_samples: 1, bounces: 6 };
    let field = field(&world, [2, 2, 2], 1.5, &params);
    // Scattered radiance is albedo (1 + albedo + ...), here to the sixth bounce.
    assert_eq!(field.bytes(), 8 * probe_bytes(&params));
    let expected = (1..=6).map(|k| 0.5f32.powi(k)).sum::<f32>();
    for i in 0..50 {
        let n = direction(i);
        let found = field.irradiance(direction(i + 100) * 0.8, n).x / std::f32::consts::PI;
        assert!((found / expected - 1.0).abs() < 0.02, "{found}, expected {expected}");
    }
}

/// The same with walls of rough metal: light that glossy lobes hand on.
#[test]
fn bounces_add_up_in_a_furnace_of_metal() {
    let walls = "<shape type='cube'><transform name='to_world'><scale value='2'/></transform><boolean name='flip_normals' value='true'/>
        <bsdf type='roughconductor'><string name='material' value='none'/><float name='alpha' value='0.15'/>
        <rgb name='specular_reflectance' value='0.5'/></bsdf><emitter type='area'><rgb name='radiance' value='1'/></emitter></shape>";
    let world = world(walls);
    let params = LightFieldBakeParams { size: 64, ambient_size: 16, spp: 16, lobe_samples: 1, bounces: 6 };
    let field = field(&world, [2, 2, 2], 1.5, &params);
    let expected = (1..=6).map(|k| 0.5f32.powi(k)).sum::<f32>();
    for i in 0..50 {
        let found = field.light[i % 8].about(direction(i as u32), 3.0).x;
        // A hundredth for what a lobe scatters more than once, and for noise.
        assert!((found / expected - 1.0).abs() < 0.03, "{found}, expected {expected}");
    }
}

/// A wall thinner than the probes' spacing parts a lit room and a dark one.
#[test]
fn no_light_leaks_through_a_thin_wall() {
    let walls = "<bsdf type='twosided' id='w'><bsdf type='diffuse'><rgb name='reflectance' value='0.7'/></bsdf></bsdf>
        <shape type='cube'><transform name='to_world'><scale x='4' y='2' z='2'/></transform><ref id='w'/></shape>
        <shape type='cube'><transform name='to_world'><scale x='0.05' y='2' z='2'/></transform><ref id='w'/></shape>
        <shape type='rectangle'><transform name='to_world'><rotate x='1' angle='90'/><scale value='0.7'/><translate x='-2' y='1.98'/></transform>
        <emitter type='area'><rgb name='radiance' value='5'/></emitter></shape>";
    let world = world(walls);
    let provenance = Provenance::new("place-probes", "", 0, &0);
    let grid =
        ProbeGrid::in_box(Vec3::new(-4.0, -2.0, -2.0), Vec3::new(4.0, 2.0, 2.0), Density::Counts([4, 2, 2]), provenance).unwrap();
    // In no grid: as many, in other places, and one by the wall on the lit side, which is near to all of the dark one.
    let spread = (0..grid.len()).map(|i| (grid.position(i) + 0.3 * direction(i as u32)).to_array());
    let list = listed(spread.chain([[-0.3, 0.0, 0.0]]).collect());
    for field in [lit(&world, Places::Grid(grid), &SMALL), lit(&world, list, &SMALL)] {
        let (mut lit, mut dark) = (0.0, 0.0);
        for i in 0..400 {
            let p = Vec3::new(0.1 + 3.8 * random(i, 2), 3.8 * random(i, 3) - 1.9, 3.8 * random(i, 4) - 1.9);
            let n = direction(i);
            dark += field.irradiance(p, n).x;
            lit += field.irradiance(Vec3::new(-p.x, p.y, p.z), n).x;
        }
        println!("{} of the light leaks", dark / lit);
        assert!(dark < 0.01 * lit, "{} of the light leaks", dark / lit);
    }
}

/// Radiance is the same on both sides of every seam, at every level.
#[test]
fn levels_of_radiance_join_across_the_seams() {
    let n = 64;
    let smooth = |d: Vec3| Rgb::new(1.0 + d.x, 1.0 + d.y * d.z, 2.0 + d.z);
    let radiance: Vec<Rgb> = (0..n * n).map(|i| smooth(middle(i, n))).collect();
    let light = Light::new(&radiance, n);
    for level in 0..4 {
        for k in 0..64 {
            let edge = 0.01 + 0.98 * k as f32 / 64.0;
            for (inside, outside) in
                [(Vec2::new(edge, 1e-4), Vec2::new(1.0 - edge, 1e-4)), (Vec2::new(1e-4, edge), Vec2::new(1e-4, 1.0 - edge))]
            {
                let [a, b] = [inside, outside].map(|p| light.about(decode(p), level as f32));
                let (da, db) = (decode(inside), decode(outside));
                assert!(da.angle_between(db) < 0.01, "{da} {db}");
                assert!((a - b).abs().max_element() < 0.01, "level {level}: {a} and {b}");
                assert!((a - smooth(da)).abs().max_element() < 0.03 * (1 << level) as f32, "level {level}: {a}, {}", smooth(da));
            }
        }
    }
    assert_eq!(encode(Vec3::Y), Vec2::splat(0.5));
}
