//! The container: JSON with its buffers, as one binary file, as several files or as data URIs.
//!
//! The schema is the crate `gltf_json`'s, asked through [`File::get`] alone: the crate `gltf` on top of it panics where a file refers to what it does not have.

use crate::io::read_named;
use crate::{Error, Result};
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use gltf_json::root::Get;
use gltf_json::{Index, Root, buffer};
use percent_encoding::percent_decode_str;
use serde::Deserialize;
use serde_json::Value;
use std::path::{Path, PathBuf};

/// Extensions that change what a scene looks like, and that are heeded.
const HEEDED: [&str; 12] = [
    "KHR_lights_punctual",
    "KHR_materials_emissive_strength",
    "KHR_materials_ior",
    "KHR_materials_pbrSpecularGlossiness",
    "KHR_materials_specular",
    "KHR_materials_transmission",
    "KHR_materials_unlit",
    // Of several looks a file's own is the first.
    "KHR_materials_variants",
    "KHR_materials_volume",
    "KHR_mesh_quantization",
    "KHR_texture_transform",
    "EXT_texture_webp",
];
/// Extensions in which data may hide.
const COMPRESSION: [&str; 3] = ["KHR_draco_mesh_compression", "EXT_meshopt_compression", "KHR_meshopt_compression"];
/// Extensions that add what a picture does not show.
const UNSEEN: [&str; 4] = ["KHR_xmp", "KHR_xmp_json_ld", "KHR_animation_pointer", "KHR_node_hoverability"];

const MAGIC: &[u8] = b"glTF";
const CHUNK_JSON: &[u8] = b"JSON";
const CHUNK_BINARY: &[u8] = b"BIN\0";

/// A glTF file and its buffers.
pub struct File {
    pub root: Root,
    pub path: PathBuf,
    buffers: Vec<Vec<u8>>,
}

impl File {
    /// Reads the bytes of a `.gltf` or `.glb` file, whichever the first of them say, and all buffers. Fills `warnings` with what is left out.
    pub fn open(path: &Path, bytes: &[u8], skip_unsupported: bool, warnings: &mut Vec<String>) -> Result<Self> {
        let bad = |message: String| Error::input(path, message);
        let (json, binary) = match bytes.starts_with(MAGIC) {
            true => chunks(bytes).map_err(|e| bad(format!("not a whole GLB file: {e}")))?,
            false => (bytes, None),
        };
        let mut value: Value = serde_json::from_slice(json).map_err(|e| bad(format!("not glTF: {e}")))?;
        let version = value["asset"]["version"].as_str().unwrap_or("none");
        if !version.starts_with("2.") {
            return Err(bad(format!("glTF of version {version}: expected 2.0")));
        }
        leave_out(&mut value, path, warnings);
        let root = Root::deserialize(value).map_err(|e| bad(format!("not glTF 2.0: {e}")))?;
        check_extensions(&root, path, skip_unsupported, warnings)?;
        let mut file = Self { root, path: path.to_owned(), buffers: Vec::new() };
        let read = |(i, b): (usize, &buffer::Buffer)| file.buffer(i, b, binary);
        file.buffers = Error::gather(file.root.buffers.iter().enumerate().map(read).collect::<Vec<_>>())?;
        Ok(file)
    }

    /// What an index refers to.
    pub fn get<T>(&self, index: Index<T>, what: &str) -> Result<&T>
    where
        Root: Get<T>,
    {
        self.root.get(index).ok_or_else(|| self.error(format!("there is no {what} {}", index.value())))
    }

    /// An error about this file.
    pub fn error(&self, message: impl Into<String>) -> Error {
        Error::input(&self.path, message)
    }

    /// The bytes of a buffer view.
    pub fn view(&self, index: Index<buffer::View>) -> Result<&[u8]> {
        let view = self.get(index, "buffer view")?;
        let buffer = self.buffers.get(view.buffer.value());
        let buffer = buffer.ok_or_else(|| self.error(format!("there is no buffer {}", view.buffer.value())))?;
        let (start, length) = (view.byte_offset.unwrap_or_default().0, view.byte_length.0);
        let range = usize::try_from(start).ok().zip(start.checked_add(length).and_then(|end| usize::try_from(end).ok()));
        range.and_then(|(start, end)| buffer.get(start..end)).ok_or_else(|| {
            let (view, bytes) = (index.value(), buffer.len());
            self.error(format!("buffer view {view} asks for {length} bytes at {start} of a buffer of {bytes}"))
        })
    }

    /// What a URI leads to: data in itself, or a file beside this one.
    pub fn uri(&self, uri: &str) -> Result<Vec<u8>> {
        if let Some(data) = uri.strip_prefix("data:") {
            let (kind, data) = data.split_once(',').ok_or_else(|| self.error("a data URI without a comma"))?;
            return match kind.ends_with(";base64") {
                true => STANDARD.decode(data.trim()).map_err(|e| self.error(format!("a data URI that is no base64: {e}"))),
                false => Ok(percent_decode_str(data).collect()),
            };
        }
        read_named(&self.beside(uri)?).map_err(|e| self.error(e.to_string()))
    }

