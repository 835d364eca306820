//! glTF scenes: held against the same scenes in Mitsuba's form, by their content hash, and against what the format's specification says.

mod export;
mod hostile;
mod second_set;
mod writer;

use glam::{Vec2, Vec3};
use reprobe::exchange::{LoadOptions, load};
use reprobe::material::bsdf::Bsdf;
use reprobe::material::texture::Wrap;
use reprobe::material::{Opacity, Texture};
use reprobe::scene::{Emitter, Scene};
use serde_json::json;
use std::path::Path;
use writer::{Document, F32, I16, U8, U16};

fn loaded(path: &Path) -> Scene {
    load(path, &LoadOptions::default()).unwrap_or_else(|e| panic!("{e}"))
}

/// A unit square in the plane z = 0 that faces +Z, with texture coordinates that go down.
fn square(document: &mut Document) -> serde_json::Value {
    let positions = document.numbers("VEC3", F32, &[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 1.0, 0.0]);
    let normals = document.numbers("VEC3", F32, &[0.0, 0.0, 1.0].repeat(4));
    let uvs = document.numbers("VEC2", F32, &[0.0, 1.0, 1.0, 1.0, 1.0, 0.0, 0.0, 0.0]);
    let indices = document.numbers("SCALAR", U16, &[0.0, 1.0, 2.0, 0.0, 2.0, 3.0]);
    json!({ "attributes": { "POSITION": positions, "NORMAL": normals, "TEXCOORD_0": uvs }, "indices": indices })
}

/// A document whose only node shows a square of a material.
fn with_material(material: serde_json::Value) -> Document {
    let mut document = Document::default();
    let mut primitive = square(&mut document);
    primitive["material"] = json!(0);
    document.json["materials"] = json!([material]);
    document.json["meshes"] = json!([{ "primitives": [primitive] }]);
    document.json["nodes"] = json!([{ "mesh": 0 }]);
    document
}

/// An image of 2 x 1 pixels as a data URI.
fn image(left: [u8; 4], right: [u8; 4]) -> String {
    let mut bytes = std::io::Cursor::new(Vec::new());
    let image = image::RgbaImage::from_fn(2, 1, |x, _| image::Rgba(if x == 0 { left } else { right }));
    image.write_to(&mut bytes, image::ImageFormat::Png).unwrap();
    writer::data_uri("image/png", bytes.get_ref())
}

/// A texture's value a quarter and three quarters along the square.
fn values(texture: &Texture) -> [Vec3; 2] {
    [0.25, 0.75].map(|u| texture.eval(Vec2::new(u, 0.5)))
}

fn close(a: Vec3, b: Vec3) -> bool {
    (a - b).abs().max_element() < 1e-5
}

