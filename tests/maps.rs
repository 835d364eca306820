//! Resolution map and parameterisation of a probe in a synthetic room: the physics of §4.2.

use glam::{Vec2, Vec3};
use reprobe::method::glossy_probes::quasi_harmonic::Solver;
use reprobe::method::glossy_probes::resmap::{ResmapParams, ResolutionMap, density_correlation, resolution_map, size_term};
use reprobe::method::glossy_probes::seen::{Seen, SeenBuffers};
use reprobe::probe::parameter_map::{ParameterMap, count_flipped};
use std::f32::consts::{PI, TAU};

/// A box seen from inside, with balls in it.
struct Room {
    lower: Vec3,
    upper: Vec3,
    /// Alpha of the walls at lower x, y, z and at upper x, y, z.
    walls: [Option<f32>; 6],
    /// Centre, radius, alpha.
    balls: Vec<(Vec3, f32, Option<f32>)>,
}

impl Room {
    /// The probe stands at the origin.
    fn bathroom() -> Self {
        let ball = |x: f32, y: f32, z: f32, r: f32, alpha| (Vec3::new(x, y, z), r, Some(alpha));
        Self {
            lower: Vec3::new(-1.7, -1.2, -2.4),
            upper: Vec3::new(1.4, 1.5, 1.9),
            walls: [None, Some(0.1), Some(0.0), None, None, Some(0.3)],
            balls: vec![ball(0.8, -0.9, -1.2, 0.3, 0.05), ball(-1.0, -0.6, -1.0, 0.15, 0.2), ball(0.3, -0.2, 1.3, 0.1, 0.0)],
        }
    }

    fn see(&self, d: Vec3) -> Option<Seen> {
        let mut hit: Option<Seen> = None;
        let mut offer = |alpha, depth: f32, normal: Vec3| {
            if depth > 0.0 && hit.is_none_or(|h| depth < h.depth) {
                hit = Some(Seen { alpha, depth, normal, facing: -normal.dot(d) });
            }
        };
        for axis in 0..3 {
            let side = if d[axis] < 0.0 { 0 } else { 3 };
            let plane = if d[axis] < 0.0 { self.lower[axis] } else { self.upper[axis] };
            if d[axis] != 0.0 {
                offer(self.walls[axis + side], plane / d[axis], -Vec3::AXES[axis] * d[axis].signum());
            }
        }
        for &(centre, radius, alpha) in &self.balls {
            let along = d.dot(centre);
            let inside = radius * radius - (centre - d * along).length_squared();
            if inside > 0.0 {
                let t = along - inside.sqrt();
                offer(alpha, t, (d * t - centre) / radius);
            }
        }
        hit
    }

    fn seen(&self, size: [u32; 2]) -> SeenBuffers {
        SeenBuffers::from_fn(size, |d| self.see(d))
    }

    fn map(&self) -> ResolutionMap {
        let params = ResmapParams::default();
        resolution_map(&params, &self.seen(params.size))
    }
}

fn assert_finite(map: &ResolutionMap) {
    for (name, term) in [("m", &map.m), ("m_mat", &map.m_mat), ("m_size", &map.m_size), ("m_complexity", &map.m_complexity)] {
        assert!(term.iter().all(|x| x.is_finite() && *x >= 0.0), "{name}");
    }
}

#[test]
fn size_term_sums_to_the_area_of_the_room() {
    let room = Room { balls: vec![], ..Room::bathroom() };
    let e = room.upper - room.lower;
    let area = 2.0 * (e.x * e.y + e.y * e.z + e.z * e.x);
    // One ray a texel errs where texels straddle the room's edges, in proportion to their size.
    for (w, h, tolerance) in [(256u32, 128u32, 2e-3), (1024, 512, 5e-4)] {
        let seen = room.seen([w, h]);
        let texel = (TAU / w as f32) * (PI / h as f32);
        let sum: f64 = seen
            .texels
            .iter()
            .enumerate()
            .map(|(i, t)| {
                let latitude = PI * (0.5 - ((i as u32 / w) as f32 + 0.5) / h as f32);
                let t = t.unwrap();
                f64::from(size_term(t.depth, t.facing, latitude, ResmapParams::default().facing_min) * texel)
            })
            .sum();
        assert!((sum / f64::from(area) - 1.0).abs() < tolerance, "{w}x{h}: {sum} m², the room has {area}");
    }
}

#[test]
fn terms_have_mean_one_over_the_texels_that_see_a_surface() {
    let params = ResmapParams::default();
    let room = Room::bathroom();
    let seen = SeenBuffers::from_fn(params.size, |d| if d.y > 0.3 { None } else { room.see(d) });
    let surfaces = seen.texels.iter().flatten().count() as f64;
    let map = resolution_map(&params, &seen);
    for term in [&map.m_size, &map.m_complexity] {
        let mean = term.iter().map(|&x| f64::from(x)).sum::<f64>() / surfaces;
        assert!((mean - 1.0).abs() < 1e-5, "{mean}");
    }
}

