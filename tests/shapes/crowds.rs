//! Round shapes by the hundred: point clouds, and chains of lamps.

use super::measure::{PATH, expect_quarters, scene, usual_sensor};
use glam::{DVec3, Vec3};
use reprobe::base::progress::Silent;
use reprobe::base::ray::Ray;
use reprobe::scene::film::Filter;
use reprobe::surface::{CurvatureParams, curvature};
use reprobe::transport::World;

const SKY: &str = "<emitter type='constant'/>";
const WALL: &str = "<shape type='rectangle'><transform name='to_world'><scale value='3'/><translate z='-1.2'/></transform>
    <bsdf type='diffuse'/></shape>";

/// Shapes on a lattice of the cube [-1, 1]³, with colours: they reflect, or shine.
fn crowd(count: u32, shape: &str, lamps: bool) -> String {
    crowd_at(0.0, count, shape, lamps)
}

/// A crowd moved along x.
fn crowd_at(shift: f64, count: u32, shape: &str, lamps: bool) -> String {
    let lattice = |i: u32, k: f64| (f64::from(i + 1) * k).fract();
    let one = |i: u32| {
        let [x, y, z] = [0.754_877_666, 0.569_840_290, 0.438_344].map(|k| 2.0 * lattice(i, k) - 1.0);
        let x = x + shift;
        let [a, b, c] = [0.819_172_513, 0.671_043_607, 0.549_700_478].map(|k| lattice(i, k));
        let place = match shape {
            "sphere" => format!("<point name='center' x='{x:.4}' y='{y:.4}' z='{z:.4}'/><float name='radius' value='0.04'/>"),
            "cylinder" => format!(
                "<point name='p0' x='{x:.4}' y='{y:.4}' z='{z:.4}'/><point name='p1' x='{:.4}' y='{:.4}' z='{:.4}'/>
                 <float name='radius' value='0.02'/>",
                x + 0.1 * a - 0.05,
                y + 0.1 * b + 0.02,
                z + 0.1 * c - 0.05
            ),
            _ => format!(
                "<transform name='to_world'><scale value='0.08'/><rotate x='1' angle='{:.2}'/>
                 <translate x='{x:.4}' y='{y:.4}' z='{z:.4}'/></transform>",
                180.0 * a
            ),
        };
        let diffuse = format!("<bsdf type='diffuse'><rgb name='reflectance' value='{a:.4},{b:.4},{c:.4}'/></bsdf>");
        let looks = match (lamps, shape) {
            (true, _) => format!("<emitter type='area'><rgb name='radiance' value='{a:.4},{b:.4},{c:.4}'/></emitter>"),
            (false, "sphere") => diffuse,
            (false, _) => format!("<bsdf type='twosided'>{diffuse}</bsdf>"),
        };
        format!("<shape type='{shape}'>{place}{looks}</shape>\n")
    };
    (0..count).map(one).collect()
}

fn expect(inside: &str, mitsuba: [[f64; 3]; 4], error: f64) {
    let world = scene(inside);
    assert!(!world.geometry.rounds.is_empty(), "no crowd");
    expect_quarters(inside, 192, Filter::Box, mitsuba, error);
}

#[test]
fn a_point_cloud_of_spheres_looks_like_mitsubas() {
    let inside = format!("{PATH}{}{SKY}{}", usual_sensor(), crowd(512, "sphere", false));
    expect(
        &inside,
        [[0.84114, 0.8486, 0.84474], [0.79135, 0.79847, 0.79848], [0.80207, 0.80418, 0.804], [0.84996, 0.84237, 0.85526]],
        2.1e-04,
    );
}

#[test]
fn crowds_of_cylinders_look_like_mitsubas() {
    let inside = format!("{PATH}{}{SKY}{}", usual_sensor(), crowd(1200, "cylinder", false));
    expect(
        &inside,
        [[0.74506, 0.78971, 0.76004], [0.71024, 0.74516, 0.72022], [0.73525, 0.77485, 0.75027], [0.79188, 0.80807, 0.78275]],
        1.9e-04,
    );
}

