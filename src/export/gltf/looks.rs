//! Scattering models as metallic-roughness: exact for `principled` and diffuse surfaces, near for plastics and metals.

use super::pixels::{self, Picture};
use super::writer::Writer;
use crate::Result;
use crate::base::math::Rgb;
use crate::material::bsdf::{Bsdf, Conductor, Principled};
use crate::material::image::Image;
use crate::material::texture::{Bitmap, Wrap};
use crate::material::{Opacity, Surface, Texture};
use crate::scene::{Emitter, Scene};
use glam::{Affine2, Vec2, Vec3};
use serde_json::{Map, Value, json};
use std::sync::Arc;

/// Angle to the normal under which diffuse colours are taken: halfway to the horizon.
const VIEW: Vec3 = Vec3::new(std::f32::consts::FRAC_1_SQRT_2, 0.0, std::f32::consts::FRAC_1_SQRT_2);

/// What metallic-roughness knows of a model.
struct Look {
    /// Colour, of the diffuse light or of a metal.
    base: Texture,
    /// What the colour is multiplied by.
    tint: Rgb,
    roughness: Texture,
    metalness: Texture,
    /// Reflectance at normal incidence, as an index of refraction; 1 reflects nothing.
    ior: f32,
    /// Share of light that goes through, and whether there is an inside.
    glass: Option<(Texture, bool)>,
    normals: Option<Texture>,
}

/// A material of the scene with the light of an emitter, to be seen from both sides or from one. Its textures are written, it is not.
pub fn material(
    writer: &mut Writer,
    scene: &Scene,
    (material, emitter, both_sides): (u32, Option<u32>, bool),
    warnings: &mut Vec<String>,
) -> Result<Value> {
    let material = &scene.materials[material as usize];
    let radiance = match emitter.and_then(|e| scene.emitters.get(e as usize)) {
        Some(Emitter::Area { radiance, .. }) => Some(radiance),
        _ => None,
    };
    let mut odd = |what: &str| warnings.push(format!("material \"{}\": {what}", material.name));
    let look = look(&material.bsdf, &mut odd);
    let mut json = json!({ "name": material.name, "doubleSided": both_sides });
    let coverage = coverage(material.opacity.as_ref(), &mut odd);
    let mut pbr = Map::new();
    let (factor, texture) = base(writer, &look, coverage.as_ref())?;
    pbr.insert("baseColorFactor".into(), json!(factor));
    if let Some(texture) = texture {
        pbr.insert("baseColorTexture".into(), texture);
    }
    rough_metal(writer, &look, &mut pbr)?;
    json["pbrMetallicRoughness"] = Value::Object(pbr);
    if coverage.is_some() {
        json["alphaMode"] = json!("BLEND");
    }
    if let Some(Texture::Bitmap(bitmap)) = &look.normals {
        json["normalTexture"] = info(writer, bitmap, &pixels::linear(&bitmap.image))?;
    }
    let mut extensions = Map::new();
    match look.ior {
        1.0 => add(writer, &mut extensions, "KHR_materials_specular", json!({ "specularFactor": 0.0 })),
        1.5 => {}
        ior => add(writer, &mut extensions, "KHR_materials_ior", json!({ "ior": ior })),
    }
    if let Some((share, inside)) = &look.glass {
        let share = share.mean().x.clamp(0.0, 1.0);
        add(writer, &mut extensions, "KHR_materials_transmission", json!({ "transmissionFactor": share }));
        if *inside {
            add(writer, &mut extensions, "KHR_materials_volume", json!({ "thicknessFactor": 1.0 }));
        }
    }
    if let Some(radiance) = radiance {
        emission(writer, radiance, &mut json, &mut extensions)?;
    }
    if !extensions.is_empty() {
        json["extensions"] = Value::Object(extensions);
    }
    Ok(json)
}

fn add(writer: &mut Writer, extensions: &mut Map<String, Value>, name: &'static str, content: Value) {
    writer.uses(name);
    extensions.insert(name.into(), content);
}

