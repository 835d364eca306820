//! Lights that a file adds to a scene.

use super::track::Track;
use crate::material::Texture;
use crate::scene::mesh::append;
use crate::scene::{Emitter, Geometry, primitives};
use glam::{DMat3, DMat4, DVec3};

/// A light. Positions are in the file's units, angles in degrees.
#[derive(Debug, Clone)]
pub enum Light {
    /// A point.
    Point {
        /// Where it is.
        position: Track,
        /// W/sr in all directions.
        intensity: Track,
    },
    /// A cone.
    Spot {
        /// Its tip.
        position: Track,
        /// A point of its axis.
        target: Track,
        /// W/sr on the axis.
        intensity: Track,
        /// Angle where the light ends.
        cutoff: Track,
        /// Angle up to which it is full; three quarters of the cutoff where there is none, as in Mitsuba.
        beam: Option<Track>,
    },
    /// Parallel light.
    Directional {
        /// Which way it goes; of any length.
        direction: Track,
        /// W/m² on a facing surface.
        irradiance: Track,
    },
    /// A rectangle.
    Area {
        /// Its middle.
        position: Track,
        /// Where it shines to.
        target: Track,
        /// Which way its height goes.
        up: Track,
        /// Width and height.
        size: Track,
        /// W/(m² sr) to the side of the target.
        radiance: Track,
    },
}

impl Light {
    /// Where it looks at a time: unit axes across, up and forward, as Mitsuba's `lookat` has them.
    ///
    /// # Errors
    /// It looks nowhere.
    pub fn frame(&self, time: f64) -> Result<DMat3, String> {
        let (forward, up) = match self {
            Self::Point { .. } => (DVec3::Z, DVec3::Y),
            Self::Directional { direction, .. } => (direction.at(time), DVec3::ZERO),
            Self::Spot { position, target, .. } => (target.at(time) - position.at(time), DVec3::ZERO),
            Self::Area { position, target, up, .. } => (target.at(time) - position.at(time), up.at(time)),
        };
        let z = forward.try_normalize().ok_or(match self {
            Self::Directional { .. } => "the direction has no length",
            _ => "position and target are the same",
        })?;
        let x = match self {
            // A milliradian: nearer than that, the direction of "up" is rounding.
            Self::Area { .. } => up
                .try_normalize()
                .map(|up| up.cross(z))
                .filter(|x| x.length() > 1e-3)
                .ok_or_else(|| format!("up {up} is parallel to the way to the target, or zero"))?
                .normalize(),
            _ => z.any_orthonormal_vector(),
        };
        Ok(DMat3::from_cols(x, z.cross(x), z))
    }

    /// Times of the keys of where it looks; none where that does not change.
    pub fn key_times(&self) -> Vec<f64> {
        let tracks: Vec<&Track> = match self {
            Self::Point { .. } => vec![],
            Self::Spot { position, target, .. } => vec![position, target],
            Self::Directional { direction, .. } => vec![direction],
            Self::Area { position, target, up, .. } => vec![position, target, up],
        };
        tracks.into_iter().filter(|t| t.moves()).flat_map(|t| t.times().iter().copied()).collect()
    }

    /// Vertices and triangles that it adds.
    pub fn size(&self) -> [usize; 2] {
        if matches!(self, Self::Area { .. }) { [4, 2] } else { [0; 2] }
    }

    /// The emitter at a time, in metres, and its rectangle in `geometry` with a `material` that reflects nothing. `index` is the emitter's own.
    pub fn add(
        &self,
        time: f64,
        unit_scale: f32,
        geometry: &mut Geometry,
        (name, material, index): (String, u32, u32),
    ) -> Emitter {
        let metres = |position: &Track| (position.at(time) * f64::from(unit_scale)).as_vec3();
        // Lengths grow by the unit scale; so must intensities, for the same irradiance.
        let watts = |intensity: &Track| intensity.color(time) * (unit_scale * unit_scale);
        // That it has one at all frames was checked when it was loaded.
        let frame = self.frame(time).unwrap_or(DMat3::IDENTITY);
        match self {
            Self::Point { position, intensity } => Emitter::Point { position: metres(position), intensity: watts(intensity) },
            Self::Spot { position, intensity, cutoff, beam, .. } => {
                let cutoff = cutoff.number(time);
                let beam = beam.as_ref().map_or(0.75 * cutoff, |b| b.number(time)).min(cutoff);
                Emitter::Spot {
                    position: metres(position),
                    direction: frame.z_axis.as_vec3(),
                    intensity: watts(intensity),
                    cutoff_rad: (cutoff as f32).to_radians(),
                    beam_rad: (beam as f32).to_radians(),
                    pattern: None,
                }
            }
            Self::Directional { irradiance, .. } => {
                Emitter::Directional { direction: frame.z_axis.as_vec3(), irradiance: irradiance.color(time) }
            }
            Self::Area { position, size, radiance, .. } => {
                let object = geometry.objects.len() as u32;
                let half = (0.5 * size.at(time)).with_z(1.0);
                let placed = DMat4::from_translation(position.at(time)) * DMat4::from_mat3(frame) * DMat4::from_scale(half);
                let to_world = DMat4::from_scale(DVec3::splat(unit_scale.into())) * placed;
                append(geometry, primitives::rectangle(), to_world.as_mat4(), false, false, name, material, Some(index));
                Emitter::Area { object, radiance: Texture::Constant(radiance.color(time)) }
            }
        }
    }
}
