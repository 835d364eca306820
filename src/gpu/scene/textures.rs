//! Textures and the pixels of their images.

use super::{NONE, Words};
use crate::gpu::spec::{StructLayout, layout};
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

/// A texture, as the constants `TEXTURE_...` of scene.wgsl have it.
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

pub(crate) const IMAGE: StructLayout = layout!(GpuImage as "Image" { offset, width, height, bytes });
#[cfg(test)]
pub(crate) const TEXTURE: StructLayout =
    layout!(GpuTexture as "TEXTURE" { to_u, kind, to_v, wrap, color0, scale, color1, nearest, image });

pub(crate) const CONSTANT: u32 = 0;
pub(crate) const BITMAP: u32 = 1;
pub(crate) const CHECKERBOARD: u32 = 2;
/// A checkerboard whose colours are the textures `image.offset` and `image.width`.
pub(crate) const CHECKERED: u32 = 3;
pub(crate) const REPEAT: u32 = 0;
pub(crate) const MIRROR: u32 = 1;
pub(crate) const CLAMP: u32 = 2;

/// All textures, with each image once.
#[derive(Default)]
pub(crate) struct Textures {
    pub list: Vec<GpuTexture>,
    /// What of the scene's materials the kernels do not know, if anything.
    pub unknown: Option<&'static str>,
    images: Vec<(Arc<Image>, GpuImage)>,
    /// Tables of linear values that bytes stand for, and where they lie.
    linear: Vec<(Box<[f32; 256]>, u32)>,
}

impl Textures {
    /// Adds a texture; its index.
    pub fn add(&mut self, texture: &Texture, words: &mut Words) -> u32 {
        let texture = match texture {
            Texture::Constant(c) => GpuTexture { kind: CONSTANT, color0: c.to_array(), ..GpuTexture::default() },
            Texture::Bitmap(bitmap) => GpuTexture {
                kind: BITMAP,
                wrap: match bitmap.wrap {
                    Wrap::Repeat => REPEAT,
                    Wrap::Mirror => MIRROR,
                    Wrap::Clamp => CLAMP,
                },
                scale: bitmap.scale,
                nearest: u32::from(bitmap.nearest),
                image: self.image(&bitmap.image, words),
                ..placed(&bitmap.to_uv)
            },
            Texture::Checkerboard { colors, to_uv } => match &**colors {
                [Texture::Constant(color0), Texture::Constant(color1)] => {
                    GpuTexture { kind: CHECKERBOARD, color0: color0.to_array(), color1: color1.to_array(), ..placed(to_uv) }
                }
                [a, b] => {
                    let (offset, width) = (self.add(a, words), self.add(b, words));
                    GpuTexture { kind: CHECKERED, image: GpuImage { offset, width, ..GpuImage::default() }, ..placed(to_uv) }
                }
            },
            Texture::Attribute(_) => {
                self.unknown = Some("mesh_attribute textures");
                GpuTexture::default()
            }
        };
        self.list.push(texture);
        self.list.len() as u32 - 1
    }

    /// Adds an image unless it is there.
    pub fn image(&mut self, image: &Arc<Image>, words: &mut Words) -> GpuImage {
        if let Some((_, known)) = self.images.iter().find(|(i, _)| Arc::ptr_eq(i, image)) {
            return *known;
        }
        let (offset, bytes) = match &image.pixels {
            Pixels::Float(pixels) => (words.floats(pixels.iter().flat_map(|p| p.to_array())), NONE),
            Pixels::Bytes { rgb, linear } => {
                let offset = words.extend(rgb.chunks_exact(3).map(|p| u32::from_le_bytes([p[0], p[1], p[2], 0])));
                let bytes = match self.linear.iter().find(|(known, _)| known == linear) {
                    Some((_, at)) => *at,
                    None => {
                        let at = words.floats(linear.iter().copied());
                        self.linear.push((linear.clone(), at));
                        at
                    }
                };
                (offset, bytes)
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
