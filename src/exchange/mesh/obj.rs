//! Wavefront OBJ, read by `tobj` after a look at each line.
//!
//! `tobj` answers errors without a line, overflows on absurd indices and splits a file at its groups; so the lines that
//! matter (`v`, `vt`, `vn`, `f`) are checked here first and passed on alone. As in Mitsuba: one mesh a file, one vertex a
//! distinct position/uv/normal triple, polygons as fans, and v stored as 1 - v.
//! Ours: corners without uv in a file that has some get (0, 0), corners without normal a smooth one.

use crate::scene::mesh::Mesh;
use crate::{Error, Result};
use glam::{Vec2, Vec3};
use std::path::Path;

/// Reads an OBJ file.
pub fn load(path: &Path) -> Result<Mesh> {
    parse(&std::fs::read(path).map_err(|e| Error::io(path, e))?, path)
}

/// Reads the bytes of an OBJ file; `path` is for messages.
pub fn parse(text: &[u8], path: &Path) -> Result<Mesh> {
    let lines = geometry_lines(text, path)?;
    let options = tobj::LoadOptions { single_index: true, triangulate: true, ..Default::default() };
    let no_materials = |_: &Path| Err(tobj::LoadError::OpenFileFailed);
    let (models, _) = tobj::load_obj_buf(&mut &lines[..], &options, no_materials)
        .map_err(|e| first_bad_number(text, path).unwrap_or_else(|| Error::input(path, e.to_string())))?;
    drop(lines);

    let (any_uv, any_normal) =
        (models.iter().any(|m| !m.mesh.texcoords.is_empty()), models.iter().any(|m| !m.mesh.normals.is_empty()));
    let mut mesh = Mesh::default();
    for tobj::Model { mesh: part, .. } in models {
        let first = mesh.positions.len() as u32;
        mesh.positions.extend(part.positions.chunks_exact(3).map(Vec3::from_slice));
        mesh.uvs.extend(part.texcoords.chunks_exact(2).map(|t| Vec2::new(t[0], 1.0 - t[1])));
        mesh.normals.extend(part.normals.chunks_exact(3).map(Vec3::from_slice));
        if any_uv {
            mesh.uvs.resize(mesh.positions.len(), Vec2::ZERO);
        }
        if any_normal {
            mesh.normals.resize(mesh.positions.len(), Vec3::ZERO);
        }
        mesh.triangles.extend(part.indices.chunks_exact(3).map(|t| [t[0] + first, t[1] + first, t[2] + first]));
    }
    if mesh.triangles.is_empty() {
        return Err(Error::input(path, "no faces found, expected at least one \"f\" line"));
    }
    crate::scene::mesh::check(&mesh).map_err(|e| first_bad_number(text, path).unwrap_or_else(|| Error::input(path, e)))?;
    Ok(mesh)
}

/// Which indices the corners of a face have.
#[derive(Clone, Copy, PartialEq)]
struct Kind {
    uv: bool,
    normal: bool,
}

/// The `v`, `vt`, `vn` and `f` lines of a file, faces checked. Where faces change between having and lacking uvs or normals,
/// an `o` line makes `tobj` begin a new part, since within a part it wants them all alike.
fn geometry_lines(text: &[u8], path: &Path) -> Result<Vec<u8>> {
    let mut out = Vec::with_capacity(text.len());
    let mut counts = [0u64; 3];
    let mut highest = [(0i64, 0u32); 3]; // index and line, of v, vt, vn
    let mut last_kind = None;
    for (number, line) in text.split(|&b| b == b'\n').enumerate() {
        let line = if line.contains(&b'#') { line.split(|&b| b == b'#').next().unwrap_or_default() } else { line };
        let line = line.trim_ascii();
        let word = line.split(u8::is_ascii_whitespace).next().unwrap_or_default();
        let number = number as u32 + 1;
        match word {
            b"v" => counts[0] += 1,
            b"vt" => counts[1] += 1,
            b"vn" => counts[2] += 1,
            b"f" => {
                let kind = face(&line[1..], counts, number, &mut highest).map_err(|e| Error::at_line(path, number, e))?;
                if last_kind.is_some_and(|k| k != kind) {
                    out.extend_from_slice(b"o part\n");
                }
                last_kind = Some(kind);
            }
            _ => continue,
        }
        out.extend_from_slice(line);
        out.push(b'\n');
    }
    for k in 0..3 {
        let (index, line) = highest[k];
        if index > counts[k] as i64 {
            let message = format!("index {index}, but the file has only {} {} lines", counts[k], ["v", "vt", "vn"][k]);
            return Err(Error::at_line(path, line, message));
        }
    }
    Ok(out)
}

/// Checks one face's corners. Absolute indices are compared later, when all lines are counted.
fn face(corners: &[u8], counts: [u64; 3], line: u32, highest: &mut [(i64, u32); 3]) -> std::result::Result<Kind, String> {
    let mut kind = None;
    let mut n = 0;
    for corner in corners.split(u8::is_ascii_whitespace).filter(|c| !c.is_empty()) {
        let shown = || String::from_utf8_lossy(corner).into_owned();
        let mut seen = [false; 3];
        for (k, index) in corner.split(|&b| b == b'/').enumerate() {
            if k > 2 {
                return Err(format!("face corner \"{}\" has more than three indices", shown()));
            }
            if index.is_empty() {
                continue;
            }
            let value: i32 = std::str::from_utf8(index)
                .ok()
                .and_then(|s| s.parse().ok())
                .ok_or_else(|| format!("face corner \"{}\" is not made of whole numbers", shown()))?;
            let value = i64::from(value);
            if value == 0 || value < -(counts[k] as i64) {
                return Err(format!(
                    "index {value} in \"{}\", but {} {} lines precede it",
                    shown(),
                    counts[k],
                    ["v", "vt", "vn"][k]
                ));
            }
            if value > highest[k].0 {
                highest[k] = (value, line);
            }
            seen[k] = true;
        }
        let this = Kind { uv: seen[1], normal: seen[2] };
        if !seen[0] || kind.is_some_and(|k| k != this) {
            return Err(format!("face corner \"{}\" does not match the face's other corners", shown()));
        }
        kind = Some(this);
        n += 1;
    }
    match kind {
        Some(kind) if n >= 3 => Ok(kind),
        _ => Err(format!("face of {n} corners, expected at least 3")),
    }
}

