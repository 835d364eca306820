//! Second texture coordinates that a file has for light maps: they come back, with the light on them.

use crate::export::{accessor, parts, view};
use crate::writer::{Document, F32, U8, U16};
use crate::{image, loaded};
use glam::{Vec2, Vec3};
use reprobe::export::gltf::{Bakes, Exported, glb};
use reprobe::lightmap::{Atlas, AtlasParams, LightMap, lookup};
use reprobe::scene::Scene;
use serde_json::{Value, json};
use std::path::Path;

/// A unit square's corners on a texture.
type Corners = [[f32; 2]; 4];

/// A rectangle of the texture.
const fn upright([left, top]: [f32; 2], [right, bottom]: [f32; 2]) -> Corners {
    [[left, bottom], [right, bottom], [right, top], [left, top]]
}

/// Of numbers that no eight bits hold.
const LEFT: Corners = upright([0.0123457, 0.1], [0.47, 0.9]);
/// Turned by a quarter and mirrored.
const RIGHT: Corners = [[0.52, 0.1], [0.52, 0.9], [0.987654, 0.9], [0.987654, 0.1]];
const ALL: Corners = upright([0.0, 0.0], [1.0, 1.0]);
const TILED: Corners = upright([0.0, 0.0], [3.0, 3.0]);

/// Squares side by side in one shape, the first at x.
fn shape(document: &mut Document, x: f32, second: &[Corners]) -> Value {
    let corners = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];
    let count = second.len();
    let places = |i: usize| corners.map(|[u, v, w]| [x + i as f32 + u, v, w]).concat();
    let positions: Vec<f32> = (0..count).flat_map(places).collect();
    let first = [0.0, 1.0, 1.0, 1.0, 1.0, 0.0, 0.0, 0.0].repeat(count);
    let indices: Vec<f32> = (0..count).flat_map(|i| [0, 1, 2, 0, 2, 3].map(|k| (4 * i + k) as f32)).collect();
    let attributes = json!({
        "POSITION": document.numbers("VEC3", F32, &positions),
        "NORMAL": document.numbers("VEC3", F32, &[0.0, 0.0, 1.0].repeat(4 * count)),
        "TEXCOORD_0": document.numbers("VEC2", F32, &first),
        "TEXCOORD_1": document.numbers("VEC2", F32, second.concat().as_flattened()),
    });
    json!({ "attributes": attributes, "indices": document.numbers("SCALAR", U16, &indices), "material": 0 })
}

/// Shapes of one textured material, each a list of squares, at x = 10 times their number.
fn document(shapes: &[&[Corners]]) -> Document {
    let mut document = Document::default();
    let primitives: Vec<Value> =
        shapes.iter().enumerate().map(|(i, second)| shape(&mut document, 10.0 * i as f32, second)).collect();
    document.json["meshes"] = primitives.iter().map(|primitive| json!({ "primitives": [primitive] })).collect();
    document.json["nodes"] = (0..shapes.len()).map(|i| json!({ "mesh": i, "name": format!("shape {i}") })).collect();
    document.json["materials"] = json!([{ "pbrMetallicRoughness": { "baseColorTexture": { "index": 0 }, "metallicFactor": 0 } }]);
    document.json["images"] = json!([{ "uri": image([200, 100, 50, 255], [20, 30, 250, 255]) }]);
    document.json["textures"] = json!([{ "source": 0 }]);
    document
}

/// A map whose light grows along its columns and rows, and that of backs along its rows.
fn map(scene: &Scene, has_back: bool) -> LightMap {
    let params = AtlasParams { texel: Some(1.0 / 96.0), ..AtlasParams::default() };
    let atlas = Atlas::build(&scene.geometry, &|_| true, &params).unwrap();
    let [width, height] = atlas.size;
    let each = |light: &dyn Fn(f32, f32) -> Vec3| {
        let row = |y: u32| (0..width).map(move |x| light(x as f32 / width as f32, y as f32 / height as f32));
        (0..height).flat_map(row).collect::<Vec<Vec3>>()
    };
    let front = each(&|x, y| Vec3::new(1.0 + x, 1.0 + y, 0.5) * 30.0);
    let back = has_back.then(|| each(&|_, y| Vec3::new(0.5, 2.0 + y, 1.0)));
    lookup::sides(&scene.geometry, &atlas, front, back)
}

