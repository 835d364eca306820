//! Spheres, cylinders and disks: where they stand, and how fine a mesh each gets.

use super::Builder;
use crate::Result;
use crate::base::math::Basis;
use crate::exchange::mitsuba::params::Params;
use crate::exchange::mitsuba::tree::{Kind, Node, Value};
use crate::scene::round::RoundKind;
use crate::scene::{Round, primitives};
use glam::{DAffine3, DMat3, DMat4, DVec3, Vec3};
use std::collections::BTreeMap;

/// Triangles that all round shapes of a scene may have together before they count as a crowd. *Ours*: sixteen fine spheres. A fine
/// sphere costs some 5 MB and 8 ms; in a crowd, meshes are coarse, and rays meet the shapes themselves.
const FINE_TRIANGLES: u64 = 16 * 16_128;

/// How finely each round shape of a crowd is cut, by its place in memory; empty where all have fine meshes.
pub(super) type Crowd = BTreeMap<*const Node, [u32; 2]>;

impl<'a> Builder<'a> {
    /// Shares [`FINE_TRIANGLES`] out by area where fine meshes would take more.
    pub(super) fn crowd(&self) -> Crowd {
        let mut found = Vec::new();
        for child in self.children {
            let Value::Plugin(node) = &child.value else { continue };
            if node.kind != Kind::Shape {
                continue;
            }
            // What is wrong with it is told when it is built.
            if let Ok(Some((kind, to_world))) = self.round_space(&mut self.params(node)) {
                found.push((node, kind, kind.area(&DMat3::from_mat4(to_world))));
            }
        }
        let all: u64 = found.iter().map(|(_, kind, _)| u64::from(fine(*kind).0)).sum();
        if all <= FINE_TRIANGLES {
            return Crowd::new();
        }
        let total: f64 = found.iter().map(|(_, _, area)| area).sum();
        let share = |area: f64| (area / total * FINE_TRIANGLES as f64).clamp(0.0, 1e6);
        found.into_iter().map(|(node, kind, area)| (node as *const Node, kind.cells(share(area), fine(kind).1))).collect()
    }

    /// A round shape's kind, and the map from its own space to the world; `None` for other shapes.
    pub(super) fn round_space(&self, p: &mut Params<'a>) -> Result<Option<(RoundKind, DMat4)>> {
        let (kind, local) = match p.node.plugin.as_str() {
            "sphere" => {
                let center = p.vector("center")?.unwrap_or(Vec3::ZERO).as_dvec3();
                let radius = f64::from(p.positive("radius", 1.0)?);
                (RoundKind::Sphere, DMat4::from_translation(center) * DMat4::from_scale(DVec3::splat(radius)))
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
