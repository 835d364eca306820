//! Texture plugins.

use super::Builder;
use crate::Result;
use crate::base::math::Rgb;
use crate::exchange::mitsuba::params::{Params, color_of, wrong};
use crate::exchange::mitsuba::tree::{Kind, Node};
use crate::material::Texture;
use crate::material::texture::{Bitmap, Wrap};
use glam::{Affine2, DMat4, Mat2, Vec2};

const WRAPS: [(&str, Wrap); 3] = [("repeat", Wrap::Repeat), ("mirror", Wrap::Mirror), ("clamp", Wrap::Clamp)];
const FILTERS: [(&str, bool); 4] = [("bilinear", false), ("nearest", true), ("trilinear", false), ("ewa", false)];

impl<'a> Builder<'a> {
    /// A parameter that may be textured.
    pub(super) fn textured(&mut self, params: &mut Params<'a>, name: &str, default: f32) -> Result<Texture> {
        let Some(p) = params.get(name) else { return Ok(Texture::Constant(Rgb::splat(default))) };
        if let Some(color) = color_of(p, params.node)? {
            return Ok(Texture::Constant(color));
        }
        match params.plugin_of(p)? {
            Some(node) if node.kind == Kind::Texture => self.texture(node),
            _ => Err(wrong(p, params.node, "a colour or a texture")),
        }
    }

    /// A texture plugin.
    pub(super) fn texture(&mut self, node: &'a Node) -> Result<Texture> {
        self.count(node)?;
        let mut params = self.params(node);
        let texture = match node.plugin.as_str() {
            "bitmap" => {
                params.file()?;
                // Whether the pixels are linear is settled when the file is read. The rest is about memory and speed.
                params.accept(&["raw", "gamma", "format", "accel", "cache", "max_anisotropy"]);
                let wrap = match params.has("wrap_mode") {
                    true => params.choice("wrap_mode", Wrap::Repeat, &WRAPS)?,
                    false => {
                        let u = params.choice("wrap_mode_u", Wrap::Repeat, &WRAPS)?;
                        let v = params.choice("wrap_mode_v", u, &WRAPS)?;
                        if u != v {
                            let at = params.at("wrap_mode_v");
                            self.scene.warnings.push(at.warning("wrapping differs along u and v: that of u is taken for both"));
                        }
                        u
                    }
                };
                let nearest = params.choice("filter_type", false, &FILTERS)?;
                let to_uv = to_uv(&mut params)?;
                Texture::Bitmap(Bitmap { image: self.assets.image(node)?, to_uv, nearest, wrap, scale: 1.0 })
            }
            "checkerboard" => Texture::Checkerboard {
                color0: params.color("color0", Rgb::splat(0.4))?,
                color1: params.color("color1", Rgb::splat(0.2))?,
                to_uv: to_uv(&mut params)?,
            },
            _ => return Err(Self::unknown(node, "texture", "bitmap, checkerboard")),
        };
        params.finish(&mut self.scene.warnings);
        Ok(texture)
    }
}

/// `to_uv`, or 0.6's scale and offset (offset first, as Mitsuba 3 converts them).
fn to_uv(params: &mut Params) -> Result<Affine2> {
    let scale = Vec2::new(params.f32("uscale", 1.0)?, params.f32("vscale", 1.0)?);
    let offset = Vec2::new(params.f32("uoffset", 0.0)?, params.f32("voffset", 0.0)?);
    Ok(affine2(&params.transform("to_uv")?) * Affine2::from_scale(scale) * Affine2::from_translation(offset))
}

fn affine2(m: &DMat4) -> Affine2 {
    let column = |i: usize| Vec2::new(m.col(i).x as f32, m.col(i).y as f32);
    Affine2::from_mat2_translation(Mat2::from_cols(column(0), column(1)), column(3))
}
