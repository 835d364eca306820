//! Materials: metallic-roughness as our `principled`, with what the ratified extensions add.

use super::file::File;
use super::textures::{Place, Textures};
use crate::Result;
use crate::base::math::{Rgb, luminance};
use crate::material::bsdf::{
    Blend, Bsdf, DielectricParams, Diffuse, NormalMap, Principled, PrincipledParams, ThinDielectric, TwoSided,
};
use crate::material::image::Take;
use crate::material::texture::Bitmap;
use crate::material::{Opacity, Texture};
use glam::Vec3;
use gltf_json::extensions::material::Material as Extensions;
use gltf_json::material::{AlphaMode, Material};
use gltf_json::validation::Checked;
use std::sync::Arc;

/// Roughness past which a thin pane would blur what is behind it.
const CLEAR: f32 = 0.1;

/// What a material looks like.
#[derive(Debug, Clone)]
pub struct Look {
    /// Its scattering model, but for normals and sides.
    pub surface: Surface,
    /// Coverage.
    pub opacity: Option<Opacity>,
    /// Radiance that leaves its front.
    pub emission: Option<Texture>,
    /// Tangent-space normals.
    pub normals: Option<Normals>,
    /// The texture coordinates that its textures lie on.
    pub set: u32,
    /// Whether colours of vertices count.
    pub plain: bool,
}

/// A normal map and the factor on its slopes.
#[derive(Debug, Clone)]
pub struct Normals {
    texture: Texture,
    scale: f32,
}

impl Normals {
    /// The map for texture coordinates as they are, or for mirrored ones, whose second axis our frames turn round.
    fn texture(&self, mirrored: bool) -> Texture {
        match &self.texture {
            Texture::Bitmap(bitmap) if mirrored || self.scale != 1.0 => {
                let signs = Vec3::new(self.scale, if mirrored { -self.scale } else { self.scale }, 1.0);
                let image = bitmap.image.changed(|p| (p * 2.0 - 1.0) * signs * 0.5 + 0.5);
                Texture::Bitmap(Bitmap { image: Arc::new(image), ..bitmap.clone() })
            }
            texture => texture.clone(),
        }
    }
}

/// A scattering model whose colour may be the mesh's.
#[derive(Debug, Clone)]
pub enum Surface {
    /// Reflects nothing: all light that leaves it is emitted.
    Dark,
    /// Metallic-roughness.
    Principled(Box<PrincipledParams>),
    /// The same in front of what lies behind a thin pane; the share that the pane lets through, and its index of refraction.
    Pane(Box<PrincipledParams>, Texture, f32),
}

impl Look {
    /// The constant colour that those of vertices are multiplied by.
    pub fn base(&self) -> Rgb {
        match &self.surface {
            Surface::Dark => Rgb::ZERO,
            Surface::Principled(params) | Surface::Pane(params, ..) => params.base_color.mean(),
        }
    }

    /// The scattering model: seen from both sides, as modelling programs show it, but where light goes in.
    pub fn bsdf(&self, mirrored: bool, vertex_colors: Option<Texture>) -> Result<Bsdf> {
        let tilted = |bsdf: Bsdf| match &self.normals {
            Some(normals) => Bsdf::NormalMap(NormalMap { texture: normals.texture(mirrored), nested: Box::new(bsdf) }),
            None => bsdf,
        };
        let both_sides = |bsdf: Bsdf| Bsdf::TwoSided(TwoSided { front: Box::new(bsdf.clone()), back: Box::new(bsdf) });
        let colored = |params: &PrincipledParams| {
            let base_color = vertex_colors.clone().unwrap_or_else(|| params.base_color.clone());
            PrincipledParams { base_color, ..params.clone() }
        };
        Ok(match &self.surface {
            Surface::Dark => both_sides(Bsdf::Diffuse(Diffuse { reflectance: Texture::Constant(Rgb::ZERO) })),
            Surface::Principled(params) => {
                let bsdf = tilted(Bsdf::Principled(Box::new(Principled::new(colored(params))?)));
                if is_zero(&params.spec_trans) { both_sides(bsdf) } else { bsdf }
            }
            Surface::Pane(params, share, ior) => {
                let params = colored(params);
                let pane = ThinDielectric::new(DielectricParams {
                    int_ior: *ior,
                    ext_ior: 1.0,
                    specular_reflectance: white(1.0),
                    specular_transmittance: params.base_color.clone(),
                })?;
                let pane = Bsdf::ThinDielectric(Box::new(pane));
                if matches!(share, Texture::Constant(c) if luminance(*c) >= 1.0) {
                    return Ok(pane);
                }
                let opaque = both_sides(tilted(Bsdf::Principled(Box::new(Principled::new(params)?))));
                Bsdf::Blend(Blend { weight: share.clone(), a: Box::new(opaque), b: Box::new(pane), coverage: None })
            }
        })
    }
}

