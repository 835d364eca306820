//! Wavefront OBJ.
//!
//! As Mitsuba: one mesh a file whatever its groups, one vertex a distinct position/uv/normal triple in order of first use, polygons as
//! fans, v stored as 1 - v, and a vertex's weight `w`, which is of rational curves and surfaces alone, passed over.
//! Ours: corners without uv in a file that has some, whatever those beside them have, get (0, 0), corners without normal a smooth one; a line that ends in a backslash goes
//! on in the next, as the format has it; colours after a position are the attribute `vertex_color`.

use super::{MeshAttribute, MeshFile};
use crate::io::read_named;
use crate::scene::mesh::Mesh;
use crate::{Error, Result};
use glam::{Vec2, Vec3};
use std::borrow::Cow;
use std::collections::HashMap;
use std::path::Path;

/// Stands for an index that a corner does not have.
const NONE: u32 = u32::MAX;

/// Reads an OBJ file.
pub fn load(path: &Path) -> Result<MeshFile> {
    parse(&read_named(path)?, path)
}

/// Reads the bytes of an OBJ file; `path` is for messages.
pub fn parse(text: &[u8], path: &Path) -> Result<MeshFile> {
    let mut lines = Lines::default();
    for (number, line) in logical_lines(text) {
        lines.add(&line, number).map_err(|e| Error::at_line(path, number, e))?;
    }
    for ((name, count), (index, line)) in NAMES.iter().zip(lines.counts()).zip(lines.highest) {
        if index > count as i64 {
            let message = format!("index {index}, but the file has only {count} {name} lines");
            return Err(Error::at_line(path, line, message));
        }
    }
    if lines.sizes.is_empty() {
        return Err(Error::input(path, "no faces found, expected at least one \"f\" line"));
    }
    let file = lines.into_file();
    file.check().map_err(|e| Error::input(path, e))?;
    Ok(file)
}

const NAMES: [&str; 3] = ["v", "vt", "vn"];

/// Lines without comments and the white space around them, each with the number of its first line; one that ends in a backslash is joined
/// with the next.
fn logical_lines(text: &[u8]) -> impl Iterator<Item = (u32, Cow<'_, [u8]>)> {
    let mut physical = text.split(|&b| b == b'\n').zip(1..).map(|(line, number)| {
        let line = line.split(|&b| b == b'#').next().unwrap_or_default();
        (number, line.trim_ascii())
    });
    std::iter::from_fn(move || {
        let (number, line) = physical.next()?;
        let Some(mut begun) = line.strip_suffix(b"\\") else { return Some((number, Cow::Borrowed(line))) };
        let mut whole = Vec::new();
        loop {
            whole.extend_from_slice(begun);
            whole.push(b' ');
            let Some((_, next)) = physical.next() else { break };
            match next.strip_suffix(b"\\") {
                Some(next) => begun = next,
                None => {
                    whole.extend_from_slice(next);
                    break;
                }
            }
        }
        Some((number, Cow::Owned(whole)))
    })
}

/// What the lines of a file hold.
#[derive(Default)]
struct Lines {
    positions: Vec<Vec3>,
    /// One a position, as soon as one has a colour.
    colors: Vec<Vec3>,
    uvs: Vec<Vec2>,
    normals: Vec<Vec3>,
    /// Indices from 0 of position, uv and normal of all faces' corners.
    corners: Vec<[u32; 3]>,
    /// Corners of each face.
    sizes: Vec<usize>,
    /// Highest index and its line, of v, vt, vn: they may come before the lines that they mean.
    highest: [(i64, u32); 3],
}

impl Lines {
    fn counts(&self) -> [usize; 3] {
        [self.positions.len(), self.uvs.len(), self.normals.len()]
    }

    fn add(&mut self, line: &[u8], number: u32) -> std::result::Result<(), String> {
        let word = line.split(u8::is_ascii_whitespace).next().unwrap_or_default();
        let rest = &line[word.len()..];
        match word {
            b"v" => {
                let mut numbers = [1.0; 6];
                let found = self::numbers(line, rest, 3, &mut numbers)?;
                self.positions.push(Vec3::from_slice(&numbers));
                if found == 6 && self.colors.is_empty() {
                    self.colors.resize(self.positions.len() - 1, Vec3::ONE);
                }
                if found == 6 || !self.colors.is_empty() {
                    self.colors.push(if found == 6 { Vec3::from_slice(&numbers[3..]) } else { Vec3::ONE });
                }
            }
            b"vt" => {
                let mut numbers = [0.0; 2];
                self::numbers(line, rest, 1, &mut numbers)?;
                self.uvs.push(Vec2::new(numbers[0], 1.0 - numbers[1]));
            }
            b"vn" => {
                let mut numbers = [0.0; 3];
                self::numbers(line, rest, 3, &mut numbers)?;
                self.normals.push(Vec3::from(numbers));
            }
            b"f" | b"fo" => {
                let before = self.corners.len();
                let counts = self.counts().map(|n| n as u64);
                face(rest, counts, number, &mut self.highest, &mut self.corners)?;
                self.sizes.push(self.corners.len() - before);
            }
            _ => {}
        }
        Ok(())
    }

