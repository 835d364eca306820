//! What `export-gltf` writes, read again by another reader (the `gltf_json` schema and the images by themselves) and by ours.

use glam::{Vec2, Vec3};
use reprobe::exchange::{LoadOptions, load};
use reprobe::export::gltf::{Bakes, glb};
use reprobe::lightmap::{Atlas, AtlasParams, LightMap, lookup};
use reprobe::material::Texture;
use reprobe::material::bsdf::Bsdf;
use reprobe::scene::{Emitter, Scene};
use serde_json::{Value, json};
use std::path::Path;

/// The document and the binary chunk of a file.
pub fn parts(bytes: &[u8]) -> (Value, Vec<u8>) {
    let length = |at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap()) as usize;
    assert_eq!((&bytes[..4], length(4), length(8)), (&b"glTF"[..], 2, bytes.len()));
    let json = length(12);
    (serde_json::from_slice(&bytes[20..20 + json]).unwrap(), bytes[28 + json..].to_vec())
}

pub fn view<'a>(document: &Value, binary: &'a [u8], index: &Value) -> &'a [u8] {
    let view = &document["bufferViews"][index.as_u64().unwrap() as usize];
    let [start, length] = ["byteOffset", "byteLength"].map(|name| view[name].as_u64().unwrap() as usize);
    &binary[start..start + length]
}

pub fn accessor<T: bytemuck::Pod>(document: &Value, binary: &[u8], index: &Value) -> Vec<T> {
    let accessor = &document["accessors"][index.as_u64().unwrap() as usize];
    bytemuck::pod_collect_to_vec(view(document, binary, &accessor["bufferView"]))
}

fn written(scene: &Scene, map: Option<&LightMap>, folder: &Path) -> (Scene, Value, Vec<u8>) {
    let bytes = glb(scene, Bakes { light: map, openness: None }, &json!({})).unwrap().bytes;
    let path = folder.join("scene.glb");
    std::fs::write(&path, &bytes).unwrap();
    let again = load(&path, &LoadOptions::default()).unwrap_or_else(|e| panic!("{e}"));
    let (document, binary) = parts(&bytes);
    (again, document, binary)
}