/// Reads materials; all that is odd goes to `warnings`.
pub struct Reader<'a> {
    pub file: &'a File,
    pub textures: &'a mut Textures,
    pub warnings: &'a mut Vec<String>,
}

impl Reader<'_> {
    /// What a material looks like; `name` is for warnings.
    pub fn look(&mut self, material: &Material, name: &str) -> Result<Look> {
        let pbr = &material.pbr_metallic_roughness;
        let nothing = Extensions::default();
        let more = material.extensions.as_ref().unwrap_or(&nothing);
        let gloss = more.pbr_specular_glossiness.as_ref();
        let (color, factor) = match gloss {
            Some(gloss) => (gloss.diffuse_texture.as_ref(), gloss.diffuse_factor.0),
            None => (pbr.base_color_texture.as_ref(), pbr.base_color_factor.0),
        };
        let color = color.map(Place::of);
        let [r, g, b, alpha] = factor;
        let base_color = self.color(color, Rgb::new(r, g, b))?;
        let normals = material.normal_texture.as_ref();
        let places = [
            color,
            gloss.and(None).or(pbr.metallic_roughness_texture.as_ref()).map(Place::of),
            normals.map(Place::of_normals),
            material.emissive_texture.as_ref().map(Place::of),
        ];
        let look = Look {
            surface: self.surface(material, more, base_color.clone(), name)?,
            opacity: self.opacity(material, color, alpha)?,
            emission: self.emission(material, more, base_color)?,
            normals: normals.map(|info| self.normals(Place::of_normals(info), info.scale)).transpose()?,
            set: places.iter().flatten().map(|p| p.set).next().unwrap_or(0),
            plain: color.is_none(),
        };
        if places.iter().flatten().any(|p| p.set != look.set) {
            self.warn(name, "its textures lie on several sets of texture coordinates: all are taken on that of the first");
        }
        Ok(look)
    }

    fn surface(&mut self, material: &Material, more: &Extensions, base_color: Texture, name: &str) -> Result<Surface> {
        if more.unlit.is_some() {
            return Ok(Surface::Dark);
        }
        let pbr = &material.pbr_metallic_roughness;
        let ior = more.ior.as_ref().map_or(1.5, |ior| ior.ior.0);
        let mut params = PrincipledParams { base_color, ..PrincipledParams::default() };
        match &more.pbr_specular_glossiness {
            Some(gloss) => {
                params.roughness = white(1.0 - gloss.glossiness_factor.0);
                params.eta = eta_of(luminance(Rgb::from_array(gloss.specular_factor.0)).min(0.2));
                self.warn(name, "specular-glossiness is taken without its texture and for a dielectric");
            }
            None => {
                let place = pbr.metallic_roughness_texture.as_ref().map(Place::of);
                params.roughness = self.scalar(place, 1, pbr.roughness_factor.0)?;
                params.metallic = self.scalar(place, 2, pbr.metallic_factor.0)?;
                let specular = more.specular.as_ref();
                let factor = specular.map_or(1.0, |s| s.specular_factor.0);
                let colored = |s: &&gltf_json::extensions::material::Specular| {
                    s.specular_texture.is_some() || s.specular_color_texture.is_some() || s.specular_color_factor.0 != [1.0; 3]
                };
                if specular.as_ref().is_some_and(colored) {
                    self.warn(name, "of KHR_materials_specular the factor counts alone");
                }
                params.eta = eta_of(((ior - 1.0) / (ior + 1.0)).powi(2) * factor.clamp(0.0, 1.0));
            }
        }
        let Some(through) = more.transmission.as_ref().filter(|t| t.transmission_factor.0 > 0.0) else {
            return Ok(Surface::Principled(Box::new(params)));
        };
        let share = self.scalar(through.transmission_texture.as_ref().map(Place::of), 0, through.transmission_factor.0)?;
        if let Some(volume) = more.volume.as_ref().filter(|v| v.thickness_factor.0 > 0.0) {
            if volume.attenuation_distance.0.is_finite() && volume.attenuation_distance.0 > 0.0 {
                self.warn(name, "what its inside absorbs is left out");
            }
            (params.spec_trans, params.eta) = (share, ior);
            return Ok(Surface::Principled(Box::new(params)));
        }
        if luminance(params.roughness.mean()) > CLEAR {
            self.warn(name, "a rough pane is taken for a clear one");
        }
        Ok(Surface::Pane(Box::new(params), share, ior))
    }

    fn opacity(&mut self, material: &Material, color: Option<Place>, alpha: f32) -> Result<Option<Opacity>> {
        let cut = match material.alpha_mode {
            Checked::Valid(AlphaMode::Mask) => Some(material.alpha_cutoff.map_or(0.5, |c| c.0)),
            Checked::Valid(AlphaMode::Blend) => None,
            _ => return Ok(None),
        };
        let coverage = self.scalar(color, 3, alpha)?;
        Ok(match (cut, coverage) {
            (None, Texture::Constant(c)) if c.x >= 1.0 => None,
            (None, coverage) => Some(Opacity::Texture(coverage)),
            (Some(cut), Texture::Constant(c)) => (c.x < cut).then(|| Opacity::constant(0.0)),
            (Some(cut), Texture::Bitmap(b)) => {
                let image = Arc::new(b.image.map(|x| if x * b.scale >= cut { 1.0 } else { 0.0 }));
                Some(Opacity::Texture(Texture::Bitmap(Bitmap { image, scale: 1.0, ..b })))
            }
            (Some(_), coverage) => Some(Opacity::Texture(coverage)),
        })
    }

    fn emission(&mut self, material: &Material, more: &Extensions, base_color: Texture) -> Result<Option<Texture>> {
        if more.unlit.is_some() {
            return Ok(Some(base_color));
        }
        let strength = more.emissive_strength.as_ref().map_or(1.0, |s| s.emissive_strength.0);
        let factor = Rgb::from_array(material.emissive_factor.0) * strength;
        if factor.max_element() <= 0.0 {
            return Ok(None);
        }
        let emission = self.color(material.emissive_texture.as_ref().map(Place::of), factor)?;
        Ok((emission.mean().max_element() > 0.0).then_some(emission))
    }

    fn normals(&mut self, place: Place, scale: f32) -> Result<Normals> {
        let texture = match self.textures.get(self.file, place, Take::Linear, Rgb::ONE)? {
            // Flat until its image is read.
            Texture::Constant(_) => Texture::Constant(Rgb::new(0.5, 0.5, 1.0)),
            texture => texture,
        };
        Ok(Normals { texture, scale })
    }

    fn color(&mut self, place: Option<Place>, factor: Rgb) -> Result<Texture> {
        match place {
            Some(place) => self.textures.get(self.file, place, Take::Color, factor),
            None => Ok(Texture::Constant(factor)),
        }
    }

    fn scalar(&mut self, place: Option<Place>, channel: u8, factor: f32) -> Result<Texture> {
        match place {
            Some(place) => self.textures.get(self.file, place, Take::Channel(channel), Rgb::splat(factor)),
            None => Ok(white(factor)),
        }
    }

    fn warn(&mut self, name: &str, what: &str) {
        let warning = format!("{}: material \"{name}\": {what}", self.file.path.display());
        if !self.warnings.contains(&warning) {
            self.warnings.push(warning);
        }
    }
}

fn white(value: f32) -> Texture {
    Texture::Constant(Rgb::splat(value))
}

fn is_zero(texture: &Texture) -> bool {
    matches!(texture, Texture::Constant(c) if *c == Rgb::ZERO)
}

/// The index of refraction that reflects a share `f0` of light at normal incidence.
fn eta_of(f0: f32) -> f32 {
    let root = f0.clamp(0.0, 0.99).sqrt();
    (1.0 + root) / (1.0 - root)
}
