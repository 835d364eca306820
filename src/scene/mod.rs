//! A scene as the stages see it: world-space triangles, materials, emitters and the sensor.

pub mod animation;
pub mod camera;
pub mod camera_path;
pub mod emitter;
pub mod film;
pub mod geometry;
pub mod hash;
pub mod mesh;
pub mod normals;
pub mod primitives;
pub mod round;
pub mod spline;
pub mod summary;
pub mod units;

use crate::material::bsdf::Bsdf;
use crate::material::{Material, Surface};
use std::path::PathBuf;
use std::sync::Arc;

pub use animation::Animation;
pub use camera::Camera;
pub use emitter::Emitter;
pub use geometry::{Geometry, Object};
pub use round::Round;

/// A loaded scene. Everything is in world space and metres: the file's units times [`Self::unit_scale`].
#[derive(Debug, Default, Clone)]
pub struct Scene {
    /// All triangles of all shapes; scenes that differ in light or materials alone share them.
    pub geometry: Arc<Geometry>,
    /// Materials; `Object::material` indexes them.
    pub materials: Vec<Material>,
    /// Emitters; `Object::emitter` indexes the area lights among them.
    pub emitters: Vec<Emitter>,
    /// The scene file's own sensor.
    pub sensor: Option<Camera>,
    /// The filter of the sensor's film.
    pub film_filter: film::FilmFilter,
    /// The integrator's `max_depth`, in Mitsuba's counting (1: emission only); `None` is unbounded.
    pub max_depth: Option<u32>,
    /// Where the scene says so, as file:line.
    pub max_depth_at: String,
    /// The integrator's `rr_depth`, after which Russian roulette starts; `None` where the scene gives none.
    pub rr_depth: Option<u32>,
    /// The integrator's `hide_emitters`: cameras see past area lights, and no environment.
    pub hide_emitters: bool,
    /// What the file's lengths were multiplied by; those of a camera path must be, too.
    pub unit_scale: units::UnitScale,
    /// [`hash::content`]: what provenance compares.
    pub hash: String,
    /// The file that was loaded.
    pub path: PathBuf,
    /// What was odd but no error: unknown properties, say. One line each, with file and line.
    pub warnings: Vec<String>,
}

impl Scene {
    /// The triangles, to be changed: copied first where another scene has them too.
    pub fn geometry_mut(&mut self) -> &mut Geometry {
        Arc::make_mut(&mut self.geometry)
    }

    /// How a surface of this scene scatters light.
    #[inline]
    pub fn bsdf(&self, surface: &Surface) -> &Bsdf {
        &self.materials[surface.material as usize].bsdf
    }
}
