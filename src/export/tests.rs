//! Cubes, volumes and harmonics against closed forms and brute force; the container against another reader.

use super::ktx2::Texture;
use super::probes::cube::{Mirror, diffuse, direction, reflections};
use super::probes::volume::volume;
use super::probes::{Around, Probe};
use crate::base::math::{Basis, Rgb};
use crate::base::octahedral::middle;
use crate::io::Provenance;
use crate::method::light_field_probes::probe::Light;
use glam::{Vec2, Vec3};
use std::f32::consts::PI;

/// A probe that sees `radiance` and has `irradiance` around it.
fn probe(radiance: impl Fn(Vec3) -> Rgb, irradiance: impl Fn(Vec3) -> Rgb) -> Probe {
    let map = |n: usize, f: &dyn Fn(Vec3) -> Rgb| (0..n * n).map(|i| f(middle(i, n))).collect::<Vec<Rgb>>();
    Probe { light: Light::new(&map(128, &radiance), 128), around: Around { irradiance: map(32, &irradiance), size: 32 } }
}

#[test]
fn another_reader_finds_what_was_written() {
    let texel = |i: usize| Rgb::new(i as f32, 0.5 * i as f32, 1e6);
    let cube = Texture { size: [4, 4, 0], faces: 6, levels: [16, 4, 1].map(|n| (0..6 * n).map(texel).collect()).to_vec() };
    let provenance = Provenance::new("export-probes", "abc", 7, &4);
    let bytes = cube.encode(&provenance);
    assert!(super::ktx2::is_ours(&bytes[..bytes.len().min(4096)]));
    let reader = ktx2::Reader::new(&bytes[..]).unwrap();
    let header = reader.header();
    assert_eq!((header.pixel_width, header.pixel_height, header.pixel_depth, header.face_count), (4, 4, 0, 6));
    assert_eq!(header.format, Some(ktx2::Format::R16G16B16A16_SFLOAT));
    assert_eq!(header.supercompression_scheme, None);
    assert_eq!(reader.dfd_blocks().len(), 1);
    let entries: Vec<_> = reader.key_value_data().collect();
    assert_eq!((entries[0].0, &entries[0].1[..8]), ("KTXwriter", &b"reprobe "[..]));
    let text = serde_json::to_string(&provenance).unwrap() + "\0";
    assert_eq!(entries[1..], [("reprobe.provenance", text.as_bytes())]);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.ktx2");
    for end in 0..=bytes.len().min(1024) {
        std::fs::write(&path, &bytes[..end]).unwrap();
        if let Err(e) = super::ktx2::read_provenance(&path) {
            assert!(e.to_string().contains("a.ktx2: not a readable KTX 2.0 file"), "{end}: {e}");
        }
    }
    std::fs::write(&path, &bytes).unwrap();
    assert_eq!(super::ktx2::read_provenance(&path).unwrap(), ([4, 4, 0], Some(provenance.clone())));
    let levels: Vec<_> = reader.levels().collect();
    assert_eq!(levels.len(), 3);
    for (level, texels) in levels.iter().zip([16, 4, 1]) {
        let halves: Vec<f32> = level.data.chunks(2).map(|b| half::f16::from_le_bytes([b[0], b[1]]).to_f32()).collect();
        assert_eq!(halves.len(), 4 * 6 * texels);
        for (i, found) in halves.chunks(4).enumerate() {
            // Half floats end at 65504.
            assert_eq!(found, [i as f32, 0.5 * i as f32, 65504.0, 1.0]);
        }
    }
    let flat = Texture { size: [2, 4, 6], faces: 1, levels: vec![vec![Rgb::ONE; 48]] };
    let bytes = flat.encode(&provenance);
    let reader = ktx2::Reader::new(&bytes[..]).unwrap();
    assert_eq!((reader.header().pixel_depth, reader.header().face_count, reader.levels().count()), (6, 1, 1));
}

#[test]
fn faces_lie_as_graphics_interfaces_have_them() {
    let middle = Vec2::splat(0.5);
    let axes = [Vec3::X, Vec3::NEG_X, Vec3::Y, Vec3::NEG_Y, Vec3::Z, Vec3::NEG_Z];
    for (face, axis) in axes.into_iter().enumerate() {
        assert_eq!(direction(face as u32, middle), axis);
    }
    // Upper left corners, by the table of the OpenGL specification.
    let corners = [[1, 1, 1], [-1, 1, -1], [-1, 1, -1], [-1, -1, 1], [-1, 1, 1], [1, 1, -1]];
    for (face, corner) in corners.into_iter().enumerate() {
        let found = direction(face as u32, Vec2::ZERO) * 3f32.sqrt();
        assert!(found.distance(Vec3::from_array(corner.map(|x| x as f32))) < 1e-5, "{face}: {found}");
    }
    // A light in +Z of the world is found by each engine's lookup.
    let lit = probe(|d| if d.z > 0.8 { Rgb::ONE } else { Rgb::ZERO }, |_| Rgb::ZERO);
    for (mirror, face) in [(Mirror::None, 4), (Mirror::X, 4), (Mirror::Z, 5)] {
        let level = &reflections(&lit, 16, mirror).levels[0];
        let brightest = (0..6).max_by(|a, b| {
            let sum = |face: usize| level[256 * face..256 * (face + 1)].iter().map(|c| c.x).sum::<f32>();
            sum(*a).total_cmp(&sum(*b))
        });
        assert_eq!(brightest, Some(face), "{mirror}");
    }
}

