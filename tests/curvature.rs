//! Curvature against surfaces whose curvature is known, and the file it travels in.

use glam::{Mat3, Vec2, Vec3};
use reprobe::base::progress::Silent;
use reprobe::io::Provenance;
use reprobe::scene::{Geometry, Object};
use reprobe::surface::{CurvatureMap, CurvatureParams, curvature, curvature_file};
use std::f32::consts::{PI, TAU};

/// A grid of (nu + 1) x (nv + 1) vertices over the unit square, seams split as files do.
fn grid(nu: u32, nv: u32, at: impl Fn(f32, f32) -> (Vec3, Vec3)) -> Geometry {
    let mut g = Geometry::default();
    for j in 0..=nv {
        for i in 0..=nu {
            let (p, n) = at(i as f32 / nu as f32, j as f32 / nv as f32);
            g.positions.push(p);
            g.normals.push(n.normalize());
            g.uvs.push(Vec2::new(i as f32 / nu as f32, j as f32 / nv as f32));
        }
    }
    for j in 0..nv {
        for i in 0..nu {
            let a = j * (nu + 1) + i;
            let (b, c, d) = (a + 1, a + nu + 2, a + nu + 1);
            // Winding that agrees with the normals, whatever the parametrisation's handedness.
            for t in [[a, b, c], [a, c, d]] {
                let [p, q, r] = t.map(|k| g.positions[k as usize]);
                let facing =
                    (q - p).cross(r - p).dot(g.normals[t[0] as usize] + g.normals[t[1] as usize] + g.normals[t[2] as usize]);
                g.triangles.push(if facing < 0.0 { [t[0], t[2], t[1]] } else { t });
            }
        }
    }
    g.triangle_object = vec![0; g.triangles.len()];
    g.objects.push(Object {
        name: "grid".into(),
        triangles: 0..g.triangles.len() as u32,
        vertices: 0..g.positions.len() as u32,
        material: 0,
        emitter: None,
        face_normals: false,
        has_uvs: true,
    });
    g
}

/// A closed seam needs bit-equal positions: angles wrap before they meet sin and cos.
fn circle(u: f32) -> (f32, f32) {
    ((u.fract() * TAU).sin(), (u.fract() * TAU).cos())
}

fn sphere(radius: f32, side: f32) -> Geometry {
    grid(48, 24, |u, v| {
        let (s, c) = circle(u);
        let (st, ct) = if v == 0.0 || v == 1.0 { (0.0, 1.0 - 2.0 * v) } else { (v * PI).sin_cos() };
        let n = Vec3::new(s * st, ct, c * st);
        (Vec3::new(0.3, 1.0, -2.0) + n * radius, n * side)
    })
}

fn torus(big: f32, small: f32) -> Geometry {
    grid(96, 32, |u, v| {
        let ((s, c), (t, e)) = (circle(u), circle(v));
        let out = Vec3::new(c, 0.0, s);
        let n = out * e + Vec3::Y * t;
        (out * big + n * small, n)
    })
}

fn saddle(k1: f32, k2: f32) -> Geometry {
    grid(32, 32, |u, v| {
        let (x, y) = (u * 0.4 - 0.2, v * 0.4 - 0.2);
        (Vec3::new(x, y, -0.5 * (k1 * x * x + k2 * y * y)), Vec3::new(k1 * x, k2 * y, 1.0))
    })
}

fn cylinder(radius: f32, around: u32, along: u32) -> Geometry {
    grid(around, along, |u, v| {
        let (s, c) = circle(u);
        (Vec3::new(s * radius, v * 2.0, c * radius), Vec3::new(s, 0.0, c))
    })
}

fn estimate(g: &Geometry) -> CurvatureMap {
    curvature(g, &CurvatureParams::default(), &Silent)
}

fn assert_close(found: f32, expected: f32, tolerance: f32, what: &str) {
    assert!((found - expected).abs() <= tolerance, "{what}: {found}, expected {expected} within {tolerance}");
}

#[test]
fn a_sphere_has_the_curvature_one_over_its_radius_everywhere() {
    let map = estimate(&sphere(0.5, 1.0));
    for i in 0..map.k1.len() {
        assert_close(map.k1[i], 2.0, 0.08, "k1");
        assert_close(map.k2[i], 2.0, 0.08, "k2");
        assert!((map.d1[i].length() - 1.0).abs() < 1e-5);
    }
}

#[test]
fn a_sphere_seen_from_inside_has_negative_curvature() {
    let map = estimate(&sphere(0.5, -1.0));
    assert!(map.k1.iter().chain(&map.k2).all(|k| (k + 2.0).abs() < 0.08));
}

#[test]
fn a_cylinder_bends_around_its_axis_only_however_coarse_it_is_along_it() {
    for along in [1, 2, 20] {
        let g = cylinder(0.25, 32, along);
        let map = estimate(&g);
        for i in 0..map.k1.len() {
            assert_close(map.k1[i], 4.0, 0.12, &format!("k1, {along} quads along, vertex {i}"));
            assert_close(map.k2[i], 0.0, 0.04, &format!("k2, {along} quads along, vertex {i}"));
            assert!(map.d1[i].y.abs() < 0.02, "d1 lies across the axis: {}", map.d1[i]);
        }
    }
}

#[test]
fn a_torus_has_its_two_curvatures_and_their_directions() {
    let (big, small) = (1.0f32, 0.3f32);
    let g = torus(big, small);
    let map = estimate(&g);
    for i in 0..map.k1.len() {
        let n = g.normals[i];
        let out = Vec3::new(g.positions[i].x, 0.0, g.positions[i].z).normalize();
        let around = n.dot(out) / (big + small * n.dot(out));
        assert_close(map.k1[i], 1.0 / small, 0.1, "around the tube");
        assert_close(map.k2[i], around, 0.06, "around the axis");
        assert!(map.d1[i].dot(Vec3::Y.cross(out)).abs() < 0.03, "{}", map.d1[i]);
    }
}

