//! From a resolution map to a probe's parameterisation (§4.2.2).

use super::quasi_harmonic::Solver;
use crate::probe::parameter_map::ParameterMap;
use crate::{Error, Result};
use serde::{Deserialize, Serialize};

/// Parameters of the parameterisation.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct QhmapParams {
    /// Width and height of the probes, texels. *Paper* (§7): 1024 x 512.
    pub size: [u32; 2],
    /// Added to m, in units of its mean: bounds how far directions without need are compressed, and keeps the system
    /// regular where m is 0. *Ours*.
    pub epsilon: f32,
    /// Plain lat-long, whatever the resolution map asks for (Fig. 12).
    #[serde(default, skip_serializing_if = "is_false")]
    pub lat_long: bool,
}

#[allow(clippy::trivially_copy_pass_by_ref, reason = "serde's signature")]
fn is_false(b: &bool) -> bool {
    !b
}

impl Default for QhmapParams {
    fn default() -> Self {
        Self { size: [1024, 512], epsilon: 0.01, lat_long: false }
    }
}

impl QhmapParams {
    /// Refuses what [`parameter_map`] cannot work with.
    pub fn validate(&self) -> Result<()> {
        let [w, h] = self.size;
        if w < 2 || h < 2 || w > 16384 || h > 16384 {
            return Err(Error::Request(format!("probes of {w}x{h} texels: expected from 2 to 16384 each way")));
        }
        if !(1e-6..=1e3).contains(&self.epsilon) {
            return Err(Error::Request(format!("epsilon {}: expected 0.000001 to 1000 times the mean of m", self.epsilon)));
        }
        Ok(())
    }
}

