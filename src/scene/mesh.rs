//! Shape plugins: each becomes a [`Mesh`], and [`append`] places it in the scene.
//!
//! Conventions are Mitsuba 3's: a mesh without vertex normals gets smooth ones unless it asks for face normals, and a
//! mirroring transform turns the normals that come from the winding but not those that the file gives.

pub mod normals;
pub mod obj;
pub mod ply;
pub mod primitives;
pub mod serialized;

use super::{Geometry, Object};
use glam::{Mat3, Mat4, Vec2, Vec3};

/// One shape's triangles in its own space, before they join the scene.
#[derive(Debug, Default, Clone)]
pub struct Mesh {
    /// Vertex positions.
    pub positions: Vec<Vec3>,
    /// Vertex normals, of any length; empty where the file has none.
    pub normals: Vec<Vec3>,
    /// Texture coordinates in Mitsuba's sense, v = 0 at a bitmap's first row; empty where the shape has none.
    pub uvs: Vec<Vec2>,
    /// Vertex indices.
    pub triangles: Vec<[u32; 3]>,
}

impl Mesh {
    /// Replaces v by 1 - v: what `flip_tex_coords` asks for. [`obj::load`] has done it once already, as Mitsuba does.
    pub fn flip_v(&mut self) {
        for uv in &mut self.uvs {
            uv.y = 1.0 - uv.y;
        }
    }
}

/// Places `mesh` in the scene as its next object.
///
/// Positions go through `to_world`, normals through its inverse transpose. Without `face_normals`, a mesh without normals
/// gets smooth ones from its placed triangles. `flip_normals` turns shading and geometric normals round.
///
/// Ours: where the file's normals are used and `to_world` mirrors, the winding is reversed too, so that geometric and
/// shading normals stay on one side. Mitsuba leaves the two opposed, but only ever asks the shading normal for a side.
/// Triangles without area keep their index; the BVH leaves them out.
#[expect(clippy::too_many_arguments, reason = "one call a shape plugin; the arguments are a shape's own properties")]
pub fn append(
    geometry: &mut Geometry,
    mesh: Mesh,
    to_world: Mat4,
    flip_normals: bool,
    face_normals: bool,
    name: String,
    material: u32,
    emitter: Option<u32>,
) {
    let Mesh { mut positions, normals, uvs, mut triangles } = mesh;
    let linear = Mat3::from_mat4(to_world);
    let file_normals = !face_normals && normals.len() == positions.len() && !normals.is_empty();
    for p in &mut positions {
        *p = to_world.transform_point3(*p);
    }
    let mirrored = linear.determinant() < 0.0;
    if flip_normals != (file_normals && mirrored) {
        for t in &mut triangles {
            t.swap(1, 2);
        }
    }
    let normals = if file_normals {
        let turn = normals::cofactor(linear) * (if mirrored { -1.0 } else { 1.0 }) * (if flip_normals { -1.0 } else { 1.0 });
        let mut given: Vec<Vec3> = normals.into_iter().map(|n| turn * n).collect();
        normals::normalize_or_smooth(&mut given, &positions, &triangles);
        given
    } else {
        normals::smooth(&positions, &triangles)
    };

    let (first_vertex, first_triangle) = (geometry.positions.len() as u32, geometry.triangles.len() as u32);
    let has_uvs = uvs.len() == positions.len() && !uvs.is_empty();
    let object = geometry.objects.len() as u32;
    geometry.positions.append(&mut positions);
    geometry.normals.extend(normals);
    geometry.uvs.extend(uvs);
    geometry.uvs.resize(geometry.positions.len(), Vec2::ZERO);
    geometry.triangles.extend(triangles.into_iter().map(|t| t.map(|i| i + first_vertex)));
    geometry.triangle_object.resize(geometry.triangles.len(), object);
    geometry.objects.push(Object {
        name,
        triangles: first_triangle..geometry.triangles.len() as u32,
        vertices: first_vertex..geometry.positions.len() as u32,
        material,
        emitter,
        face_normals,
        has_uvs,
    });
}

