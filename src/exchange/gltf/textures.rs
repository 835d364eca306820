//! Images and the textures that they are part of.

use super::file::File;
use crate::Result;
use crate::base::math::Rgb;
use crate::material::Texture;
use crate::material::image::{self, Image, ReadOptions, Take};
use crate::material::texture::{Bitmap, Wrap};
use glam::{Affine2, Vec2};
use gltf_json::texture::{Info, MagFilter, Sampler, WrappingMode};
use gltf_json::validation::Checked;
use gltf_json::{Index, texture};
use rayon::prelude::*;
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::sync::Arc;

/// Where a texture is used: its number, the texture coordinates that it lies on and how they are changed first.
#[derive(Debug, Clone, Copy)]
pub struct Place {
    pub texture: Index<texture::Texture>,
    pub set: u32,
    pub to_uv: Affine2,
}

impl Place {
    /// What a material says of its texture.
    pub fn of(info: &Info) -> Self {
        let transform = info.extensions.as_ref().and_then(|e| e.texture_transform.as_ref());
        let set = transform.and_then(|t| t.tex_coord).unwrap_or(info.tex_coord);
        let to_uv = transform.map_or(Affine2::IDENTITY, |t| placed(t.offset.0, t.rotation.0, t.scale.0));
        Self { texture: info.index, set, to_uv }
    }

    /// The same of a normal map, whose extensions the schema's types leave as they are.
    pub fn of_normals(info: &gltf_json::material::NormalTexture) -> Self {
        let transform = info.extensions.as_ref().and_then(|e| e.others.get("KHR_texture_transform"));
        let number =
            |name: &str, i: usize, default: f64| transform.map_or(default, |t| t[name][i].as_f64().unwrap_or(default)) as f32;
        let rotation = transform.and_then(|t| t["rotation"].as_f64()).unwrap_or(0.0) as f32;
        let set = transform.and_then(|t| t["texCoord"].as_u64()).and_then(|n| n.try_into().ok());
        let offset = [number("offset", 0, 0.0), number("offset", 1, 0.0)];
        let to_uv = placed(offset, rotation, [number("scale", 0, 1.0), number("scale", 1, 1.0)]);
        Self { texture: info.index, set: set.unwrap_or(info.tex_coord), to_uv }
    }
}

/// `KHR_texture_transform`: scaled, turned against the clock as a picture shows it, moved.
fn placed(offset: [f32; 2], rotation: f32, scale: [f32; 2]) -> Affine2 {
    Affine2::from_scale_angle_translation(Vec2::ONE, -rotation, offset.into()) * Affine2::from_scale(scale.into())
}

/// Images by number and by what of them is taken. Materials are built twice: the first time they say what they want.
#[derive(Default)]
pub struct Textures {
    wanted: BTreeSet<(usize, Take)>,
    images: BTreeMap<(usize, Take), Arc<Image>>,
}

impl Textures {
    /// Reads what is wanted, in parallel.
    pub fn read(&mut self, file: &File, allow_truncated: bool, warnings: &mut Vec<String>) -> Result<()> {
        let wanted: Vec<_> = std::mem::take(&mut self.wanted).into_iter().collect();
        let read: Vec<_> =
            wanted.par_iter().map(|&(number, take)| read(file, number, ReadOptions { take, allow_truncated })).collect();
        for (key, (image, odd)) in wanted.into_iter().zip(crate::Error::gather(read)?) {
            warnings.extend(odd.into_iter().filter(|odd| !warnings.contains(odd)).collect::<Vec<_>>());
            self.images.insert(key, Arc::new(image));
        }
        Ok(())
    }

    /// A texture times a colour. Where its image is not there yet it is noted, and the colour stands for it.
    pub fn get(&mut self, file: &File, place: Place, take: Take, factor: Rgb) -> Result<Texture> {
        let texture = file.get(place.texture, "texture")?;
        let webp = texture.extensions.as_ref().and_then(|e| e.others.get("EXT_texture_webp")).and_then(|e| e["source"].as_u64());
        let number = webp.map_or(texture.source.value(), |n| usize::try_from(n).unwrap_or(usize::MAX));
        if number >= file.root.images.len() {
            let why = "expected an image; KTX2 textures are not supported";
            return Err(file.error(format!("texture {} has no image: {why}", place.texture.value())));
        }
        let Some(image) = self.images.get(&(number, take)) else {
            self.wanted.insert((number, take));
            return Ok(Texture::Constant(factor));
        };
        let sampler = match texture.sampler {
            Some(index) => file.get(index, "sampler")?,
            None => &Sampler::default(),
        };
        let (image, scale) = match factor {
            f if f.x == f.y && f.y == f.z => (image.clone(), f.x),
            f => (Arc::new(image.changed(|p| p * f)), 1.0),
        };
        let nearest = matches!(sampler.mag_filter, Some(Checked::Valid(MagFilter::Nearest)));
        Ok(Texture::Bitmap(Bitmap { image, to_uv: place.to_uv, nearest, wrap: wrap(sampler), scale }))
    }
}

/// How a texture goes on; ours do so alike in both directions.
fn wrap(sampler: &Sampler) -> Wrap {
    match sampler.wrap_s {
        Checked::Valid(WrappingMode::ClampToEdge) => Wrap::Clamp,
        Checked::Valid(WrappingMode::MirroredRepeat) => Wrap::Mirror,
        _ => Wrap::Repeat,
    }
}

fn read(file: &File, number: usize, options: ReadOptions) -> Result<(Image, Vec<String>)> {
    let image = &file.root.images[number];
    let named = |name: &str| Path::new(&format!("{} ({name})", file.path.display())).to_owned();
    let (path, bytes) = match (&image.uri, image.buffer_view) {
        (Some(uri), _) if uri.starts_with("data:") => (named(&format!("image {number}")), file.uri(uri)?),
        (Some(uri), _) => (file.beside(uri)?, file.uri(uri)?),
        (None, Some(view)) => (named(&format!("image {number}")), file.view(view)?.to_vec()),
        (None, None) => return Err(file.error(format!("image {number} has neither \"uri\" nor \"bufferView\""))),
    };
    image::decode(&path, &bytes, options)
}
