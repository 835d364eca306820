//! A GLB file as it grows.

use super::pixels::Picture;
use crate::{Error, Result};
use glam::{Vec2, Vec3};
use serde_json::{Map, Value, json};
use std::collections::BTreeMap;

const FLOAT: u32 = 5126;
const UNSIGNED_INT: u32 = 5125;
const VERTICES: u32 = 34962;
const INDICES: u32 = 34963;

/// Lists of a glTF document, and its binary chunk.
#[derive(Default)]
pub struct Writer {
    lists: Map<String, Value>,
    used: Vec<&'static str>,
    binary: Vec<u8>,
    /// Images by their pixels.
    images: BTreeMap<[u8; 32], usize>,
}

impl Writer {
    /// Appends to one of the document's lists; returns the entry's number.
    pub fn push(&mut self, list: &str, entry: Value) -> usize {
        let list = self.lists.entry(list).or_insert_with(|| json!([]));
        match list {
            Value::Array(entries) => {
                entries.push(entry);
                entries.len() - 1
            }
            _ => 0,
        }
    }

    /// Says that the document uses an extension.
    pub fn uses(&mut self, extension: &'static str) {
        if !self.used.contains(&extension) {
            self.used.push(extension);
        }
    }

    /// The same for an entry that may be there already.
    fn once(&mut self, list: &str, entry: Value) -> usize {
        let there = self.lists.get(list).and_then(Value::as_array);
        let found = there.and_then(|entries| entries.iter().position(|e| *e == entry));
        found.unwrap_or_else(|| self.push(list, entry))
    }

    /// An image with the sampler that its texture has; returns the texture's number. Pixels are encoded and written once.
    pub fn texture(&mut self, picture: &Picture, name: &str, sampler: Value) -> Result<usize> {
        let key = picture.key();
        let image = match self.images.get(&key) {
            Some(image) => *image,
            None => {
                let view = self.view(&picture.png()?, None);
                let image = self.push("images", json!({ "bufferView": view, "mimeType": "image/png", "name": name }));
                self.images.insert(key, image);
                image
            }
        };
        let sampler = self.once("samplers", sampler);
        Ok(self.once("textures", json!({ "source": image, "sampler": sampler })))
    }

    /// An attribute of places, with the bounds that the format wants of them.
    pub fn positions(&mut self, points: &[Vec3]) -> usize {
        let low = points.iter().copied().fold(Vec3::INFINITY, Vec3::min);
        let high = points.iter().copied().fold(Vec3::NEG_INFINITY, Vec3::max);
        let view = self.view(bytemuck::cast_slice(points), Some(VERTICES));
        let (low, high) = (low.to_array(), high.to_array());
        let accessor = json!({
            "bufferView": view, "componentType": FLOAT, "count": points.len(), "type": "VEC3", "min": low, "max": high
        });
        self.push("accessors", accessor)
    }

    /// An attribute of directions.
    pub fn directions(&mut self, vectors: &[Vec3]) -> usize {
        self.attribute(bytemuck::cast_slice(vectors), "VEC3", vectors.len())
    }

    /// An attribute of texture coordinates.
    pub fn coordinates(&mut self, uvs: &[Vec2]) -> usize {
        self.attribute(bytemuck::cast_slice(uvs), "VEC2", uvs.len())
    }

    /// Corners of triangles.
    pub fn triangles(&mut self, triangles: &[[u32; 3]]) -> usize {
        let view = self.view(bytemuck::cast_slice(triangles), Some(INDICES));
        let count = 3 * triangles.len();
        self.push("accessors", json!({ "bufferView": view, "componentType": UNSIGNED_INT, "count": count, "type": "SCALAR" }))
    }

    fn attribute(&mut self, bytes: &[u8], kind: &str, count: usize) -> usize {
        let view = self.view(bytes, Some(VERTICES));
        self.push("accessors", json!({ "bufferView": view, "componentType": FLOAT, "count": count, "type": kind }))
    }

    fn view(&mut self, bytes: &[u8], target: Option<u32>) -> usize {
        let mut view = json!({ "buffer": 0, "byteOffset": self.binary.len(), "byteLength": bytes.len() });
        if let Some(target) = target {
            view["target"] = json!(target);
        }
        self.binary.extend(bytes);
        self.binary.resize(self.binary.len().next_multiple_of(4), 0);
        self.push("bufferViews", view)
    }

    /// The file's bytes. `asset` says who wrote it, `extensions` what the document itself has of them.
    pub fn finish(self, asset: Value, extensions: Value) -> Result<Vec<u8>> {
        let mut root = Map::new();
        root.insert("asset".into(), asset);
        if !self.used.is_empty() {
            root.insert("extensionsUsed".into(), json!(self.used));
        }
        if extensions.as_object().is_some_and(|e| !e.is_empty()) {
            root.insert("extensions".into(), extensions);
        }
        root.insert("scene".into(), json!(0));
        root.extend(self.lists);
        root.insert("buffers".into(), json!([{ "byteLength": self.binary.len() }]));
        let mut text = Value::Object(root).to_string().into_bytes();
        text.resize(text.len().next_multiple_of(4), b' ');
        let length = 12 + 8 + text.len() + 8 + self.binary.len();
        let too_long = |_| Error::Request(format!("a GLB file of {length} bytes: the format ends at 4 GiB"));
        let words = [u32::try_from(length).map_err(too_long)?, text.len() as u32, self.binary.len() as u32];
        let [length, text_length, binary_length] = words.map(u32::to_le_bytes);
        Ok([b"glTF", &2u32.to_le_bytes()[..], &length, &text_length, b"JSON", &text, &binary_length, b"BIN\0", &self.binary]
            .concat())
    }
}
