//! Materials and the trees of scattering models.

use super::textures::Textures;
use super::{NONE, Words};
#[cfg(test)]
use crate::gpu::spec::{StructLayout, layout};
use crate::material::bsdf::{Bsdf, Distribution, Lobes, PlasticParams};
use crate::material::{Material, Opacity, Texture};
use bytemuck::{Pod, Zeroable};

/// A material, as the constants `MATERIAL_...` of scene.wgsl have it.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
pub(crate) struct GpuMaterial {
    model: u32,
    opacity: u32,
    lobes: u32,
    flags: u32,
}

pub(crate) const TRANSMISSIVE: u32 = 1;
pub(crate) const TWO_SIDED_FLAG: u32 = 2;

/// A scattering model, as the constants `MODEL_...` of scene.wgsl have it.
#[repr(C)]
#[derive(Clone, Copy, Default, Pod, Zeroable)]
pub(crate) struct GpuModel {
    kind: u32,
    distribution: u32,
    lobes: u32,
    leaves: u32,
    first: u32,
    second: u32,
    table: u32,
    option: u32,
    eta: [f32; 3],
    a: f32,
    k: [f32; 3],
    b: f32,
    textures: [u32; 12],
    alpha: f32,
    slots: u32,
    padding: [u32; 2],
}

#[cfg(test)]
pub(crate) const MATERIAL: StructLayout = layout!(GpuMaterial as "MATERIAL" { model, opacity, lobes, flags });
#[cfg(test)]
pub(crate) const MODEL: StructLayout = layout!(GpuModel as "MODEL" {
    kind, distribution, lobes, leaves, first, second, table, option, eta, a, k, b, textures, alpha, slots
});

/// Kinds of models, numbered as in models.wgsl.
#[derive(Clone, Copy)]
#[repr(u32)]
pub(crate) enum Kind {
    Diffuse,
    Plastic,
    RoughPlastic,
    Conductor,
    RoughConductor,
    Dielectric,
    ThinDielectric,
    RoughDielectric,
    Principled,
    TwoSided,
    BumpMap,
    NormalMap,
    Blend,
}

/// All models, children before their parents.
pub(crate) struct Models<'a> {
    pub list: Vec<GpuModel>,
    pub textures: &'a mut Textures,
    pub words: &'a mut Words,
}