#[test]
fn crowds_of_disks_look_like_mitsubas() {
    let inside = format!("{PATH}{}{SKY}{}", usual_sensor(), crowd(300, "disk", false));
    expect(
        &inside,
        [[0.77767, 0.78596, 0.74845], [0.68243, 0.68919, 0.7032], [0.74322, 0.71938, 0.74503], [0.80417, 0.7704, 0.78191]],
        1.8e-04,
    );
}

#[test]
fn lamps_of_many_spheres_light_a_wall_like_mitsubas() {
    let inside = format!("{PATH}{}{WALL}{}", usual_sensor(), crowd(150, "sphere", true));
    let lights = World::new(scene(&inside)).lights;
    assert!(!lights.is_empty());
    expect(
        &inside,
        [[0.0794, 0.07547, 0.0678], [0.06087, 0.06965, 0.07394], [0.06243, 0.06602, 0.07121], [0.08182, 0.07564, 0.07609]],
        1.3e-04,
    );
}

#[test]
fn lamps_of_many_cylinders_light_a_wall_like_mitsubas() {
    let inside = format!("{PATH}{}{WALL}{}", usual_sensor(), crowd(1200, "cylinder", true));
    expect(
        &inside,
        [[0.19146, 0.24667, 0.20723], [0.22732, 0.27377, 0.24232], [0.19661, 0.24586, 0.20404], [0.17676, 0.20243, 0.15926]],
        1.9e-04,
    );
}

#[test]
fn lamps_of_many_disks_light_a_wall_like_mitsubas() {
    let inside = format!("{PATH}{}{WALL}{}", usual_sensor(), crowd(300, "disk", true));
    expect(
        &inside,
        [[0.05622, 0.11328, 0.10408], [0.06274, 0.1435, 0.14036], [0.04595, 0.10857, 0.12373], [0.04054, 0.0808, 0.07406]],
        1.1e-04,
    );
}

/// Memory is what triangles and their vertices take: so many bytes a shape, whatever the crowd's size.
#[test]
fn a_crowds_meshes_are_coarse_and_a_few_shapes_are_fine() {
    let fine = scene(&format!("{SKY}{}", crowd(16, "sphere", false))).geometry;
    assert!(fine.rounds.is_empty());
    assert_eq!(fine.triangles.len(), 16 * 16_128);
    for count in [17, 500, 6000] {
        let g = scene(&format!("{SKY}{}", crowd(count, "sphere", false))).geometry;
        assert_eq!(g.rounds.len(), count as usize);
        assert!(g.triangles.len() <= (16 * 16_128).max(48 * count as usize), "{count}: {}", g.triangles.len());
    }
    // A globe among beads keeps what the beads do not need.
    let globe = "<shape type='sphere'><float name='radius' value='30'/></shape>";
    let g = scene(&format!("{SKY}{globe}{}", crowd(500, "sphere", false))).geometry;
    assert_eq!((g.objects[0].triangles.len(), g.objects[1].triangles.len()), (16_128, 48));
}

/// Points, normals and texture coordinates that Mitsuba 3.9.1's `ray_intersect` gives for single shapes, of which a crowd makes
/// other objects: they must be those of the shapes themselves, not of meshes.
#[test]
fn rays_meet_the_shapes_themselves() {
    let squeeze = "<transform name='to_world'><rotate x='1' angle='25'/><translate x='0.1'/></transform>";
    for (shape, o, expected) in [
        (
            format!("<shape type='sphere'>{squeeze}<float name='radius' value='2'/></shape>"),
            [0.3, 0.2, 50.0],
            [
                [0.3, 0.2, 1.979899],
                [0.1, 0.1, 0.98995],
                [0.219125, 0.173596, 0.0],
                [-6.396302, 1.138899, 0.531078],
                [1.03555, 6.154554, -0.72631],
            ],
        ),
        (
            format!(
                "<shape type='cylinder'>{squeeze}<point name='p0' x='0' y='-1' z='0'/><point name='p1' x='0' y='3' z='1'/>
                 <float name='radius' value='0.7'/></shape>"
            ),
            [0.3, 0.2, 50.0],
            [
                [0.3, 0.200001, 1.338038],
                [0.285714, -0.603558, 0.744369],
                [0.796115, 0.47736, 0.0],
                [4.214895, 0.791445, -0.97609],
                [0.0, 3.202613, 2.596781],
            ],
        ),
        (
            format!("<shape type='disk'>{squeeze}</shape>"),
            [0.3, 0.2, 50.0],
            [
                [0.3, 0.2, 0.093262],
                [0.0, -0.422618, 0.906308],
                [0.297822, 0.132816, 0.0],
                [0.671542, 0.671544, 0.313146],
                [-1.386551, 1.1389, 0.531078],
            ],
        ),
    ] {
        let far = crowd_at(100.0, 1200, "cylinder", false);
        let world = World::new(scene(&format!("{SKY}{shape}{far}")));
        let s = world.intersect(&Ray::new(Vec3::from(o), Vec3::NEG_Z)).unwrap();
        assert_eq!(s.object, 0);
        let found = [s.p, s.frame.n, s.uv.extend(0.0), s.dp_du, s.dp_dv];
        for (k, (found, expected)) in found.into_iter().zip(expected).enumerate() {
            let expected = Vec3::from(expected);
            assert!((found - expected).length() <= 2e-5 * expected.length().max(1.0), "{shape} {k}: {found}, Mitsuba {expected}");
        }
    }
}

