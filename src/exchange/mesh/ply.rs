//! Stanford PLY, ascii and binary, read by `ply-rs-bw`.
//!
//! As Mitsuba: positions `x y z`, normals `nx ny nz`, texture coordinates `u v` or `s t` kept as they are, faces in
//! `vertex_indices` or `vertex_index`. Polygons become fans. Other elements and properties are passed over.

use crate::scene::mesh::Mesh;
use crate::{Error, Result};
use glam::{Vec2, Vec3};
use ply_rs_bw::parser::{Parser, Reader};
use ply_rs_bw::ply::{PropertyAccess, PropertyAccessResult};
use std::path::Path;

/// Reads a PLY file.
pub fn load(path: &Path) -> Result<Mesh> {
    parse(&std::fs::read(path).map_err(|e| Error::io(path, e))?, path)
}

/// Reads the bytes of a PLY file; `path` is for messages.
pub fn parse(bytes: &[u8], path: &Path) -> Result<Mesh> {
    // The parser tells its story on several lines; errors here have one.
    let bad = |e: ply_rs_bw::parser::ParseError| {
        let message = e.to_string();
        let words: Vec<&str> = message.split_whitespace().collect();
        Error::input(path, format!("not a readable PLY file: {}", words.join(" ")))
    };
    let mut reader = Reader::new(bytes);
    let header = Parser::<Vertex>::new().read_header(&mut reader).map_err(bad)?;
    let has = |element: &str, property: &str| header.elements.get(element).is_some_and(|e| e.properties.contains_key(property));
    if !(has("vertex", "x") && has("vertex", "y") && has("vertex", "z")) {
        return Err(Error::input(path, "no vertex properties x, y and z found"));
    }
    if !(has("face", "vertex_indices") || has("face", "vertex_index")) {
        return Err(Error::input(path, "no face property vertex_indices found"));
    }
    let has_normals = has("vertex", "nx") && has("vertex", "ny") && has("vertex", "nz");
    let has_uvs = [("u", "v"), ("s", "t")].iter().any(|(u, v)| has("vertex", u) && has("vertex", v));

    let mut mesh = Mesh::default();
    for (name, element) in &header.elements {
        // Each element takes a byte at least; more of them than bytes is a broken header, and could fill the memory.
        if element.count > bytes.len() {
            let message = format!("declares {} elements \"{name}\", but the file has only {} bytes", element.count, bytes.len());
            return Err(Error::input(path, message));
        }
        match name.as_str() {
            "vertex" => {
                for v in Parser::<Vertex>::new().read_payload_for_element(&mut reader, element, &header).map_err(bad)? {
                    mesh.positions.push(v.position);
                    if has_normals {
                        mesh.normals.push(v.normal);
                    }
                    if has_uvs {
                        mesh.uvs.push(v.uv);
                    }
                }
            }
            "face" => {
                let faces = Parser::<Face>::new().read_payload_for_element(&mut reader, element, &header).map_err(bad)?;
                for (i, Face(corners)) in faces.into_iter().enumerate() {
                    if corners.len() < 3 {
                        let message = format!("face {i} has {} corners, expected at least 3", corners.len());
                        return Err(Error::input(path, message));
                    }
                    mesh.triangles.extend(corners[1..].windows(2).map(|bc| [corners[0], bc[0], bc[1]]));
                }
            }
            _ => {
                Parser::<Skipped>::new().read_payload_for_element(&mut reader, element, &header).map_err(bad)?;
            }
        }
    }
    if mesh.triangles.is_empty() {
        return Err(Error::input(path, "no faces found, expected at least one"));
    }
    crate::scene::mesh::check(&mesh).map_err(|e| Error::input(path, e))?;
    Ok(mesh)
}

#[derive(Default)]
struct Vertex {
    position: Vec3,
    normal: Vec3,
    uv: Vec2,
}