#[test]
fn a_room_is_the_same_as_in_mitsubas_form() {
    let folder = tempfile::tempdir().unwrap();
    let mut document = Document::default();
    let mut wall = square(&mut document);
    wall["material"] = json!(0);
    let mut lamp = square(&mut document);
    lamp["material"] = json!(1);
    document.json["meshes"] = json!([{ "primitives": [wall] }, { "primitives": [lamp] }]);
    document.json["materials"] = json!([
        { "pbrMetallicRoughness": { "baseColorFactor": [0.5, 0.25, 0.125, 1], "roughnessFactor": 0.5, "metallicFactor": 0.25 } },
        { "emissiveFactor": [1, 0.5, 0.25], "pbrMetallicRoughness": { "metallicFactor": 0 },
          "extensions": { "KHR_materials_emissive_strength": { "emissiveStrength": 4 }, "KHR_materials_ior": { "ior": 1.25 } } }
    ]);
    document.json["extensionsUsed"] = json!(["KHR_lights_punctual", "KHR_materials_emissive_strength", "KHR_materials_ior"]);
    let light = json!({ "type": "point", "color": [1, 0.5, 0.5], "intensity": 8 });
    document.json["extensions"] = json!({ "KHR_lights_punctual": { "lights": [light] } });
    document.json["nodes"] = json!([
        { "children": [1, 2], "scale": [2, 2, 2] },
        { "mesh": 0, "rotation": [0, 0.5f32.sqrt(), 0, 0.5f32.sqrt()], "translation": [0.5, 0, 0] },
        { "mesh": 1, "matrix": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, -2, 1] },
        { "extensions": { "KHR_lights_punctual": { "light": 0 } }, "translation": [0, 3, 1] }
    ]);
    let gltf = loaded(&document.gltf(folder.path()));
    std::fs::write(
        folder.path().join("square.obj"),
        "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nvn 0 0 1\nf 1/1/1 2/2/1 3/3/1 4/4/1\n",
    )
    .unwrap();
    let xml = folder.path().join("scene.xml");
    std::fs::write(
        &xml,
        r#"<scene version="3.0.0">
        <shape type="obj"><string name="filename" value="square.obj"/>
            <transform name="to_world"><rotate y="1" angle="90"/><translate x="0.5"/><scale value="2"/></transform>
            <bsdf type="twosided"><bsdf type="principled"><rgb name="base_color" value="0.5 0.25 0.125"/><float name="roughness" value="0.5"/>
                <float name="metallic" value="0.25"/><float name="eta" value="1.5"/></bsdf></bsdf></shape>
        <shape type="obj"><string name="filename" value="square.obj"/>
            <transform name="to_world"><translate z="-2"/><scale value="2"/></transform>
            <bsdf type="twosided"><bsdf type="principled"><rgb name="base_color" value="1 1 1"/><float name="roughness" value="1"/>
                <float name="eta" value="1.25"/></bsdf></bsdf>
            <emitter type="area"><rgb name="radiance" value="4 2 1"/></emitter></shape>
        <emitter type="point"><point name="position" x="0" y="3" z="1"/><rgb name="intensity" value="8 4 4"/></emitter>
        </scene>"#,
    )
    .unwrap();
    let twin = loaded(&xml);
    for (a, b) in gltf.geometry.positions.iter().zip(&twin.geometry.positions) {
        assert!((*a - *b).abs().max_element() < 1e-6, "{a} {b}");
    }
    for (a, b) in gltf.geometry.normals.iter().zip(&twin.geometry.normals) {
        assert!((*a - *b).abs().max_element() < 1e-6, "{a} {b}");
    }
    assert_eq!(gltf.geometry.uvs, twin.geometry.uvs);
    assert_eq!(gltf.geometry.triangles, twin.geometry.triangles);
    let text = |value: &dyn erased::Text| value.text();
    assert_eq!(text(&gltf.emitters), text(&twin.emitters));
    // Indices of refraction come from reflectances, so that their last digits differ.
    for (a, b) in gltf.materials.iter().zip(&twin.materials) {
        let [a, b] = [a, b].map(|m| match &m.bsdf {
            Bsdf::TwoSided(sides) => match &*sides.front {
                Bsdf::Principled(p) => p.params.clone(),
                other => panic!("{other:?}"),
            },
            other => panic!("{other:?}"),
        });
        assert!((a.eta - b.eta).abs() < 1e-5, "{} {}", a.eta, b.eta);
        let alike = |p: &reprobe::material::bsdf::PrincipledParams| {
            serde_json::to_string(&reprobe::material::bsdf::PrincipledParams { eta: 0.0, ..p.clone() }).unwrap()
        };
        assert_eq!(alike(&a), alike(&b));
    }
}

/// Serialised text of whatever a scene holds.
mod erased {
    pub trait Text {
        fn text(&self) -> String;
    }

    impl<T: serde::Serialize> Text for T {
        fn text(&self) -> String {
            serde_json::to_string(self).unwrap()
        }
    }
}

#[test]
fn one_binary_file_and_several_hold_the_same() {
    let folder = tempfile::tempdir().unwrap();
    let document = with_material(json!({}));
    let (a, b) = (loaded(&document.gltf(folder.path())), loaded(&document.glb(folder.path())));
    let c = loaded(&document.with_file(folder.path(), "buffer of it.bin", "buffer%20of%20it.bin"));
    assert_eq!(a.hash, b.hash);
    assert_eq!(a.hash, c.hash);
    assert_eq!(a.geometry.triangles.len(), 2);
}

