//! Sensors.

use super::Builder;
use crate::Result;
use crate::exchange::mitsuba::params::{Params, number_of, wrong};
use crate::exchange::mitsuba::tree::{Kind, Node, Value};
use crate::scene::Camera;
use crate::scene::camera::FovAxis;
use glam::{Affine3A, DMat4, Mat3A};

const AXES: [(&str, FovAxis); 5] = [
    ("x", FovAxis::X),
    ("y", FovAxis::Y),
    ("diagonal", FovAxis::Diagonal),
    ("smaller", FovAxis::Smaller),
    ("larger", FovAxis::Larger),
];

/// Diagonal of 35 mm film, which `focal_length` refers to, millimetres.
const FILM_DIAGONAL_MM: f32 = 43.266_615;

/// Longest side of a film, pixels.
const MAX_SIDE: i64 = 65_536;

impl<'a> Builder<'a> {
    /// The scene's own camera.
    pub(super) fn sensor(&mut self, node: &'a Node) -> Result<()> {
        let mut params = self.params(node);
        let p = &mut params;
        let lens = match node.plugin.as_str() {
            "perspective" => false,
            "thinlens" => true,
            _ => return Err(Self::unknown(node, "sensor", "perspective, thinlens")),
        };
        p.accept(&["near_clip", "far_clip", "shutter_open", "shutter_close", "srf"]);
        p.children(Kind::Other)?;
        let mut size = [768, 576];
        for film in p.children(Kind::Film)? {
            let mut film = self.params(film);
            for (i, side) in ["width", "height"].into_iter().enumerate() {
                size[i] = film.integer(side, i64::from(size[i]), 1, MAX_SIDE)? as u32;
            }
            if film.has("crop_width") || film.has("crop_height") {
                let at = film.at("crop_width");
                self.scene.warnings.push(at.warning("the film's crop window is ignored: the whole film is rendered"));
            }
        }
        let fov_x = fov_x(p, size)?;
        let (aperture_radius, focus_distance) = match lens {
            true => (p.positive("aperture_radius", 1.0)?, p.positive("focus_distance", 1.0)?),
            // Perspective sensors of Mitsuba 0.6 carry a distance that they do not use.
            false => (0.0, p.positive("focus_distance", 1.0)?),
        };
        if lens && !p.has("aperture_radius") {
            return Err(node.at.error("thinlens has no \"aperture_radius\""));
        }
        let placed = self.placed(p)?;
        let to_world = rigid(&placed).ok_or_else(|| p.at("to_world").error("the sensor's axes do not span space"))?;
        params.finish(&mut self.scene.warnings);
        let (aperture_radius, focus_distance) = (aperture_radius * self.unit_scale, focus_distance * self.unit_scale);
        self.scene.sensor = Some(Camera { to_world, fov_x, size, aperture_radius, focus_distance });
        Ok(())
    }
}

fn fov_x(p: &mut Params, size: [u32; 2]) -> Result<f32> {
    let axis = p.choice("fov_axis", FovAxis::X, &AXES)?;
    let (fov, axis) = if p.has("fov") {
        let fov = p.f32("fov", 0.0)?;
        if !(fov > 0.0 && fov < 180.0) {
            return Err(p.at("fov").error(format!("fov = {fov}: expected more than 0 and less than 180 degrees")));
        }
        if p.has("focal_length") {
            return Err(p.at("focal_length").error("found both fov and focal_length, expected one of them"));
        }
        (fov.to_radians(), axis)
    } else {
        let millimetres = focal_length_mm(p)?;
        (2.0 * (FILM_DIAGONAL_MM * 0.5 / millimetres).atan(), FovAxis::Diagonal)
    };
    Ok(axis.fov_x(fov, size))
}

/// `50mm`, or a number.
fn focal_length_mm(p: &mut Params) -> Result<f32> {
    let Some(param) = p.get("focal_length") else { return Ok(50.0) };
    let given = match &param.value {
        Value::Text(text) => text.trim().trim_end_matches("mm").trim().parse::<f32>().ok(),
        _ => number_of(param, p.node)?,
    };
    match given {
        Some(x) if x > 0.0 && x.is_finite() => Ok(x),
        _ => Err(wrong(param, p.node, "a positive length such as 50mm")),
    }
}

/// The transform without its scale; a mirrored camera stays mirrored.
fn rigid(m: &DMat4) -> Option<Affine3A> {
    let [x, y, z, origin] = [0, 1, 2, 3].map(|i| m.col(i).truncate());
    let z = z.try_normalize()?;
    let y_right = (y - z * z.dot(y)).try_normalize()?;
    let x_right = (x - z * z.dot(x) - y_right * y_right.dot(x)).try_normalize()?;
    let axes = Mat3A::from_cols(x_right.as_vec3a(), y_right.as_vec3a(), z.as_vec3a());
    Some(Affine3A { matrix3: axes, translation: origin.as_vec3a() })
}