impl Vertex {
    fn set(&mut self, name: &str, value: f32) -> PropertyAccessResult {
        *(match name {
            "x" => &mut self.position.x,
            "y" => &mut self.position.y,
            "z" => &mut self.position.z,
            "nx" => &mut self.normal.x,
            "ny" => &mut self.normal.y,
            "nz" => &mut self.normal.z,
            "u" | "s" => &mut self.uv.x,
            "v" | "t" => &mut self.uv.y,
            _ => return PropertyAccessResult::Ignored,
        }) = value;
        PropertyAccessResult::Set
    }
}

impl PropertyAccess for Vertex {
    fn new() -> Self {
        Self::default()
    }
    fn set_char(&mut self, _: &str, _: i8) -> PropertyAccessResult {
        PropertyAccessResult::Ignored
    }
    fn set_uchar(&mut self, _: &str, _: u8) -> PropertyAccessResult {
        PropertyAccessResult::Ignored
    }
    fn set_short(&mut self, name: &str, value: i16) -> PropertyAccessResult {
        self.set(name, value.into())
    }
    fn set_ushort(&mut self, name: &str, value: u16) -> PropertyAccessResult {
        self.set(name, value.into())
    }
    fn set_int(&mut self, name: &str, value: i32) -> PropertyAccessResult {
        self.set(name, value as f32)
    }
    fn set_uint(&mut self, name: &str, value: u32) -> PropertyAccessResult {
        self.set(name, value as f32)
    }
    fn set_float(&mut self, name: &str, value: f32) -> PropertyAccessResult {
        self.set(name, value)
    }
    fn set_double(&mut self, name: &str, value: f64) -> PropertyAccessResult {
        self.set(name, value as f32)
    }
}

/// Vertex indices; `u32::MAX`, never a vertex, stands for one that does not fit.
struct Face(Vec<u32>);

impl Face {
    fn set<T: TryInto<u32>>(&mut self, name: &str, values: Vec<T>) -> PropertyAccessResult {
        if !matches!(name, "vertex_indices" | "vertex_index") {
            return PropertyAccessResult::Ignored;
        }
        self.0 = values.into_iter().map(|i| i.try_into().unwrap_or(u32::MAX)).collect();
        PropertyAccessResult::Set
    }
}

impl PropertyAccess for Face {
    fn new() -> Self {
        Self(Vec::new())
    }
    fn set_list_char(&mut self, name: &str, value: Vec<i8>) -> PropertyAccessResult {
        self.set(name, value)
    }
    fn set_list_uchar(&mut self, name: &str, value: Vec<u8>) -> PropertyAccessResult {
        self.set(name, value)
    }
    fn set_list_short(&mut self, name: &str, value: Vec<i16>) -> PropertyAccessResult {
        self.set(name, value)
    }
    fn set_list_ushort(&mut self, name: &str, value: Vec<u16>) -> PropertyAccessResult {
        self.set(name, value)
    }
    fn set_list_int(&mut self, name: &str, value: Vec<i32>) -> PropertyAccessResult {
        self.set(name, value)
    }
    fn set_list_uint(&mut self, name: &str, value: Vec<u32>) -> PropertyAccessResult {
        self.set(name, value)
    }
}

/// An element that nobody asks for.
struct Skipped;