fn look(bsdf: &Bsdf, odd: &mut dyn FnMut(&str)) -> Look {
    let white = |x: f32| Texture::Constant(Rgb::splat(x));
    let plain = |base: &Texture, roughness: f32, ior: f32| Look {
        base: base.clone(),
        tint: tint(bsdf, base),
        roughness: white(roughness),
        metalness: white(0.0),
        ior,
        glass: None,
        normals: None,
    };
    let metal = |metal: &Conductor, roughness: Texture| {
        let f0 = reflectance(metal);
        Look { metalness: white(1.0), roughness, tint: f0, ..plain(&metal.specular_reflectance, 0.0, 1.5) }
    };
    let glass = |ior: f32, roughness: Texture, inside: bool| Look {
        glass: Some((white(1.0), inside)),
        roughness,
        tint: Rgb::ONE,
        ..plain(&white(1.0), 0.0, ior)
    };
    match bsdf {
        Bsdf::Diffuse(d) => plain(&d.reflectance, 1.0, 1.0),
        Bsdf::Plastic(p) => plain(&p.params.diffuse_reflectance, 0.0, p.params.int_ior / p.params.ext_ior),
        Bsdf::RoughPlastic(p) => plain(&p.params.diffuse_reflectance, p.alpha.sqrt(), p.params.int_ior / p.params.ext_ior),
        Bsdf::Conductor(c) => metal(c, white(0.0)),
        Bsdf::RoughConductor(c) => metal(&c.metal, root(&c.alpha_u)),
        Bsdf::Dielectric(d) => glass(d.params.int_ior / d.params.ext_ior, white(0.0), true),
        Bsdf::ThinDielectric(d) => glass(d.params.int_ior / d.params.ext_ior, white(0.0), false),
        Bsdf::RoughDielectric(d) => glass(d.params.int_ior / d.params.ext_ior, root(&d.alpha_u), true),
        Bsdf::TwoSided(sides) => look(&sides.front, odd),
        Bsdf::NormalMap(map) => Look { normals: Some(map.texture.clone()), ..look(&map.nested, odd) },
        Bsdf::BumpMap(map) => {
            odd("its bumps are left out");
            look(&map.nested, odd)
        }
        Bsdf::Blend(blend) => {
            odd("of a blend the greater part is taken");
            look(if blend.weight.mean().x > 0.5 { &blend.b } else { &blend.a }, odd)
        }
        Bsdf::Principled(principled) => {
            let p = &principled.params;
            let through =
                (!matches!(&p.spec_trans, Texture::Constant(c) if *c == Rgb::ZERO)).then(|| (p.spec_trans.clone(), true));
            Look {
                roughness: p.roughness.clone(),
                metalness: p.metallic.clone(),
                tint: principled_tint(principled),
                glass: through,
                ..plain(&p.base_color, 0.0, p.eta)
            }
        }
    }
}

/// What the diffuse lobe sends out of a base colour, relative to it: what a coating keeps back.
fn tint(bsdf: &Bsdf, base: &Texture) -> Rgb {
    let out = bsdf.diffuse_out(&flat(), VIEW);
    // Textures are asked at one place there, so that their value is known here, too.
    let there = base.eval(flat().uv);
    let share = |out: f32, there: f32| if there > 0.0 { out / there } else { 1.0 };
    Rgb::new(share(out.x, there.x), share(out.y, there.y), share(out.z, there.z))
}

/// Where metal and glass take their share of the colour, viewers do the same.
fn principled_tint(principled: &Principled) -> Rgb {
    let p = &principled.params;
    let zero = Texture::Constant(Rgb::ZERO);
    let diffuse =
        Principled::new(crate::material::bsdf::PrincipledParams { metallic: zero.clone(), spec_trans: zero, ..p.clone() });
    diffuse.map_or(Rgb::ONE, |d| tint(&Bsdf::Principled(Box::new(d)), &p.base_color))
}

/// A point in the middle of a texture.
fn flat() -> Surface {
    Surface { uv: Vec2::splat(0.5), barycentric: Vec2::splat(1.0 / 3.0), ..Surface::flat(Vec3::ZERO, Vec3::Z) }
}

/// Reflectance of a metal at normal incidence.
fn reflectance(metal: &Conductor) -> Rgb {
    let of = |n: f32, k: f32| ((n - 1.0) * (n - 1.0) + k * k) / ((n + 1.0) * (n + 1.0) + k * k);
    Rgb::from_array(std::array::from_fn(|i| of(metal.eta[i], metal.k[i])))
}

/// Roughness of alpha.
fn root(alpha: &Texture) -> Texture {
    match alpha {
        Texture::Bitmap(b) => {
            let image = Arc::new(b.image.map(|a| (a * b.scale).max(0.0).sqrt()));
            Texture::Bitmap(Bitmap { image, scale: 1.0, ..b.clone() })
        }
        other => Texture::Constant(other.mean().max(Rgb::ZERO).map(f32::sqrt)),
    }
}

/// Coverage as a constant or an image.
fn coverage(opacity: Option<&Opacity>, odd: &mut dyn FnMut(&str)) -> Option<Texture> {
    match opacity? {
        Opacity::Texture(texture) => Some(texture.clone()),
        other => {
            odd("of nested masks the mean is taken");
            Some(Texture::Constant(Rgb::splat(other.eval(Vec2::splat(0.5), true))))
        }
    }
}

