//! Primitives: triangles of one material, at rest.

use super::file::File;
use crate::Result;
use crate::base::math::Rgb;
use crate::scene::mesh::{self, Mesh};
use crate::scene::normals::cofactor;
use glam::{DMat4, Mat3, Mat4, Vec2, Vec3};
use gltf_json::accessor::Accessor;
use gltf_json::mesh::{Mode, Primitive, Semantic};
use gltf_json::skin::Skin;
use gltf_json::validation::Checked;
use gltf_json::{Index, Root};

/// A primitive's triangles, and what of its vertices not every mesh has.
#[derive(Default)]
pub struct Part {
    pub mesh: Mesh,
    pub colors: Vec<Rgb>,
    /// Texture coordinates for light maps.
    pub light_uvs: Vec<Vec2>,
}

/// The texture coordinates that programs lay out for light maps.
const LIGHT_SET: u32 = 1;

/// Reads a primitive with the texture coordinates of `set`; `None` where it has no triangles. `weights` are its morph targets'.
pub fn part(file: &File, primitive: &Primitive, set: u32, weights: &[f32]) -> Result<Option<Part>> {
    let attribute = |semantic: Semantic| primitive.attributes.get(&Checked::Valid(semantic)).copied();
    let Some(positions) = attribute(Semantic::Positions) else { return Ok(None) };
    let mut positions = vectors(file, positions, "positions")?;
    let mut normals = match attribute(Semantic::Normals) {
        Some(normals) => vectors(file, normals, "normals")?,
        None => Vec::new(),
    };
    let targets = primitive.targets.iter().flatten().zip(weights).filter(|(_, weight)| **weight != 0.0);
    for (target, &weight) in targets {
        move_by(file, target.positions, &mut positions, weight)?;
        move_by(file, target.normals, &mut normals, weight)?;
    }
    let coordinates = |set: u32| -> Result<Vec<Vec2>> {
        let Some(uvs) = attribute(Semantic::TexCoords(set)) else { return Ok(Vec::new()) };
        Ok(file.numbers::<2>(uvs, "texture coordinates")?.into_iter().map(Vec2::from).collect())
    };
    let uvs = coordinates(set)?;
    let light_uvs = if set == LIGHT_SET { Vec::new() } else { coordinates(LIGHT_SET)? };
    let colors = attribute(Semantic::Colors(0)).map(|colors| self::colors(file, colors)).transpose()?.unwrap_or_default();
    let corners = match primitive.indices {
        Some(indices) => file.indices(indices, "indices")?,
        None => (0..positions.len() as u32).collect(),
    };
    let Some(triangles) = triangles(&primitive.mode, &corners) else { return Ok(None) };
    let counts = [
        ("normals", normals.len()),
        ("texture coordinates", uvs.len()),
        ("second texture coordinates", light_uvs.len()),
        ("colours", colors.len()),
    ];
    for (what, count) in counts {
        if count != 0 && count != positions.len() {
            return Err(file.error(format!("a primitive has {count} {what} of {} vertices", positions.len())));
        }
    }
    let mesh = Mesh { positions, normals, uvs, triangles };
    mesh::check(&mesh).map_err(|e| file.error(e))?;
    Ok((!mesh.triangles.is_empty()).then_some(Part { mesh, colors, light_uvs }))
}

/// How many vertices a primitive says that it has, nothing of it read.
pub fn vertex_count(root: &Root, primitive: &Primitive) -> u64 {
    let positions = primitive.attributes.get(&Checked::Valid(Semantic::Positions));
    positions.and_then(|index| root.get(*index)).map_or(0, |accessor| accessor.count.0)
}

/// How many triangles a primitive says that it has, nothing of it read.
pub fn triangle_count(root: &Root, primitive: &Primitive) -> u64 {
    let corners = primitive.indices.and_then(|index| root.get(index)).map(|accessor| accessor.count.0);
    let corners = corners.unwrap_or_else(|| vertex_count(root, primitive));
    match primitive.mode {
        Checked::Valid(Mode::TriangleStrip | Mode::TriangleFan) => corners.saturating_sub(2),
        _ => corners / 3,
    }
}

fn vectors(file: &File, index: Index<Accessor>, what: &str) -> Result<Vec<Vec3>> {
    Ok(file.numbers::<3>(index, what)?.into_iter().map(Vec3::from).collect())
}

fn move_by(file: &File, by: Option<Index<Accessor>>, points: &mut [Vec3], weight: f32) -> Result<()> {
    let Some(by) = by else { return Ok(()) };
    for (point, offset) in points.iter_mut().zip(vectors(file, by, "morph targets")?) {
        *point += offset * weight;
    }
    Ok(())
}

fn colors(file: &File, index: Index<Accessor>) -> Result<Vec<Rgb>> {
    Ok(match file.components(index)? {
        4 => file.numbers::<4>(index, "colours")?.into_iter().map(|[r, g, b, _]| Rgb::new(r, g, b)).collect(),
        _ => vectors(file, index, "colours")?,
    })
}

