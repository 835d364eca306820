//! The tree of nodes: where meshes, lights and cameras stand.

use super::Builder;
use super::file::File;
use crate::Result;
use crate::base::math::Rgb;
use crate::scene::{Camera, Emitter};
use glam::{Affine3A, DMat4, DQuat, DVec3, Vec2, Vec3};
use gltf_json::camera::{self, Type};
use gltf_json::extensions::scene::khr_lights_punctual::{Light, Type as Kind};
use gltf_json::scene::Node;
use gltf_json::validation::Checked;
use gltf_json::{Index, Root};

/// Width of the picture that a glTF camera is taken for, pixels.
const WIDTH: u32 = 1280;
/// Its shape where the camera has none.
const ASPECT: f32 = 16.0 / 9.0;

/// The nodes of the file's scene, parents first, and where each of the file's nodes stands.
pub struct Placed {
    pub shown: Vec<usize>,
    pub to_world: Vec<DMat4>,
}

/// Walks the scene that is to be shown, or all nodes where there is none. A node with two parents is an error.
pub fn placed(file: &File, unit_scale: f32) -> Result<Placed> {
    let Root { scene, scenes, nodes, .. } = &file.root;
    let roots: Vec<usize> = match (scene, scenes.first()) {
        (Some(index), _) => file.get(*index, "scene")?.nodes.iter().map(Index::value).collect(),
        (None, Some(first)) => first.nodes.iter().map(Index::value).collect(),
        (None, None) => {
            let children: std::collections::BTreeSet<usize> = nodes.iter().flat_map(children).collect();
            (0..nodes.len()).filter(|i| !children.contains(i)).collect()
        }
    };
    let root = DMat4::from_scale(DVec3::splat(f64::from(unit_scale)));
    let mut all = Placed { shown: Vec::new(), to_world: vec![DMat4::IDENTITY; nodes.len()] };
    let mut seen = vec![false; nodes.len()];
    let mut next: Vec<(usize, DMat4)> = roots.into_iter().rev().map(|i| (i, root)).collect();
    while let Some((i, parent)) = next.pop() {
        let node = nodes.get(i).ok_or_else(|| file.error(format!("there is no node {i}")))?;
        if std::mem::replace(&mut seen[i], true) {
            return Err(file.error(format!("node {i} is the child of two nodes, or of itself")));
        }
        all.to_world[i] = parent * local(node);
        all.shown.push(i);
        let below: Vec<usize> = children(node).collect();
        next.extend(below.into_iter().rev().map(|child| (child, all.to_world[i])));
    }
    Ok(all)
}

fn children(node: &Node) -> impl Iterator<Item = usize> {
    node.children.iter().flatten().map(Index::value)
}

fn local(node: &Node) -> DMat4 {
    if let Some(matrix) = node.matrix {
        return DMat4::from_cols_array(&matrix.map(f64::from));
    }
    let vector = |v: Option<[f32; 3]>, default: f32| DVec3::from_array(v.unwrap_or([default; 3]).map(f64::from));
    let rotation = node.rotation.map_or(DQuat::IDENTITY, |q| DQuat::from_array(q.0.map(f64::from)));
    // What is not of unit length within an exporter's rounding.
    let rotation = if rotation.length_squared() > 0.0 { rotation.normalize() } else { DQuat::IDENTITY };
    DMat4::from_scale_rotation_translation(vector(node.scale, 1.0), rotation, vector(node.translation, 0.0))
}