/// The parameterisation for a resolution map `m` of the solver's size, and the epsilon that it took. `params` are valid.
pub fn parameter_map(solver: &mut Solver, m: &[f32], params: &QhmapParams) -> Result<(ParameterMap, f32)> {
    if params.lat_long {
        return Ok((ParameterMap::identity(params.size), params.epsilon));
    }
    let forward = solver.forward_map(m, params.epsilon)?;
    Ok((ParameterMap::from_forward(solver.mesh(), forward.vertices, params.size), forward.epsilon))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::math::{direction_from_lat_long, hash_words};
    use crate::io::Provenance;
    use glam::Vec2;

    fn random(seed: u32, i: u32) -> f32 {
        hash_words(&[seed, i]) as f32 / u32::MAX as f32
    }

    /// Two glossy patches, one across the seam, and nothing elsewhere.
    fn patches(mesh: [u32; 2]) -> Vec<f32> {
        (0..mesh[0] * mesh[1])
            .map(|i| {
                let u = (i % mesh[0]) as f32 / mesh[0] as f32;
                let v = (i / mesh[0]) as f32 / mesh[1] as f32;
                let bump = |cu: f32, cv: f32, s: f32| {
                    let du = (u - cu + 0.5).rem_euclid(1.0) - 0.5;
                    (-(du * du * 4.0 + (v - cv) * (v - cv)) / (2.0 * s * s)).exp()
                };
                3.0 * bump(0.02, 0.7, 0.08) + bump(0.6, 0.4, 0.05)
            })
            .collect()
    }

    fn adapted() -> ParameterMap {
        let mesh = [64, 32];
        let forward = Solver::new(mesh).unwrap().forward_map(&patches(mesh), 0.01).unwrap();
        ParameterMap::from_forward(mesh, forward.vertices, [256, 128])
    }

    fn wrapped(d: Vec2, width: f32) -> Vec2 {
        Vec2::new((d.x + width * 0.5).rem_euclid(width) - width * 0.5, d.y)
    }

    #[test]
    fn identity_is_plain_lat_long() {
        let map = ParameterMap::identity([64, 32]);
        for i in 0..1000 {
            let texel = Vec2::new(random(1, i) * 64.0, random(2, i) * 32.0);
            let d = direction_from_lat_long(texel / Vec2::new(64.0, 32.0));
            assert!(wrapped(map.texel_from_direction(d) - texel, 64.0).length() < 2e-3, "texel {texel}");
            assert!((map.direction_from_texel(texel) - d).length() < 1e-5, "texel {texel}");
            assert_eq!(map.search_scale(texel), Vec2::ONE);
        }
    }

    #[test]
    fn forward_undoes_inverse_at_every_texel_centre() {
        let map = adapted();
        let mut worst = 0f32;
        for y in 0..128 {
            for x in 0..256 {
                let centre = Vec2::new(x as f32, y as f32) + 0.5;
                let back = map.forward_at(map.inverse[y * 256 + x]) * Vec2::new(256.0, 128.0);
                worst = worst.max((back - centre).length());
                let seen = map.texel_from_direction(map.direction_from_texel(centre));
                assert!(wrapped(seen - centre, 256.0).length() < 0.5, "{centre} -> {seen}");
            }
        }
        assert!(worst < 1e-3, "exact but for f32: {worst} texels");
    }

    #[test]
    fn directions_round_trip_within_half_a_texel() {
        let map = adapted();
        for i in 0..20_000 {
            let texel = Vec2::new(random(3, i) * 256.0, random(4, i) * 128.0);
            let back = map.texel_from_direction(map.direction_from_texel(texel));
            let error = wrapped(back - texel, 256.0).abs().max_element();
            assert!(error < 0.5, "{texel} -> {back}");
        }
    }

    #[test]
    fn forward_keeps_the_unwrapped_turn_and_the_seam_is_continuous() {
        let map = adapted();
        for i in 0..100 {
            let v = random(5, i);
            let (left, right) = (map.forward_at(Vec2::new(0.0, v)), map.forward_at(Vec2::new(1.0 - 1e-7, v)));
            assert!((right - left - Vec2::X).length() < 1e-4, "v = {v}");
            let u = random(6, i);
            assert!((map.forward_at(Vec2::new(u - 1.0, v)) + Vec2::X - map.forward_at(Vec2::new(u, v))).length() < 1e-5);
        }
    }

    #[test]
    fn search_steps_cover_the_same_angle_where_the_map_magnifies() {
        let map = adapted();
        let size = Vec2::new(256.0, 128.0);
        for i in 0..2000 {
            let texel = Vec2::new(random(7, i) * 254.0 + 1.0, random(8, i) * 126.0 + 1.0).floor();
            // Texel coordinates between the four texels that one stored derivative stands for.
            let texel = (texel / 2.0).floor() * 2.0 + 1.0;
            let scale = map.search_scale(texel);
            for (axis, s) in [(Vec2::X, scale.x), (Vec2::Y, scale.y)] {
                let (a, b) = (map.lat_long_from_texel(texel - axis * 0.5), map.lat_long_from_texel(texel + axis * 0.5));
                let step = ((b - a) * size).length();
                // Differences across a quad's edge see both sides of a kink.
                assert!((step * s - 1.0).abs() < 0.35, "texel {texel}: a step of {step} lat-long texels, scale {s}");
            }
        }
        let magnified = map.texel_from_direction(direction_from_lat_long(Vec2::new(0.02, 0.7)));
        assert!(map.search_scale(magnified).min_element() > 1.5, "{}", map.search_scale(magnified));
    }

    #[test]
    fn a_map_survives_its_files() {
        let dir = tempfile::tempdir().unwrap();
        let provenance = Provenance::new("qhmap", "abc", 0, &1);
        let map = adapted();
        map.save(dir.path(), 7, &provenance).unwrap();
        let (back, from) = ParameterMap::load(dir.path(), 7).unwrap();
        assert_eq!(from, provenance);
        assert_eq!((back.mesh, back.size, &back.forward, &back.inverse), (map.mesh, map.size, &map.forward, &map.inverse));
        assert_eq!(back.derivative, map.derivative);
    }

    #[test]
    fn flipped_or_missing_data_is_an_error() {
        let dir = tempfile::tempdir().unwrap();
        let provenance = Provenance::new("qhmap", "abc", 0, &1);
        let mut map = adapted();
        map.forward.swap(100, 101);
        map.save(dir.path(), 0, &provenance).unwrap();
        let message = ParameterMap::load(dir.path(), 0).unwrap_err().to_string();
        assert!(message.contains("flipped"), "{message}");
        map = adapted();
        map.inverse[5].x = f32::NAN;
        map.save(dir.path(), 0, &provenance).unwrap();
        let message = ParameterMap::load(dir.path(), 0).unwrap_err().to_string();
        assert!(message.contains("inverse.U") && message.contains("pixel 5"), "{message}");
    }
}
