//! Scattering models and materials.

use super::Builder;
use crate::base::math::Rgb;
use crate::exchange::mitsuba::ior;
use crate::exchange::mitsuba::params::{Params, number_of, wrong};
use crate::exchange::mitsuba::tree::{Kind, MAX_DEPTH, Node, Value};
use crate::material::bsdf::{
    Blend, Bsdf, BumpMap, Conductor, Dielectric, DielectricParams, Diffuse, Distribution, NormalMap, Plastic, PlasticParams,
    Principled, PrincipledParams, RoughConductor, RoughDielectric, RoughPlastic, ThinDielectric, TwoSided,
};
use crate::material::{Material, Opacity, Texture};
use crate::{Error, Result};

const KNOWN: &str = "diffuse, plastic, roughplastic, conductor, roughconductor, dielectric, thindielectric, roughdielectric, \
                     twosided, mask, null, bumpmap, normalmap, blendbsdf, principled";

const DISTRIBUTIONS: [(&str, Distribution); 2] = [("beckmann", Distribution::Beckmann), ("ggx", Distribution::Ggx)];

/// A scattering model and the coverage that a `mask` in or around it gives.
type Masked = (Bsdf, Option<Opacity>);

impl<'a> Builder<'a> {
    /// Index of the material of a scattering model. Where several shapes refer to it, they share it.
    pub(super) fn material(&mut self, node: &'a Node, shape: &str) -> Result<u32> {
        if let Some(&index) = self.materials.get(&(node as *const Node)) {
            return Ok(index);
        }
        self.of_one_shape = false;
        let (bsdf, opacity) = self.bsdf(node, 0)?;
        let name = match &node.id {
            Some(id) => id.clone(),
            None if shape.is_empty() => format!("{}.{}", node.plugin, self.scene.materials.len()),
            None => format!("{shape}.{}", node.plugin),
        };
        let index = self.scene.materials.len() as u32;
        self.scene.materials.push(Material { name, bsdf, opacity });
        if !self.of_one_shape {
            self.materials.insert(node, index);
        }
        Ok(index)
    }

    /// What a shape without a scattering model gets: Mitsuba's grey.
    pub(super) fn default_material(&mut self) -> u32 {
        *self.default_material.get_or_insert_with(|| {
            self.scene.materials.push(Material { name: "default".into(), bsdf: grey(0.5), opacity: None });
            self.scene.materials.len() as u32 - 1
        })
    }

    fn bsdf(&mut self, node: &'a Node, depth: usize) -> Result<Masked> {
        self.count(node)?;
        if depth > MAX_DEPTH {
            return Err(node
                .at
                .error(format!("scattering models are nested more than {MAX_DEPTH} deep: do they refer to themselves?")));
        }
        let mut params = self.params(node);
        let p = &mut params;
        let built = match node.plugin.as_str() {
            "twosided" | "mask" | "bumpmap" | "normalmap" | "blendbsdf" => self.adapter(p, depth),
            // Light goes through as if nothing were there.
            "null" => Ok((grey(0.0), Some(Opacity::constant(0.0)))),
            _ => self.model(p).map(|model| (model, None)),
        };
        match self.or_left_out(built, "a grey diffuse surface stands for it")? {
            Some(masked) => {
                params.finish(&mut self.scene.warnings);
                Ok(masked)
            }
            None => Ok((grey(0.5), None)),
        }
    }

    fn model(&mut self, p: &mut Params<'a>) -> Result<Bsdf> {
        // Errors of the models' own checks come without a line.
        let at = &p.node.at;
        let located = |e: Error| match e {
            Error::Request(m) => at.error(m),
            e => e,
        };
        Ok(match p.node.plugin.as_str() {
            "diffuse" => {
                let name = if p.has("diffuse_reflectance") { "diffuse_reflectance" } else { "reflectance" };
                Bsdf::Diffuse(Diffuse { reflectance: self.textured(p, name, 0.5)? })
            }
            "plastic" => Bsdf::Plastic(Box::new(Plastic::new(self.plastic(p)?).map_err(located)?)),
            "roughplastic" => {
                let distribution = distribution(p)?;
                let alpha = alpha_number(p)?;
                let params = self.plastic(p)?;
                Bsdf::RoughPlastic(Box::new(RoughPlastic::new(params, alpha, distribution).map_err(located)?))
            }
            "conductor" => Bsdf::Conductor(self.metal(p)?),
            "roughconductor" => {
                let distribution = distribution(p)?;
                let (alpha_u, alpha_v) = self.alphas(p)?;
                Bsdf::RoughConductor(Box::new(RoughConductor { metal: self.metal(p)?, alpha_u, alpha_v, distribution }))
            }
            "dielectric" => Bsdf::Dielectric(Box::new(Dielectric::new(self.dielectric(p)?).map_err(located)?)),
            "thindielectric" => Bsdf::ThinDielectric(Box::new(ThinDielectric::new(self.dielectric(p)?).map_err(located)?)),
            "roughdielectric" => {
                let distribution = distribution(p)?;
                let (alpha_u, alpha_v) = self.alphas(p)?;
                let params = self.dielectric(p)?;
                Bsdf::RoughDielectric(Box::new(RoughDielectric::new(params, alpha_u, alpha_v, distribution).map_err(located)?))
            }
            "principled" => Bsdf::Principled(Box::new(Principled::new(self.principled(p)?).map_err(located)?)),
            _ => return Err(Self::unknown(p.node, "bsdf", KNOWN)),
        })
    }

