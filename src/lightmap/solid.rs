//! Closed surfaces whose inside nobody sees: a light map sample inside one is dark, and belongs to no picture.
//!
//! *Ours*: a solid is a connected part of an object, every edge of which joins exactly two triangles of one
//! orientation, and which holds neither the sensor nor an emitter (or else the room itself would be a solid).
//! A ray that meets the inner side of a solid first, started inside it.

use super::adjacency::{Adjacency, NONE, adjacency};
use crate::scene::{Emitter, Geometry, Scene};
use glam::{DVec3, Vec3};
use std::f64::consts::PI;

/// For each triangle: +1 where its winding faces out of a solid, -1 where it faces in, 0 where there is no solid.
pub type Orientation = Vec<i8>;

/// Marks the solids of one object in `orientation`; `occupied` are points that no solid may hold.
pub fn mark_solids(geometry: &Geometry, adjacency: &Adjacency, occupied: &[Vec3], orientation: &mut Orientation) {
    let count = adjacency.normals.len();
    let mut seen = vec![false; count];
    for start in 0..count {
        if seen[start] {
            continue;
        }
        seen[start] = true;
        let (mut part, mut closed) = (vec![start], true);
        let mut i = 0;
        while i < part.len() {
            let t = part[i];
            // A degenerate triangle has no neighbours: where it fills a gap, the surface counts as open.
            for &(next, _) in &adjacency.across[t] {
                let local = next.wrapping_sub(adjacency.first) as usize;
                if next == NONE {
                    closed = false;
                } else if !seen[local] {
                    seen[local] = true;
                    part.push(local);
                }
            }
            i += 1;
        }
        if !closed {
            continue;
        }
        let triangles: Vec<u32> = part.iter().map(|&t| adjacency.first + t as u32).collect();
        let bounds = triangles
            .iter()
            .flat_map(|&t| geometry.corners(t))
            .fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(lo, hi), p| (lo.min(p), hi.max(p)));
        let volume = volume(geometry, &triangles, bounds.0);
        let thin = 1e-6 * f64::from((bounds.1 - bounds.0).length()).powi(3);
        let holds =
            |p: &Vec3| p.cmpge(bounds.0).all() && p.cmple(bounds.1).all() && winding(geometry, &triangles, *p).abs() > 3.0 * PI;
        if volume.abs() <= thin || occupied.iter().any(holds) {
            continue;
        }
        for t in triangles {
            orientation[t as usize] = if volume > 0.0 { 1 } else { -1 };
        }
    }
}

/// Signed volume inside a closed surface: positive where the winding faces out.
fn volume(geometry: &Geometry, triangles: &[u32], origin: Vec3) -> f64 {
    let six: f64 = triangles
        .iter()
        .map(|&t| {
            let [a, b, c] = geometry.corners(t).map(|p| (p - origin).as_dvec3());
            a.dot(b.cross(c))
        })
        .sum();
    six / 6.0
}

/// Solid angle of a closed surface from `p`: ±4π inside, 0 outside, ±2π on it (van Oosterom and Strackee 1983).
fn winding(geometry: &Geometry, triangles: &[u32], p: Vec3) -> f64 {
    triangles
        .iter()
        .map(|&t| {
            let [a, b, c] = geometry.corners(t).map(|q| DVec3::from(q - p));
            let (la, lb, lc) = (a.length(), b.length(), c.length());
            let denominator = la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb;
            2.0 * a.dot(b.cross(c)).atan2(denominator)
        })
        .sum()
}

/// The solids of a scene. Masked objects have holes and transmissive ones let light in: they are none.
pub(super) fn solids(scene: &Scene) -> Orientation {
    let geometry = &scene.geometry;
    let mut occupied: Vec<Vec3> = scene.sensor.iter().map(|s| s.position()).collect();
    for emitter in &scene.emitters {
        match emitter {
            Emitter::Area { object, .. } => {
                let Some(o) = geometry.objects.get(*object as usize) else { continue };
                // Points just before the emitting side, so that a lamp's own surface does not hold them.
                for t in o.triangles.clone().step_by(o.triangles.len().div_ceil(16).max(1)) {
                    let [a, b, c] = geometry.corners(t);
                    let n = geometry.area_normal(t);
                    occupied.push((a + b + c) / 3.0 + n.normalize_or_zero() * (1e-3 * n.length().sqrt()));
                }
            }
            Emitter::Point { position, .. } | Emitter::Spot { position, .. } | Emitter::Projector { position, .. } => {
                occupied.push(*position)
            }
            Emitter::Envmap { .. } | Emitter::Constant { .. } | Emitter::Sun { .. } | Emitter::Directional { .. } => {}
        }
    }
    let mut orientation = vec![0; geometry.triangles.len()];
    for (i, o) in geometry.objects.iter().enumerate() {
        let material = &scene.materials[o.material as usize];
        if material.opacity.is_none() && !material.bsdf.is_transmissive() {
            mark_solids(geometry, &adjacency(geometry, i), &occupied, &mut orientation);
        }
    }
    orientation
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lightmap::adjacency::adjacency;
    use crate::lightmap::testing;

    fn orientation(g: &Geometry, occupied: &[Vec3]) -> Orientation {
        let mut out = vec![0; g.triangles.len()];
        for o in 0..g.objects.len() {
            mark_solids(g, &adjacency(g, o), occupied, &mut out);
        }
        out
    }

    #[test]
    fn closed_boxes_are_solid_and_sheets_and_rooms_are_not() {
        let mut g = Geometry::default();
        testing::cuboid(&mut g, Vec3::splat(1.0), Vec3::splat(2.0));
        testing::sphere(&mut g, Vec3::ZERO, 0.5, 8);
        testing::quad(&mut g, Vec3::ZERO, Vec3::X, Vec3::Z);
        testing::doubled_sheet(&mut g);
        // The room, inside out, with the sensor in it.
        testing::cuboid(&mut g, Vec3::splat(9.0), Vec3::splat(-9.0));
        let found = orientation(&g, &[Vec3::new(3.0, 3.0, 3.0)]);
        for (o, expected) in g.objects.iter().zip([1, 1, 0, 0, 0]) {
            for t in o.triangles.clone() {
                assert_eq!(found[t as usize], expected, "{}", o.name);
            }
        }
        // Nobody in the room: it is a solid, and what it encloses lies in the dark.
        assert_eq!(orientation(&g, &[]).last(), Some(&-1));
    }

    #[test]
    fn a_box_without_a_lid_is_open() {
        let mut g = Geometry::default();
        testing::cuboid(&mut g, Vec3::ZERO, Vec3::ONE);
        g.triangles.truncate(10);
        g.objects[0].triangles = 0..10;
        assert!(orientation(&g, &[]).iter().all(|&o| o == 0));
    }
}
