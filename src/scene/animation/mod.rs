//! Lights, materials and objects that change from frame to frame, and the scene of each frame.
//!
//! What a file says of them is read by [`crate::exchange::animation`].

pub mod light;
pub mod object;
pub mod track;

use super::{Emitter, Geometry, Scene};
use crate::base::math::Rgb;
use crate::material::bsdf::{Bsdf, Diffuse};
use crate::material::{Material, Texture};
use light::Light;
use object::MovingObject;
use std::path::PathBuf;
use std::sync::Arc;
use track::Track;

/// What changes in one scene. Frame k is at k / fps seconds.
#[derive(Debug, Clone)]
pub struct Animation {
    /// Frames a second.
    pub fps: f64,
    /// Time of the last keyframe, seconds; 0 where nothing moves.
    pub last: f64,
    /// Whether the scene's own emitters shine.
    pub scene_lights: bool,
    /// Lights beside those of the scene.
    pub lights: Vec<Light>,
    /// Materials of the scene that are others than in its file.
    pub materials: Vec<ChangedMaterial>,
    /// Shapes of the scene that emit otherwise than in its file.
    pub emission: Vec<Emission>,
    /// Shapes beside those of the scene.
    pub objects: Vec<MovingObject>,
    /// The scene's triangles, its shapes with the emitters that [`Self::emission`] gives them; `None` where those are in its file.
    pub relit: Option<Arc<Geometry>>,
    /// Mesh files that objects are made of, in order of first use.
    pub files: Vec<PathBuf>,
}

/// Other values for a material.
#[derive(Debug, Clone)]
pub struct ChangedMaterial {
    /// Those that the file's `id` means, ascending; several where the scene has made copies.
    pub indices: Vec<u32>,
    /// Diffuse reflectance.
    pub albedo: Option<Track>,
    /// Microfacet alpha.
    pub roughness: Option<Track>,
}

/// Radiance of a shape of the scene.
#[derive(Debug, Clone)]
pub struct Emission {
    /// The shape.
    pub object: u32,
    /// Its emitter: one of the scene's, or one after those.
    pub emitter: u32,
    /// Radiance, the same all over.
    pub radiance: Track,
}

impl Animation {
    /// Frames until the last keyframe; 1 where nothing moves.
    pub fn frames(&self) -> u32 {
        // The last keyframe is a frame too where it falls on one, rounding aside.
        (self.last.max(0.0) * self.fps + 1e-6).floor() as u32 + 1
    }

    /// Materials (indices of the scene's) whose albedo or roughness is not left to the scene's file, ascending.
    pub fn changed_materials(&self) -> Vec<u32> {
        let mut indices: Vec<u32> = self.materials.iter().flat_map(|m| m.indices.iter().copied()).collect();
        indices.sort_unstable();
        indices
    }

    /// Whether emitters differ from those of the scene's file at any time.
    pub fn changes_light(&self) -> bool {
        !self.scene_lights || !self.lights.is_empty() || !self.emission.is_empty()
    }

    /// The scene of a frame, of the scene that the animation was loaded for: geometry, materials and emitters of the scene first and in
    /// their places, then what the file adds. Its hash stays the scene's.
    pub fn scene_at(&self, scene: &Scene, frame: u32) -> Scene {
        let time = f64::from(frame) / self.fps;
        let mut of_frame = scene.clone();
        if let Some(relit) = &self.relit {
            of_frame.geometry = relit.clone();
        }
        self.change_materials(&mut of_frame.materials, time);
        self.change_emitters(&mut of_frame.emitters, time);
        self.add_objects(&mut of_frame, time);
        self.add_lights(&mut of_frame, time);
        of_frame
    }

    fn change_materials(&self, materials: &mut [Material], time: f64) {
        for change in &self.materials {
            for &index in &change.indices {
                let bsdf = &mut materials[index as usize].bsdf;
                if let Some(albedo) = &change.albedo {
                    bsdf.set_albedo(albedo.color(time));
                }
                if let Some(roughness) = &change.roughness {
                    bsdf.set_roughness(roughness.number(time) as f32);
                }
            }
        }
    }

    fn change_emitters(&self, emitters: &mut Vec<Emitter>, time: f64) {
        if !self.scene_lights {
            emitters.iter_mut().for_each(darken);
        }
        for Emission { object, emitter, radiance } in &self.emission {
            let lit = Emitter::Area { object: *object, radiance: Texture::Constant(radiance.color(time)) };
            match emitters.get_mut(*emitter as usize) {
                Some(own) => *own = lit,
                None => emitters.push(lit),
            }
        }
    }

    fn add_objects(&self, scene: &mut Scene, time: f64) {
        let sizes = self.objects.iter().map(|o| [o.mesh.positions.len(), o.mesh.triangles.len()]);
        let all = sizes.chain(self.lights.iter().map(Light::size)).fold([0; 2], |[a, b], [c, d]| [a + c, b + d]);
        if all != [0; 2] {
            scene.geometry = Arc::new(scene.geometry.with_room(all[0], all[1]));
        }
        for (i, object) in self.objects.iter().enumerate() {
            let (name, material) = (format!("objects[{i}]"), scene.materials.len() as u32);
            scene.materials.push(diffuse(&name, object.albedo.color(time)));
            let unit_scale = scene.unit_scale.0;
            object.add(time, unit_scale, scene.geometry_mut(), (name, material));
        }
    }

    fn add_lights(&self, scene: &mut Scene, time: f64) {
        let material = scene.materials.len() as u32;
        if self.lights.iter().any(|l| matches!(l, Light::Area { .. })) {
            scene.materials.push(diffuse("lights", Rgb::ZERO));
        }
        for (i, light) in self.lights.iter().enumerate() {
            let name = format!("lights[{i}]");
            let (unit_scale, index) = (scene.unit_scale.0, scene.emitters.len() as u32);
            let geometry = match light {
                Light::Area { .. } => scene.geometry_mut(),
                // Adds none: the scene's need not be copied.
                _ => &mut Geometry::default(),
            };
            let emitter = light.add(time, unit_scale, geometry, (name, material, index));
            scene.emitters.push(emitter);
        }
    }
}

/// Takes an emitter's light, and leaves it in its place: shapes know theirs by number.
fn darken(emitter: &mut Emitter) {
    *emitter = match emitter {
        Emitter::Area { object, .. } => Emitter::Area { object: *object, radiance: Texture::Constant(Rgb::ZERO) },
        _ => Emitter::Constant { radiance: Rgb::ZERO },
    };
}

fn diffuse(name: &str, albedo: Rgb) -> Material {
    let bsdf = Bsdf::Diffuse(Diffuse { reflectance: Texture::Constant(albedo) });
    Material { name: name.into(), bsdf, opacity: None }
}
