//! Models in a tilted frame (Mitsuba's `bumpmap` and `normalmap`).
//!
//! As in Mitsuba 3.7.1 and later: a normal that faces away from the viewer is turned about the surface's own
//! (Schüssler et al. 2017), and a shadowing term softens the terminator that tilted normals draw where light grazes
//! the surface itself (Conty Estevez et al. 2019). The term belongs to the light's direction alone, so such a model
//! is not reciprocal.
//! *Ours*: the tilted tangent is the surface's, turned. Mitsuba 3.9.1's `bumpmap` mixes world and local coordinates
//! there (its `normalmap` does not), which shows for anisotropic models alone.

use super::{At, Bsdf, BsdfSample, Lobes, Model, Query, Scatter, Surface};
use crate::base::math::{Basis, Rgb, luminance};
use crate::material::Texture;
use glam::{Vec2, Vec3};

/// A height field that tilts the frame.
#[derive(Debug, Clone, serde::Serialize)]
pub struct BumpMap {
    /// Height, in scene units over `scale`.
    pub texture: Texture,
    /// Factor on the height. Mitsuba: 1.
    pub scale: f32,
    /// What scatters in the tilted frame.
    pub nested: Box<Bsdf>,
}

/// A normal map.
#[derive(Debug, Clone, serde::Serialize)]
pub struct NormalMap {
    /// Tangent-space normals, stored as (n + 1) / 2, read `raw`.
    pub texture: Texture,
    /// What scatters in the tilted frame.
    pub nested: Box<Bsdf>,
}

/// A model whose frame follows a texture.
trait Tilted {
    /// The tilted normal in the surface's shading frame, of any length.
    fn normal(&self, s: &Surface) -> Vec3;

    /// What scatters in the tilted frame.
    fn nested(&self) -> &Bsdf;
}

impl Tilted for BumpMap {
    fn normal(&self, s: &Surface) -> Vec3 {
        let slope = self.scale * height_gradient(&self.texture, s.uv);
        // The change of the base surface's normal is left out, as is usual.
        let n = s.frame.n;
        let du = s.dp_du + n * (slope.x - n.dot(s.dp_du));
        let dv = s.dp_dv + n * (slope.y - n.dot(s.dp_dv));
        let tilted = du.cross(dv);
        s.frame.to_local(if s.ng.dot(tilted) < 0.0 { -tilted } else { tilted })
    }

    fn nested(&self) -> &Bsdf {
        &self.nested
    }
}

impl Tilted for NormalMap {
    fn normal(&self, s: &Surface) -> Vec3 {
        self.texture.at(s) * 2.0 - Vec3::ONE
    }

    fn nested(&self) -> &Bsdf {
        &self.nested
    }
}

/// The tilted frame as one viewer sees it, in the surface's shading frame.
#[derive(Clone, Copy)]
struct Tilt {
    local: Basis,
}

impl Tilt {
    fn new(model: &impl Tilted, s: &Surface, wi: Vec3) -> Self {
        let mut n = model.normal(s);
        if wi.z * wi.dot(n) <= 0.0 {
            n = Vec3::new(-n.x, -n.y, n.z);
        }
        let n = n.try_normalize().unwrap_or(Vec3::Z);
        Self { local: Basis::from_normal_and_tangent(n, Vec3::X) }
    }

    /// The surface with the tilted frame for its own.
    fn surface(&self, s: &Surface) -> Surface {
        let (f, local) = (s.frame, self.local);
        Surface { frame: Basis { s: f.to_world(local.s), t: f.to_world(local.t), n: f.to_world(local.n) }, ..*s }
    }

    /// The viewer's direction in the tilted frame.
    fn view(&self, wi: Vec3) -> Vec3 {
        self.local.to_local(wi)
    }

    /// The light's direction in the tilted frame and the share of its light that the terminator lets pass;
    /// `None` where the two normals do not agree on its side.
    fn light(&self, wo: Vec3) -> Option<(Vec3, f32)> {
        let tilted = self.local.to_local(wo);
        (tilted.z * wo.z > 0.0).then(|| (tilted, self.shadowing(wo)))
    }

    /// GGX shadowing of `wo` over bumps as rough as the tilt is steep.
    fn shadowing(&self, wo: Vec3) -> f32 {
        let n = self.local.n;
        let alpha2 = (0.125 * n.truncate().length_squared() / (n.z * n.z)).min(1.0);
        let cos = wo.z.abs();
        2.0 * cos / (cos + (cos * cos + alpha2 * wo.truncate().length_squared()).sqrt())
    }
}