impl Models<'_> {
    pub fn material(&mut self, material: &Material) -> GpuMaterial {
        let bsdf = &material.bsdf;
        let model = self.add(bsdf);
        let flag = |condition: bool, flag: u32| if condition { flag } else { 0 };
        GpuMaterial {
            model,
            opacity: match &material.opacity {
                Some(Opacity::Texture(t)) => self.texture(t),
                Some(_) => {
                    self.textures.unknown = Some("textured masks within masks or blends, or on one side");
                    NONE
                }
                None => NONE,
            },
            lobes: u32::from(bsdf.lobes().bits()),
            flags: flag(bsdf.is_transmissive(), TRANSMISSIVE) | flag(bsdf.is_two_sided(), TWO_SIDED_FLAG),
        }
    }

    fn texture(&mut self, texture: &Texture) -> u32 {
        self.textures.add(texture, self.words)
    }

    fn slots<const N: usize>(&mut self, textures: [&Texture; N]) -> [u32; 12] {
        let mut slots = [NONE; 12];
        for (slot, texture) in slots.iter_mut().zip(textures) {
            *slot = self.texture(texture);
        }
        slots
    }

    fn add(&mut self, bsdf: &Bsdf) -> u32 {
        let eta = |eta: f32| [eta, 0.0, 0.0];
        let model = match bsdf {
            Bsdf::Diffuse(m) => GpuModel { textures: self.slots([&m.reflectance]), ..of(Kind::Diffuse) },
            Bsdf::Plastic(m) => GpuModel { eta: eta(m.eta), a: m.internal_reflectance, ..self.plastic(Kind::Plastic, &m.params) },
            Bsdf::RoughPlastic(m) => GpuModel {
                distribution: family(m.distribution),
                eta: eta(m.eta),
                a: m.internal_reflectance,
                b: m.mean_transmittance,
                table: self.words.floats(m.transmittance.iter().copied()),
                alpha: m.alpha,
                ..self.plastic(Kind::RoughPlastic, &m.params)
            },
            Bsdf::Conductor(m) => GpuModel {
                eta: m.eta.to_array(),
                k: m.k.to_array(),
                textures: self.slots([&m.specular_reflectance]),
                ..of(Kind::Conductor)
            },
            Bsdf::RoughConductor(m) => GpuModel {
                distribution: family(m.distribution),
                eta: m.metal.eta.to_array(),
                k: m.metal.k.to_array(),
                textures: self.slots([&m.metal.specular_reflectance, &m.alpha_u, &m.alpha_v]),
                ..of(Kind::RoughConductor)
            },
            Bsdf::Dielectric(m) => GpuModel {
                eta: eta(m.eta),
                textures: self.slots([&m.params.specular_reflectance, &m.params.specular_transmittance]),
                ..of(Kind::Dielectric)
            },
            Bsdf::ThinDielectric(m) => GpuModel {
                eta: eta(m.eta),
                textures: self.slots([&m.params.specular_reflectance, &m.params.specular_transmittance]),
                ..of(Kind::ThinDielectric)
            },
            Bsdf::RoughDielectric(m) => GpuModel {
                distribution: family(m.distribution),
                eta: eta(m.eta),
                textures: self.slots([&m.params.specular_reflectance, &m.params.specular_transmittance, &m.alpha_u, &m.alpha_v]),
                ..of(Kind::RoughDielectric)
            },
            Bsdf::Principled(m) => {
                let p = &m.params;
                GpuModel {
                    eta: eta(p.eta),
                    textures: self.slots([
                        &p.base_color,
                        &p.roughness,
                        &p.anisotropic,
                        &p.metallic,
                        &p.spec_trans,
                        &p.spec_tint,
                        &p.sheen,
                        &p.sheen_tint,
                        &p.flatness,
                        &p.clearcoat,
                        &p.clearcoat_gloss,
                    ]),
                    ..of(Kind::Principled)
                }
            }
            Bsdf::TwoSided(m) => {
                let (first, second) = (self.add(&m.front), self.add(&m.back));
                let leaves = self.leaves(first).max(self.leaves(second));
                GpuModel { first, second, leaves, ..of(Kind::TwoSided) }
            }
            Bsdf::BumpMap(m) => {
                let first = self.add(&m.nested);
                GpuModel { a: m.scale, textures: self.slots([&m.texture]), ..self.tilted(Kind::BumpMap, first) }
            }
            Bsdf::NormalMap(m) => {
                let first = self.add(&m.nested);
                GpuModel { textures: self.slots([&m.texture]), ..self.tilted(Kind::NormalMap, first) }
            }
            Bsdf::Blend(m) => {
                let (first, second) = (self.add(&m.a), self.add(&m.b));
                if m.coverage.is_some() {
                    self.textures.unknown = Some("masks within blends");
                }
                let has_diffuse = |b: &Bsdf| b.lobes().contains(Lobes::DIFFUSE);
                GpuModel {
                    first,
                    second,
                    leaves: self.leaves(first) + self.leaves(second),
                    distribution: u32::from(bsdf.is_two_sided()),
                    option: match (has_diffuse(&m.a), has_diffuse(&m.b)) {
                        (true, false) => 0,
                        (false, true) => 1,
                        _ => NONE,
                    },
                    textures: self.slots([&m.weight]),
                    ..of(Kind::Blend)
                }
            }
        };
        let slots = model.textures.iter().filter(|t| **t != NONE).count() as u32;
        self.list.push(GpuModel { lobes: u32::from(bsdf.lobes().bits()), slots, ..model });
        self.list.len() as u32 - 1
    }

    fn leaves(&self, model: u32) -> u32 {
        self.list[model as usize].leaves
    }

    fn plastic(&mut self, kind: Kind, params: &PlasticParams) -> GpuModel {
        let textures = self.slots([&params.diffuse_reflectance, &params.specular_reflectance]);
        GpuModel { option: u32::from(params.nonlinear), textures, ..of(kind) }
    }

    fn tilted(&self, kind: Kind, first: u32) -> GpuModel {
        GpuModel { first, leaves: self.leaves(first), ..of(kind) }
    }
}

fn of(kind: Kind) -> GpuModel {
    GpuModel { kind: kind as u32, leaves: 1, first: NONE, second: NONE, table: NONE, textures: [NONE; 12], ..GpuModel::default() }
}

pub(crate) fn family(distribution: Distribution) -> u32 {
    match distribution {
        Distribution::Beckmann => 0,
        Distribution::Ggx => 1,
    }
}

/// Tilted frames that lie one within the other.
pub(crate) fn tilts(bsdf: &Bsdf) -> usize {
    match bsdf {
        Bsdf::BumpMap(m) => 1 + tilts(&m.nested),
        Bsdf::NormalMap(m) => 1 + tilts(&m.nested),
        Bsdf::TwoSided(m) => tilts(&m.front).max(tilts(&m.back)),
        Bsdf::Blend(m) => tilts(&m.a).max(tilts(&m.b)),
        _ => 0,
    }
}
