use super::triangle::Shear;
use super::*;
use crate::base::math::{Rgb, direction_from_lat_long};
use crate::material::bsdf::{Bsdf, Diffuse};
use crate::material::{Material, Opacity, Texture};
use crate::scene::mesh::{Mesh, append};
use crate::scene::{Geometry, primitives};
use glam::{Mat4, Vec2, Vec3};

/// Uniform numbers in [0, 1) from a counter.
struct Random(u32);

impl Random {
    fn next(&mut self) -> f32 {
        self.0 += 1;
        (hash_words(&[self.0, 77]) >> 8) as f32 / 16_777_216.0
    }
    fn point(&mut self) -> Vec3 {
        Vec3::new(self.next(), self.next(), self.next()) * 2.0 - 1.0
    }
    fn direction(&mut self) -> Vec3 {
        let u = self.next();
        direction_from_lat_long(Vec2::new(u, (1.0 - 2.0 * self.next()).acos() / std::f32::consts::PI))
    }
}

fn scene_of(mesh: Mesh, m: Mat4) -> Scene {
    let mut scene = Scene::default();
    append(scene.geometry_mut(), mesh, m, false, false, String::new(), 0, None);
    scene
}

/// Small and large triangles, needles, some without area, some twice.
fn soup(count: u32, random: &mut Random) -> Mesh {
    let mut mesh = Mesh::default();
    for i in 0..count {
        let first = mesh.positions.len() as u32;
        let centre = random.point();
        let size = [0.02, 0.02, 0.1, 1.5][i as usize % 4];
        let [mut a, b, mut c] = [0; 3].map(|_| centre + random.point() * size);
        match i % 16 {
            3 => c = a,
            5 => c = a + (b - a) * 0.5,
            7 => a = Vec3::splat(f32::NAN),
            9 => c = b + (b - a).cross(c) * 1e-4,
            11 => (a.x, c.x) = (b.x, b.x),
            _ => {}
        }
        mesh.positions.extend([a, b, c]);
        mesh.triangles.push([first, first + 1, first + 2]);
        if i % 16 == 13 {
            mesh.triangles.push([first, first + 2, first + 1]);
        }
    }
    mesh
}

fn brute_force(geometry: &Geometry, ray: &Ray) -> Option<Hit> {
    let shear = Shear::new(ray);
    let mut best: Option<Hit> = None;
    for triangle in 0..geometry.triangles.len() as u32 {
        let corners = geometry.corners(triangle);
        if unit_normal(corners).is_none() {
            continue;
        }
        let found = shear.intersect(corners).filter(|&(t, ..)| t >= ray.t_min && t <= ray.t_max);
        if let Some((t, u, v)) = found.filter(|&(t, ..)| best.is_none_or(|b| t < b.t)) {
            best = Some(Hit { t, triangle, u, v });
        }
    }
    best
}

/// Random rays, axis-parallel rays, rays at corners and along edges, bounded and not.
fn ray_of(i: u32, geometry: &Geometry, scale: f32, random: &mut Random) -> Ray {
    let o = random.point() * 1.2 * scale;
    let triangle = hash_words(&[i]) % geometry.triangles.len() as u32;
    let [a, b, c] = geometry.corners(triangle).map(|p| if p.is_finite() { p } else { Vec3::ZERO });
    let towards = |p: Vec3| (p - o).try_normalize().unwrap_or(Vec3::X);
    let axis = [Vec3::X, Vec3::NEG_X, Vec3::Y, Vec3::NEG_Y, Vec3::Z, Vec3::NEG_Z][(i / 8) as usize % 6];
    let (o, d) = match i % 8 {
        0 => (o, axis),
        1 => (o, towards(a)),
        2 => (o, towards(a.lerp(b, 0.5))),
        3 => (a - (b - a), (b - a).try_normalize().unwrap_or(Vec3::Y)),
        4 => (a - axis * scale, axis),
        5 => (o, towards((a + b + c) / 3.0)),
        _ => (o, random.direction()),
    };
    let mut ray = Ray::new(o, d);
    if i.is_multiple_of(3) {
        ray.t_min = 0.2 * scale;
        ray.t_max = 0.9 * scale;
    }
    ray
}