/// A file that was written, and what of a node is asked.
struct Written {
    document: Value,
    binary: Vec<u8>,
    exported: Exported,
}

impl Written {
    fn of(scene: &Scene, light: Option<&LightMap>, folder: &Path) -> Self {
        let exported = glb(scene, Bakes { light, openness: None }, &json!({})).unwrap();
        std::fs::write(folder.join("out.glb"), &exported.bytes).unwrap();
        let (document, binary) = parts(&exported.bytes);
        Self { document, binary, exported }
    }

    /// What was said of second coordinates.
    fn told(&self) -> Vec<&str> {
        self.exported.warnings.iter().map(String::as_str).filter(|told| told.contains("second")).collect()
    }

    fn primitive(&self, node: usize) -> &Value {
        let mesh = self.document["nodes"][node]["mesh"].as_u64().unwrap() as usize;
        &self.document["meshes"][mesh]["primitives"][0]
    }

    /// What each corner of each triangle has of an attribute.
    fn corners<T: bytemuck::Pod>(&self, node: usize, attribute: &str) -> Vec<T> {
        let primitive = self.primitive(node);
        let values: Vec<T> = accessor(&self.document, &self.binary, &primitive["attributes"][attribute]);
        let indices: Vec<u32> = accessor(&self.document, &self.binary, &primitive["indices"]);
        indices.into_iter().map(|i| values[i as usize]).collect()
    }

    fn second(&self, node: usize) -> Vec<[u32; 2]> {
        self.corners(node, "TEXCOORD_1")
    }

    fn texture(&self, node: usize) -> u64 {
        self.document["nodes"][node]["extensions"]["MX_lightmap"]["lightMapTexture"]["index"].as_u64().unwrap()
    }

    fn material(&self, node: usize) -> &Value {
        &self.document["materials"][self.primitive(node)["material"].as_u64().unwrap() as usize]
    }

    fn picture(&self, texture: u64) -> image::DynamicImage {
        let source = self.document["textures"][texture as usize]["source"].as_u64().unwrap() as usize;
        let image = &self.document["images"][source];
        image::load_from_memory(view(&self.document, &self.binary, &image["bufferView"])).unwrap()
    }

    /// Irradiance at the triangles' middles, bilinear and decoded as the extension's text says.
    fn light(&self, node: usize) -> Vec<Vec3> {
        let picture = self.picture(self.texture(node)).into_rgba8();
        let intensity = self.document["nodes"][node]["extensions"]["MX_lightmap"]["intensity"].as_f64().unwrap() as f32;
        let size = picture.dimensions();
        let decoded = |x: f32, y: f32| {
            let [x, y] = [(x, size.0), (y, size.1)].map(|(x, n)| (x.max(0.0) as u32).min(n - 1));
            let [r, g, b, a] = picture.get_pixel(x, y).0.map(|byte| f32::from(byte) / 255.0);
            Vec3::new(r, g, b) * (34.49 * a.powf(2.2) * intensity)
        };
        let at = |corners: &[[f32; 2]]| {
            let middle = corners.iter().map(|uv| Vec2::from(*uv)).sum::<Vec2>() / 3.0;
            let at = middle * Vec2::new(size.0 as f32, size.1 as f32) - 0.5;
            let (c, f) = (at.floor(), at - at.floor());
            let row = |y: f32| decoded(c.x, y).lerp(decoded(c.x + 1.0, y), f.x);
            row(c.y).lerp(row(c.y + 1.0), f.y)
        };
        self.corners::<[f32; 2]>(node, "TEXCOORD_1").chunks(3).map(at).collect()
    }
}

/// The bits of what a shape of these squares has at each corner of its triangles.
fn bits(second: &[Corners]) -> Vec<[u32; 2]> {
    second.iter().flat_map(|c| [0, 1, 2, 0, 2, 3].map(|k| c[k].map(f32::to_bits))).collect()
}

