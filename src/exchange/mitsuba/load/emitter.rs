//! Emitters that stand by themselves.

use super::Builder;
use super::sensor::fov_x;
use crate::Result;
use crate::base::math::Rgb;
use crate::exchange::mitsuba::params::Params;
use crate::exchange::mitsuba::tree::{Kind, Node, Param, Value};
use crate::material::Texture;
use crate::scene::Emitter;
use crate::scene::emitter::Pattern;
use glam::{Affine3A, Mat4, Vec2, Vec3};

/// What there is.
const KNOWN: &str = "area, envmap, constant, sunsky, point, spot, directional, projector";

impl<'a> Builder<'a> {
    /// Adds an emitter.
    pub(super) fn emitter(&mut self, node: &'a Node) -> Result<()> {
        let mut params = self.params(node);
        let p = &mut params;
        p.accept(&["sampling_weight"]);
        // Lengths grow by the unit scale; so must intensities, for the same irradiance.
        let area_scale = self.unit_scale * self.unit_scale;
        if matches!(node.plugin.as_str(), "envmap" | "constant" | "sunsky" | "sky" | "sun") {
            self.environments += 1;
            if self.environments > 1 {
                return Err(node.at.error("a second environment: expected one envmap, constant or sunsky"));
            }
        }
        let emitter = match node.plugin.as_str() {
            "envmap" => {
                p.file()?;
                let to_world = Affine3A::from_mat4(p.transform("to_world")?.as_mat4());
                Emitter::Envmap { image: self.assets.image(node)?, scale: not_negative(p, "scale", 1.0)?, to_world }
            }
            "constant" => Emitter::Constant { radiance: p.color("radiance", Rgb::ONE)? },
            "point" => {
                let intensity = p.color("intensity", Rgb::ONE)? * area_scale;
                let local = p.vector("position")?.unwrap_or(Vec3::ZERO);
                Emitter::Point { position: self.placed(p)?.as_mat4().transform_point3(local), intensity }
            }
            "spot" => self.spot(p, area_scale)?,
            "projector" => self.projector(p)?,
            "directional" => {
                let irradiance = p.color("irradiance", Rgb::ONE)?;
                let direction = match p.vector("direction")? {
                    Some(d) => d.try_normalize().ok_or_else(|| p.at("direction").error("the direction has no length"))?,
                    None => {
                        let to_world = p.transform("to_world")?.as_mat4();
                        axis(p, &to_world)?
                    }
                };
                Emitter::Directional { direction, irradiance }
            }
            "area" => return self.area_by_itself(node),
            "sunsky" | "sky" | "sun" => return self.sunsky(params),
            "timed_sunsky" => {
                let message = "timed_sunsky: a sun that moves while the shutter is open is not supported: a sunsky is";
                return Err(node.at.unsupported(message));
            }
            _ => return Err(Self::unknown(node, "emitter", KNOWN)),
        };
        params.finish(&mut self.scene.warnings);
        self.scene.emitters.push(emitter);
        Ok(())
    }

    /// A spot; its intensity grows by `area_scale`.
    fn spot(&mut self, p: &mut Params<'a>, area_scale: f32) -> Result<Emitter> {
        let intensity = p.color("intensity", Rgb::ONE)? * area_scale;
        let to_world = self.placed(p)?.as_mat4();
        let cutoff = p.positive("cutoff_angle", 20.0)?;
        let beam = not_negative(p, "beam_width", 0.75 * cutoff)?;
        if cutoff > 180.0 {
            return Err(p.at("cutoff_angle").error(format!("cutoff_angle = {cutoff}: expected at most 180")));
        }
        if beam > cutoff {
            p.warn(p.at("beam_width").warning(format!("beam_width = {beam}: the light ends at {cutoff} degrees")));
        }
        let beam = beam.min(cutoff);
        let pattern = match p.has("texture") {
            true => {
                let (texture, half) = (self.textured(p, "texture", 1.0)?, Vec2::splat(cutoff.to_radians().tan()));
                Some(Box::new(Pattern { texture, to_local: inverse(&to_world), half }))
            }
            false => None,
        };
        Ok(Emitter::Spot {
            position: to_world.transform_point3(Vec3::ZERO),
            direction: axis(p, &to_world)?,
            intensity,
            cutoff_rad: cutoff.to_radians(),
            beam_rad: beam.to_radians(),
            pattern,
        })
    }
}

impl<'a> Builder<'a> {
    /// An area light directly under the scene is for shapes to refer to.
    fn area_by_itself(&mut self, node: &'a Node) -> Result<()> {
        let is_it = |p: &Param| matches!(&p.value, Value::Reference(id) if node.id.as_deref() == Some(id.as_str()));
        let uses = |shape: &&Node| shape.kind == Kind::Shape && shape.params.iter().any(is_it);
        let plugins = self.children.iter().filter_map(|c| match &c.value {
            Value::Plugin(node) => Some(node),
            _ => None,
        });
        match plugins.into_iter().any(|plugin| uses(&plugin)) {
            true => Ok(()),
            false => {
                self.scene.warnings.push(node.at.warning("an area emitter that no shape holds or refers to lights nothing"));
                Ok(())
            }
        }
    }

    fn projector(&mut self, p: &mut Params<'a>) -> Result<Emitter> {
        let texture = self.textured(p, "irradiance", 1.0)?;
        let size = match &texture {
            Texture::Bitmap(bitmap) => [bitmap.image.width as u32, bitmap.image.height as u32],
            _ => [1, 1],
        };
        let fov_x = fov_x(p, size)?;
        let scale = not_negative(p, "scale", 1.0)?;
        let to_world = self.placed(p)?.as_mat4();
        let half_x = (0.5 * fov_x).tan();
        let half = Vec2::new(half_x, half_x * size[1] as f32 / size[0] as f32);
        Ok(Emitter::Projector {
            position: to_world.transform_point3(Vec3::ZERO),
            direction: axis(p, &to_world)?,
            // Mitsuba's camera space has x to the left and y up, and v goes down.
            image: Box::new(Pattern { texture: texture.scaled(scale), to_local: inverse(&to_world), half: -half }),
            cutoff_rad: half.length().atan(),
        })
    }
}

fn inverse(to_world: &Mat4) -> Affine3A {
    Affine3A::from_mat4(*to_world).inverse()
}

/// The world direction of local +Z.
fn axis(p: &Params, to_world: &Mat4) -> Result<Vec3> {
    let direction = to_world.transform_vector3(Vec3::Z).try_normalize();
    direction.ok_or_else(|| p.at("to_world").error("the direction has no length"))
}

pub(super) fn not_negative(p: &mut Params, name: &str, default: f32) -> Result<f32> {
    let x = p.f32(name, default)?;
    if x >= 0.0 { Ok(x) } else { Err(p.at(name).error(format!("{name} = {x}: expected at least 0"))) }
}
