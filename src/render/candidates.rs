//! What the search over a probe's texels compares, made ready: a candidate is one record to read, without arithmetic.

use super::gather::{Reflection, WeightedProbe};
use crate::probe::file::{NO_TRIANGLE, Probe, Texel};
use crate::scene::Geometry;
use glam::Vec3;
use rayon::prelude::*;
use std::collections::BTreeMap;

/// [`Candidate::material`] and [`Candidate::object`] of a texel that sees no surface.
pub const NO_SURFACE: u32 = u32::MAX;

/// A texel of a probe, as the gather sees it.
#[derive(Debug, Clone, Copy)]
#[repr(align(16))]
pub struct Candidate {
    /// What the energy compares.
    pub reflection: Reflection,
    /// Material of the reflector.
    pub material: u32,
    /// Object of the reflector.
    pub object: u32,
}

/// The candidates of a probe, one a texel.
pub fn candidates(geometry: &Geometry, probe: &Probe) -> Vec<Candidate> {
    let width = probe.size[0] as usize;
    probe.texels.par_iter().with_min_len(width).map(|texel| candidate(geometry, texel, probe.position)).collect()
}

fn candidate(geometry: &Geometry, texel: &Texel, eye: Vec3) -> Candidate {
    let reflected = texel.reflected();
    if texel.triangle == NO_TRIANGLE {
        let reflection = Reflection { normal: Vec3::ZERO, direction: Vec3::ZERO, reflected };
        return Candidate { reflection, material: NO_SURFACE, object: NO_SURFACE };
    }
    let (position, normal) = reflector(geometry, texel, eye);
    let object = geometry.triangle_object[texel.triangle as usize];
    Candidate {
        reflection: Reflection { normal, direction: reflected.direction_from(position), reflected },
        material: geometry.objects[object as usize].material,
        object,
    }
}

/// r_p and n_p of a texel: position, and shading normal facing the probe.
fn reflector(geometry: &Geometry, texel: &Texel, eye: Vec3) -> (Vec3, Vec3) {
    let b = texel.barycentric();
    let weights = [1.0 - b.x - b.y, b.x, b.y];
    let [i, j, k] = geometry.triangles[texel.triangle as usize].map(|v| v as usize);
    let mix = |v: &[Vec3]| v[i] * weights[0] + v[j] * weights[1] + v[k] * weights[2];
    let position = mix(&geometry.positions);
    let ng = geometry.area_normal(texel.triangle);
    let n = if geometry.object(texel.triangle).face_normals { ng } else { mix(&geometry.normals) };
    let n = n.try_normalize().unwrap_or(Vec3::Y);
    let eye_side = ng.dot(eye - position) * ng.dot(n);
    (position, if eye_side < 0.0 { -n } else { n })
}

/// The candidates of the probes around the camera, for as long as they are around it: quickly made, and twice the probe's memory.
#[derive(Default)]
pub struct NearCandidates(BTreeMap<usize, Vec<Candidate>>);

impl NearCandidates {
    /// The probes `near` the camera (index, probe, weight), ready for the gather. Makes the candidates that are missing, and drops
    /// those of all other probes.
    pub fn of<'a>(&'a mut self, geometry: &Geometry, near: &[(usize, &'a Probe, f32)]) -> Vec<WeightedProbe<'a>> {
        self.0.retain(|index, _| near.iter().any(|(i, ..)| i == index));
        for &(index, probe, _) in near {
            self.0.entry(index).or_insert_with(|| candidates(geometry, probe));
        }
        let of = |&(index, probe, weight)| WeightedProbe { index, probe, candidates: &self.0[&index], weight };
        near.iter().map(of).collect()
    }
}