/// The first `v`, `vt` or `vn` line that lacks a finite number, as an error.
fn first_bad_number(text: &[u8], path: &Path) -> Option<Error> {
    for (number, line) in text.split(|&b| b == b'\n').enumerate() {
        let line = String::from_utf8_lossy(line);
        let mut words = line.split_whitespace();
        let wanted = match words.next() {
            Some("v" | "vn") => 3,
            Some("vt") => 2,
            _ => continue,
        };
        let found = words.take(wanted).filter_map(|w| w.parse::<f32>().ok()).filter(|x| x.is_finite()).count();
        if found < wanted {
            let message = format!("found \"{}\", expected {wanted} finite numbers", line.trim());
            return Some(Error::at_line(path, number as u32 + 1, message));
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<Mesh> {
        parse(text.as_bytes(), Path::new("mesh.obj"))
    }

    const QUAD: &str = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0.1 0.2\nvt .9 .3\nvt .8 .7\nvt .1 .95\n";

    #[test]
    fn a_textured_quad_is_read_as_mitsuba_reads_it() {
        let mesh = read(&format!("{QUAD}f 1/1 2/2 3/3 4/4\n")).unwrap();
        assert_eq!(mesh.triangles, [[0, 1, 2], [0, 2, 3]]);
        assert_eq!(mesh.uvs, [[0.1, 0.8], [0.9, 0.7], [0.8, 1.0 - 0.7], [0.1, 1.0 - 0.95]].map(Vec2::from));
        assert!(mesh.normals.is_empty());
    }

    #[test]
    fn groups_materials_comments_and_foreign_bytes_do_not_split_a_mesh() {
        let mut text = b"mtllib none.mtl\ng caf\xe9\n".to_vec();
        text.extend_from_slice(QUAD.as_bytes());
        text.extend_from_slice(b"o a\nusemtl x\nf 1 2 3 # first\ng b\nusemtl y\r\ns 1\nf -4 -2 -1\r\n");
        let mesh = parse(&text, Path::new("mesh.obj")).unwrap();
        assert_eq!((mesh.positions.len(), mesh.triangles.len()), (4, 2));
    }

    #[test]
    fn faces_without_uv_or_normal_among_others_keep_their_place() {
        let mesh = read(&format!("{QUAD}vn 0 0 1\nf 1/1/1 2/2/1 3/3/1\nf 1 3 4\nf 1//1 3//1 4//1\n")).unwrap();
        assert_eq!(mesh.positions.len(), 9);
        assert_eq!((mesh.uvs.len(), mesh.normals.len()), (9, 9));
        assert_eq!(mesh.uvs[3], Vec2::ZERO);
        assert_eq!((mesh.normals[2], mesh.normals[3], mesh.normals[8]), (Vec3::Z, Vec3::ZERO, Vec3::Z));
        assert_eq!(mesh.triangles[2], [6, 7, 8]);
    }

    #[test]
    fn bad_lines_are_named() {
        let cases = [
            ("v 0 0 0\nv nan 0 0\nv 0 1 0\nf 1 2 3\n", ":2:"),
            ("v 0 0 0\nv 1e39 0 0\nv 0 1 0\nf 1 2 3\n", ":2:"),
            ("v 0 0 0\nv 1 0 0\nv 0 1\n", ":3:"),
            ("v 0 0 0\nv 1 0 0\nv 0 1 0\nvn 0 x 1\nf 1//1 2//1 3//1\n", ":4:"),
            ("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 4\n", ":4: index 4, but the file has only 3 v lines"),
            ("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1/9 2/9 3/9\n", ":4: index 9"),
            ("v 0 0 0\nv 1 0 0\nv 0 1 0\nf -1 -2 -4\n", ":4:"),
            ("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 0 1 2\n", ":4:"),
            ("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9223372036854775807\n", ":4:"),
            ("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1/-9223372036854775808 2/1 3/1\n", ":4:"),
            ("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2\n", ":4: face of 2 corners"),
            ("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1/1/1/1 2 3\n", ":4:"),
            ("v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nf 1/1 2 3\n", ":5:"),
            ("v 0 0 0\nv 1 0 0\nv 0 1 0\nf /1 /2 /3\n", ":4:"),
            ("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 \u{ff13}\n", ":4:"),
            ("", "no faces"),
            ("\u{0}\u{1}nonsense", "no faces"),
        ];
        for (text, expected) in cases {
            let message = read(text).expect_err(text).to_string();
            assert!(message.starts_with("mesh.obj") && message.contains(expected), "{text:?}: {message}");
        }
    }

    #[test]
    fn no_prefix_of_a_file_panics() {
        let text = format!("{QUAD}vn 0 0 1\nf 1/1/1 2/2/1 3/3/1\nf 1 3 4\nf 1//1 3//1 4//1\n");
        let read = (0..text.len()).filter(|&n| read(&text[..n]).is_ok()).count();
        assert!((1..text.len()).contains(&read));
    }
}