#[test]
fn a_saddle_has_curvatures_of_both_signs_up_to_its_rim() {
    let (g, n) = (saddle(3.0, -2.0), 33);
    let map = estimate(&g);
    let centre = n * 16 + 16;
    assert_close(map.k1[centre], 3.0, 0.06, "k1");
    assert_close(map.k2[centre], -2.0, 0.06, "k2");
    assert!(map.d1[centre].x.abs() > 0.999, "{}", map.d1[centre]);
    // On the rim the estimate is the inner neighbours': one step of 0.0125 from a slope of 0.6.
    for i in 0..n {
        let rim = n * 32 + i;
        assert!(map.k1[rim] > 1.0 && map.k2[rim] < -1.0, "{} {}", map.k1[rim], map.k2[rim]);
    }
}

#[test]
fn a_plane_of_any_orientation_and_tessellation_has_curvature_zero_exactly() {
    let turn = Mat3::from_euler(glam::EulerRot::XYZ, 0.4, 1.1, -0.7);
    for (nu, nv) in [(1, 1), (2, 1), (1, 30), (17, 23)] {
        let g = grid(nu, nv, |u, v| {
            let skewed = Vec3::new(3.0 * u * u + 0.3 * v, 2.0 * v, 0.0);
            (turn * skewed + Vec3::new(5.0, -3.0, 8.0), turn * Vec3::Z)
        });
        let map = estimate(&g);
        assert!(map.k1.iter().chain(&map.k2).all(|&k| k == 0.0), "{nu} x {nv}");
    }
}

#[test]
fn face_normals_make_planes_of_a_sphere() {
    let mut g = sphere(0.5, 1.0);
    g.objects[0].face_normals = true;
    let map = estimate(&g);
    assert!(map.k1.iter().chain(&map.k2).all(|&k| k == 0.0));
    assert!(map.at(&g, 100, Vec2::splat(0.3), Vec3::Z).is_flat());
}

#[test]
fn facets_with_normals_of_their_own_are_planes() {
    // A prism of 24 sides whose file gives each side its own normals, 15 degrees apart.
    let smooth = cylinder(0.25, 24, 4);
    let mut g = Geometry { objects: smooth.objects.clone(), ..Geometry::default() };
    for pair in smooth.triangles.chunks(2) {
        let n = smooth.area_normal(g.triangles.len() as u32).normalize();
        for t in pair {
            let first = g.positions.len() as u32;
            g.positions.extend(t.map(|i| smooth.positions[i as usize]));
            g.normals.extend([n; 3]);
            g.triangles.push([first, first + 1, first + 2]);
        }
    }
    g.objects[0].vertices = 0..g.positions.len() as u32;
    g.triangle_object = vec![0; g.triangles.len()];
    let map = estimate(&g);
    assert!(map.k1.iter().chain(&map.k2).all(|&k| k == 0.0));
}

#[test]
fn interpolation_keeps_the_tensor_and_turns_its_sign_with_the_viewer() {
    let g = torus(1.0, 0.3);
    let map = estimate(&g);
    for t in (0..g.triangles.len() as u32).step_by(7) {
        let n = g.triangles[t as usize].map(|i| g.normals[i as usize]).into_iter().sum::<Vec3>().normalize();
        let front = map.at(&g, t, Vec2::splat(1.0 / 3.0), n);
        let back = map.at(&g, t, Vec2::splat(1.0 / 3.0), -n);
        assert_close(front.k1, 1.0 / 0.3, 0.12, "front k1");
        assert_close(back.k2, -front.k1, 1e-3, "back k2");
        assert_close(back.k1, -front.k2, 1e-3, "back k1");
        assert!(front.d1.dot(n).abs() < 1e-5 && (front.d1.cross(front.d2) - n).length() < 1e-4);
        assert!((back.d1.cross(back.d2) + n).length() < 1e-4);
    }
}

#[test]
fn degenerate_triangles_and_points_give_finite_numbers() {
    let mut g = sphere(0.5, 1.0);
    for i in (0..g.positions.len()).step_by(5) {
        g.positions[i] = Vec3::ONE;
    }
    for n in g.normals.iter_mut().step_by(11) {
        *n = Vec3::ZERO;
    }
    let map = estimate(&g);
    assert!(map.k1.iter().chain(&map.k2).all(|k| k.is_finite()) && map.d1.iter().all(|d| d.is_finite()));
    let empty = estimate(&Geometry::default());
    assert!(empty.k1.is_empty());
}

#[test]
fn one_thread_equals_many() {
    let g = torus(1.0, 0.3);
    let pool = |n| rayon::ThreadPoolBuilder::new().num_threads(n).build().unwrap();
    assert_eq!(pool(1).install(|| estimate(&g)), pool(4).install(|| estimate(&g)));
}

#[test]
fn the_file_round_trips_and_refuses_another_scene() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("curvature.exr");
    let g = torus(1.0, 0.3);
    let map = estimate(&g);
    let vertices = g.positions.len();
    curvature_file::write(&map, &path, Provenance::new("curvature", "abc", 0, &CurvatureParams::default())).unwrap();
    assert_eq!(curvature_file::read(&path, vertices, "abc").unwrap(), map);
    assert!(curvature_file::read(&path, vertices, "abd").unwrap_err().to_string().contains("another scene"));
    let message = curvature_file::read(&path, vertices + 4096, "abc").unwrap_err().to_string();
    assert!(message.contains("4096 x 1 entries") && message.contains("curvature.exr"), "{message}");
}
