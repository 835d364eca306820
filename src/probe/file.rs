//! A probe: what a point sees in every direction, stored texel by texel (§4.1, Fig. 3), and its file.
//!
//! *Paper* (§7.3.4): 24 bytes a texel: glossy colour 6, reflected position and material 8, triangle 4, barycentrics 4, and the
//! parameterisation with its derivative 8 at half resolution. [`Texel`] holds the first four, and 6 of our own for perfect mirrors;
//! [`ParameterMap`] the rest.

use super::parameter_map::ParameterMap;
use crate::base::math::{Rgb, floor};
use crate::io::{ExrImage, Provenance};
use crate::view::mirror::{NOTHING, Reflected, SKY};
use crate::{Error, Result};
use glam::{Vec2, Vec3};
use half::f16;
use serde::{Deserialize, Serialize};
use std::path::Path;

/// Most materials that a probe file can tell apart: its half-float channel counts exactly up to here.
pub const MAX_MATERIALS: usize = 2047;
/// In [`Texel::triangle`]: this direction sees no surface.
pub const NO_TRIANGLE: u32 = u32::MAX;
/// How `reflected.material` says [`SKY`] and [`NOTHING`] on disk.
const SKY_ON_DISK: f32 = -1.0;
const NOTHING_ON_DISK: f32 = -2.0;

/// One texel of a probe.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
pub struct Texel {
    /// Glossy radiance L(S|D)*S+E at the reduced roughness.
    pub glossy: [f16; 3],
    /// Position of the mirror-reflected hit (direction for the sky).
    pub reflected: [f16; 3],
    /// Its material, [`SKY`] or [`NOTHING`].
    pub reflected_material: u16,
    /// Barycentric weights of the reflector triangle's second and third vertex.
    pub barycentric: [f16; 2],
    /// The part of `glossy` that [`crate::view::mirror_light`] finds, where the reflector is a perfect mirror.
    pub mirrored: [f16; 3],
    /// The reflector's triangle or [`NO_TRIANGLE`].
    pub triangle: u32,
}

impl Texel {
    /// A direction that sees nothing.
    pub const EMPTY: Self = Self {
        glossy: [f16::ZERO; 3],
        reflected: [f16::ZERO; 3],
        reflected_material: NOTHING,
        barycentric: [f16::ZERO; 2],
        mirrored: [f16::ZERO; 3],
        triangle: NO_TRIANGLE,
    };

    /// A texel that sees `triangle` at `barycentric`, which mirrors `reflected`; the glossy colour is black as yet.
    pub fn new(triangle: u32, barycentric: Vec2, reflected: Reflected) -> Self {
        Self {
            reflected: reflected.point.to_array().map(f16::from_f32),
            reflected_material: reflected.material,
            barycentric: barycentric.to_array().map(f16::from_f32),
            triangle,
            ..Self::EMPTY
        }
    }

    /// The mirror-reflected hit.
    pub fn reflected(&self) -> Reflected {
        Reflected { point: Vec3::from_array(self.reflected.map(f16::to_f32)), material: self.reflected_material }
    }

    /// Barycentric weights of the second and third vertex.
    pub fn barycentric(&self) -> Vec2 {
        Vec2::from_array(self.barycentric.map(f16::to_f32))
    }

    /// Glossy radiance.
    pub fn glossy(&self) -> Rgb {
        Rgb::from_array(self.glossy.map(f16::to_f32))
    }

    /// Sets the glossy radiance, clamped to what a half float holds.
    pub fn set_glossy(&mut self, c: Rgb) {
        self.glossy = half(c);
    }

    /// What of the glossy radiance a perfect mirror shows of lamps and diffuse light.
    pub fn mirrored(&self) -> Rgb {
        Rgb::from_array(self.mirrored.map(f16::to_f32))
    }

    /// Sets that part, likewise.
    pub fn set_mirrored(&mut self, c: Rgb) {
        self.mirrored = half(c);
    }
}

fn half(c: Rgb) -> [f16; 3] {
    c.min(Rgb::splat(f16::MAX.to_f32())).to_array().map(f16::from_f32)
}

/// A baked probe.
#[derive(Debug, Clone)]
pub struct Probe {
    /// Where it stands.
    pub position: Vec3,
    /// Width and height, texels.
    pub size: [u32; 2],
    /// Rows from the top.
    pub texels: Vec<Texel>,
    /// Its parameterisation.
    pub map: ParameterMap,
}

impl Probe {
    /// Memory that it takes.
    pub fn bytes(&self) -> usize {
        size_of_val(self.texels.as_slice())
            + size_of_val(self.map.forward.as_slice())
            + size_of_val(self.map.inverse.as_slice())
            + size_of_val(self.map.derivative.as_slice())
    }

    /// Texel that holds the continuous coordinate `x` (wraps in u, clamps in v).
    pub fn texel(&self, x: Vec2) -> &Texel {
        &self.texels[self.index_at(x)]
    }

    /// Index of the texel that holds the continuous coordinate `x` (wraps in u, clamps in v).
    pub fn index_at(&self, x: Vec2) -> usize {
        self.index(floor(x.x), floor(x.y))
    }

