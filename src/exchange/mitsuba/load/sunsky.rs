//! The clear sky and its sun: an image at infinity and a disc.
//!
//! The sky is smooth, so that pixels of a third of a degree show it as it is. The sun is half a degree wide: in that image it would be two
//! pixels, and a directional light would cast no penumbra and show no disc in mirrors.

use super::Builder;
use super::emitter::not_negative;
use crate::Result;
use crate::base::math::Rgb;
use crate::exchange::mitsuba::params::Params;
use crate::exchange::mitsuba::sky;
use crate::exchange::mitsuba::sky::{Moment, Sky};
use crate::scene::Emitter;
use glam::{Affine3A, DMat4, DVec3, Mat4};
use std::f32::consts::TAU;
use std::sync::Arc;

/// Parameters that say where the sun stands by place and time.
const MOMENT: [&str; 9] = ["latitude", "longitude", "timezone", "year", "month", "day", "hour", "minute", "second"];

/// From an image's own space, Y up, to the sky's, Z up ([`sky::image`]).
const SKY_FROM_IMAGE: Mat4 =
    Mat4::from_cols_array(&[1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, -1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]);

impl<'a> Builder<'a> {
    /// A `sunsky`, or one of its halves under the names that Mitsuba 0.6 had for them.
    pub(super) fn sunsky(&mut self, mut params: Params<'a>) -> Result<()> {
        let p = &mut params;
        let turbidity = p.f32("turbidity", 3.0)?;
        if !(1.0..=10.0).contains(&turbidity) {
            return Err(p.at("turbidity").error(format!("turbidity = {turbidity}: expected 1 to 10")));
        }
        let albedo = p.reflectance("albedo", Rgb::splat(0.3))?;
        let (sun_scale, sky_scale) = scales(p)?;
        let aperture = p.f32("sun_aperture", 0.5358)?;
        if !(aperture > 0.0 && aperture < 180.0) {
            return Err(p.at("sun_aperture").error(format!("sun_aperture = {aperture}: expected more than 0 and less than 180")));
        }
        if p.bool("complex_sun", false)? {
            p.warn(
                p.at("complex_sun").warning("complex_sun: the disc is drawn without its darker rim; its irradiance is the same"),
            );
        }
        let to_world = p.transform("to_world")?;
        let local = sun_direction(p, &to_world)?;
        if local.z < 0.0 {
            p.warn(p.node.at.warning("the sun is below the horizon: it and the sky are black"));
        } else {
            let elevation = local.z.clamp(0.0, 1.0).asin();
            if sky_scale > 0.0 {
                let sky = Sky::new(f64::from(turbidity), albedo, elevation);
                let to_world = Affine3A::from_mat4(to_world.as_mat4() * SKY_FROM_IMAGE);
                self.scene.emitters.push(Emitter::Envmap {
                    image: Arc::new(sky::image(&sky, local)),
                    scale: sky_scale,
                    to_world,
                });
            }
            if sun_scale > 0.0 {
                // Wide or narrow, the disc's irradiance is the sun's, as in Mitsuba.
                let angle_rad = 0.5 * aperture.to_radians();
                let solid_angle = 2.0 * TAU * (0.5 * angle_rad).sin().powi(2);
                let radiance = sky::sun_irradiance(f64::from(turbidity), elevation) * (sun_scale / solid_angle);
                // The parser takes no transform that flattens space, so that no direction is lost.
                let [direction, up] = [local, DVec3::Z].map(|d| to_world.transform_vector3(d).normalize_or(DVec3::Z).as_vec3());
                self.scene.emitters.push(Emitter::Sun { direction, up, angle_rad, radiance });
            }
        }
        params.finish(&mut self.scene.warnings);
        Ok(())
    }
}

/// Factors of the sun and of the sky. Mitsuba 3 has neither `sky` nor `sun`: they are a `sunsky` with one half dark.
fn scales(p: &mut Params) -> Result<(f32, f32)> {
    let halves = [("sky", "the sun", "sun_scale"), ("sun", "the sky", "sky_scale")];
    let Some((plugin, other, scale)) = halves.into_iter().find(|(plugin, ..)| *plugin == p.node.plugin) else {
        return Ok((not_negative(p, "sun_scale", 1.0)?, not_negative(p, "sky_scale", 1.0)?));
    };
    p.warn(p.node.at.warning(format!("{plugin}: Mitsuba 3 has none; read as a sunsky without {other} ({scale} = 0)")));
    let scale = not_negative(p, "scale", 1.0)?;
    Ok(if plugin == "sun" { (scale, 0.0) } else { (0.0, scale) })
}

/// Unit direction to the sun in the sky's own space.
fn sun_direction(p: &mut Params, to_world: &DMat4) -> Result<DVec3> {
    let Some(world) = p.vector("sun_direction")? else { return Ok(moment(p)?.sun()) };
    if let Some(name) = MOMENT.into_iter().find(|name| p.has(name)) {
        return Err(p.at(name).error(format!("{name} beside sun_direction: expected one of the two")));
    }
    let local = to_world.inverse().transform_vector3(world.as_dvec3()).try_normalize();
    local.ok_or_else(|| p.at("sun_direction").error("the direction has no length"))
}

fn moment(p: &mut Params) -> Result<Moment> {
    let default = Moment::default();
    let mut number = |name: &str, default: f64| match p.has(name) {
        true => p.f32(name, 0.0).map(f64::from),
        false => Ok(default),
    };
    let mut moment = Moment {
        latitude: number("latitude", default.latitude)?,
        longitude: number("longitude", default.longitude)?,
        timezone: number("timezone", default.timezone)?,
        hour: number("hour", default.hour)?,
        minute: number("minute", default.minute)?,
        second: number("second", default.second)?,
        ..default
    };
    moment.year = p.integer("year", default.year, -4000, 10_000)?;
    moment.month = p.integer("month", default.month, 1, 12)?;
    moment.day = p.integer("day", default.day, 1, 31)?;
    Ok(moment)
}