#[test]
fn diffuse_texels_get_nothing() {
    let room = Room { walls: [None; 6], balls: vec![], ..Room::bathroom() };
    assert!(room.map().m.iter().all(|&m| m == 0.0));
    let room = Room { walls: [None, None, Some(0.0), None, None, None], balls: vec![], ..room };
    let (map, seen) = (room.map(), room.seen([256, 128]));
    assert!(map.m_mat.iter().zip(&seen.texels).all(|(m, t)| (*m > 0.0) == t.unwrap().alpha.is_some()));
    // The blur reaches 4 sigma; the far side of the room stays empty.
    assert_eq!(map.m[64 * 256 + 128], 0.0);
    assert!(map.m[64 * 256] > 0.0);
}

#[test]
fn smoother_materials_get_more() {
    let with = |alpha| {
        let room = Room { walls: [None, None, Some(alpha), None, Some(0.5), None], balls: vec![], ..Room::bathroom() };
        room.map().m[64 * 256]
    };
    assert!(with(0.0) > with(0.1) && with(0.1) > with(0.4) && with(0.4) > 0.0);
}

#[test]
fn scaling_the_scene_leaves_m_unchanged() {
    let room = Room::bathroom();
    let balls = room.balls.iter().map(|&(c, r, a)| (c * 100.0, r * 100.0, a)).collect();
    let large = Room { lower: room.lower * 100.0, upper: room.upper * 100.0, balls, ..room };
    let worst = large.map().m.iter().zip(Room::bathroom().map().m).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
    assert!(worst < 1e-3, "{worst}");
}

#[test]
fn one_flat_wall_has_no_complexity_and_finite_m() {
    // A wall so large that it fills one half of the sphere, the other half empty; and one that fills all of it.
    let wall = |d: Vec3| Seen { alpha: Some(0.1), depth: 1.0, normal: Vec3::Z, facing: d.z.abs() };
    let params = ResmapParams::default();
    let map = resolution_map(&params, &SeenBuffers::from_fn(params.size, |d| (d.z < 0.0).then(|| wall(d))));
    assert_finite(&map);
    let map = resolution_map(&params, &SeenBuffers::from_fn(params.size, |d| Some(wall(d))));
    assert!(map.m_complexity.iter().all(|&c| c == 0.0));
    assert_finite(&map);
    assert!(map.m.iter().all(|&m| m > 0.0));
}

#[test]
fn grazing_angles_and_escaped_rays_stay_finite() {
    let params = ResmapParams::default();
    let floor = |d: Vec3| Seen { alpha: Some(0.0), depth: (0.0001 / -d.y).min(1e6), normal: Vec3::Y, facing: 0.0 };
    let map = resolution_map(&params, &SeenBuffers::from_fn(params.size, |d| (d.y < 0.0).then(|| floor(d))));
    assert_finite(&map);
    let nothing = resolution_map(&params, &SeenBuffers::from_fn(params.size, |_| None));
    assert!(nothing.m.iter().all(|&m| m == 0.0));
    assert_finite(&nothing);
    let forward = Solver::new(params.size).unwrap().forward_map(&nothing.m, 0.01).unwrap();
    assert_eq!(forward.vertices[257 * 64 + 64], Vec2::new(0.25, 0.5), "nothing to see: plain lat-long");
}

#[test]
fn turning_the_scene_about_up_rolls_the_map() {
    let params = ResmapParams::default();
    let room = Room::bathroom();
    // A quarter turn: what lay at longitude u now lies at u + 1/4.
    let turned = SeenBuffers::from_fn(params.size, |d| {
        let seen = room.see(Vec3::new(d.z, d.y, -d.x))?;
        Some(Seen { normal: Vec3::new(-seen.normal.z, seen.normal.y, seen.normal.x), ..seen })
    });
    let (a, b) = (room.map(), resolution_map(&params, &turned));
    let scale = a.m.iter().copied().fold(0.0, f32::max);
    for (i, &m) in b.m.iter().enumerate() {
        let from = i / 256 * 256 + (i % 256 + 192) % 256;
        assert!((m - a.m[from]).abs() < 1e-3 * scale, "texel {i}: {m}, before {}", a.m[from]);
    }
}

#[test]
fn texel_density_follows_m_over_a_room() {
    let map = Room::bathroom().map();
    let epsilon = reprobe::method::glossy_probes::qhmap::QhmapParams::default().epsilon;
    let forward = Solver::new(map.size).unwrap().forward_map(&map.m, epsilon).unwrap();
    assert_eq!(count_flipped(map.size, &forward.vertices), 0);
    assert_eq!(forward.epsilon, epsilon);
    let probe = ParameterMap::from_forward(map.size, forward.vertices, [512, 256]);
    let r = density_correlation(&probe.log_density(), &map.m);
    assert!(r >= 0.85, "correlation {r}");
}