fn check_light(scene: &Scene, map: &LightMap, written: &Written, node: usize, back: bool) {
    let name = written.document["nodes"][node]["name"].as_str().unwrap();
    let object = scene.geometry.objects.iter().find(|o| o.name == name).unwrap();
    for (triangle, found) in object.triangles.clone().zip(written.light(node)) {
        let expected = map.lookup(triangle, Vec2::splat(1.0 / 3.0), back);
        assert!(found.distance(expected) < 0.02 * expected.max_element(), "{name}, {triangle}: {found} {expected}");
    }
}

#[test]
fn a_layout_for_light_maps_is_kept_and_carries_the_light() {
    let folder = tempfile::tempdir().unwrap();
    let shapes: [&[Corners]; 5] = [&[LEFT], &[RIGHT], &[ALL], &[TILED], &[LEFT, RIGHT, LEFT]];
    let scene = loaded(&document(&shapes).gltf(folder.path()));
    let map = map(&scene, false);
    let written = Written::of(&scene, Some(&map), folder.path());
    for (node, own) in shapes.iter().enumerate() {
        assert_eq!(written.second(node) == bits(own), node < 3, "shape {node}");
        check_light(&scene, &map, &written, node, false);
        let first: Vec<[f32; 2]> = written.corners(node, "TEXCOORD_0");
        assert_eq!(first[..3], [[0.0, 1.0], [1.0, 1.0], [1.0, 0.0]]);
    }
    // Two share a square, a third fills one, two have none.
    let texture = [0, 1, 2, 3, 4].map(|node| written.texture(node));
    assert!(texture[0] == texture[1] && texture[1] != texture[2] && texture[2] != texture[3] && texture[3] == texture[4]);
    assert_eq!((written.exported.kept, written.exported.pages), (3, 2));
    let occlusion = [0, 1, 2, 3, 4].map(|node| {
        let occlusion = &written.material(node)["occlusionTexture"];
        assert_eq!(occlusion["texCoord"], 1);
        occlusion["index"].as_u64().unwrap()
    });
    assert!(occlusion[0] == occlusion[1] && occlusion[1] != occlusion[2] && occlusion[2] != occlusion[3]);
    assert_eq!(written.picture(occlusion[0]).to_rgb8().dimensions(), written.picture(texture[0]).to_rgb8().dimensions());
    // A density like the map's, of 96 texels a metre; LEFT covers .37 of the square and RIGHT as much.
    let side = written.picture(texture[0]).width();
    assert!((150..180).contains(&side), "{side}");
    // Three materials that differ in occlusion, one texture of colour: with the light, three and three and one images.
    assert_eq!(written.exported.materials, 3);
    let colour = |node: usize| written.material(node)["pbrMetallicRoughness"]["baseColorTexture"]["index"].as_u64().unwrap();
    assert!((0..5).all(|node| colour(node) == colour(0)));
    assert_eq!(written.document["images"].as_array().unwrap().len(), 7);
    let told = written.told().join("\n");
    assert!(told.contains("\"shape 3\" lie outside of [0, 1]") && told.contains("\"shape 4\" overlap"), "{told}");
    assert_eq!(written.told().len(), 2, "{told}");
}

#[test]
fn what_was_exported_keeps_its_layout_when_it_is_exported_again() {
    let folder = tempfile::tempdir().unwrap();
    let shapes: [&[Corners]; 3] = [&[LEFT, RIGHT], &[ALL], &[TILED]];
    let scene = loaded(&document(&shapes).glb(folder.path()));
    let first = Written::of(&scene, Some(&map(&scene, false)), folder.path());
    let again = loaded(&folder.path().join("out.glb"));
    let map = map(&again, false);
    let second = Written::of(&again, Some(&map), folder.path());
    // The third has our own, which is a layout, too.
    for node in 0..3 {
        assert_eq!(first.second(node), second.second(node), "{node}");
        check_light(&again, &map, &second, node, false);
    }
    assert_eq!((second.exported.kept, second.told().len()), (3, 0), "{:?}", second.told());
    // Without light they are there, whatever they are.
    let plain = Written::of(&scene, None, folder.path());
    for (node, own) in shapes.iter().enumerate() {
        assert_eq!(plain.second(node), bits(own));
    }
    assert!(plain.document["nodes"].as_array().unwrap().iter().all(|node| node["extensions"].is_null()));
}