#[test]
fn hits_are_those_of_brute_force() {
    let mut random = Random(1);
    // Powers of two keep the shapes; the others round them anew.
    for scale in [1.0, 1e-6, 3e5] {
        let scene = scene_of(soup(600, &mut random), Mat4::from_scale(Vec3::splat(scale)));
        let bvh = Bvh::build(&scene, &|_| true);
        let (mut hits, mut ties) = (0, 0);
        for i in 0..6000 {
            let ray = ray_of(i, &scene.geometry, scale, &mut random);
            let expected = brute_force(&scene.geometry, &ray);
            assert_eq!(bvh.closest(&scene, &[], &ray), expected, "ray {i} {ray:?} at scale {scale}");
            assert_eq!(bvh.occluded(&scene, &ray), expected.is_some(), "ray {i} {ray:?}");
            hits += u32::from(expected.is_some());
            ties += u32::from(expected.is_some_and(|h| h.triangle > 0 && h.u * h.v * (1.0 - h.u - h.v) == 0.0));
        }
        assert!(hits > 2000 && hits < 6000 && ties > 20, "{hits} hits, {ties} on edges");
    }
}

#[test]
fn only_kept_triangles_are_hit() {
    let mut random = Random(2);
    let scene = scene_of(soup(200, &mut random), Mat4::IDENTITY);
    let bvh = Bvh::build(&scene, &|t| t.is_multiple_of(2));
    let mut odd = Geometry::clone(&scene.geometry);
    odd.triangles.iter_mut().skip(1).step_by(2).for_each(|t| *t = [0; 3]);
    for i in 0..2000 {
        let ray = ray_of(i, &scene.geometry, 1.0, &mut random);
        assert_eq!(bvh.closest(&scene, &[], &ray), brute_force(&odd, &ray));
    }
}

#[test]
fn nothing_and_one_triangle() {
    let empty = Scene::default();
    let bvh = Bvh::build(&empty, &|_| true);
    let ray = Ray::new(Vec3::Z, Vec3::NEG_Z);
    assert_eq!(bvh.closest(&empty, &[], &ray), None);
    assert!(!bvh.occluded(&empty, &ray));
    let scene = scene_of(primitives::rectangle(), Mat4::IDENTITY);
    let bvh = Bvh::build(&scene, &|t| t == 1);
    assert_eq!(bvh.closest(&scene, &[], &Ray::new(Vec3::new(-0.5, 0.2, 1.0), Vec3::NEG_Z)).map(|h| h.t), Some(1.0));
    assert_eq!(bvh.closest(&scene, &[], &Ray::new(Vec3::new(0.5, -0.2, 1.0), Vec3::NEG_Z)), None);
}

#[test]
fn closed_meshes_do_not_leak() {
    let turned = Mat4::from_euler(glam::EulerRot::XYZ, 0.3, 1.1, -0.7);
    let rooms = [
        scene_of(primitives::sphere(Vec3::new(3.0, -2.0, 5.0), 1.5), Mat4::IDENTITY),
        scene_of(primitives::cube(), turned * Mat4::from_scale(Vec3::new(4.0, 1.3, 0.2))),
    ];
    for scene in rooms {
        let bvh = Bvh::build(&scene, &|_| true);
        let (lo, hi) = scene.geometry.bounds();
        let mut random = Random(3);
        for i in 0..100_000 {
            // Half of the rays are aimed at edges and corners.
            let o = (lo + hi) / 2.0 + random.point() * 0.01;
            let [a, b, c] = scene.geometry.corners(hash_words(&[i]) % scene.geometry.triangles.len() as u32);
            let d = match i % 4 {
                0 => (a - o).normalize(),
                1 => (b.lerp(c, random.next()) - o).normalize(),
                _ => random.direction(),
            };
            assert!(bvh.closest(&scene, &[], &Ray::new(o, d)).is_some(), "ray {i} {o} {d}");
        }
    }
}

