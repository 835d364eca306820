//! Sensors.

use super::Builder;
use crate::Result;
use crate::exchange::mitsuba::params::{Params, number_of, wrong};
use crate::exchange::mitsuba::tree::{Kind, Node, Value};
use crate::scene::Camera;
use crate::scene::camera::FovAxis;
use crate::scene::film::{FilmFilter, Filter};
use glam::{Affine3A, DMat4, Mat3A, Vec2};

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

/// Properties of films, of Mitsuba 0.6 to 3, that change nothing here: files, their numbers' types, borders, tone mapping.
const FILM: [&str; 23] = [
    "file_format",
    "pixel_format",
    "component_format",
    "compensate",
    "sample_border",
    "filename",
    "banner",
    "high_quality_edges",
    "attach_log",
    "tonemap_method",
    "gamma",
    "exposure",
    "key",
    "burn",
    "has_variance",
    "digits",
    "variable",
    "fov",
    "label",
    "channel_names",
    "channel_name",
    "crop_window",
    "rfilter",
];

/// What stands for `near_clip` and `far_clip` where only one is given.
const EVERYTHING: (f32, f32) = (0.0, f32::INFINITY);

/// Mitsuba's `far_clip`, where a lens is focused that is not told of another distance.
const FAR: f32 = 10_000.0;

/// A film's size and the part of it that is rendered, pixels.
struct Window {
    film: [u32; 2],
    offset: [u32; 2],
    size: [u32; 2],
}

impl<'a> Builder<'a> {
    /// The scene's own camera.
    pub(super) fn sensor(&mut self, node: &'a Node) -> Result<()> {
        let mut params = self.params(node);
        let p = &mut params;
        let (lens, parallel) = match node.plugin.as_str() {
            "perspective" => (false, false),
            "thinlens" => (true, false),
            "orthographic" => (false, true),
            _ => return Err(Self::unknown(node, "sensor", "perspective, thinlens, orthographic")),
        };
        p.accept(&["shutter_open", "shutter_close", "srf"]);
        p.children(Kind::Other)?;
        let window = self.film(p)?;
        // Axes and clipping planes are about the whole film, also where only a part of it is rendered.
        let fov_x = if parallel { 1.0 } else { fov_x(p, window.film)? };
        if lens && !p.has("aperture_radius") {
            return Err(node.at.error("thinlens has no \"aperture_radius\""));
        }
        let (aperture_radius, focus_distance) = aperture_and_focus(p, lens)?;
        let principal_point = match parallel {
            true => Vec2::ZERO,
            false => Vec2::new(p.f32("principal_point_offset_x", 0.0)?, p.f32("principal_point_offset_y", 0.0)?),
        };
        let clip = clip(p)?;
        let placed = self.placed(p)?;
        let to_world = rigid(&placed).ok_or_else(|| p.at("to_world").error("the sensor's axes do not span space"))?;
        params.finish(&mut self.scene.warnings);

        let whole = Vec2::new(window.film[0] as f32, window.film[1] as f32);
        let part = Vec2::new(window.size[0] as f32, window.size[1] as f32);
        let axis = whole * (0.5 - principal_point) - Vec2::new(window.offset[0] as f32, window.offset[1] as f32);
        let narrower = part.x / whole.x;
        let mut camera = Camera::pinhole(to_world, fov_x, window.size);
        if narrower != 1.0 {
            camera.fov_x = 2.0 * (narrower * (0.5 * fov_x).tan()).atan();
        }
        (camera.aperture_radius, camera.focus_distance) = (aperture_radius * self.unit_scale, focus_distance * self.unit_scale);
        camera.shift = axis / part - 0.5;
        let [x, y, z] = [0, 1, 2].map(|k| placed.col(k).truncate().length() as f32);
        camera.clip = [clip.0 * self.unit_scale, clip.1 * self.unit_scale];
        if parallel {
            camera.orthographic = Some(Vec2::new(x, y) * narrower);
            // As Mitsuba: the near plane is scaled with the camera, the way to the far one is not.
            let near = clip.0 * z;
            camera.clip = [near, near + camera.clip[1] - camera.clip[0]];
        }
        if !camera.can_see() {
            return Err(node.at.error(format!(
                "a sensor of {} radians across at {} sees nothing: its field of view is too small or too large, or it stands nowhere",
                camera.fov_x,
                camera.position()
            )));
        }
        self.scene.sensor = Some(camera);
        Ok(())
    }