#[test]
fn strips_fans_and_integers_are_the_same_square() {
    let folder = tempfile::tempdir().unwrap();
    let corners = |mode: u32, indices: Option<&[f32]>, order: &[usize]| {
        let mut document = Document::default();
        let points = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];
        // Quantised, normalised, and two bytes apart from one another.
        let shorts: Vec<f32> = order.iter().flat_map(|&i| points[i].map(|x| x * 32767.0)).collect();
        let positions = document.strided("VEC3", I16, &shorts, 8, true);
        let mut primitive = json!({ "attributes": { "POSITION": positions }, "mode": mode });
        if let Some(indices) = indices {
            primitive["indices"] = document.numbers("SCALAR", U8, indices);
        }
        document.json["meshes"] = json!([{ "primitives": [primitive] }]);
        document.json["nodes"] = json!([{ "mesh": 0 }]);
        document.json["extensionsRequired"] = json!(["KHR_mesh_quantization"]);
        let scene = loaded(&document.glb(folder.path()));
        let g = &scene.geometry;
        assert!(g.objects[0].face_normals);
        (0..g.triangles.len() as u32).map(|t| (g.corners(t).iter().sum::<Vec3>(), g.area_normal(t))).collect::<Vec<_>>()
    };
    let list = corners(4, Some(&[0.0, 1.0, 2.0, 0.0, 2.0, 3.0]), &[0, 1, 2, 3]);
    assert_eq!(list, [(Vec3::new(2.0, 1.0, 0.0), Vec3::Z), (Vec3::new(1.0, 2.0, 0.0), Vec3::Z)]);
    assert_eq!(corners(6, None, &[0, 1, 2, 3]), list);
    let strip = corners(5, Some(&[0.0, 1.0, 3.0, 2.0]), &[0, 1, 2, 3]);
    assert!(strip.iter().all(|(_, normal)| *normal == Vec3::Z), "{strip:?}");
    assert_eq!(strip.iter().map(|(sum, _)| *sum).sum::<Vec3>(), Vec3::new(3.0, 3.0, 0.0));
}

#[test]
fn morph_targets_skins_and_sparse_elements_move_vertices() {
    let folder = tempfile::tempdir().unwrap();
    let mut document = Document::default();
    let mut primitive = square(&mut document);
    let up = document.sparse("VEC3", 4, &[2], &[0.0, 0.0, 4.0]);
    primitive["targets"] = json!([{ "POSITION": up }]);
    primitive["attributes"]["JOINTS_0"] = document.numbers("VEC4", U8, &[0.0, 1.0, 0.0, 0.0].repeat(4));
    primitive["attributes"]["WEIGHTS_0"] = document.numbers("VEC4", F32, &[0.25, 0.75, 0.0, 0.0].repeat(4));
    document.json["meshes"] = json!([{ "primitives": [primitive], "weights": [0.5] }]);
    document.json["skins"] = json!([{ "joints": [1, 2] }]);
    document.json["nodes"] = json!([
        { "mesh": 0, "skin": 0, "translation": [100, 0, 0] },
        { "translation": [4, 0, 0], "children": [2] },
        { "translation": [0, 8, 0] }
    ]);
    let scene = loaded(&document.glb(folder.path()));
    // A quarter of (4, 0, 0) and three of (4, 8, 0); the node's own place counts for nothing. Half of the target lifts corner 2.
    let moved = Vec3::new(4.0, 6.0, 0.0);
    assert_eq!(scene.geometry.positions[0], moved);
    assert_eq!(scene.geometry.positions[2], moved + Vec3::new(1.0, 1.0, 2.0));
}

#[test]
fn textures_are_looked_up_as_the_format_says() {
    let folder = tempfile::tempdir().unwrap();
    let mut document = with_material(json!({
        "pbrMetallicRoughness": {
            "baseColorTexture": { "index": 0, "extensions": { "KHR_texture_transform": { "offset": [0.5, 0] } } },
            "baseColorFactor": [1, 0.5, 1, 1],
            "metallicRoughnessTexture": { "index": 1 }, "roughnessFactor": 0.5
        },
        "alphaMode": "MASK", "alphaCutoff": 0.5
    }));
    document.json["images"] =
        json!([{ "uri": image([255, 255, 0, 255], [0, 255, 0, 100]) }, { "uri": image([9, 51, 102, 255], [9, 204, 0, 255]) }]);
    document.json["samplers"] = json!([{ "magFilter": 9728, "wrapS": 33648, "wrapT": 33648 }]);
    document.json["textures"] = json!([{ "source": 0, "sampler": 0 }, { "source": 1 }]);
    let scene = loaded(&document.gltf(folder.path()));
    let material = &scene.materials[0];
    let Bsdf::TwoSided(sides) = &material.bsdf else { panic!("{:?}", material.bsdf) };
    let Bsdf::Principled(principled) = &*sides.front else { panic!("{:?}", sides.front) };
    let p = &principled.params;
    // Moved by half of the texture, of which every other copy is mirrored.
    assert_eq!(values(&p.base_color), [Vec3::new(0.0, 0.5, 0.0), Vec3::new(0.0, 0.5, 0.0)]);
    assert!(matches!(&p.base_color, Texture::Bitmap(b) if b.nearest && b.wrap == Wrap::Mirror));
    assert!(close(p.roughness.eval(Vec2::new(0.25, 0.5)), Vec3::splat(0.1)), "{:?}", values(&p.roughness));
    assert!(close(p.metallic.eval(Vec2::new(0.25, 0.5)), Vec3::splat(0.4)));
    let opacity = material.opacity.as_ref().unwrap();
    assert_eq!([opacity.eval(Vec2::new(-0.25, 0.5), true), opacity.eval(Vec2::new(0.25, 0.5), true)], [1.0, 0.0]);
    assert!(matches!(opacity, Opacity::Texture(Texture::Bitmap(_))));
}