/// Factor and texture of the colour, with coverage as alpha.
fn base(writer: &mut Writer, look: &Look, coverage: Option<&Texture>) -> Result<([f32; 4], Option<Value>)> {
    let color = |c: Rgb, alpha: f32| {
        let [r, g, b] = c.clamp(Rgb::ZERO, Rgb::ONE).to_array();
        [r, g, b, alpha.clamp(0.0, 1.0)]
    };
    let (constant, covering) = match coverage {
        Some(Texture::Constant(c)) => (c.x, None),
        Some(Texture::Bitmap(bitmap)) => (1.0, Some(bitmap)),
        _ => (1.0, None),
    };
    let alpha = covering.map(|b| b.image.map(|x| x * b.scale));
    Ok(match (as_bitmap(&look.base), covering) {
        (Some(bitmap), _) => {
            let picture = pixels::color(&bitmap.image, alpha.as_ref());
            (color(look.tint * bitmap.scale, constant), Some(info(writer, &bitmap, &picture)?))
        }
        (None, Some(bitmap)) => {
            let Image { width, height, .. } = *bitmap.image;
            let white = Image::new(width, height, vec![Rgb::ONE; width * height]);
            let picture = pixels::color(&white, alpha.as_ref());
            (color(look.base.mean() * look.tint, constant), Some(info(writer, bitmap, &picture)?))
        }
        (None, None) => (color(look.base.mean() * look.tint, constant), None),
    })
}

/// A checkerboard of constants as an image of four pixels.
fn as_bitmap(texture: &Texture) -> Option<Bitmap> {
    match texture {
        Texture::Bitmap(bitmap) => Some(bitmap.clone()),
        Texture::Checkerboard { colors, to_uv } => {
            let [a, b] = [colors[0].mean(), colors[1].mean()];
            let image = Arc::new(Image::new(2, 2, vec![a, b, b, a]));
            Some(Bitmap { image, to_uv: *to_uv, nearest: true, wrap: Wrap::Repeat, scale: 1.0 })
        }
        Texture::Constant(_) | Texture::Attribute(_) => None,
    }
}

fn rough_metal(writer: &mut Writer, look: &Look, pbr: &mut Map<String, Value>) -> Result<()> {
    let bitmap = [&look.roughness, &look.metalness].into_iter().find_map(|t| match t {
        Texture::Bitmap(bitmap) => Some(bitmap),
        _ => None,
    });
    let factors = match bitmap {
        None => [&look.roughness, &look.metalness].map(|t| t.mean().x.clamp(0.0, 1.0)),
        Some(bitmap) => {
            let image = |t: &Texture| match t {
                Texture::Bitmap(b) => b.image.map(|x| x * b.scale),
                other => Image::new(1, 1, vec![other.mean()]),
            };
            let picture = pixels::roughness_metalness(&image(&look.roughness), &image(&look.metalness));
            pbr.insert("metallicRoughnessTexture".into(), info(writer, bitmap, &picture)?);
            [1.0, 1.0]
        }
    };
    pbr.insert("roughnessFactor".into(), json!(factors[0]));
    pbr.insert("metallicFactor".into(), json!(factors[1]));
    Ok(())
}

fn emission(writer: &mut Writer, radiance: &Texture, json: &mut Value, extensions: &mut Map<String, Value>) -> Result<()> {
    let bitmap = as_bitmap(radiance);
    let largest = match &bitmap {
        Some(b) => {
            (0..b.image.width * b.image.height)
                .map(|i| b.image.pixel(i % b.image.width, i / b.image.width).max_element())
                .fold(0.0, f32::max)
                * b.scale
        }
        None => radiance.mean().max_element(),
    };
    let strength = largest.max(1.0);
    match bitmap {
        Some(b) => {
            let picture = pixels::color(&b.image.map(|x| x * b.scale / strength), None);
            json["emissiveFactor"] = json!([1.0, 1.0, 1.0]);
            json["emissiveTexture"] = info(writer, &b, &picture)?;
        }
        None => json["emissiveFactor"] = json!((radiance.mean() / strength).max(Rgb::ZERO).to_array()),
    }
    if strength > 1.0 {
        add(writer, extensions, "KHR_materials_emissive_strength", json!({ "emissiveStrength": strength }));
    }
    Ok(())
}

/// A texture's entry of a material.
fn info(writer: &mut Writer, bitmap: &Bitmap, picture: &Picture) -> Result<Value> {
    let (filter, wrap) = (
        if bitmap.nearest { 9728 } else { 9729 },
        match bitmap.wrap {
            Wrap::Repeat => 10497,
            Wrap::Mirror => 33648,
            Wrap::Clamp => 33071,
        },
    );
    let sampler =
        json!({ "magFilter": filter, "minFilter": if bitmap.nearest { 9728 } else { 9987 }, "wrapS": wrap, "wrapT": wrap });
    let index = writer.texture(picture, "", sampler)?;
    let mut info = json!({ "index": index });
    if bitmap.to_uv != Affine2::IDENTITY {
        writer.uses("KHR_texture_transform");
        let (scale, angle, offset) = bitmap.to_uv.to_scale_angle_translation();
        info["extensions"] =
            json!({ "KHR_texture_transform": { "offset": offset.to_array(), "rotation": -angle, "scale": scale.to_array() } });
    }
    Ok(info)
}
