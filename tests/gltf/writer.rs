//! Writes small glTF files.

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

/// Component types by their numbers in the format.
pub const U8: u32 = 5121;
pub const I16: u32 = 5122;
pub const U16: u32 = 5123;
pub const F32: u32 = 5126;

/// A document that grows.
#[derive(Clone)]
pub struct Document {
    pub json: Value,
    pub binary: Vec<u8>,
}

impl Default for Document {
    fn default() -> Self {
        Self { json: json!({ "asset": { "version": "2.0" }, "accessors": [], "bufferViews": [] }), binary: Vec::new() }
    }
}

impl Document {
    /// Adds an accessor with a view of its own; returns its number.
    pub fn numbers(&mut self, kind: &str, component: u32, numbers: &[f32]) -> Value {
        let stride = width(component) * components(kind);
        self.strided(kind, component, numbers, stride, false)
    }

    /// The same with elements so many bytes apart.
    pub fn strided(&mut self, kind: &str, component: u32, numbers: &[f32], stride: usize, normalized: bool) -> Value {
        let n = components(kind);
        let mut bytes = Vec::new();
        for element in numbers.chunks(n) {
            element.iter().for_each(|&x| bytes.extend(encoded(x, component)));
            bytes.resize(bytes.len() + stride - n * width(component), 0xaa);
        }
        let view = self.view(&bytes);
        if stride != n * width(component) {
            self.json["bufferViews"][view]["byteStride"] = json!(stride);
        }
        let accessor = json!({ "bufferView": view, "componentType": component, "count": numbers.len() / n, "type": kind, "normalized": normalized });
        self.add(accessor)
    }

    /// Zeros but for one element.
    pub fn sparse(&mut self, kind: &str, count: usize, places: &[u8], values: &[f32]) -> Value {
        let indices = self.view(places);
        let bytes: Vec<u8> = values.iter().flat_map(|x| x.to_le_bytes()).collect();
        let values = self.view(&bytes);
        let sparse = json!({ "count": places.len(), "indices": { "bufferView": indices, "componentType": U8 }, "values": { "bufferView": values } });
        self.add(json!({ "componentType": F32, "count": count, "type": kind, "sparse": sparse }))
    }

    fn add(&mut self, accessor: Value) -> Value {
        let accessors = self.json["accessors"].as_array_mut().unwrap();
        accessors.push(accessor);
        json!(accessors.len() - 1)
    }

    fn view(&mut self, bytes: &[u8]) -> usize {
        self.binary.resize(self.binary.len().next_multiple_of(4), 0);
        let view = json!({ "buffer": 0, "byteOffset": self.binary.len(), "byteLength": bytes.len() });
        self.binary.extend(bytes);
        let views = self.json["bufferViews"].as_array_mut().unwrap();
        views.push(view);
        views.len() - 1
    }

    /// Writes it with its buffer as a data URI.
    pub fn gltf(&self, folder: &Path) -> PathBuf {
        self.with_uri(folder, &data_uri("application/octet-stream", &self.binary))
    }

    /// Writes it with its buffer in a file, which a URI names.
    pub fn with_file(&self, folder: &Path, name: &str, uri: &str) -> PathBuf {
        std::fs::write(folder.join(name), &self.binary).unwrap();
        self.with_uri(folder, uri)
    }

    fn with_uri(&self, folder: &Path, uri: &str) -> PathBuf {
        let mut json = self.json.clone();
        json["buffers"] = json!([{ "byteLength": self.binary.len(), "uri": uri }]);
        let path = folder.join("scene.gltf");
        std::fs::write(&path, json.to_string()).unwrap();
        path
    }

    /// Writes it as one binary file.
    pub fn glb(&self, folder: &Path) -> PathBuf {
        let path = folder.join("scene.glb");
        std::fs::write(&path, self.bytes()).unwrap();
        path
    }

    /// The bytes of one binary file.
    pub fn bytes(&self) -> Vec<u8> {
        let mut json = self.json.clone();
        json["buffers"] = json!([{ "byteLength": self.binary.len() }]);
        let chunk = |kind: &[u8], mut data: Vec<u8>, fill: u8| {
            data.resize(data.len().next_multiple_of(4), fill);
            [&(data.len() as u32).to_le_bytes(), kind, &data].concat()
        };
        let chunks = [chunk(b"JSON", json.to_string().into_bytes(), b' '), chunk(b"BIN\0", self.binary.clone(), 0)].concat();
        [b"glTF", &2u32.to_le_bytes()[..], &(12 + chunks.len() as u32).to_le_bytes(), &chunks].concat()
    }
}

/// Bytes as a data URI.
pub fn data_uri(kind: &str, bytes: &[u8]) -> String {
    format!("data:{kind};base64,{}", STANDARD.encode(bytes))
}

fn components(kind: &str) -> usize {
    ["SCALAR", "VEC2", "VEC3", "VEC4"].iter().position(|k| *k == kind).unwrap() + 1
}

fn width(component: u32) -> usize {
    match component {
        U8 => 1,
        I16 | U16 => 2,
        _ => 4,
    }
}

fn encoded(x: f32, component: u32) -> Vec<u8> {
    match component {
        U8 => vec![x as u8],
        I16 => (x as i16).to_le_bytes().into(),
        U16 => (x as u16).to_le_bytes().into(),
        _ => x.to_le_bytes().into(),
    }
}