    /// Bytes of all buffers.
    pub fn buffered(&self) -> usize {
        self.buffers.iter().map(Vec::len).sum()
    }

    /// The file that a relative URI names.
    pub fn beside(&self, uri: &str) -> Result<PathBuf> {
        if uri.contains("://") {
            return Err(self.error(format!("\"{uri}\": nothing is fetched from elsewhere; expected a file beside this one")));
        }
        let name = percent_decode_str(uri).decode_utf8().map_err(|_| self.error(format!("\"{uri}\" is no UTF-8")))?;
        Ok(self.path.parent().unwrap_or(Path::new("")).join(&*name))
    }

    /// What may be the matter where data is missing.
    pub fn compressed(&self) -> String {
        let used = self.root.extensions_used.iter().find(|name| COMPRESSION.contains(&name.as_str()));
        used.map_or_else(String::new, |name| format!(" ({name} is not supported: gltf-transform and Blender undo it)"))
    }

    fn buffer(&self, i: usize, buffer: &buffer::Buffer, binary: Option<&[u8]>) -> Result<Vec<u8>> {
        let mut bytes = match (&buffer.uri, binary) {
            (Some(uri), _) => self.uri(uri)?,
            (None, Some(binary)) if i == 0 => binary.to_vec(),
            _ => {
                return Err(
                    self.error(format!("buffer {i} has no data: expected a \"uri\" or a binary chunk{}", self.compressed()))
                );
            }
        };
        let expected = usize::try_from(buffer.byte_length.0).unwrap_or(usize::MAX);
        if bytes.len() < expected {
            return Err(self.error(format!("buffer {i} has {} bytes: expected {expected}", bytes.len())));
        }
        bytes.truncate(expected);
        Ok(bytes)
    }
}

/// The JSON and the binary chunk of a GLB file.
fn chunks(bytes: &[u8]) -> std::result::Result<(&[u8], Option<&[u8]>), String> {
    let number = |at: usize| {
        let four = bytes.get(at..at + 4).and_then(|b| b.try_into().ok());
        four.map(u32::from_le_bytes).ok_or_else(|| "it ends early".to_owned())
    };
    let version = number(4)?;
    if version != 2 {
        return Err(format!("its version is {version}, expected 2"));
    }
    let (mut json, mut binary, mut at) = (None, None, 12);
    while at + 8 <= bytes.len() {
        let (length, kind) = (number(at)? as usize, &bytes[at + 4..at + 8]);
        let data = bytes
            .get(at + 8..(at + 8).saturating_add(length))
            .ok_or_else(|| format!("a chunk of {length} bytes at {at} ends early"))?;
        match kind {
            CHUNK_JSON if json.is_none() => json = Some(data),
            CHUNK_BINARY if binary.is_none() => binary = Some(data),
            _ => {}
        }
        at += 8 + length.next_multiple_of(4);
    }
    json.map(|json| (json, binary)).ok_or_else(|| "it has no JSON".into())
}

/// Takes away what is not heeded and what the schema's types refuse.
fn leave_out(value: &mut Value, path: &Path, warnings: &mut Vec<String>) {
    if let Some(root) = value.as_object_mut()
        && root.remove("animations").is_some()
    {
        warnings.push(format!("{}: animations are left out: the scene is taken at rest", path.display()));
    }
    for scene in value.get_mut("scenes").and_then(Value::as_array_mut).into_iter().flatten().filter_map(Value::as_object_mut) {
        scene.entry("nodes").or_insert_with(|| Value::Array(Vec::new()));
    }
    if let Some(lights) = value.pointer_mut("/extensions/KHR_lights_punctual/lights").and_then(Value::as_array_mut) {
        lights.iter_mut().filter_map(Value::as_object_mut).for_each(|light| drop(light.remove("extensions")));
    }
}

fn check_extensions(root: &Root, path: &Path, skip_unsupported: bool, warnings: &mut Vec<String>) -> Result<()> {
    let unknown = |name: &&String| !HEEDED.contains(&name.as_str());
    let required: Vec<&str> = root.extensions_required.iter().filter(unknown).map(String::as_str).collect();
    if !required.is_empty() && !skip_unsupported {
        let message = format!(
            "the scene cannot do without {}, which is not supported (--skip-unsupported tries; gltf-transform and Blender undo compression)",
            required.join(", ")
        );
        return Err(Error::Unsupported { path: path.to_owned(), line: 0, message });
    }
    let left_out = root.extensions_used.iter().filter(unknown).filter(|name| !UNSEEN.contains(&name.as_str()));
    warnings.extend(left_out.map(|name| format!("{}: {name} is left out", path.display())));
    Ok(())
}
