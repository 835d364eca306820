//! The layers of a view that radiance probes light (§4.2, §5.1).

use super::frame_map::FrameMap;
use super::light::Light;
use super::params::RadianceProbeParams;
use super::transport::{Kept, first_four};
use super::volume::{Volume, irradiance};
use crate::base::math::{Basis, Rgb, hash_words, luminance};
use crate::lightmap::LightMap;
use crate::material::Surface;
use crate::material::bsdf::warp::cosine_hemisphere;
use crate::material::bsdf::{Lobes, Query};
use crate::transport::path::{PathParams, scattered};
use crate::transport::{Sampler, World};
use crate::view::direct::{GLOSSY_BRANCH, direct};
use crate::view::gbuffer::{GBuffer, GLOSSY, Pixel};
use glam::{Vec2, Vec3};
use std::f32::consts::{FRAC_1_PI, PI};

/// Directions by which light of first order is taken in.
pub(crate) const DIRECTIONS: u32 = 16;

/// Branch of a pixel's random stream: paths along its lobes.
const ALONG_LOBES: u32 = 2;

/// Light that comes by way of the probes, where pixels look it up.
pub enum Indirect {
    /// E_T.
    Irradiance(LightMap),
    /// The four harmonics of radiance.
    Radiance(Box<[LightMap; 4]>),
}

impl Indirect {
    /// Of a frame's light at receivers.
    pub fn new(map: &FrameMap, kept: Kept, light: &Light) -> Self {
        match kept {
            Kept::Irradiance => Self::Irradiance(map.lit(&light.indirect)),
            Kept::Sh1 => {
                let number = |k: usize| light.indirect.iter().skip(k).step_by(4).copied();
                Self::Radiance(Box::new([0, 1, 2, 3].map(|k| map.filled(number(k)))))
            }
        }
    }
}

/// What a view is made of.
pub struct Shading<'a> {
    /// The frame's world.
    pub world: &'a World,
    /// Light by way of the probes.
    pub indirect: &'a Indirect,
    /// All light of the receivers, where glossy paths read it.
    pub total: Option<&'a LightMap>,
    /// Receivers in free space and their light.
    pub volume: Option<(&'a Volume, &'a [Rgb])>,
    /// How.
    pub params: &'a RadianceProbeParams,
    /// Seed of the random numbers.
    pub seed: u32,
    /// Frame of the path.
    pub frame: u32,
}