/// `Err` with what is wrong where a triangle asks for a vertex that is not there, or a number is not finite.
pub(crate) fn check(mesh: &Mesh) -> std::result::Result<(), String> {
    let count = mesh.positions.len();
    if let Some(i) = mesh.positions.iter().position(|p| !p.is_finite()) {
        return Err(format!("vertex {i} is {}, expected finite numbers", mesh.positions[i]));
    }
    if let Some(i) = mesh.normals.iter().position(|n| !n.is_finite()) {
        return Err(format!("normal {i} is {}, expected finite numbers", mesh.normals[i]));
    }
    if let Some(i) = mesh.uvs.iter().position(|uv| !uv.is_finite()) {
        return Err(format!("texture coordinate {i} is {}, expected finite numbers", mesh.uvs[i]));
    }
    if let Some((i, t)) = mesh.triangles.iter().enumerate().find(|(_, t)| t.iter().any(|&v| v as usize >= count)) {
        return Err(format!("triangle {i} has vertices {t:?}, but there are only {count} vertices"));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn triangle() -> Mesh {
        Mesh { positions: vec![Vec3::ZERO, Vec3::X, Vec3::new(1.0, 1.0, 0.5)], triangles: vec![[0, 1, 2]], ..Default::default() }
    }

    fn placed(mesh: Mesh, m: Mat4, flip: bool, face: bool) -> (Vec3, Vec3) {
        let mut g = Geometry::default();
        append(&mut g, mesh, m, flip, face, String::new(), 0, None);
        (g.area_normal(0).normalize(), g.normals[0])
    }

    /// The signs are what Mitsuba 3.9.1 answers for sh_frame.n of the same mesh.
    #[test]
    fn mirrors_turn_winding_normals_but_not_those_of_the_file() {
        let mirror = Mat4::from_scale(Vec3::new(-1.0, 1.0, 1.0));
        let with_normals = Mesh { normals: vec![Vec3::Z; 3], ..triangle() };
        for flip in [false, true] {
            let sign = if flip { -1.0 } else { 1.0 };
            let (ng, n) = placed(with_normals.clone(), mirror, flip, false);
            assert!(ng.z * sign > 0.5 && n.z * sign > 0.5, "{ng} {n}");
            let (ng, n) = placed(triangle(), mirror, flip, false);
            assert!(ng.z * sign < -0.5 && n.z * sign < -0.5, "{ng} {n}");
            let (ng, _) = placed(with_normals.clone(), mirror, flip, true);
            assert!(ng.z * sign < -0.5, "{ng}");
            let (ng, n) = placed(with_normals.clone(), Mat4::IDENTITY, flip, false);
            assert!(ng.z * sign > 0.5 && n.z * sign > 0.5, "{ng} {n}");
        }
    }

    #[test]
    fn normals_stay_perpendicular_under_uneven_scale() {
        let n = Vec3::new(0.0, -0.5, 1.0).normalize(); // of the plane through the triangle
        let mesh = Mesh { normals: vec![n; 3], ..triangle() };
        let m = Mat4::from_rotation_x(0.4) * Mat4::from_scale(Vec3::new(1.0, 3.0, 0.2));
        let (ng, n) = placed(mesh, m, false, false);
        assert!((ng - n).length() < 1e-5, "{ng} {n}");
    }

    #[test]
    fn objects_keep_their_ranges() {
        let mut g = Geometry::default();
        append(&mut g, primitives::cube(), Mat4::IDENTITY, false, false, "a".into(), 3, None);
        append(&mut g, triangle(), Mat4::IDENTITY, false, true, "b".into(), 4, Some(1));
        assert_eq!(g.objects[1].triangles, 12..13);
        assert_eq!(g.objects[1].vertices, 24..27);
        assert_eq!(g.triangles[12], [24, 25, 26]);
        assert_eq!(g.object(12).material, 4);
        assert!(g.objects[0].has_uvs && !g.objects[1].has_uvs && g.objects[1].face_normals);
        assert_eq!(g.uvs.len(), g.positions.len());
        assert_eq!(g.normals.len(), g.positions.len());
    }
}