#[test]
fn backs_have_textures_of_their_own_in_the_same_layout() {
    let folder = tempfile::tempdir().unwrap();
    let scene = loaded(&document(&[&[LEFT], &[RIGHT]]).gltf(folder.path()));
    let map = map(&scene, true);
    let written = Written::of(&scene, Some(&map), folder.path());
    assert_eq!(written.exported.behind, 4);
    // Front and back of each in turn; a back's corners go the other way round.
    for (node, back) in [(0, false), (1, true), (2, false), (3, true)] {
        let mut expected = bits(&[if node < 2 { LEFT } else { RIGHT }]);
        if back {
            expected.chunks_mut(3).for_each(|t| t.swap(1, 2));
        }
        assert_eq!(written.second(node), expected, "{node}");
        check_light(&scene, &map, &written, node, back);
    }
    let texture = [0, 1, 2, 3].map(|node| written.texture(node));
    assert!(texture[0] == texture[2] && texture[1] == texture[3] && texture[0] != texture[1], "{texture:?}");
}

/// A mesh that is mirrored on its first coordinates in part comes in as two shapes; sets that a texture lies on are none for light.
#[test]
fn normal_maps_leave_the_layout_as_it_is_and_textures_on_it_take_it() {
    let folder = tempfile::tempdir().unwrap();
    let mut document = document(&[&[LEFT, RIGHT]]);
    let mirrored = [0.0, 1.0, 1.0, 1.0, 1.0, 0.0, 0.0, 0.0, 1.0, 1.0, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0];
    let first = document.numbers("VEC2", F32, &mirrored);
    document.json["meshes"][0]["primitives"][0]["attributes"]["TEXCOORD_0"] = first;
    document.json["materials"][0]["normalTexture"] = json!({ "index": 0 });
    let scene = loaded(&document.gltf(folder.path()));
    assert_eq!(scene.geometry.objects.len(), 2);
    let map = map(&scene, false);
    let written = Written::of(&scene, Some(&map), folder.path());
    let mut found = [written.second(0), written.second(1)];
    found.sort();
    let mut expected = [bits(&[LEFT]), bits(&[RIGHT])];
    expected.sort();
    assert_eq!(found, expected);
    assert_eq!(written.texture(0), written.texture(1));

    document.json["materials"][0] = json!({ "pbrMetallicRoughness": { "baseColorTexture": { "index": 0, "texCoord": 1 } } });
    let scene = loaded(&document.gltf(folder.path()));
    assert!(scene.geometry.light_uvs.is_empty());
    assert_eq!(scene.geometry.uvs[0], Vec2::from(LEFT[0]));
}

#[test]
fn a_set_that_is_broken_or_flat_is_told() {
    let folder = tempfile::tempdir().unwrap();
    let flat = upright([0.1, 0.5], [0.9, 0.5]);
    let broken = [[f32::NAN, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
    let scene = loaded(&document(&[&[flat], &[broken], &[flat], &[LEFT]]).glb(folder.path()));
    let written = Written::of(&scene, Some(&map(&scene, false)), folder.path());
    let told = written.told().join("\n");
    assert!(told.contains("\"shape 0\" and 1 more have no area") && told.contains("\"shape 1\" are not all finite"), "{told}");
    assert_eq!(written.exported.kept, 1);

    // One number an element, and fewer elements than there are vertices.
    let mut short = document(&[&[LEFT]]);
    let set = short.numbers("VEC2", F32, &[0.0, 0.0, 1.0, 0.0]);
    short.json["meshes"][0]["primitives"][0]["attributes"]["TEXCOORD_1"] = set;
    let refused = |document: &Document| {
        reprobe::exchange::load(&document.gltf(folder.path()), &Default::default()).map(|_| ()).unwrap_err().to_string()
    };
    assert!(refused(&short).contains("2 second texture coordinates of 4 vertices"), "{}", refused(&short));
    let set = short.numbers("SCALAR", U8, &[0.0; 4]);
    short.json["meshes"][0]["primitives"][0]["attributes"]["TEXCOORD_1"] = set;
    assert!(refused(&short).contains("texture coordinates"), "{}", refused(&short));
}
