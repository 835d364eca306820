//! Spheres, cylinders and disks: where they stand, and how fine a mesh each gets.

use super::Builder;
use super::group::MAX_SHAPES;
use crate::Result;
use crate::base::math::Basis;
use crate::exchange::mitsuba::params::Params;
use crate::exchange::mitsuba::tree::{Kind, MAX_DEPTH, Node, Value};
use crate::scene::round::RoundKind;
use crate::scene::{Round, primitives};
use glam::{DAffine3, DMat3, DMat4, DVec3, Vec3};
use std::collections::BTreeMap;

/// Triangles that all round shapes of a scene may have together before they count as a crowd. *Ours*: sixteen fine spheres. A fine
/// sphere costs some 5 MB and 8 ms; in a crowd, meshes are coarse, and rays meet the shapes themselves.
const FINE_TRIANGLES: u64 = 16 * 16_128;

/// How finely each round shape of a crowd is cut, by its place in memory; empty where all have fine meshes.
pub(super) type Crowd = BTreeMap<*const Node, [u32; 2]>;

/// A round shape of the file, and its copies.
struct Rounds {
    kind: RoundKind,
    /// Of all copies together.
    area: f64,
    count: u64,
}

impl<'a> Builder<'a> {
    /// Shares [`FINE_TRIANGLES`] out by area where fine meshes would take more.
    pub(super) fn crowd(&self) -> Crowd {
        let mut found = BTreeMap::new();
        let mut visited = 0;
        for child in self.children {
            if let Value::Plugin(node) = &child.value {
                self.rounds(node, &DMat3::IDENTITY, 0, &mut visited, &mut found);
            }
        }
        let all: u64 = found.values().map(|r: &Rounds| r.count * u64::from(fine(r.kind).0)).sum();
        if all <= FINE_TRIANGLES {
            return Crowd::new();
        }
        let total: f64 = found.values().map(|r| r.area).sum();
        let share = |r: &Rounds| (r.area / r.count as f64 / total * FINE_TRIANGLES as f64).clamp(0.0, 1e6);
        found.into_iter().map(|(node, r)| (node, r.kind.cells(share(&r), fine(r.kind).1))).collect()
    }

    /// Counts the round shapes of a shape, within groups and as often as they are instanced.
    fn rounds(
        &self,
        node: &'a Node,
        outer: &DMat3,
        depth: usize,
        visited: &mut usize,
        found: &mut BTreeMap<*const Node, Rounds>,
    ) {
        *visited += 1;
        if node.kind != Kind::Shape || depth > MAX_DEPTH || *visited > MAX_SHAPES {
            return;
        }
        // What is wrong with any of them is told when it is built.
        let mut params = self.params(node);
        let mut within = |outer: &DMat3, node| {
            for part in self.params(node).children(Kind::Shape).unwrap_or_default() {
                self.rounds(part, outer, depth + 1, visited, found);
            }
        };
        match node.plugin.as_str() {
            // Seen through its instances alone.
            "shapegroup" => {}
            "merge" => within(outer, node),
            "instance" => {
                let Ok(to_world) = params.transform("to_world") else { return };
                let outer = *outer * DMat3::from_mat4(to_world);
                for group in params.children(Kind::Shape).unwrap_or_default() {
                    within(&outer, group);
                }
            }
            _ => {
                let Ok(Some((kind, to_world))) = self.round_space(&mut params) else { return };
                let rounds = found.entry(node as *const Node).or_insert(Rounds { kind, area: 0.0, count: 0 });
                rounds.area += kind.area(&(*outer * DMat3::from_mat4(to_world)));
                rounds.count += 1;
            }
        }
    }