/// Triangle and weights name a place exactly: what is found there again is what the ray met.
#[test]
fn a_hits_triangle_and_weights_mean_its_place() {
    for (shape, flip) in [("sphere", false), ("sphere", true), ("cylinder", false), ("cylinder", true), ("disk", true)] {
        let inside = crowd(1200, shape, false).replace("<bsdf", &format!("<boolean name='flip_normals' value='{flip}'/><bsdf"));
        let world = World::new(scene(&format!("{SKY}{inside}")));
        let mut seen = 0;
        for i in 0..20_000u32 {
            let u = |k: f64| (f64::from(i) * k).fract();
            let o = DVec3::new(u(0.618_034) * 2.4 - 1.2, u(0.754_878) * 2.4 - 1.2, 3.0).as_vec3();
            let d = Vec3::new((u(0.569_84) - 0.5) as f32, (u(0.438_3) - 0.5) as f32, -1.0).normalize();
            let Some(hit) = world.closest(&Ray::new(o, d)) else { continue };
            seen += 1;
            let s = world.surface(&hit);
            let on_ray = o + d * hit.t;
            assert!((s.p - on_ray).length() < 1e-5, "{shape}: {} {on_ray}", s.p);
            let round = &world.scene.geometry.rounds[world.scene.geometry.round(hit.triangle).unwrap() as usize];
            assert_eq!(round.object, s.object);
            // The mesh's own triangle lies there too, as near as its coarseness allows, on the same side.
            let g = &world.scene.geometry;
            let [a, b, c] = g.corners(hit.triangle);
            let flat = a * (1.0 - hit.u - hit.v) + b * hit.u + c * hit.v;
            assert!(
                flat.distance(s.p) < 0.02 && (hit.u >= 0.0 && hit.v >= 0.0 && hit.u + hit.v < 1.00001),
                "{shape}: {flat} {}",
                s.p
            );
            assert!(g.area_normal(hit.triangle).normalize().dot(s.ng) > 0.8, "{shape}: {}", s.ng);
            // Nothing but other shapes stands before what leaves it.
            let out = if s.ng.dot(d) < 0.0 { s.ng } else { -s.ng };
            if let Some(next) = world.closest(&s.spawn(out)) {
                assert!(world.surface(&next).object != s.object || shape == "cylinder", "{shape} meets itself from {}", s.p);
            }
        }
        assert!(seen > 2000, "{shape}: {seen}");
    }
}

#[test]
fn a_crowd_has_curvatures() {
    let g = scene(&format!("{SKY}{}", crowd(500, "sphere", false))).geometry;
    let map = curvature(&g, &CurvatureParams::default(), &Silent);
    let mut sum = 0.0;
    for k in map.k1.iter().chain(&map.k2) {
        sum += f64::from(k.abs());
    }
    let mean = sum / (2.0 * map.k1.len() as f64);
    assert!((mean * 0.04 - 1.0).abs() < 0.05, "mean curvature {mean}, of balls of radius .04");
}