impl Builder<'_> {
    /// Adds a node's light.
    ///
    /// Candela, lux and the radiance of emissive materials (nits) are all of one system, so that each number is taken as it is.
    pub(super) fn light(&mut self, node: &Node, to_world: &DMat4) -> Result<()> {
        let Some(reference) = node.extensions.as_ref().and_then(|e| e.khr_lights_punctual.as_ref()) else { return Ok(()) };
        let lights = self.file.root.extensions.as_ref().and_then(|e| e.khr_lights_punctual.as_ref());
        let number = reference.light.value();
        let light = lights.and_then(|l| l.lights.get(number));
        let light = light.ok_or_else(|| self.file.error(format!("there is no light {number}")))?;
        let axis = to_world.transform_vector3(DVec3::NEG_Z).try_normalize().map_or(Vec3::NEG_Z, |d| d.as_vec3());
        let position = to_world.transform_point3(DVec3::ZERO).as_vec3();
        let color = Rgb::from_array(light.color) * light.intensity;
        if !(color.is_finite() && color.min_element() >= 0.0 && position.is_finite()) {
            return Err(self.file.error(format!("light {number} shines {color} at {position}: expected finite numbers")));
        }
        // Lengths grow by the unit scale; so must intensities, for the same irradiance.
        let intensity = color * (self.unit_scale * self.unit_scale);
        let emitter = match light.type_ {
            Checked::Valid(Kind::Directional) => Emitter::Directional { direction: axis, irradiance: color },
            Checked::Valid(Kind::Point) => Emitter::Point { position, intensity },
            Checked::Valid(Kind::Spot) => spot(light, position, axis, intensity),
            Checked::Invalid => return Err(self.file.error(format!("light {number} is of an unknown type"))),
        };
        self.scene.emitters.push(emitter);
        Ok(())
    }

    /// Takes a node's camera for the scene's, where it has none yet.
    pub(super) fn camera(&mut self, node: &Node, to_world: &DMat4) -> Result<()> {
        let Some(index) = node.camera.filter(|_| self.scene.sensor.is_none()) else { return Ok(()) };
        let camera = self.file.get(index, "camera")?;
        let bad = || self.file.error(format!("camera {} is not one that sees something", index.value()));
        self.scene.sensor = Some(sensor(camera, to_world).ok_or_else(bad)?);
        Ok(())
    }

    /// A view of everything from before and above, for a file without a camera.
    pub(super) fn stand_back(&mut self) {
        let (low, high) = self.scene.geometry.bounds();
        let (middle, radius) = ((low + high) * 0.5, 0.5 * low.distance(high));
        let towards = Vec3::new(0.5, 0.35, 1.0).normalize();
        let fov_x = 2.0 * (0.5 * 45f32.to_radians()).tan().atan();
        let size = [WIDTH, (WIDTH as f32 / ASPECT) as u32];
        let origin = middle + towards * (radius * 2.6 * ASPECT.sqrt());
        self.scene.sensor = Some(Camera::look_at(origin, middle, Vec3::Y, fov_x, size));
    }
}

/// A spot; glTF's falls off by the square of the cosine, ours linearly in the angle between the same two cones.
fn spot(light: &Light, position: Vec3, direction: Vec3, intensity: Rgb) -> Emitter {
    let [inner, outer] =
        light.spot.as_ref().map_or([0.0, std::f32::consts::FRAC_PI_4], |s| [s.inner_cone_angle, s.outer_cone_angle]);
    let cutoff_rad = outer.clamp(1e-3, std::f32::consts::FRAC_PI_2);
    Emitter::Spot { position, direction, intensity, cutoff_rad, beam_rad: inner.clamp(0.0, cutoff_rad), pattern: None }
}

/// A camera that looks along local -Z with +X to the right, as ours, which looks along +Z with +X to the left.
fn sensor(camera: &camera::Camera, to_world: &DMat4) -> Option<Camera> {
    let axes = [to_world.x_axis, to_world.y_axis, to_world.z_axis].map(|axis| axis.truncate().try_normalize());
    let [Some(x), Some(y), Some(z)] = axes else { return None };
    let turned = glam::DMat3::from_cols(-x, y, -z);
    let placed = Affine3A::from_mat3_translation(turned.as_mat3(), to_world.w_axis.truncate().as_vec3());
    if !placed.is_finite() {
        return None;
    }
    let pinhole = |aspect: f32, fov_x: f32| {
        let height = (WIDTH as f32 / aspect).round().clamp(1.0, 65_536.0) as u32;
        Camera::pinhole(placed, fov_x, [WIDTH, height])
    };
    let found = match (&camera.type_, &camera.perspective, &camera.orthographic) {
        (Checked::Valid(Type::Perspective), Some(lens), _) => {
            let aspect = lens.aspect_ratio.filter(|a| *a > 0.0).unwrap_or(ASPECT);
            let half = (0.5 * lens.yfov).tan() * aspect;
            (lens.yfov > 0.0 && half > 0.0 && half.is_finite()).then(|| pinhole(aspect, 2.0 * half.atan()))
        }
        (Checked::Valid(Type::Orthographic), _, Some(lens)) => {
            let (x, y) = (lens.xmag, lens.ymag);
            let fits = x > 0.0 && y > 0.0 && (x / y).is_normal();
            let scale = to_world.x_axis.truncate().length() as f32;
            // Of half the width, in pixels, along either axis.
            fits.then(|| Camera { orthographic: Some(Vec2::splat(x * scale)), ..pinhole(x / y, 1.0) })
        }
        _ => None,
    };
    found.filter(Camera::can_see)
}