#[test]
fn normal_maps_tilt_towards_the_top_of_the_picture_on_either_side_of_a_seam() {
    let folder = tempfile::tempdir().unwrap();
    // A normal between +Z and the picture's top.
    let mut document = with_material(json!({ "normalTexture": { "index": 0 } }));
    document.json["images"] = json!([{ "uri": image([128, 218, 218, 255], [128, 218, 218, 255]) }]);
    document.json["textures"] = json!([{ "source": 0 }]);
    // A second square whose texture is mirrored left to right.
    let mut primitive = square(&mut document);
    primitive["material"] = json!(0);
    primitive["attributes"]["TEXCOORD_0"] = document.numbers("VEC2", F32, &[1.0, 1.0, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0]);
    document.json["meshes"].as_array_mut().unwrap().push(json!({ "primitives": [primitive] }));
    document.json["nodes"].as_array_mut().unwrap().push(json!({ "mesh": 1, "translation": [2, 0, 0] }));
    let scene = loaded(&document.gltf(folder.path()));
    let world = reprobe::transport::World::new(scene);
    for x in [0.5, 2.5] {
        let ray = reprobe::base::ray::Ray::new(Vec3::new(x, 0.4, 1.0), Vec3::NEG_Z);
        let surface = world.intersect(&ray).unwrap();
        let Bsdf::TwoSided(sides) = &world.scene.materials[world.scene.geometry.object(surface.triangle).material as usize].bsdf
        else {
            panic!()
        };
        let Bsdf::NormalMap(map) = &*sides.front else { panic!() };
        let tilted = surface.frame.to_world(map.texture.at(&surface) * 2.0 - Vec3::ONE).normalize();
        assert!(tilted.y > 0.6 && tilted.z > 0.6, "{x}: {tilted}");
    }
}

#[test]
fn cameras_look_along_their_own_minus_z() {
    let folder = tempfile::tempdir().unwrap();
    let mut document = with_material(json!({}));
    document.json["cameras"] =
        json!([{ "type": "perspective", "perspective": { "yfov": 1.0, "aspectRatio": 2.0, "znear": 0.1 } }]);
    document.json["nodes"].as_array_mut().unwrap().push(json!({ "camera": 0, "translation": [0, 0, 5], "scale": [3, 3, 3] }));
    let scene = loaded(&document.gltf(folder.path()));
    let camera = scene.sensor.unwrap();
    assert_eq!(camera.size, [1280, 640]);
    let ray = |x: f32, y: f32| camera.ray(Vec2::new(x, y), Vec2::ZERO);
    let (middle, corner) = (ray(640.0, 320.0), ray(1280.0, 0.0));
    assert!(close(middle.d, Vec3::NEG_Z) && close(middle.o, Vec3::new(0.0, 0.0, 5.0)), "{middle:?}");
    let half = 0.5f32.tan();
    assert!(close(corner.d, Vec3::new(2.0 * half, half, -1.0).normalize()), "{corner:?}");
}