    /// Index of an integer texel coordinate (wraps in u, clamps in v).
    pub fn index(&self, x: i64, y: i64) -> usize {
        self.row(y) + self.column(x)
    }

    /// Index of the first texel of row `y` (clamps).
    pub fn row(&self, y: i64) -> usize {
        y.clamp(0, i64::from(self.size[1]) - 1) as usize * self.size[0] as usize
    }

    /// Column `x` (wraps).
    pub fn column(&self, x: i64) -> usize {
        let width = i64::from(self.size[0]);
        if (0..width).contains(&x) { x as usize } else { x.rem_euclid(width) as usize }
    }

    /// The probe's image, with its parameterisation.
    pub fn to_image(&self, provenance: Provenance) -> ExrImage {
        let t = &self.texels;
        let half = |f: &dyn Fn(&Texel) -> f16| t.iter().map(|x| f(x).to_f32()).collect::<Vec<_>>();
        let material = t.iter().map(|x| match x.reflected_material {
            SKY => SKY_ON_DISK,
            NOTHING => NOTHING_ON_DISK,
            m => f32::from(m),
        });
        self.map
            .inverse_image()
            .with_f16("glossy.R", half(&|x| x.glossy[0]))
            .with_f16("glossy.G", half(&|x| x.glossy[1]))
            .with_f16("glossy.B", half(&|x| x.glossy[2]))
            .with_f16("mirrored.R", half(&|x| x.mirrored[0]))
            .with_f16("mirrored.G", half(&|x| x.mirrored[1]))
            .with_f16("mirrored.B", half(&|x| x.mirrored[2]))
            .with_u32("reflector.triangle", t.iter().map(|x| x.triangle).collect())
            .with_f16("reflector.u", half(&|x| x.barycentric[0]))
            .with_f16("reflector.v", half(&|x| x.barycentric[1]))
            .with_f16("reflected.X", half(&|x| x.reflected[0]))
            .with_f16("reflected.Y", half(&|x| x.reflected[1]))
            .with_f16("reflected.Z", half(&|x| x.reflected[2]))
            .with_f16("reflected.material", material)
            .with_provenance(provenance)
    }

    /// Reads what [`Probe::to_image`] made. `triangles` and `materials` bound the indices that the file may hold.
    pub fn from_image(
        path: &Path,
        image: &ExrImage,
        map: ParameterMap,
        position: Vec3,
        triangles: usize,
        materials: usize,
    ) -> Result<Self> {
        let channel = |name: &str| image.f32(path, name);
        let glossy = image.rgb(path, "glossy")?;
        let mirrored = if image.has("mirrored.R") { Some(image.rgb(path, "mirrored")?) } else { None };
        let triangle = image.u32(path, "reflector.triangle")?;
        let (u, v) = (channel("reflector.u")?, channel("reflector.v")?);
        let (x, y, z) = (channel("reflected.X")?, channel("reflected.Y")?, channel("reflected.Z")?);
        let material = channel("reflected.material")?;
        let mut texels = Vec::with_capacity(triangle.len());
        for i in 0..triangle.len() {
            if triangle[i] != NO_TRIANGLE && triangle[i] as usize >= triangles {
                let message =
                    format!("channel \"reflector.triangle\" holds {}, but the scene has {triangles} triangles", triangle[i]);
                return Err(Error::input(path, message));
            }
            let material = match material[i] {
                SKY_ON_DISK => SKY,
                NOTHING_ON_DISK => NOTHING,
                m if m >= 0.0 && (m as usize) < materials => m as u16,
                m => {
                    let message = format!("channel \"reflected.material\" holds {m}, but the scene has {materials} materials");
                    return Err(Error::input(path, message));
                }
            };
            let reflected = Reflected { point: Vec3::new(x[i], y[i], z[i]), material };
            let mut texel = Texel::new(triangle[i], Vec2::new(u[i], v[i]), reflected);
            texel.set_glossy(glossy[i]);
            texel.set_mirrored(mirrored.as_ref().map_or(Rgb::ZERO, |m| m[i]));
            texels.push(texel);
        }
        Ok(Self { position, size: [image.width as u32, image.height as u32], texels, map })
    }
}

/// `set.json` of a probe folder: written last, so its presence says that the set is whole. `Served` says which views a set that does not
/// hold every texel is for, in the words of the method that it was baked for; [`serde::de::IgnoredAny`] for a reader that does not ask.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct BakedSet<Served> {
    /// Where the probes stand.
    #[serde(alias = "grid")]
    pub places: crate::probe::places::Places,
    /// Width and height of a probe, texels.
    pub size: [u32; 2],
    /// What alpha was multiplied by at the first vertex (§6.1).
    pub roughness_scale: f32,
    /// Whether texels that see a perfect mirror tell what of their radiance [`crate::view::mirror_light`] finds.
    #[serde(default)]
    pub mirrored: bool,
    /// The views that it serves; `None` serves any.
    pub views: Option<Served>,
    /// blake3 of every probe's file, hex, by index; empty where the views do not use the probe.
    pub files: Vec<String>,
    /// Where the set came from.
    pub provenance: Provenance,
}