    /// The film's size, crop window and filter.
    fn film(&mut self, p: &mut Params<'a>) -> Result<Window> {
        let mut window = Window { film: [768, 576], offset: [0; 2], size: [768, 576] };
        self.scene.film_filter.filter = Filter::Gaussian(0.5);
        for node in p.children(Kind::Film)? {
            let mut film = self.params(node);
            for (i, side) in ["width", "height"].into_iter().enumerate() {
                window.film[i] = film.integer(side, i64::from(window.film[i]), 1, MAX_SIDE)? as u32;
            }
            for (i, axis) in ["x", "y"].into_iter().enumerate() {
                let (whole, extent) = (i64::from(window.film[i]), ["crop_width", "crop_height"][i]);
                window.offset[i] = film.integer(&format!("crop_offset_{axis}"), 0, 0, MAX_SIDE)? as u32;
                let rest = whole - i64::from(window.offset[i]);
                let size = film.integer(extent, whole, 1, MAX_SIDE)?;
                if size > rest {
                    let message = format!("{extent} = {size} from {} on: the film has {whole} pixels", window.offset[i]);
                    return Err(film.at(extent).error(message));
                }
                window.size[i] = size as u32;
            }
            if let Some(format) = film.text("pixel_format")?.filter(|f| !["rgb", "rgba"].contains(f)) {
                film.warn(film.at("pixel_format").warning(format!("pixel_format = {format}: frames are red, green and blue")));
            }
            film.accept(&FILM);
            for filter in film.children(Kind::Other)? {
                if let Some(found) = self.filter(filter)? {
                    let named = format!("{} ({}:{})", filter.plugin, filter.at.file.display(), filter.at.line);
                    self.scene.film_filter = FilmFilter { filter: found, named: Some(named) };
                }
            }
            film.finish(&mut self.scene.warnings);
        }
        Ok(window)
    }

    /// A reconstruction filter; `None` for other plugins of a film.
    fn filter(&mut self, node: &'a Node) -> Result<Option<Filter>> {
        let mut params = self.params(node);
        let p = &mut params;
        let third = 1.0 / 3.0;
        let filter = match node.plugin.as_str() {
            "box" => {
                p.accept(&["radius"]);
                Filter::Box
            }
            "tent" => Filter::Tent(f64::from(p.positive("radius", 1.0)?)),
            "gaussian" => Filter::Gaussian(f64::from(p.positive("stddev", 0.5)?)),
            "mitchell" => Filter::Mitchell(f64::from(p.f32("b", third)?), f64::from(p.f32("c", third)?)),
            "catmullrom" => Filter::Mitchell(0.0, 0.5),
            "lanczos" => Filter::Lanczos(p.integer("lobes", 3, 1, 16)? as f64),
            _ => {
                self.scene.warnings.push(node.at.warning(format!("unknown filter \"{}\": a Gaussian stands in", node.plugin)));
                return Ok(None);
            }
        };
        params.finish(&mut self.scene.warnings);
        Ok(Some(filter))
    }
}

/// Aperture and distance of a lens; a sensor without one may have a distance all the same, which perspective sensors of Mitsuba 0.6 carry and do not use.
fn aperture_and_focus(p: &mut Params, lens: bool) -> Result<(f32, f32)> {
    let elsewhere = if lens { p.f32("far_clip", FAR)? } else { 1.0 };
    let focus_distance = p.f32("focus_distance", elsewhere)?;
    if focus_distance <= 0.0 {
        return Err(p.at("focus_distance").error(format!("focus_distance = {focus_distance}: expected more than 0")));
    }
    let aperture_radius = if lens { p.f32("aperture_radius", 0.0)? } else { 0.0 };
    if aperture_radius < 0.0 {
        return Err(p.at("aperture_radius").error(format!("aperture_radius = {aperture_radius}: expected at least 0")));
    }
    Ok((aperture_radius, focus_distance))
}

/// `near_clip` and `far_clip`. *Ours*: without them nothing is cut off, where Mitsuba takes 0.01 and 10,000 in whatever unit.
fn clip(p: &mut Params) -> Result<(f32, f32)> {
    let (near, far) = (p.f32("near_clip", EVERYTHING.0)?, if p.has("far_clip") { p.f32("far_clip", 0.0)? } else { EVERYTHING.1 });
    if near < 0.0 || near >= far {
        let name = if p.has("far_clip") { "far_clip" } else { "near_clip" };
        return Err(p.at(name).error(format!("near_clip = {near}, far_clip = {far}: expected 0 <= near < far")));
    }
    Ok((near, far))
}

/// Horizontal field of view, radians, of an image of `size`, by `fov` and `fov_axis` or by `focal_length`.
pub(super) fn fov_x(p: &mut Params, size: [u32; 2]) -> Result<f32> {
    let axis = p.choice_of_any_case("fov_axis", FovAxis::X, &AXES)?;
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