impl Shading<'_> {
    /// The diffuse layer, linear radiance.
    pub fn diffuse(&self, view: &GBuffer) -> Vec<Rgb> {
        let query = Query { lobes: Lobes::DIFFUSE, ..Query::default() };
        view.shade([self.seed, self.frame], |p, stream| {
            let scene = &self.world.scene;
            let straight = direct(self.world, p, query, self.params.direct_samples, stream);
            straight
                + match self.indirect {
                    _ if self.world.is_added(&p.surface) => self.of_added(&p.surface, p.wo),
                    Indirect::Irradiance(map) => map.diffuse_radiance(scene, &p.surface, p.wo),
                    Indirect::Radiance(maps) => self.taken_in(p, &looked_up(maps, p)),
                }
        })
    }

    /// The glossy layer: paths along the lobes that read diffuse light from the receivers; without any, where receivers keep sh1, direct light
    /// and the linear terms of theirs as one distant light (§5.1, after Sloan 2008); else none.
    pub fn glossy(&self, view: &GBuffer) -> Vec<Rgb> {
        view.shade([self.seed, self.frame], |p, stream| match (self.total, self.indirect) {
            _ if p.alpha.is_none() => Rgb::ZERO,
            (Some(total), _) => self.along_lobes(p, total, hash_words(&[stream, ALONG_LOBES])),
            (None, Indirect::Irradiance(_)) => Rgb::ZERO,
            (None, Indirect::Radiance(maps)) => {
                let count = self.params.direct_samples;
                let straight = direct(self.world, p, GLOSSY, count, hash_words(&[stream, GLOSSY_BRANCH]));
                straight + self.reflected(p, &looked_up(maps, p))
            }
        })
    }

    fn along_lobes(&self, p: &Pixel, total: &LightMap, stream: u32) -> Rgb {
        let known = |s: &Surface, wo: Vec3| self.read(total, s, wo);
        let path = PathParams::default();
        let sample = |i| scattered(self.world, &p.surface, p.wo, GLOSSY, Some(&known), &path, &mut Sampler::new(stream, i));
        (0..self.params.gloss_samples).map(sample).sum::<Rgb>() / self.params.gloss_samples as f32
    }

    /// Diffuse radiance of a surface towards `wo`, direct light included; none where the light of receivers is not at hand.
    pub fn radiance(&self, surface: &Surface, wo: Vec3) -> Rgb {
        self.total.map_or(Rgb::ZERO, |total| self.read(total, surface, wo))
    }

    /// The same by the receivers' light; a shape that the frame adds has direct light by one sample, and the volume's.
    fn read(&self, total: &LightMap, surface: &Surface, wo: Vec3) -> Rgb {
        if !self.world.is_added(surface) {
            return total.diffuse_radiance(&self.world.scene, surface, wo);
        }
        let query = Query { lobes: Lobes::DIFFUSE, ..Query::default() };
        let stream = hash_words(&[self.seed, surface.triangle, surface.t.to_bits()]);
        let mut sampler = Sampler::new(stream, 0);
        scattered(self.world, surface, wo, query, None, &PathParams::DIRECT, &mut sampler) + self.of_added(surface, wo)
    }

    /// What the diffuse lobe of a shape that the frame adds sends on of light by way of the probes.
    fn of_added(&self, surface: &Surface, wo: Vec3) -> Rgb {
        let Some((volume, light)) = self.volume else { return Rgb::ZERO };
        let bsdf = self.world.scene.bsdf(surface);
        match bsdf.diffuse_out(surface, surface.frame.to_local(wo)) {
            Rgb::ZERO => Rgb::ZERO,
            out => out * irradiance(&volume.taps(self.world, surface, wo), light) * FRAC_1_PI,
        }
    }

    /// Diffuse reflection of light of first order. *Ours*: by directions in place of the two factors of Ramamoorthi and Hanrahan 2001, so that
    /// coats, bump and normal maps have their part.
    fn taken_in(&self, p: &Pixel, light: &[Rgb; 4]) -> Rgb {
        let bsdf = self.world.scene.bsdf(&p.surface);
        let out = bsdf.diffuse_out(&p.surface, p.surface.frame.to_local(p.wo));
        if out == Rgb::ZERO {
            return Rgb::ZERO;
        }
        let frame = Basis::from_normal(p.normal);
        let from = |i: u32| {
            let u = Vec2::new((i as f32 + 0.5) / DIRECTIONS as f32, (0.618_034 * (i as f32 + 0.5)).fract());
            let d = frame.to_world(cosine_hemisphere(u));
            radiance(light, d) * bsdf.diffuse_in(&p.surface, p.surface.frame.to_local(d))
        };
        let taken: Rgb = (0..DIRECTIONS).map(from).sum::<Rgb>() * (PI / DIRECTIONS as f32);
        out * taken.max(Rgb::ZERO) * FRAC_1_PI
    }

    fn reflected(&self, p: &Pixel, light: &[Rgb; 4]) -> Rgb {
        let [_, y, z, x] = light.map(luminance);
        let Some(d) = Vec3::new(x, y, z).try_normalize() else { return Rgb::ZERO };
        // A distant light of irradiance c has the terms c Y_j(d): c by least squares over the linear ones.
        let [_, y1 @ ..] = first_four(d);
        let irradiance = light[1..].iter().zip(y1).map(|(&l, y)| l * y).sum::<Rgb>() / (0.75 * FRAC_1_PI);
        let bsdf = self.world.scene.bsdf(&p.surface);
        let local = |w: Vec3| p.surface.frame.to_local(w);
        let (value, _) = bsdf.eval_pdf(&p.surface, local(p.wo), local(d), GLOSSY);
        value * irradiance.max(Rgb::ZERO)
    }
}

/// Radiance of an expansion of first order from a direction.
fn radiance(light: &[Rgb; 4], d: Vec3) -> Rgb {
    light.iter().zip(first_four(d)).map(|(&l, y)| l * y).sum()
}

fn looked_up(maps: &[LightMap; 4], p: &Pixel) -> [Rgb; 4] {
    let back = p.surface.frame.n.dot(p.wo) < 0.0;
    [0, 1, 2, 3].map(|k: usize| maps[k].lookup(p.surface.triangle, p.surface.barycentric, back))
}
