//! Textures and the pixels of their images.

use super::{NONE, Tables};
use crate::material::Texture;
use crate::material::image::{Image, Pixels};
use crate::material::texture::Wrap;
use bytemuck::{Pod, Zeroable};
use glam::Affine2;
use std::sync::Arc;

/// `Image` of scene.wgsl.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub(crate) struct GpuImage {
    offset: u32,
    width: u32,
    height: u32,
    bytes: u32,
}

/// `Texture` of scene.wgsl.
#[repr(C)]
#[derive(Clone, Copy, Default, Pod, Zeroable)]
pub(crate) struct GpuTexture {
    to_u: [f32; 3],
    kind: u32,
    to_v: [f32; 3],
    wrap: u32,
    color0: [f32; 3],
    scale: f32,
    color1: [f32; 3],
    nearest: u32,
    image: GpuImage,
}

const CONSTANT: u32 = 0;
const BITMAP: u32 = 1;
const CHECKERBOARD: u32 = 2;

/// All textures, with each image once.
#[derive(Default)]
pub(crate) struct Textures {
    pub list: Vec<GpuTexture>,
    /// Words that the images' offsets count.
    pub pixels: Vec<u32>,
    images: Vec<(Arc<Image>, GpuImage)>,
    /// Tables of linear values that bytes stand for, and where they lie.
    linear: Vec<(Box<[f32; 256]>, u32)>,
}

impl Textures {
    /// Adds a texture; its index.
    pub fn add(&mut self, texture: &Texture, tables: &mut Tables) -> u32 {
        let texture = match texture {
            Texture::Constant(c) => GpuTexture { kind: CONSTANT, color0: c.to_array(), ..GpuTexture::default() },
            Texture::Bitmap(bitmap) => GpuTexture {
                kind: BITMAP,
                wrap: match bitmap.wrap {
                    Wrap::Repeat => 0,
                    Wrap::Mirror => 1,
                    Wrap::Clamp => 2,
                },
                scale: bitmap.scale,
                nearest: u32::from(bitmap.nearest),
                image: self.image(&bitmap.image, tables),
                ..placed(&bitmap.to_uv)
            },
            Texture::Checkerboard { color0, color1, to_uv } => {
                GpuTexture { kind: CHECKERBOARD, color0: color0.to_array(), color1: color1.to_array(), ..placed(to_uv) }
            }
        };
        self.list.push(texture);
        self.list.len() as u32 - 1
    }

    /// Adds an image unless it is there.
    pub fn image(&mut self, image: &Arc<Image>, tables: &mut Tables) -> GpuImage {
        if let Some((_, known)) = self.images.iter().find(|(i, _)| Arc::ptr_eq(i, image)) {
            return *known;
        }
        let offset = self.pixels.len() as u32;
        let bytes = match &image.pixels {
            Pixels::Float(pixels) => {
                self.pixels.extend(pixels.iter().flat_map(|p| p.to_array().map(f32::to_bits)));
                NONE
            }
            Pixels::Bytes { rgb, linear } => {
                self.pixels.extend(rgb.chunks_exact(3).map(|p| u32::from_le_bytes([p[0], p[1], p[2], 0])));
                match self.linear.iter().find(|(known, _)| known == linear) {
                    Some((_, at)) => *at,
                    None => {
                        let at = tables.floats(linear.iter().copied());
                        self.linear.push((linear.clone(), at));
                        at
                    }
                }
            }
        };
        let there = GpuImage { offset, width: image.width as u32, height: image.height as u32, bytes };
        self.images.push((image.clone(), there));
        there
    }
}

fn placed(to_uv: &Affine2) -> GpuTexture {
    let (x, y, t) = (to_uv.matrix2.x_axis, to_uv.matrix2.y_axis, to_uv.translation);
    GpuTexture { to_u: [x.x, y.x, t.x], to_v: [x.y, y.y, t.y], ..GpuTexture::default() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gpu::layout::check;
    use crate::gpu::scene::RAYS;

    #[test]
    fn structs_are_laid_out_as_in_the_shader() {
        check!(RAYS, GpuImage as "Image" { offset, width, height, bytes });
        check!(RAYS, GpuTexture as "Texture" { to_u, kind, to_v, wrap, color0, scale, color1, nearest, image });
    }
}
