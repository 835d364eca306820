//! Emitters that stand by themselves.

use super::Builder;
use crate::Result;
use crate::base::math::Rgb;
use crate::exchange::mitsuba::params::Params;
use crate::exchange::mitsuba::tree::Node;
use crate::scene::Emitter;
use glam::{Affine3A, Mat4, Vec3};

impl<'a> Builder<'a> {
    /// Adds an emitter.
    pub(super) fn emitter(&mut self, node: &'a Node) -> Result<()> {
        let mut params = self.params(node);
        let p = &mut params;
        p.accept(&["sampling_weight"]);
        // Lengths grow by the unit scale; so must intensities, for the same irradiance.
        let area_scale = self.unit_scale * self.unit_scale;
        if matches!(node.plugin.as_str(), "envmap" | "constant") {
            self.environments += 1;
            if self.environments > 1 {
                return Err(node.at.error("a second environment: expected one envmap or constant"));
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
            "spot" => {
                let intensity = p.color("intensity", Rgb::ONE)? * area_scale;
                let to_world = self.placed(p)?.as_mat4();
                let cutoff = p.positive("cutoff_angle", 20.0)?;
                let beam = not_negative(p, "beam_width", 0.75 * cutoff)?;
                if beam > cutoff || cutoff > 180.0 {
                    let message = format!("cutoff_angle = {cutoff}, beam_width = {beam}: expected beam <= cutoff <= 180");
                    return Err(node.at.error(message));
                }
                Emitter::Spot {
                    position: to_world.transform_point3(Vec3::ZERO),
                    direction: axis(p, &to_world)?,
                    intensity,
                    cutoff_rad: cutoff.to_radians(),
                    beam_rad: beam.to_radians(),
                }
            }
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
            "area" => return Err(node.at.error("found an area emitter by itself, expected it within a shape")),
            _ => return Err(Self::unknown(node, "emitter", "area, envmap, constant, point, spot, directional")),
        };
        params.finish(&mut self.scene.warnings);
        self.scene.emitters.push(emitter);
        Ok(())
    }
}

/// The world direction of local +Z.
fn axis(p: &Params, to_world: &Mat4) -> Result<Vec3> {
    let direction = to_world.transform_vector3(Vec3::Z).try_normalize();
    direction.ok_or_else(|| p.at("to_world").error("the direction has no length"))
}

fn not_negative(p: &mut Params, name: &str, default: f32) -> Result<f32> {
    let x = p.f32(name, default)?;
    if x >= 0.0 { Ok(x) } else { Err(p.at(name).error(format!("{name} = {x}: expected at least 0"))) }
}