    fn adapter(&mut self, p: &mut Params<'a>, depth: usize) -> Result<Masked> {
        let node = p.node;
        let nested = p.children(Kind::Bsdf)?;
        let allowed = match node.plugin.as_str() {
            "twosided" => 1..=2,
            "blendbsdf" => 2..=2,
            _ => 1..=1,
        };
        if !allowed.contains(&nested.len()) {
            let message = format!("{}: found {} nested bsdfs, expected {}", node.plugin, nested.len(), allowed.end());
            return Err(node.at.error(message));
        }
        let mut built = Error::gather(nested.iter().map(|n| self.bsdf(n, depth + 1)).collect::<Vec<_>>())?.into_iter();
        let (first, opacity) = built.next().ok_or_else(|| node.at.error("no nested bsdf"))?;
        let (second, boxed) = (built.next(), Box::new(first));
        Ok(match node.plugin.as_str() {
            "twosided" => {
                // Coverage is the material's: where the sides differ, each has its own.
                let opacity = match &second {
                    Some((_, behind)) if opacity.is_some() || behind.is_some() => {
                        let [front, back] = [&opacity, behind].map(|o| o.clone().unwrap_or(Opacity::constant(1.0)));
                        Some(Opacity::Sides(Box::new([front, back])))
                    }
                    _ => opacity,
                };
                let back = second.map_or_else(|| boxed.clone(), |(b, _)| Box::new(b));
                (Bsdf::TwoSided(TwoSided { front: boxed, back }), opacity)
            }
            "mask" => {
                let own = self.scalar(p, "opacity", 0.5)?;
                if matches!(own, Texture::Attribute(_)) {
                    p.warn(node.at.warning("mask: of a mesh_attribute the mean is taken"));
                }
                let own = Opacity::Texture(own);
                let both = match opacity {
                    None => own,
                    Some(nested) => Opacity::product(own, nested),
                };
                (*boxed, Some(both))
            }
            "bumpmap" => {
                // Heights are lengths.
                let scale = p.f32("scale", 1.0)? * self.unit_scale;
                (Bsdf::BumpMap(BumpMap { texture: self.only_texture(p)?, scale, nested: boxed }), opacity)
            }
            "normalmap" => (Bsdf::NormalMap(NormalMap { texture: self.only_texture(p)?, nested: boxed }), opacity),
            _ => {
                let (b, other_opacity) = second.ok_or_else(|| node.at.error("no second nested bsdf"))?;
                let weight = self.scalar(p, "weight", 0.5)?;
                let mut blend = Blend { weight, a: boxed, b: Box::new(b), coverage: None };
                if opacity.is_none() && other_opacity.is_none() {
                    return Ok((Bsdf::Blend(blend), None));
                }
                let [a, b] = [opacity, other_opacity].map(|o| o.unwrap_or(Opacity::constant(1.0)));
                blend.coverage = Some(Box::new([a.clone(), b.clone()]));
                let opacity = Opacity::blend(blend.weight.clone(), a, b);
                (Bsdf::Blend(blend), Some(opacity))
            }
        })
    }

    fn only_texture(&mut self, p: &mut Params<'a>) -> Result<Texture> {
        match p.children(Kind::Texture)?.as_slice() {
            [texture] => self.texture(texture),
            found => Err(p.node.at.error(format!("{}: found {} textures, expected 1", p.node.plugin, found.len()))),
        }
    }

    fn plastic(&mut self, p: &mut Params<'a>) -> Result<PlasticParams> {
        p.accept(&["specular_sampling_weight", "sample_visible", "distribution"]);
        Ok(PlasticParams {
            int_ior: index_of_refraction(p, "int_ior", "polypropylene")?,
            ext_ior: index_of_refraction(p, "ext_ior", "air")?,
            nonlinear: p.bool("nonlinear", false)?,
            diffuse_reflectance: self.textured(p, "diffuse_reflectance", 0.5)?,
            specular_reflectance: self.textured(p, "specular_reflectance", 1.0)?,
        })
    }

