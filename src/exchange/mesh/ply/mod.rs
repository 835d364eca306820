//! Stanford PLY, ascii and binary.
//!
//! As Mitsuba: positions `x y z`, normals `nx ny nz`, texture coordinates (`u v`, `s t`, `texture_u texture_v`) kept as they are, faces
//! in `vertex_indices` or `vertex_index`, attributes by their names' last part (`foo_x foo_y foo_z` are `vertex_foo`). Polygons become
//! fans. Other elements and properties are passed over.
//! Ours: texture coordinates of faces' corners (`texcoord`, as MeshLab writes them), which take vertices apart; colours given as integers
//! are sRGB (Mitsuba takes bytes for numbers up to 255, and warns).

mod attributes;
mod header;
mod numbers;

use super::{MeshAttribute, MeshFile};
use crate::io::read_named;
use crate::scene::mesh::Mesh;
use crate::{Error, Result};
use attributes::Channels;
use glam::{Vec2, Vec3};
use header::Element;
use numbers::Numbers;
use std::collections::HashMap;
use std::path::Path;

/// What texture coordinates are called.
const UVS: [[&str; 2]; 7] =
    [["u", "v"], ["s", "t"], ["texture_u", "texture_v"], ["texture_s", "texture_t"], ["tx", "ty"], ["u0", "v0"], ["s0", "t0"]];
/// What the texture coordinates of a face's corners are called.
const FACE_UVS: [&str; 4] = ["texcoord", "texcoords", "texture_coordinates", "uv"];
const CORNERS: [&str; 2] = ["vertex_indices", "vertex_index"];

/// Reads a PLY file.
pub fn load(path: &Path) -> Result<MeshFile> {
    parse(&read_named(path)?, path)
}

/// Reads the bytes of a PLY file; `path` is for messages.
pub fn parse(bytes: &[u8], path: &Path) -> Result<MeshFile> {
    let header = header::parse(bytes, path)?;
    let element = |name: &str| header.elements.iter().find(|e| e.name == name);
    if !element("vertex").is_some_and(|e| ["x", "y", "z"].iter().all(|n| e.number(n).is_some())) {
        return Err(Error::input(path, "no vertex properties x, y and z found"));
    }
    if element("face").is_some_and(|e| e.list(&CORNERS).is_none()) {
        return Err(Error::input(path, "no face property vertex_indices found"));
    }
    let mut numbers = Numbers::new(path, bytes, header.end, header.encoding);
    let (mut file, mut faces) = (MeshFile::default(), Faces::default());
    for element in &header.elements {
        match element.name.as_str() {
            "vertex" => vertices(element, &mut numbers, &mut file)?,
            "face" => faces.read(element, &mut numbers, &mut file)?,
            _ if element.properties.is_empty() => {}
            _ => {
                let mut skipped = Vec::new();
                for _ in 0..element.count {
                    element.properties.iter().try_for_each(|p| numbers.of(p, &mut skipped))?;
                }
            }
        }
    }
    file.check().map_err(|e| Error::input(path, e))?;
    if !faces.corner_uvs.is_empty() && file.mesh.uvs.is_empty() {
        take_apart(&mut file, &faces.corner_uvs);
        file.check().map_err(|e| Error::input(path, e))?;
    }
    Ok(file)
}

/// Three numbers of an element that are there, from a row of all its properties.
fn places<const N: usize>(element: &Element, names: [&str; N]) -> Option<[usize; N]> {
    let found = names.map(|n| element.number(n));
    found.iter().all(Option::is_some).then(|| found.map(Option::unwrap_or_default))
}

fn vertices(element: &Element, numbers: &mut Numbers, file: &mut MeshFile) -> Result<()> {
    let position = places(element, ["x", "y", "z"]).unwrap_or_default();
    let normal = places(element, ["nx", "ny", "nz"]);
    let uv = UVS.into_iter().find_map(|pair| places(element, pair));
    let taken: Vec<usize> = position.into_iter().chain(normal.into_iter().flatten()).chain(uv.into_iter().flatten()).collect();
    let channels = attributes::find(element, "vertex", &taken);
    let mut attributes: Vec<Vec<_>> = vec![Vec::new(); channels.len()];
    let (mut row, mut list) = (vec![0.0; element.properties.len()], Vec::new());
    for _ in 0..element.count {
        for (place, property) in row.iter_mut().zip(&element.properties) {
            numbers.of(property, &mut list)?;
            *place = list.first().copied().unwrap_or(0.0);
        }
        let vector = |p: [usize; 3]| Vec3::from(p.map(|i| row[i] as f32));
        file.mesh.positions.push(vector(position));
        file.mesh.normals.extend(normal.map(vector));
        file.mesh.uvs.extend(uv.map(|p| Vec2::from(p.map(|i| row[i] as f32))));
        for (values, c) in attributes.iter_mut().zip(&channels) {
            values.push(c.value(&row));
        }
    }
    named(channels, attributes, file);
    Ok(())
}