#[test]
fn masks_let_through_what_their_opacity_says() {
    let mut scene = scene_of(primitives::rectangle(), Mat4::IDENTITY);
    let back = Mat4::from_translation(Vec3::NEG_Z);
    append(scene.geometry_mut(), primitives::rectangle(), back, false, false, String::new(), 1, None);
    let material = |opacity: Option<f32>| Material {
        name: String::new(),
        bsdf: Bsdf::Diffuse(Diffuse { reflectance: Texture::Constant(Rgb::ONE) }),
        opacity: opacity.map(Opacity::constant),
    };
    for opacity in [0.0, 0.3, 1.0] {
        scene.materials = vec![material(Some(opacity)), material(None)];
        let bvh = Bvh::build(&scene, &|_| true);
        let mut random = Random(4);
        let count = 20_000;
        let mut stopped = 0;
        for _ in 0..count {
            let d = (random.point() * Vec3::new(0.2, 0.2, 0.0) + Vec3::NEG_Z).normalize();
            let ray = Ray::new(Vec3::new(random.next() * 0.5, random.next() * 0.5, 1.0), d);
            let hit = bvh.closest(&scene, &[], &ray).expect("the back is opaque");
            stopped += u32::from(hit.t < 1.5);
            let shorter = Ray { t_max: 1.5, ..ray };
            assert_eq!(bvh.occluded(&scene, &shorter), hit.t < 1.5);
            assert_eq!(bvh.closest(&scene, &[], &shorter).is_some(), hit.t < 1.5);
        }
        let mean = stopped as f32 / count as f32;
        let sigma = (opacity * (1.0 - opacity) / count as f32).sqrt();
        assert!((mean - opacity).abs() <= 4.0 * sigma, "{mean} of {opacity}, sigma {sigma}");
    }
}

/// Kitchen's blinds are boxes a tenth of a millimetre thick.
#[test]
fn a_thin_sheet_counts_once_and_two_sheets_twice() {
    let opacity = 0.6f32;
    for (gap, expected) in [(1e-4, opacity), (0.3, 1.0 - (1.0 - opacity).powi(2))] {
        let mut sheets = primitives::rectangle();
        let behind = primitives::rectangle();
        sheets.triangles.extend(behind.triangles.iter().map(|t| t.map(|i| i + 4)));
        sheets.positions.extend(behind.positions.iter().map(|p| *p - Vec3::Z * gap));
        sheets.normals.extend(behind.normals);
        sheets.uvs.extend(behind.uvs);
        let mut scene = scene_of(sheets, Mat4::IDENTITY);
        scene.materials = vec![Material {
            name: String::new(),
            bsdf: Bsdf::Diffuse(Diffuse { reflectance: Texture::Constant(Rgb::ONE) }),
            opacity: Some(Opacity::constant(opacity)),
        }];
        let bvh = Bvh::build(&scene, &|_| true);
        let mut random = Random(4);
        let count = 20_000;
        let stopped = (0..count)
            .filter(|_| {
                let d = (random.point() * Vec3::new(0.2, 0.2, 0.0) + Vec3::NEG_Z).normalize();
                bvh.occluded(&scene, &Ray::new(Vec3::new(random.next() * 0.5, random.next() * 0.5, 1.0), d))
            })
            .count();
        let mean = stopped as f32 / count as f32;
        let sigma = (expected * (1.0 - expected) / count as f32).sqrt();
        // One sheet in thirty straddles two intervals, and then stops a quarter more of what is left.
        let straddling = 0.04 * opacity * (1.0 - opacity);
        assert!((mean - expected).abs() <= 4.0 * sigma + straddling, "{gap} m: {mean} of {expected}, sigma {sigma}");
    }
}