fn scene(folder: &Path, shapes: &str) -> Scene {
    let path = folder.join("scene.xml");
    std::fs::write(&path, format!(r#"<scene version="3.0.0">{shapes}</scene>"#)).unwrap();
    load(&path, &LoadOptions::default()).unwrap_or_else(|e| panic!("{e}"))
}

#[test]
fn geometry_lights_and_the_camera_come_back() {
    let folder = tempfile::tempdir().unwrap();
    let before = scene(
        folder.path(),
        r#"<sensor type="perspective"><float name="fov" value="50"/><transform name="to_world"><lookat origin="1 2 5" target="0 0 0" up="0 1 0"/></transform>
             <film type="hdrfilm"><integer name="width" value="320"/><integer name="height" value="200"/></film></sensor>
           <shape type="sphere"><point name="center" x="1" y="0" z="0"/></shape>
           <shape type="cube"><boolean name="face_normals" value="true"/><transform name="to_world"><translate y="3"/></transform>
             <emitter type="area"><rgb name="radiance" value="6 3 1.5"/></emitter></shape>
           <emitter type="spot"><rgb name="intensity" value="4 2 1"/><float name="cutoff_angle" value="30"/><float name="beam_width" value="15"/>
             <transform name="to_world"><lookat origin="0 4 0" target="1 0 0" up="0 0 1"/></transform></emitter>
           <emitter type="directional"><vector name="direction" x="0" y="-1" z="0"/><rgb name="irradiance" value="2 2 2"/></emitter>"#,
    );
    let (after, ..) = written(&before, None, folder.path());
    let (a, b) = (&before.geometry, &after.geometry);
    assert_eq!(a.triangles.len(), b.triangles.len());
    for t in 0..a.triangles.len() as u32 {
        assert_eq!(a.corners(t), b.corners(t));
        let normals = |g: &reprobe::scene::Geometry| match g.object(t).face_normals {
            true => [g.area_normal(t).normalize(); 3],
            false => g.triangles[t as usize].map(|i| g.normals[i as usize]),
        };
        for (m, n) in normals(a).into_iter().zip(normals(b)) {
            assert!(m.distance(n) < 1e-5, "{t}: {m} {n}");
        }
    }
    let lights = |scene: &Scene| {
        let of = |e: &Emitter| match e {
            Emitter::Area { radiance, .. } => radiance.mean(),
            Emitter::Spot { direction, intensity, cutoff_rad, beam_rad, position, .. } => {
                assert!(
                    (cutoff_rad - 30f32.to_radians()).abs() < 1e-3
                        && (beam_rad - 15f32.to_radians()).abs() < 1e-3
                        && *position == Vec3::Y * 4.0
                );
                *intensity + *direction
            }
            Emitter::Directional { direction, irradiance } => *direction + *irradiance,
            other => panic!("{other:?}"),
        };
        let mut all: Vec<Vec3> = scene.emitters.iter().map(of).collect();
        all.sort_by(|a, b| a.x.total_cmp(&b.x));
        all
    };
    for (a, b) in lights(&before).into_iter().zip(lights(&after)) {
        assert!(a.distance(b) < 1e-4, "{a} {b}");
    }
    let [a, b] = [&before, &after].map(|s| s.sensor.clone().unwrap());
    assert!((a.fov_x - b.fov_x).abs() < 1e-5);
    for (x, y) in [(0.0, 0.0), (1.0, 0.3)] {
        let ray = |c: &reprobe::scene::Camera| c.ray(Vec2::new(x, y) * Vec2::new(c.size[0] as f32, c.size[1] as f32), Vec2::ZERO);
        assert!(ray(&a).d.distance(ray(&b).d) < 1e-3 && ray(&a).o.distance(ray(&b).o) < 1e-5);
    }
}

#[test]
fn materials_keep_their_diffuse_light_and_their_roughness() {
    let folder = tempfile::tempdir().unwrap();
    let models = [
        r#"<bsdf type="diffuse"><rgb name="reflectance" value="0.6 0.3 0.1"/></bsdf>"#,
        r#"<bsdf type="roughplastic"><rgb name="diffuse_reflectance" value="0.6 0.3 0.1"/><float name="alpha" value="0.09"/></bsdf>"#,
        r#"<bsdf type="roughconductor"><string name="material" value="Au"/><float name="alpha" value="0.25"/></bsdf>"#,
        r#"<bsdf type="principled"><rgb name="base_color" value="0.6 0.3 0.1"/><float name="roughness" value="0.7"/><float name="metallic" value="0.4"/></bsdf>"#,
    ];
    for (model, roughness, metallic) in [(0, 1.0, 0.0), (1, 0.3, 0.0), (2, 0.5, 1.0), (3, 0.7, 0.4)] {
        let before = scene(
            folder.path(),
            &format!(
                r#"<shape type="rectangle"><bsdf type="twosided">{}</bsdf></shape><emitter type="constant"/>"#,
                models[model]
            ),
        );
        let (after, ..) = written(&before, None, folder.path());
        let Bsdf::TwoSided(sides) = &after.materials[0].bsdf else { panic!("{:?}", after.materials[0].bsdf) };
        let Bsdf::Principled(p) = &*sides.front else { panic!("{:?}", sides.front) };
        assert!((p.params.roughness.mean().x - roughness).abs() < 1e-5, "{model}: {:?}", p.params.roughness);
        assert_eq!(p.params.metallic.mean().x, metallic, "{model}");
        if metallic == 0.0 {
            // Viewers' diffuse light is Lambert's: the colour is what leaves the surface towards 45 degrees.
            let world = reprobe::transport::World::new(before);
            let ray = reprobe::base::ray::Ray::new(Vec3::new(0.3, 0.2, 1.0), Vec3::NEG_Z);
            let surface = world.intersect(&ray).unwrap();
            let towards = Vec3::new(1.0, 0.0, 1.0).normalize();
            let expected = world.scene.materials[0].bsdf.diffuse_out(&surface, surface.frame.to_local(towards));
            let found = p.params.base_color.mean();
            assert!(found.distance(expected) < 2e-3, "{model}: {found} {expected}");
        }
    }
}

/// The light at every triangle's middle, decoded as the extension's text says, is the light map's.
#[test]
fn the_light_map_lies_on_the_second_coordinates() {
    let folder = tempfile::tempdir().unwrap();
    let before = scene(
        folder.path(),
        r#"<shape type="cube"><bsdf type="twosided"><bsdf type="diffuse"/></bsdf></shape>
           <shape type="rectangle"><transform name="to_world"><translate z="-4"/><scale value="3"/></transform></shape><emitter type="constant"/>"#,
    );
    let params = AtlasParams { texel: Some(0.25), ..AtlasParams::default() };
    let atlas = Atlas::build(&before.geometry, &|_| true, &params).unwrap();
    let [width, height] = atlas.size;
    let light = |x: u32, y: u32| Vec3::new(x as f32 / width as f32, y as f32 / height as f32, 0.05) * 40.0;
    let pixels: Vec<Vec3> = (0..height).flat_map(|y| (0..width).map(move |x| light(x, y))).collect();
    let map = lookup::sides(&before.geometry, &atlas, pixels, None);
    let (again, document, binary) = written(&before, Some(&map), folder.path());
    assert_eq!(again.geometry.triangles.len(), before.geometry.triangles.len());
    let mut triangle = 0;
    for node in document["nodes"].as_array().unwrap() {
        let extension = &node["extensions"]["MX_lightmap"];
        let intensity = extension["intensity"].as_f64().unwrap() as f32;
        assert!(intensity > 1.0, "brighter than RGBM goes by itself: {intensity}");
        let texture = &document["textures"][extension["lightMapTexture"]["index"].as_u64().unwrap() as usize];
        let image = &document["images"][texture["source"].as_u64().unwrap() as usize];
        let picture = image::load_from_memory(view(&document, &binary, &image["bufferView"])).unwrap().into_rgba8();
        assert_eq!(picture.dimensions(), (width, height));
        let primitive = &document["meshes"][node["mesh"].as_u64().unwrap() as usize]["primitives"][0];
        let uvs: Vec<[f32; 2]> = accessor(&document, &binary, &primitive["attributes"]["TEXCOORD_1"]);
        let indices: Vec<u32> = accessor(&document, &binary, &primitive["indices"]);
        for corners in indices.chunks(3) {
            let middle = corners.iter().map(|&i| Vec2::from(uvs[i as usize])).sum::<Vec2>() / 3.0;
            // Bilinear, as viewers do it.
            let at = middle * Vec2::new(width as f32, height as f32) - 0.5;
            let (cell, f) = (at.floor(), at - at.floor());
            let decoded = |dx: u32, dy: u32| {
                let x = (cell.x.max(0.0) as u32 + dx).min(width - 1);
                let y = (cell.y.max(0.0) as u32 + dy).min(height - 1);
                let [r, g, b, a] = picture.get_pixel(x, y).0.map(|byte| f32::from(byte) / 255.0);
                Vec3::new(r, g, b) * (34.49 * a.powf(2.2) * intensity)
            };
            let top = decoded(0, 0).lerp(decoded(1, 0), f.x);
            let found = top.lerp(decoded(0, 1).lerp(decoded(1, 1), f.x), f.y);
            let expected = map.lookup(triangle, Vec2::splat(1.0 / 3.0), false);
            assert!(found.distance(expected) < 0.02 * expected.max_element(), "{triangle}: {found} {expected}");
            triangle += 1;
        }
    }
    assert_eq!(triangle as usize, before.geometry.triangles.len());
    assert!(document["materials"].as_array().unwrap().iter().all(|m| m["occlusionTexture"]["texCoord"] == 1));
}

#[test]
fn what_is_lit_on_both_sides_is_there_for_each() {
    let folder = tempfile::tempdir().unwrap();
    let two_sided = r#"<bsdf type="twosided"><bsdf type="diffuse"/></bsdf>"#;
    let before = scene(
        folder.path(),
        &format!(
            r#"<shape type="rectangle">{two_sided}</shape><shape type="rectangle">{two_sided}<transform name="to_world"><translate z="3"/></transform></shape>
               <emitter type="constant"/>"#
        ),
    );
    let atlas = Atlas::build(&before.geometry, &|_| true, &AtlasParams { texel: Some(0.25), ..AtlasParams::default() }).unwrap();
    let count = (atlas.size[0] * atlas.size[1]) as usize;
    // All fronts are lit, and the back of the second shape.
    let mut back = vec![Vec3::ZERO; count];
    for triangle in before.geometry.objects[1].triangles.clone() {
        let places = atlas.corners(&before.geometry, triangle).unwrap();
        let (low, high) = places.iter().fold((places[0], places[0]), |(l, h), p| (l.min(*p), h.max(*p)));
        for (y, x) in (low.y as u32..=high.y as u32).flat_map(|y| (low.x as u32..=high.x as u32).map(move |x| (y, x))) {
            back.get_mut((y * atlas.size[0] + x) as usize).into_iter().for_each(|p| *p = Vec3::ONE);
        }
    }
    let map = lookup::sides(&before.geometry, &atlas, vec![Vec3::ONE; count], Some(back));
    let (after, document, _) = written(&before, Some(&map), folder.path());
    let normals: Vec<Vec3> = (0..6).map(|t| after.geometry.area_normal(t).normalize()).collect();
    assert_eq!(normals, [Vec3::Z, Vec3::Z, Vec3::Z, Vec3::Z, Vec3::NEG_Z, Vec3::NEG_Z]);
    assert_eq!(after.geometry.objects.iter().map(|o| o.triangles.len()).collect::<Vec<_>>(), [2, 2, 2]);
    assert_eq!(after.geometry.normals[8], Vec3::NEG_Z);
    let node = |i: usize| &document["nodes"][i];
    let texture = |i: usize| node(i)["extensions"]["MX_lightmap"]["lightMapTexture"]["index"].as_u64().unwrap();
    assert!(texture(0) == texture(1) && texture(1) != texture(2));
    let is_double_sided = |i: usize| {
        let primitive = &document["meshes"][node(i)["mesh"].as_u64().unwrap() as usize]["primitives"][0];
        document["materials"][primitive["material"].as_u64().unwrap() as usize]["doubleSided"].as_bool().unwrap()
    };
    assert_eq!([0, 1, 2].map(is_double_sided), [true, false, false]);
}

#[test]
fn textures_and_their_places_come_back() {
    let folder = tempfile::tempdir().unwrap();
    image::RgbImage::from_fn(4, 2, |x, y| image::Rgb([60 * x as u8, 200 * y as u8, 90]))
        .save(folder.path().join("a.png"))
        .unwrap();
    let before = scene(
        folder.path(),
        r#"<shape type="rectangle"><bsdf type="mask"><float name="opacity" value="0.5"/><bsdf type="twosided"><bsdf type="principled">
             <texture name="base_color" type="bitmap"><string name="filename" value="a.png"/><string name="wrap_mode" value="mirror"/>
               <transform name="to_uv"><scale x="2" y="3"/><rotate angle="30"/><translate x="0.2" y="0.4"/></transform></texture>
             <texture name="roughness" type="checkerboard"/></bsdf></bsdf></bsdf></shape><emitter type="constant"/>"#,
    );
    let (after, ..) = written(&before, None, folder.path());
    let of = |scene: &Scene| {
        let Bsdf::TwoSided(sides) = &scene.materials[0].bsdf else { panic!() };
        let Bsdf::Principled(p) = &*sides.front else { panic!() };
        let opacity = scene.materials[0].opacity.as_ref().unwrap().eval(Vec2::splat(0.5), true);
        (p.params.base_color.clone(), opacity)
    };
    let ((a, cover_a), (b, cover_b)) = (of(&before), of(&after));
    assert!((cover_a - 0.5).abs() < 1e-6 && (cover_b - 0.5).abs() < 1e-6, "{cover_a} {cover_b}");
    // Viewers' diffuse light has no retro-reflection: the colour as a whole differs by a factor, which is the same everywhere.
    let value = |t: &Texture, i: usize| t.eval(Vec2::new(0.37 * i as f32, 0.11 * i as f32 * i as f32));
    let factor = value(&b, 1) / value(&a, 1);
    for i in 2..40 {
        let (a, b) = (value(&a, i), value(&b, i));
        assert!((a * factor).distance(b) < 0.01, "{i}: {a} {b}");
    }
}

#[test]
fn what_the_light_map_does_not_have_is_written_without() {
    let folder = tempfile::tempdir().unwrap();
    let before = scene(
        folder.path(),
        r#"<shape type="rectangle"/><shape type="cube"><bsdf type="dielectric"/></shape><shape type="cube"><bsdf type="conductor"/></shape>
           <emitter type="constant"/>"#,
    );
    let params = AtlasParams { texel: Some(0.25), ..AtlasParams::default() };
    let atlas = Atlas::build(&before.geometry, &|object| object == 0, &params).unwrap();
    let count = (atlas.size[0] * atlas.size[1]) as usize;
    let map = lookup::sides(&before.geometry, &atlas, vec![Vec3::ONE; count], None);
    let (after, document, _) = written(&before, Some(&map), folder.path());
    assert_eq!(after.geometry.triangles.len(), before.geometry.triangles.len());
    for i in 0..3 {
        let node = &document["nodes"][i];
        let primitive = &document["meshes"][node["mesh"].as_u64().unwrap() as usize]["primitives"][0];
        let material = &document["materials"][primitive["material"].as_u64().unwrap() as usize];
        let found = [&node["extensions"]["MX_lightmap"], &material["occlusionTexture"], &primitive["attributes"]["TEXCOORD_1"]];
        assert!(found.iter().all(|value| value.is_null() == (i > 0)), "{i}: {found:?}");
    }
}