#[test]
fn even_light_stays_even_at_every_roughness() {
    let even = probe(|_| Rgb::new(2.0, 1.0, 0.5), |_| Rgb::splat(PI));
    let cube = reflections(&even, 32, Mirror::Z);
    assert_eq!(cube.levels.len(), 6);
    assert_eq!(cube.levels.iter().map(Vec::len).collect::<Vec<_>>(), [6144, 1536, 384, 96, 24, 6]);
    let is_even = |c: &Rgb| c.distance(Rgb::new(2.0, 1.0, 0.5)) < 2e-3;
    assert!(cube.levels.iter().flatten().all(is_even));
    assert!(diffuse(&even.around, Mirror::Z).levels[0].iter().all(|c| c.distance(Rgb::ONE) < 1e-5));
}

/// The lobe of each level, under light that is smooth, by 200,000 random halfway vectors.
#[test]
fn levels_are_blurred_by_their_lobes() {
    let light = |d: Vec3| Rgb::splat((1.0 + d.dot(Vec3::new(0.6, 0.0, 0.8))).powi(4));
    let cube = reflections(&probe(light, |_| Rgb::ZERO), 32, Mirror::None);
    let mut state = 7u32;
    let mut draw = || {
        state = state.wrapping_mul(747_796_405).wrapping_add(2_891_336_453);
        (state >> 8) as f32 / (1 << 24) as f32
    };
    for level in 1..6u32 {
        let alpha = (level as f32 / 5.0).powi(2);
        let n = 32 >> level;
        let texel = n / 2 * n + n / 2;
        let axis = direction(0, Vec2::splat((n / 2) as f32 + 0.5) / n as f32);
        let frame = Basis::from_normal(axis);
        let (mut sum, mut weight) = (0.0, 0.0);
        for _ in 0..200_000 {
            let (u, phi) = (draw(), 2.0 * PI * draw());
            let cos = ((1.0 - u) / (1.0 + (alpha * alpha - 1.0) * u)).sqrt();
            let sin = (1.0 - cos * cos).max(0.0).sqrt();
            let h = Vec3::new(sin * phi.cos(), sin * phi.sin(), cos);
            let l = h * (2.0 * cos) - Vec3::Z;
            if l.z > 0.0 {
                sum += light(frame.to_world(l)).x * l.z;
                weight += l.z;
            }
        }
        let (found, expected) = (cube.levels[level as usize][texel as usize].x, sum / weight);
        assert!((found / expected - 1.0).abs() < 0.02, "level {level}: {found} {expected}");
    }
}

#[test]
fn harmonics_are_those_of_a_cosine() {
    // Irradiance over π = 1 + n.y / 2 - n.x / 4.
    let around = probe(|_| Rgb::ZERO, |n| Rgb::splat(PI * (1.0 + 0.5 * n.y - 0.25 * n.x))).around;
    let expected = [2.0 * PI.sqrt(), 0.5 * (4.0 * PI / 3.0).sqrt(), 0.0, -0.25 * (4.0 * PI / 3.0).sqrt()];
    for (found, expected) in around.harmonics().into_iter().zip(expected) {
        assert!((found.x - expected).abs() < 0.01, "{found} {expected}");
    }
}

/// As Bevy's shader reads it: the values of X, Y and Z a third of the depth apart, negative ones half the height further.
#[test]
fn a_volume_is_read_as_ambient_cubes() {
    let counts = [2, 3, 4];
    let value = |i: usize, n: Vec3| Rgb::new(i as f32, n.dot(Vec3::new(1.0, 2.0, 3.0)), 0.0);
    let blocked = 7;
    let texture = volume(counts, |i, n| (i != blocked).then(|| value(i, n)));
    assert_eq!(texture.size, [2, 6, 12]);
    let texel = |x: usize, y: usize, z: usize| texture.levels[0][(z * 6 + y) * 2 + x];
    for i in (0..24).filter(|i| *i != blocked) {
        let (x, y, z) = (i % 2, i / 2 % 3, i / 6);
        for (axis, n) in [Vec3::X, Vec3::Y, Vec3::Z].into_iter().enumerate() {
            assert_eq!(texel(x, y, z + 4 * axis), value(i, n));
            assert_eq!(texel(x, y + 3, z + 4 * axis), value(i, -n));
        }
    }
    // Between (1, 0, 1) and its neighbours (0, 0, 1), (1, 1, 1), (1, 0, 0) and (1, 0, 2), all of which are known.
    assert_eq!(texel(1, 0, 1).x, (6.0 + 9.0 + 1.0 + 13.0) / 4.0);
}