#[test]
fn all_forms_answer_bit_for_bit() {
    let forms = Lanes::all();
    if forms.len() < 3 {
        println!("skipped: forms that this machine lacks");
    }
    let mut random = Random(5);
    let mut scene = scene_of(soup(1200, &mut random), Mat4::IDENTITY);
    append(scene.geometry_mut(), primitives::sphere(Vec3::X, 0.4), Mat4::IDENTITY, false, false, String::new(), 0, None);
    let bvh = Bvh::build(&scene, &|_| true);
    let mut hits = 0;
    for i in 0..6000 {
        let ray = ray_of(i, &scene.geometry, 1.0, &mut random);
        // A mask that waves through every third triangle, to see that all are asked about the same ones.
        let mut pass = |hit: &Hit| hit.triangle.is_multiple_of(3);
        let bits = |h: Option<Hit>| h.map(|h| (h.t.to_bits(), h.triangle, h.u.to_bits(), h.v.to_bits()));
        let mut answers = |lanes: &Lanes| {
            let closest = lanes.run(Closest(&bvh.tree, &[], &ray, &mut pass));
            (bits(closest), lanes.run(Any(&bvh.tree, &ray, &mut pass)))
        };
        let [first, others @ ..] = forms.as_slice() else { panic!("no form") };
        let expected = answers(first);
        for lanes in others {
            assert_eq!(answers(lanes), expected, "{} and {}, ray {i}", lanes.name(), first.name());
        }
        hits += u32::from(expected.0.is_some());
    }
    assert!((2000..6000).contains(&hits), "{hits}");
}

#[test]
fn rays_together_meet_what_they_meet_alone() {
    let mut random = Random(8);
    let scene = scene_of(soup(1200, &mut random), Mat4::IDENTITY);
    let bvh = Bvh::build(&scene, &|_| true);
    let (mut together, mut hits) = (0, 0);
    for i in 0..1500 {
        let (o, d) = (random.point() * 1.5, random.direction());
        let spread = [0.0, 1e-4, 0.02, 0.3][i % 4];
        let count = 1 + i % BEAM;
        let mut ray = || {
            let mut ray = Ray::new(o, (d + random.direction() * spread).normalize());
            (ray.t_min, ray.t_max) = if i % 3 == 0 { (random.next() * 0.2, random.next() * 2.0) } else { (0.0, f32::INFINITY) };
            ray
        };
        let rays: Vec<Ray> = (0..count).map(|_| ray()).collect();
        together += usize::from(Beam::new(&rays).is_some());
        let mut found = [None; BEAM];
        bvh.closest_of(&scene, &[], &rays, &mut found);
        for (k, ray) in rays.iter().enumerate() {
            assert_eq!(found[k], bvh.closest(&scene, &[], ray), "ray {k} of {i}");
        }
        hits += found.iter().flatten().count();
    }
    assert!((700..1500).contains(&together) && hits > 3000, "{together} beams, {hits} hits");
}

#[test]
fn deep_trees_fit_their_stack() {
    // Boxes in boxes, each a little larger than the one before: a tree as deep as it can get.
    let mut mesh = Mesh::default();
    for i in 0..120 {
        let size = 1.1f32.powi(i);
        mesh.positions.extend([Vec3::new(size, 0.0, 0.0), Vec3::new(0.0, size, 0.0), Vec3::new(0.0, 0.0, size)]);
        mesh.triangles.push([3 * i as u32, 3 * i as u32 + 1, 3 * i as u32 + 2]);
    }
    let scene = scene_of(mesh, Mat4::IDENTITY);
    let mut bvh = Bvh::build(&scene, &|_| true);
    assert!(bvh.tree.stack > 60, "{}", bvh.tree.stack);
    let mut random = Random(6);
    for _ in 0..2000 {
        let o = (random.point() + 1.0) * 1.1f32.powf(random.next() * 120.0);
        let ray = Ray::new(o, random.direction());
        let expected = brute_force(&scene.geometry, &ray);
        assert_eq!(bvh.closest(&scene, &[], &ray), expected);
        // The same on a stack from the heap, as trees too deep for the other get.
        let needed = std::mem::replace(&mut bvh.tree.stack, STACK + 1);
        assert_eq!(bvh.closest(&scene, &[], &ray), expected);
        assert_eq!(bvh.occluded(&scene, &ray), expected.is_some());
        bvh.tree.stack = needed;
    }
}