fn named(channels: Vec<Channels>, values: Vec<Vec<Vec3>>, file: &mut MeshFile) {
    file.attributes.extend(channels.into_iter().zip(values).map(|(c, values)| MeshAttribute { name: c.name, values }));
}

/// What faces say beyond their triangles.
#[derive(Default)]
struct Faces {
    /// Texture coordinates of each triangle's corners, where faces have them.
    corner_uvs: Vec<[Vec2; 3]>,
}

impl Faces {
    fn read(&mut self, element: &Element, numbers: &mut Numbers, file: &mut MeshFile) -> Result<()> {
        let corners_at = element.list(&CORNERS);
        let uvs_at = element.list(&FACE_UVS);
        let channels = attributes::find(element, "face", &[]);
        let mut attributes: Vec<Vec<_>> = vec![Vec::new(); channels.len()];
        let (mut row, mut list) = (vec![0.0; element.properties.len()], Vec::new());
        let (mut corners, mut uvs) = (Vec::new(), Vec::new());
        for i in 0..element.count {
            for (k, property) in element.properties.iter().enumerate() {
                numbers.of(property, &mut list)?;
                row[k] = list.first().copied().unwrap_or(0.0);
                if Some(k) == corners_at {
                    corners.clone_from(&list);
                } else if Some(k) == uvs_at {
                    uvs.clone_from(&list);
                }
            }
            let n = corners.len();
            if n < 3 {
                return Err(numbers.error(format!("face {i} has {n} corners, expected at least 3")));
            }
            // u32::MAX is never a vertex: it stands for what none can be.
            let index = |x: f64| if x >= 0.0 && x.fract() == 0.0 && x < f64::from(u32::MAX) { x as u32 } else { u32::MAX };
            for k in 1..n - 1 {
                file.mesh.triangles.push([0, k, k + 1].map(|c| index(corners[c])));
                attributes.iter_mut().zip(&channels).for_each(|(values, c)| values.push(c.value(&row)));
                if uvs_at.is_some() {
                    // Faces without coordinates among others that have them keep their place.
                    let uv = |c: usize| uvs.get(2 * c..2 * c + 2).map_or(Vec2::ZERO, |uv| Vec2::new(uv[0] as f32, uv[1] as f32));
                    self.corner_uvs.push([0, k, k + 1].map(uv));
                }
            }
        }
        named(channels, attributes, file);
        Ok(())
    }
}

/// A vertex for each texture coordinate that it has among its faces.
fn take_apart(file: &mut MeshFile, corner_uvs: &[[Vec2; 3]]) {
    let mut known: HashMap<(u32, [u32; 2]), u32> = HashMap::new();
    let (mut from, mut uvs) = (Vec::new(), Vec::new());
    for (triangle, corner_uvs) in file.mesh.triangles.iter_mut().zip(corner_uvs) {
        for (corner, uv) in triangle.iter_mut().zip(corner_uvs) {
            *corner = *known.entry((*corner, uv.to_array().map(f32::to_bits))).or_insert_with(|| {
                from.push(*corner as usize);
                uvs.push(*uv);
                uvs.len() as u32 - 1
            });
        }
    }
    let picked = |values: &[Vec3]| from.iter().filter_map(|&i| values.get(i).copied()).collect::<Vec<_>>();
    let Mesh { positions, normals, triangles, .. } = std::mem::take(&mut file.mesh);
    file.mesh = Mesh { positions: picked(&positions), normals: picked(&normals), uvs, triangles };
    for attribute in file.attributes.iter_mut().filter(|a| !a.is_of_faces()) {
        attribute.values = picked(&attribute.values);
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
            let mesh = parse(&bytes, Path::new("a.ply")).unwrap().mesh;
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
            (text.replace("1 1 0 255", "1 nan 0 255"), "a.ply:19: found \"nan\""),
            (text.replace("1 1 0 255", "1e39 1 0 255"), "vertex 2 is [inf, 1, 0]"),
            (text.replace("1 1 0 255", "1 one 0 255"), "a.ply:19: found \"one\""),
            (text.replace("property float x\n", ""), "no vertex properties"),
            (text.replace("vertex_index", "corners"), "no face property"),
            ("solid cube".into(), "PLY"),
            (String::new(), "PLY"),
        ];
        for (text, expected) in cases {
            let message = parse(text.as_bytes(), Path::new("a.ply")).expect_err(expected).to_string();
            assert!(message.starts_with("a.ply:") && message.contains(expected), "{message}");
        }
    }
}