/// Triangles of a list, a strip or a fan; `None` for points and lines.
fn triangles(mode: &Checked<Mode>, corners: &[u32]) -> Option<Vec<[u32; 3]>> {
    Some(match mode {
        Checked::Valid(Mode::Triangles) => corners.chunks_exact(3).map(|t| [t[0], t[1], t[2]]).collect(),
        Checked::Valid(Mode::TriangleStrip) => {
            let turned = |(i, t): (usize, &[u32])| if i % 2 == 0 { [t[0], t[1], t[2]] } else { [t[1], t[0], t[2]] };
            corners.windows(3).enumerate().map(turned).collect()
        }
        Checked::Valid(Mode::TriangleFan) => corners.get(1..)?.windows(2).map(|t| [corners[0], t[0], t[1]]).collect(),
        _ => return None,
    })
}

/// Moves a primitive's vertices with the joints of its skin, at rest. `placed` are the nodes' transforms to the world.
pub fn bend(file: &File, primitive: &Primitive, skin: &Skin, placed: &[DMat4], mesh: &mut Mesh) -> Result<()> {
    let inverse = match skin.inverse_bind_matrices {
        Some(index) => file.numbers::<16>(index, "inverse bind matrices")?,
        None => vec![Mat4::IDENTITY.to_cols_array(); skin.joints.len()],
    };
    let joint = |(joint, inverse): (&Index<_>, &[f32; 16])| {
        placed.get(joint.value()).map(|m| (*m * Mat4::from_cols_array(inverse).as_dmat4()).as_mat4())
    };
    let matrices: Option<Vec<Mat4>> = skin.joints.iter().zip(&inverse).map(joint).collect();
    let matrices = matrices.ok_or_else(|| file.error("a skin has joints that are no nodes"))?;
    let mut blended = vec![Mat4::ZERO; mesh.positions.len()];
    for set in 0.. {
        let attribute = |semantic: Semantic| primitive.attributes.get(&Checked::Valid(semantic)).copied();
        let (Some(joints), Some(weights)) = (attribute(Semantic::Joints(set)), attribute(Semantic::Weights(set))) else { break };
        let (joints, weights) = (file.whole::<4>(joints, "joints")?, file.numbers::<4>(weights, "weights")?);
        for (sum, (joints, weights)) in blended.iter_mut().zip(joints.iter().zip(&weights)) {
            for (&joint, &weight) in joints.iter().zip(weights).filter(|(_, weight)| **weight != 0.0) {
                let matrix = matrices.get(joint as usize);
                *sum +=
                    *matrix.ok_or_else(|| file.error(format!("a vertex hangs on joint {joint} of {}", matrices.len())))? * weight;
            }
        }
    }
    for (position, matrix) in mesh.positions.iter_mut().zip(&blended) {
        *position = matrix.transform_point3(*position);
    }
    for (normal, matrix) in mesh.normals.iter_mut().zip(&blended) {
        *normal = cofactor(Mat3::from_mat4(*matrix)) * *normal;
    }
    mesh::check(mesh).map_err(|e| file.error(e))
}

/// The triangles on which texture coordinates are not mirrored, and those on which they are, with the vertices that they use.
///
/// Seen from the front, u goes to the right and v down.
pub fn by_handedness(part: Part) -> [Part; 2] {
    let mesh = &part.mesh;
    let is_mirrored = |t: &[u32; 3]| {
        let [a, b, c] = t.map(|i| mesh.uvs.get(i as usize).copied().unwrap_or_default());
        (b - a).perp_dot(c - a) > 0.0
    };
    let (mirrored, upright): (Vec<_>, Vec<_>) = mesh.triangles.iter().partition(|t| is_mirrored(t));
    if mirrored.is_empty() || upright.is_empty() {
        return if mirrored.is_empty() { [part, Part::default()] } else { [Part::default(), part] };
    }
    [upright, mirrored].map(|triangles| some_of(&part, &triangles))
}

/// Some of a mesh's triangles, with the vertices that they use in their order.
fn some_of(part: &Part, triangles: &[[u32; 3]]) -> Part {
    let Mesh { positions, normals, uvs, .. } = &part.mesh;
    let mut number = vec![u32::MAX; positions.len()];
    triangles.iter().flatten().for_each(|&i| number[i as usize] = 0);
    let kept: Vec<usize> = (0..number.len()).filter(|&i| number[i] == 0).collect();
    kept.iter().enumerate().for_each(|(new, &old)| number[old] = new as u32);
    fn of<T: Copy>(list: &[T], kept: &[usize]) -> Vec<T> {
        if list.is_empty() { Vec::new() } else { kept.iter().map(|&i| list[i]).collect() }
    }
    let mesh = Mesh {
        positions: of(positions, &kept),
        normals: of(normals, &kept),
        uvs: of(uvs, &kept),
        triangles: triangles.iter().map(|t| t.map(|i| number[i as usize])).collect(),
    };
    Part { mesh, colors: of(&part.colors, &kept), light_uvs: of(&part.light_uvs, &kept) }
}