/// A model in a tilted frame at a point. What is within is asked anew each time.
#[derive(Clone, Copy)]
pub(super) struct TiltedAt<'a> {
    tilt: Tilt,
    nested: &'a Bsdf,
    s: &'a Surface,
    /// The viewer's direction in the tilted frame.
    view: Vec3,
    query: Query,
}

impl TiltedAt<'_> {
    pub(super) fn eval_pdf(&self, wo: Vec3) -> (Rgb, f32) {
        let Some((light, lit)) = self.tilt.light(wo) else { return (Rgb::ZERO, 0.0) };
        let (value, pdf) = self.nested.eval_pdf(&self.tilt.surface(self.s), self.view, light, self.query);
        (value * lit, pdf)
    }

    pub(super) fn sample(&self, u: f32, v: Vec2) -> Option<BsdfSample> {
        let sample = self.nested.sample(&self.tilt.surface(self.s), self.view, u, v, self.query)?;
        let wo = self.tilt.local.to_world(sample.wo);
        (sample.wo.z * wo.z > 0.0).then(|| BsdfSample { wo, weight: sample.weight * self.tilt.shadowing(wo), ..sample })
    }
}

impl<T: Tilted> Scatter for T {
    fn at<'a>(&'a self, s: &'a Surface, wi: Vec3, query: Query) -> At<'a> {
        let tilt = Tilt::new(self, s, wi);
        At::of(Model::Tilted(TiltedAt { tilt, nested: self.nested(), s, view: tilt.view(wi), query }))
    }

    fn lobes(&self) -> Lobes {
        self.nested().lobes()
    }

    fn diffuse_out(&self, s: &Surface, wi: Vec3) -> Rgb {
        let tilt = Tilt::new(self, s, wi);
        self.nested().diffuse_out(&tilt.surface(s), tilt.view(wi))
    }

    /// For a viewer above the surface; with the ratio of the tilted cosine to the surface's own, which the light map has.
    /// Finite at grazing angles, where the shadowing term vanishes like the cosine.
    fn diffuse_in(&self, s: &Surface, wo: Vec3) -> f32 {
        let tilt = Tilt::new(self, s, Vec3::Z.with_z(1f32.copysign(wo.z)));
        let Some((light, lit)) = tilt.light(wo) else { return 0.0 };
        self.nested().diffuse_in(&tilt.surface(s), light) * lit * (light.z / wo.z)
    }

    fn diffuse_albedo(&self, s: &Surface, wi: Vec3) -> Rgb {
        let tilt = Tilt::new(self, s, wi);
        self.nested().diffuse_albedo(&tilt.surface(s), tilt.view(wi))
    }

    fn glossy_albedo(&self, s: &Surface, wi: Vec3, query: Query) -> Rgb {
        let tilt = Tilt::new(self, s, wi);
        self.nested().glossy_albedo(&tilt.surface(s), tilt.view(wi), query)
    }

    fn alpha(&self, s: &Surface) -> Option<f32> {
        self.nested().alpha(s)
    }

    fn is_transmissive(&self) -> bool {
        self.nested().is_transmissive()
    }

    fn is_two_sided(&self) -> bool {
        self.nested().is_two_sided()
    }
}

/// Change of a texture's luminance with u and v. Exact between the pixels of a bilinear bitmap; zero for the others,
/// which are flat but for their edges.
fn height_gradient(texture: &Texture, uv: Vec2) -> Vec2 {
    let Texture::Bitmap(bitmap) = texture else { return Vec2::ZERO };
    if bitmap.nearest || !uv.is_finite() {
        return Vec2::ZERO;
    }
    let size = Vec2::new(bitmap.image.width as f32, bitmap.image.height as f32);
    let p = bitmap.to_uv.transform_point2(uv) * size - 0.5;
    let (corner, f) = (p.floor(), p - p.floor());
    let at = |x, y| bitmap.scale * luminance(bitmap.texel(corner + Vec2::new(x, y)));
    let (h00, h10, h01, h11) = (at(0.0, 0.0), at(1.0, 0.0), at(0.0, 1.0), at(1.0, 1.0));
    let per_pixel = Vec2::new((h10 - h00) * (1.0 - f.y) + (h11 - h01) * f.y, (h01 - h00) * (1.0 - f.x) + (h11 - h10) * f.x);
    // Mitsuba's order: turned into the surface's uv before the size multiplies it.
    bitmap.to_uv.matrix2.transpose() * per_pixel * size
}