impl PropertyAccess for Skipped {
    fn new() -> Self {
        Self
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const HEADER: &str = "element vertex 4\nproperty float x\nproperty double y\nproperty float z\nproperty uchar red\n\
        property float s\nproperty float t\nelement face 2\nproperty uchar flag\nproperty list uchar int vertex_index\n\
        element edge 1\nproperty int a\nend_header\n";
    const VERTICES: [[f32; 5]; 4] =
        [[0.0, 0.0, 0.0, 0.1, 0.2], [1.0, 0.0, 0.0, 0.3, 0.4], [1.0, 1.0, 0.0, 0.5, 0.6], [0.0, 1.0, 0.5, 0.7, 0.8]];
    const FACES: [&[i32]; 2] = [&[0, 1, 2, 3], &[3, 2, 1]];

    fn ascii() -> Vec<u8> {
        let mut text = format!("ply\nformat ascii 1.0\ncomment c\n{HEADER}");
        for [x, y, z, s, t] in VERTICES {
            text += &format!("{x} {y} {z} 255 {s} {t}\n");
        }
        for f in FACES {
            let list: Vec<String> = f.iter().map(i32::to_string).collect();
            text += &format!("0 {} {}\n", f.len(), list.join(" "));
        }
        (text + "7\n").into_bytes()
    }

    fn binary(big: bool) -> Vec<u8> {
        let mut out = format!("ply\nformat binary_{}_endian 1.0\n{HEADER}", if big { "big" } else { "little" }).into_bytes();
        let mut put = |mut little: Vec<u8>| {
            if big {
                little.reverse();
            }
            out.extend(little);
        };
        for [x, y, z, s, t] in VERTICES {
            put(x.to_le_bytes().to_vec());
            put(f64::from(y).to_le_bytes().to_vec());
            put(z.to_le_bytes().to_vec());
            put(vec![255]);
            put(s.to_le_bytes().to_vec());
            put(t.to_le_bytes().to_vec());
        }
        for f in FACES {
            put(vec![0]);
            put(vec![f.len() as u8]);
            f.iter().for_each(|i| put(i.to_le_bytes().to_vec()));
        }
        put(vec![7, 0, 0, 0]);
        out
    }

    #[test]
    fn the_three_encodings_say_the_same() {
        for bytes in [ascii(), binary(false), binary(true)] {
            let mesh = parse(&bytes, Path::new("a.ply")).unwrap();
            assert_eq!(mesh.triangles, [[0, 1, 2], [0, 2, 3], [3, 2, 1]]);
            assert_eq!(mesh.positions[3], Vec3::new(0.0, 1.0, 0.5));
            assert_eq!(mesh.uvs[2], Vec2::new(0.5, 0.6));
            assert!(mesh.normals.is_empty());
        }
    }

    #[test]
    fn truncated_files_are_errors() {
        for whole in [ascii(), binary(false), binary(true)] {
            let read = (0..whole.len() - 2).filter(|&n| parse(&whole[..n], Path::new("a.ply")).is_ok()).count();
            assert_eq!(read, 0);
        }
    }

    #[test]
    fn bad_content_is_named() {
        let text = String::from_utf8(ascii()).unwrap();
        let cases = [
            (text.replace("vertex 4", "vertex 18446744073709551615"), "18446744073709551615 elements \"vertex\""),
            (text.replace("edge 1\nproperty int a", "edge 4000000000"), "4000000000 elements \"edge\""),
            (text.replace("0 3 3 2 1", "0 3 3 2 4"), "triangle 2 has vertices [3, 2, 4], but there are only 4"),
            (text.replace("0 3 3 2 1", "0 3 3 2 -1"), "only 4 vertices"),
            (text.replace("0 3 3 2 1", "0 2 3 2"), "face 1 has 2 corners"),
            (text.replace("1 1 0 255", "1 nan 0 255"), "Line 19"),
            (text.replace("1 1 0 255", "1e39 1 0 255"), "vertex 2 is [inf, 1, 0]"),
            (text.replace("1 1 0 255", "1 one 0 255"), "PLY"),
            (text.replace("property float x\n", ""), "no vertex properties"),
            (text.replace("vertex_index", "corners"), "no face property"),
            ("solid cube".into(), "PLY"),
            (String::new(), "PLY"),
        ];
        for (text, expected) in cases {
            let message = parse(text.as_bytes(), Path::new("a.ply")).expect_err(expected).to_string();
            assert!(message.starts_with("a.ply: ") && message.contains(expected), "{message}");
        }
    }
}