    fn dielectric(&mut self, p: &mut Params<'a>) -> Result<DielectricParams> {
        Ok(DielectricParams {
            int_ior: index_of_refraction(p, "int_ior", "bk7")?,
            ext_ior: index_of_refraction(p, "ext_ior", "air")?,
            specular_reflectance: self.textured(p, "specular_reflectance", 1.0)?,
            specular_transmittance: self.textured(p, "specular_transmittance", 1.0)?,
        })
    }

    fn metal(&mut self, p: &mut Params<'a>) -> Result<Conductor> {
        let specular_reflectance = self.textured(p, "specular_reflectance", 1.0)?;
        let outside = index_of_refraction(p, "ext_eta", "vacuum")?;
        let given = p.has("eta") || p.has("k");
        let (eta, k) = match p.text("material")? {
            Some("none") | None if !given => (Rgb::ZERO, Rgb::ZERO),
            Some(name) if name != "none" => ior::metal(name).ok_or_else(|| {
                p.at("material").error(format!("unknown metal \"{name}\": expected none or one of {}", ior::metal_names()))
            })?,
            // As in Mitsuba: what is not given is that of `none`.
            _ => (self.mean_color(p, "eta", Rgb::ZERO)?, self.mean_color(p, "k", Rgb::ONE)?),
        };
        Ok(Conductor { eta: eta / outside, k: k / outside, specular_reflectance })
    }

    /// A colour, or the mean of a texture.
    fn mean_color(&mut self, p: &mut Params<'a>, name: &str, default: Rgb) -> Result<Rgb> {
        let Some(param) = p.get(name) else { return Ok(default) };
        if let Some(color) = p.color_of(param)? {
            return Ok(color);
        }
        p.warn(param.at.warning(format!("{name}: of a texture the mean is taken")));
        Ok(self.textured(p, name, 0.0)?.mean())
    }

    fn alphas(&mut self, p: &mut Params<'a>) -> Result<(Texture, Texture)> {
        if p.has("alpha") {
            let alpha = self.scalar(p, "alpha", 0.1)?;
            return Ok((alpha.clone(), alpha));
        }
        Ok((self.scalar(p, "alpha_u", 0.1)?, self.scalar(p, "alpha_v", 0.1)?))
    }

    fn principled(&mut self, p: &mut Params<'a>) -> Result<PrincipledParams> {
        p.accept(&["main_specular_sampling_rate", "clearcoat_sampling_rate", "diffuse_reflectance_sampling_rate"]);
        let eta = match p.has("eta") {
            true => p.positive("eta", 1.5)?,
            false => Principled::eta_from_specular(p.f32("specular", 0.5)?),
        };
        Ok(PrincipledParams {
            base_color: self.textured(p, "base_color", 0.5)?,
            roughness: self.scalar(p, "roughness", 0.5)?,
            anisotropic: self.scalar(p, "anisotropic", 0.0)?,
            metallic: self.scalar(p, "metallic", 0.0)?,
            spec_trans: self.scalar(p, "spec_trans", 0.0)?,
            eta,
            spec_tint: self.scalar(p, "spec_tint", 0.0)?,
            sheen: self.scalar(p, "sheen", 0.0)?,
            sheen_tint: self.scalar(p, "sheen_tint", 0.0)?,
            flatness: self.scalar(p, "flatness", 0.0)?,
            clearcoat: self.scalar(p, "clearcoat", 0.0)?,
            clearcoat_gloss: self.scalar(p, "clearcoat_gloss", 0.0)?,
        })
    }
}

fn grey(reflectance: f32) -> Bsdf {
    Bsdf::Diffuse(Diffuse { reflectance: Texture::Constant(Rgb::splat(reflectance)) })
}

fn distribution(p: &mut Params) -> Result<Distribution> {
    p.accept(&["sample_visible"]);
    p.choice_of_any_case("distribution", Distribution::Beckmann, &DISTRIBUTIONS)
}

fn alpha_number(p: &mut Params) -> Result<f32> {
    let alpha = p.f32("alpha", 0.1)?;
    if alpha < 0.0 {
        p.warn(p.at("alpha").warning(format!("alpha = {alpha}: 0 is taken for what is below")));
    }
    Ok(alpha.max(0.0))
}

/// A number or a name; `default` is a name.
fn index_of_refraction(p: &mut Params, name: &str, default: &str) -> Result<f32> {
    let Some(param) = p.get(name) else { return Ok(ior::dielectric(default).unwrap_or(1.0)) };
    if let Value::Text(medium) = &param.value {
        let known = || ior::names(&ior::DIELECTRICS);
        return ior::dielectric(medium)
            .ok_or_else(|| param.at.error(format!("unknown medium \"{medium}\": expected one of {}", known())));
    }
    match number_of(param, p.node)? {
        Some(ior) if ior > 0.0 => Ok(ior),
        Some(ior) => Err(param.at.error(format!("{name} = {ior}: expected more than 0"))),
        None => Err(wrong(param, p.node, "a number or a medium's name")),
    }
}
