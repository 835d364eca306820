//! Files that are broken, or that mean harm: one line that names the file, in bounded time and memory.

use super::{square, with_material};
use crate::writer::{Document, F32};
use reprobe::exchange::{LoadOptions, load};
use serde_json::{Value, json};
use std::path::Path;

fn error(path: &Path) -> String {
    let message = load(path, &LoadOptions::default()).map(|_| ()).unwrap_err().to_string();
    assert!(message.contains("scene.gl"), "{message}");
    message
}

#[test]
fn what_is_wrong_is_said() {
    let folder = tempfile::tempdir().unwrap();
    type Change = fn(&mut Value);
    let cases: [(Change, &str); 16] = [
        (|j| j["asset"]["version"] = json!("1.0"), "version 1.0"),
        (|j| j["nodes"] = json!([{ "mesh": 0, "children": [1] }, { "children": [1] }]), "child of two nodes"),
        (|j| j["nodes"][0]["mesh"] = json!(7), "no mesh 7"),
        (|j| j["scenes"] = json!([{ "nodes": [9] }]), "no node 9"),
        (|j| j["meshes"][0]["primitives"][0]["material"] = json!(1), "no material 1"),
        (|j| j["accessors"][0]["count"] = json!(5), "5 elements of 12 bytes"),
        (|j| j["accessors"][0]["count"] = json!(u64::MAX), "18446744073709551615 vertices"),
        (|j| j["accessors"][1]["count"] = json!(u64::MAX), "elements of 12 bytes"),
        (|j| j["accessors"][0]["type"] = json!("VEC2"), "expected 3"),
        (|j| j["bufferViews"][0]["byteLength"] = json!(u64::MAX), "buffer view 0 asks for"),
        (|j| j["bufferViews"][0]["byteStride"] = json!(0), "0 apart"),
        (|j| j["bufferViews"][0]["buffer"] = json!(3), "no buffer 3"),
        (|j| j["accessors"][3]["componentType"] = json!(5122), "expected whole numbers"),
        (|j| j["extensionsRequired"] = json!(["KHR_draco_mesh_compression"]), "cannot do without KHR_draco_mesh_compression"),
        (|j| j["materials"][0]["normalTexture"] = json!({ "index": 0 }), "no texture 0"),
        (|j| j["nodes"][0]["matrix"] = json!([1e30, 0, 0, 0, 0, 1e30, 0, 0, 0, 0, 1e30, 0, 0, 0, 0, 1]), "area"),
    ];
    for (change, expected) in cases {
        let mut document = with_material(json!({}));
        change(&mut document.json);
        for path in [document.glb(folder.path()), document.gltf(folder.path())] {
            let message = error(&path);
            assert!(message.contains(expected), "{message}: expected {expected}");
        }
    }
}

#[test]
fn zeros_without_data_are_bounded() {
    let folder = tempfile::tempdir().unwrap();
    let mut document = with_material(json!({}));
    document.json["accessors"][0] = json!({ "componentType": F32, "count": 3_000_000, "type": "VEC3" });
    assert!(error(&document.glb(folder.path())).contains("without data"));
}

#[test]
fn a_billion_copies_are_bounded() {
    let folder = tempfile::tempdir().unwrap();
    let mut document = Document::default();
    let primitive = square(&mut document);
    document.json["meshes"] = json!([{ "primitives": vec![primitive; 1000] }]);
    document.json["nodes"] = json!(vec![json!({ "mesh": 0 }); 30_000]);
    assert!(error(&document.glb(folder.path())).contains("expected at most 50000000"));
}

#[test]
fn files_elsewhere_are_not_fetched_and_nesting_ends() {
    let folder = tempfile::tempdir().unwrap();
    let mut document = with_material(json!({ "normalTexture": { "index": 0 } }));
    document.json["textures"] = json!([{ "source": 0 }]);
    document.json["images"] = json!([{ "uri": "https://example.com/a.png" }]);
    assert!(error(&document.glb(folder.path())).contains("nothing is fetched"));
    let path = folder.path().join("scene.gltf");
    std::fs::write(&path, "[".repeat(200_000)).unwrap();
    assert!(error(&path).contains("not glTF"));
    // A chain of nodes as deep as it likes.
    let mut document = with_material(json!({}));
    let nodes = (0..100_000).map(|i| if i < 99_999 { json!({ "children": [i + 1] }) } else { json!({ "mesh": 0 }) });
    document.json["nodes"] = nodes.collect();
    assert!(load(&document.glb(folder.path()), &LoadOptions::default()).is_ok());
}

/// No file that is cut short loads; changed ones: `tests/fuzz.rs`.
#[test]
fn cut_files_do_no_harm() {
    let folder = tempfile::tempdir().unwrap();
    let mut document = with_material(json!({ "pbrMetallicRoughness": { "baseColorTexture": { "index": 0 } } }));
    document.json["textures"] = json!([{ "source": 0, "sampler": 0 }]);
    document.json["samplers"] = json!([{ "wrapS": 33071 }]);
    document.json["images"] = json!([{ "uri": super::image([1, 2, 3, 4], [5, 6, 7, 8]) }]);
    document.json["skins"] = json!([{ "joints": [0] }]);
    let bytes = document.bytes();
    let path = folder.path().join("scene.glb");
    let tried = |bytes: &[u8]| {
        std::fs::write(&path, bytes).unwrap();
        load(&path, &LoadOptions::default()).is_ok()
    };
    assert!(tried(&bytes));
    assert!((0..bytes.len() - 3).step_by(7).all(|end| !tried(&bytes[..end])));
}
