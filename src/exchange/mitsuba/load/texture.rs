//! Texture plugins.

use super::Builder;
use crate::Result;
use crate::base::math::Rgb;
use crate::exchange::mitsuba::params::{Params, wrong};
use crate::exchange::mitsuba::spectrum_plugin;
use crate::exchange::mitsuba::tree::{Kind, MAX_DEPTH, Node};
use crate::material::Texture;
use crate::material::texture::{Bitmap, Wrap};
use glam::{Affine2, DMat4, Mat2, Vec2};

const KNOWN: &str = "bitmap, checkerboard, mesh_attribute, uniform, d65, regular, irregular, blackbody, srgb, rawconstant";

const WRAPS: [(&str, Wrap); 3] = [("repeat", Wrap::Repeat), ("mirror", Wrap::Mirror), ("clamp", Wrap::Clamp)];
const FILTERS: [(&str, bool); 4] = [("bilinear", false), ("nearest", true), ("trilinear", false), ("ewa", false)];

impl<'a> Builder<'a> {
    /// A parameter that may be textured.
    pub(super) fn textured(&mut self, params: &mut Params<'a>, name: &str, default: f32) -> Result<Texture> {
        self.textured_within(params, name, default, 0)
    }

    /// A number that may be textured. As Mitsuba takes them: a colour counts by the mean of its channels (a bitmap's pixels by
    /// their luminance), and a checkerboard has its two values the other way round than as a colour.
    pub(super) fn scalar(&mut self, params: &mut Params<'a>, name: &str, default: f32) -> Result<Texture> {
        Ok(as_number(self.textured(params, name, default)?))
    }

    fn textured_within(&mut self, params: &mut Params<'a>, name: &str, default: f32, depth: usize) -> Result<Texture> {
        let Some(p) = params.get(name) else { return Ok(Texture::Constant(Rgb::splat(default))) };
        if let Some(color) = params.color_of(p)? {
            return Ok(Texture::Constant(color));
        }
        match params.plugin_of(p)? {
            Some(node) if node.kind == Kind::Texture => self.texture_within(node, depth + 1),
            _ => Err(wrong(p, params.node, "a colour or a texture")),
        }
    }

    /// A texture plugin.
    pub(super) fn texture(&mut self, node: &'a Node) -> Result<Texture> {
        self.texture_within(node, 0)
    }

    fn texture_within(&mut self, node: &'a Node, depth: usize) -> Result<Texture> {
        self.count(node)?;
        if depth > MAX_DEPTH {
            return Err(node.at.error(format!("textures are nested more than {MAX_DEPTH} deep: do they refer to themselves?")));
        }
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
            "checkerboard" => {
                let colors = [
                    self.textured_within(&mut params, "color0", 0.4, depth)?,
                    self.textured_within(&mut params, "color1", 0.2, depth)?,
                ];
                Texture::Checkerboard { colors: Box::new(colors), to_uv: to_uv(&mut params)? }
            }
            "mesh_attribute" => self.mesh_attribute(&mut params)?,
            // A white light whose colour varies.
            "d65" if !params.children(Kind::Texture)?.is_empty() => match params.children(Kind::Texture)?.as_slice() {
                [colors] => self.texture_within(colors, depth + 1)?.scaled(params.f32("scale", 1.0)?),
                found => return Err(node.at.error(format!("d65: found {} textures, expected at most 1", found.len()))),
            },
            plugin if spectrum_plugin::NAMES.contains(&plugin) => {
                let color = spectrum_plugin::color(node, &mut params, false)?.unwrap_or(Rgb::ONE);
                params = self.params(node);
                params.accept_all();
                Texture::Constant(color)
            }
            _ => return Err(Self::unknown(node, "texture", KNOWN)),
        };
        params.finish(&mut self.scene.warnings);
        Ok(texture)
    }
}

fn as_number(texture: Texture) -> Texture {
    match texture {
        Texture::Constant(c) => Texture::Constant(Rgb::splat(c.element_sum() / 3.0)),
        Texture::Checkerboard { colors, to_uv } => {
            let [a, b] = *colors;
            Texture::Checkerboard { colors: Box::new([as_number(b), as_number(a)]), to_uv }
        }
        other => other,
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