#[test]
fn lights_and_cameras_are_made_up_where_there_are_none() {
    let folder = tempfile::tempdir().unwrap();
    let scene = loaded(&with_material(json!({})).gltf(folder.path()));
    assert!(matches!(scene.emitters[..], [Emitter::Constant { radiance: Vec3::ONE }]));
    let told = scene.warnings.join("\n");
    assert!(told.contains("the same white light") && told.contains("has no camera"), "{told}");
    // Parts that glow light a scene, which has a camera, and no model.
    let mut document = with_material(json!({ "emissiveFactor": [1, 1, 1] }));
    assert_eq!(loaded(&document.gltf(folder.path())).emitters.len(), 2);
    document.json["cameras"] = json!([{ "type": "perspective", "perspective": { "yfov": 1.0, "znear": 0.1 } }]);
    document.json["nodes"].as_array_mut().unwrap().push(json!({ "camera": 0 }));
    assert_eq!(loaded(&document.gltf(folder.path())).emitters.len(), 1);
    // All of it is in the picture.
    let camera = scene.sensor.unwrap();
    for corner in [Vec3::ZERO, Vec3::X, Vec3::ONE - Vec3::Z, Vec3::Y] {
        let local = camera.to_world.inverse().transform_point3(corner);
        let (x, y) = (local.x / local.z, local.y / local.z);
        let half = (0.5 * camera.fov_x).tan();
        assert!(local.z > 0.0 && x.abs() < half && y.abs() < half * 9.0 / 16.0, "{corner}: {local}");
    }
}

#[test]
fn spots_and_suns_shine_along_minus_z() {
    let folder = tempfile::tempdir().unwrap();
    let mut document = with_material(json!({}));
    document.json["extensions"] = json!({ "KHR_lights_punctual": { "lights": [
        { "type": "spot", "intensity": 3, "spot": { "innerConeAngle": 0.25, "outerConeAngle": 0.5 } },
        { "type": "directional", "intensity": 2, "color": [1, 0.5, 0] }
    ] } });
    let node = |light: u32| json!({ "extensions": { "KHR_lights_punctual": { "light": light } }, "rotation": [-(0.5f32.sqrt()), 0, 0, 0.5f32.sqrt()] });
    document.json["nodes"].as_array_mut().unwrap().extend([node(0), node(1)]);
    let scene = loaded(&document.gltf(folder.path()));
    let [Emitter::Spot { direction, intensity, cutoff_rad, beam_rad, .. }, Emitter::Directional { direction: sun, irradiance }] =
        &scene.emitters[..]
    else {
        panic!("{:?}", scene.emitters)
    };
    assert!(close(*direction, Vec3::NEG_Y) && close(*sun, Vec3::NEG_Y), "{direction} {sun}");
    assert_eq!((*intensity, *cutoff_rad, *beam_rad), (Vec3::splat(3.0), 0.5, 0.25));
    assert_eq!(*irradiance, Vec3::new(2.0, 1.0, 0.0));
}

#[test]
fn colours_of_vertices_are_interpolated() {
    let folder = tempfile::tempdir().unwrap();
    let mut document = with_material(json!({ "pbrMetallicRoughness": { "baseColorFactor": [0.5, 0.5, 0.5, 1] } }));
    let colors = document.numbers("VEC4", F32, &[1.0, 0.0, 0.0, 1.0, 0.0, 1.0, 0.0, 1.0, 0.0, 0.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0]);
    document.json["meshes"][0]["primitives"][0]["attributes"]["COLOR_0"] = colors;
    let scene = loaded(&document.glb(folder.path()));
    let Bsdf::TwoSided(sides) = &scene.materials[0].bsdf else { panic!() };
    let Bsdf::Principled(p) = &*sides.front else { panic!() };
    let Texture::Attribute(colors) = &p.params.base_color else { panic!("{:?}", p.params.base_color) };
    assert_eq!(colors.values, [Vec3::X * 0.5, Vec3::Y * 0.5, Vec3::Z * 0.5, Vec3::splat(0.5)]);
    assert_eq!(colors.corners, [[0, 1, 2], [0, 2, 3]]);
}

#[test]
fn glass_is_a_pane_or_a_body() {
    let folder = tempfile::tempdir().unwrap();
    let of = |more: serde_json::Value| {
        let mut extensions = json!({ "KHR_materials_transmission": { "transmissionFactor": 1 } });
        extensions.as_object_mut().unwrap().extend(more.as_object().unwrap().clone());
        let material = json!({ "pbrMetallicRoughness": { "roughnessFactor": 0, "metallicFactor": 0 }, "extensions": extensions });
        loaded(&with_material(material).gltf(folder.path())).materials.swap_remove(0).bsdf
    };
    assert!(matches!(of(json!({})), Bsdf::ThinDielectric(_)));
    let body = of(json!({ "KHR_materials_volume": { "thicknessFactor": 1 }, "KHR_materials_ior": { "ior": 1.33 } }));
    assert!(matches!(&body, Bsdf::Principled(p) if p.params.eta == 1.33), "{body:?}");
}