    fn into_file(self) -> MeshFile {
        let (any_uv, any_normal) = (self.corners.iter().any(|c| c[1] != NONE), self.corners.iter().any(|c| c[2] != NONE));
        let mut mesh = Mesh::default();
        let mut colors = Vec::new();
        let mut known: HashMap<[u32; 3], u32> = HashMap::with_capacity(self.positions.len());
        let mut first = 0;
        for size in self.sizes {
            let mut vertex = |c: usize| {
                let corner = self.corners[first + c];
                *known.entry(corner).or_insert_with(|| {
                    let [p, uv, n] = corner.map(|i| i as usize);
                    mesh.positions.push(self.positions[p]);
                    colors.extend(self.colors.get(p));
                    if any_uv {
                        mesh.uvs.push(self.uvs.get(uv).copied().unwrap_or(Vec2::ZERO));
                    }
                    if any_normal {
                        mesh.normals.push(self.normals.get(n).copied().unwrap_or(Vec3::ZERO));
                    }
                    mesh.positions.len() as u32 - 1
                })
            };
            let a = vertex(0);
            let mut b = vertex(1);
            let mut fan = Vec::with_capacity(size - 2);
            for c in 2..size {
                let last = vertex(c);
                fan.push([a, b, last]);
                b = last;
            }
            mesh.triangles.extend(fan);
            first += size;
        }
        let color = MeshAttribute { name: "vertex_color".into(), values: colors };
        MeshFile { mesh, attributes: if color.values.is_empty() { Vec::new() } else { vec![color] } }
    }
}

/// The numbers after a line's first word, at least `least`; how many of `out` there are.
fn numbers(line: &[u8], rest: &[u8], least: usize, out: &mut [f32]) -> std::result::Result<usize, String> {
    let mut found = 0;
    let words = rest.split(u8::is_ascii_whitespace).filter(|w| !w.is_empty());
    for (place, word) in out.iter_mut().zip(words) {
        match std::str::from_utf8(word).ok().and_then(|w| w.parse::<f32>().ok()).filter(|x| x.is_finite()) {
            Some(x) => *place = x,
            None if found >= least => break,
            None => return Err(format!("found \"{}\", expected {least} finite numbers", String::from_utf8_lossy(line))),
        }
        found += 1;
    }
    match found {
        n if n < least => Err(format!("found \"{}\", expected {least} finite numbers", String::from_utf8_lossy(line))),
        n => Ok(n),
    }
}

/// Reads one face's corners into `out`. Absolute indices are compared later, when all lines are counted.
fn face(
    corners: &[u8],
    counts: [u64; 3],
    line: u32,
    highest: &mut [(i64, u32); 3],
    out: &mut Vec<[u32; 3]>,
) -> std::result::Result<(), String> {
    let mut n = 0;
    for corner in corners.split(u8::is_ascii_whitespace).filter(|c| !c.is_empty()) {
        let shown = || String::from_utf8_lossy(corner).into_owned();
        let mut indices = [NONE; 3];
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
                return Err(format!("index {value} in \"{}\", but {} {} lines precede it", shown(), counts[k], NAMES[k]));
            }
            if value > highest[k].0 {
                highest[k] = (value, line);
            }
            // Negative ones count back from the last line so far.
            indices[k] = if value > 0 { value - 1 } else { counts[k] as i64 + value } as u32;
        }
        if indices[0] == NONE {
            return Err(format!("face corner \"{}\" has no position", shown()));
        }
        out.push(indices);
        n += 1;
    }
    if n >= 3 { Ok(()) } else { Err(format!("face of {n} corners, expected at least 3")) }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<Mesh> {
        parse(text.as_bytes(), Path::new("mesh.obj")).map(|file| file.mesh)
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
        let mesh = parse(&text, Path::new("mesh.obj")).unwrap().mesh;
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