    /// A round shape's kind, and the map from its own space to the world; `None` for other shapes.
    pub(super) fn round_space(&self, p: &mut Params<'a>) -> Result<Option<(RoundKind, DMat4)>> {
        let (kind, local) = match p.node.plugin.as_str() {
            "sphere" => {
                let (center, radius) = sphere(p)?;
                let local = DMat4::from_translation(center) * DMat4::from_scale(DVec3::splat(radius));
                return Ok(Some((RoundKind::Sphere, uniform(&self.placed(p)?) * local)));
            }
            "cylinder" => {
                let (p0, p1, radius) = cylinder(p)?;
                let frame = Basis::from_normal((p1 - p0).normalize());
                let axes = DMat3::from_cols(frame.s.as_dvec3() * radius, frame.t.as_dvec3() * radius, (p1 - p0).as_dvec3());
                (RoundKind::Cylinder, DMat4::from(DAffine3 { matrix3: axes, translation: p0.as_dvec3() }))
            }
            "disk" => (RoundKind::Disk, DMat4::IDENTITY),
            _ => return Ok(None),
        };
        Ok(Some((kind, self.placed(p)? * local)))
    }
}

/// The middle and the radius of a sphere; a radius below 0 turns it inside out.
pub(super) fn sphere(p: &mut Params) -> Result<(DVec3, f64)> {
    let radius = p.f32("radius", 1.0)?;
    if radius == 0.0 {
        return Err(p.at("radius").error("radius = 0: expected another number"));
    }
    Ok((p.vector("center")?.unwrap_or(Vec3::ZERO).as_dvec3(), f64::from(radius.abs())))
}

/// As Mitsuba takes a sphere's transform: of its scales that along x counts in all directions.
pub(super) fn uniform(to_world: &DMat4) -> DMat4 {
    if !is_stretched(to_world) {
        return *to_world;
    }
    let [x, y, z] = [0, 1, 2].map(|k| to_world.col(k).truncate());
    let side = DMat3::from_cols(x, y, z).determinant().signum();
    let across = (y - x * (x.dot(y) / x.length_squared())).normalize_or(x.any_orthogonal_vector().normalize());
    let axes = DMat3::from_cols(x.normalize(), across, x.normalize().cross(across) * side) * x.length();
    DMat4::from(DAffine3 { matrix3: axes, translation: to_world.col(3).truncate() })
}

/// Whether a transform makes something else than a sphere of a sphere.
pub(super) fn is_stretched(to_world: &DMat4) -> bool {
    let m = DMat3::from_mat4(*to_world);
    let square = m.transpose() * m;
    !square.abs_diff_eq(DMat3::from_diagonal(DVec3::splat(square.x_axis.x)), 1e-4 * square.x_axis.x)
}

/// The ends and the radius of a cylinder.
pub(super) fn cylinder(p: &mut Params) -> Result<(Vec3, Vec3, f64)> {
    let (p0, p1) = (p.vector("p0")?.unwrap_or(Vec3::ZERO), p.vector("p1")?.unwrap_or(Vec3::Z));
    if p0 == p1 {
        return Err(p.at("p1").error("cylinder: p0 and p1 are the same point"));
    }
    Ok((p0, p1, f64::from(p.positive("radius", 1.0)?)))
}

/// Triangles of a fine mesh, and its parts of a turn.
fn fine(kind: RoundKind) -> (u32, u32) {
    let [around, along] = match kind {
        RoundKind::Sphere => primitives::SPHERE.into(),
        RoundKind::Cylinder => [primitives::CYLINDER, 1],
        RoundKind::Disk => primitives::DISK.into(),
    };
    let poles = match kind {
        RoundKind::Sphere => 2,
        RoundKind::Cylinder => 0,
        RoundKind::Disk => 1,
    };
    (around * (2 * along - poles), around)
}

/// The round shape of a crowd whose coarse mesh, cut into `cells`, is the next to be placed by `to_world`.
pub(super) fn described(kind: RoundKind, to_world: DMat4, cells: [u32; 2], inwards: bool, first: u32, object: u32) -> Round {
    let to_world = DAffine3::from_mat4(to_world);
    // As `mesh::append` turns the triangles of a mesh with normals.
    let turned = inwards != (to_world.matrix3.determinant() < 0.0);
    Round { kind, to_world, to_local: to_world.inverse(), inwards, object, first, turned, cells }
}
