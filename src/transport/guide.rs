//! Where light comes from, by place: paths leave diffuse surfaces in the directions that light has come from.
//!
//! As in Müller et al. 2017, "Practical Path Guiding for Efficient Light-Transport Simulation", an image's own samples tell, each pass
//! more than the one before. *Ours*: what is guided is the pair of numbers by which a diffuse lobe draws its direction, as in Guo et al.
//! 2018, "Primary Sample Space Path Guiding": where nothing is known they stay what they are, and other lobes, and the choice among
//! them, are left alone. Cells tell which of six ways normals point, and have shares of the parts of the square of numbers
//! ([`super::shares`]) in proportion to the mean radiance that came by each. (Roots of mean squares, which would be best if they were
//! known, follow single bright paths.) Every part keeps a share: the mean stays the same.
//!
//! In: radiance that rays have brought. Out: for a vertex, the density of its numbers.

use super::light_tree::Receiver;
use super::places::{Grid, SIDES};
use super::shares::{PARTS, Shares, part, smoothed};
use crate::base::math::{Basis, Rgb, hash64, luminance};
use crate::material::bsdf::warp::{cosine_hemisphere, square};
use crate::material::bsdf::{At, BsdfSample};
use glam::{Mat2, Vec2, Vec3, Vec3Swizzles};
use rayon::prelude::*;
use std::f32::consts::FRAC_1_PI;

/// Cells along the longest side of what the camera sees.
const ACROSS: f32 = 16.0;

/// Share that goes to all parts alike, whatever comes by them.
const EVEN: f32 = 0.2;

/// How many rays a part the mean of the block around a cell counts for, and that of all parts in a block's.
const PRIOR: [f32; 2] = [3.0, 2.0];

/// Rays from which on a block is believed.
const BELIEVED: f32 = 64.0;

/// Rays of a pass that are remembered, about, 12 bytes each; of more, some at random.
const MOST: f32 = 2e6;

const NONE: u32 = u32::MAX;

/// What a ray from a diffuse surface brought.
#[derive(Debug, Clone, Copy)]
struct Arrival {
    /// Of the side of a cell that it left, [`PARTS`] each.
    part: u32,
    /// Density of the diffuse lobe, over that with which it was drawn.
    weight: f32,
    /// Luminance, times the weight.
    light: f32,
}

/// Radiance as it comes in. That of parts of an image is put together in the order of the parts, so that sums do not depend on threads.
#[derive(Debug, Clone)]
pub struct Arrivals {
    grid: Grid,
    arrivals: Vec<Arrival>,
    /// Rays so far, and the share of them that is remembered.
    count: u64,
    share: f32,
}

impl Arrivals {
    /// Over points that the camera sees.
    pub fn over(points: Vec<Vec3>) -> Self {
        Self { grid: Grid::over(points, ACROSS), arrivals: Vec::new(), count: 0, share: 1.0 }
    }

    /// One over the same places with nothing in it, for a part of a pass in which so many rays are to be expected.
    pub fn empty(&self, rays: f32) -> Self {
        Self { grid: self.grid, arrivals: Vec::new(), count: 0, share: MOST / rays }
    }

    /// Takes in what a ray brought in direction `d` (unit, world), drawn with density `pdf` (solid angle).
    pub(super) fn record(&mut self, from: &Receiver, d: Vec3, pdf: f32, light: Rgb) {
        self.count += 1;
        let cos = from.n.dot(d);
        let weight = cos * FRAC_1_PI / pdf;
        let remembered = self.share >= 1.0 || (hash64(self.count) as u32 as f32) < self.share * u32::MAX as f32;
        if remembered && weight > 0.0 && weight.is_finite() {
            let side = self.grid.side(from);
            let part = side * PARTS as u32 + part(Axes::about(from.n, side % SIDES as u32).numbers(d)) as u32;
            self.arrivals.push(Arrival { part, weight, light: luminance(light) * weight });
        }
    }

    /// Takes in all of another one.
    pub fn absorb(&mut self, other: &Self) {
        self.arrivals.extend_from_slice(&other.arrivals);
    }

    /// What is to be believed of it.
    pub fn guide(&self) -> Guide {
        let sides = self.grid.cells() * SIDES;
        let cells = Sums::of(&self.arrivals, sides, |side| side as usize);
        let blocks = Sums::of(&self.arrivals, sides, |side| self.grid.block(side));
        let of = |side: u32| {
            let (all, mine) = (blocks.at(self.grid.block(side))?, cells.at(side as usize)?);
            Some(Shares::new(&smoothed(&mine.means(&all.means(&[all.mean()?; PARTS], PRIOR[1]), PRIOR[0])), EVEN))
        };
        let found: Vec<(u32, Shares)> = (0..sides as u32).into_par_iter().filter_map(|side| Some((side, of(side)?))).collect();
        let mut guide = Guide { grid: self.grid, which: vec![NONE; sides], shares: Vec::with_capacity(found.len()) };
        for (side, shares) in found {
            guide.which[side as usize] = guide.shares.len() as u32;
            guide.shares.push(shares);
        }
        guide
    }
}

/// Weights and light of each part.
type Parts = [[f32; 2]; PARTS];

/// Those of several places.
struct Sums {
    which: Vec<u32>,
    parts: Vec<Parts>,
}

impl Sums {
    fn of(arrivals: &[Arrival], places: usize, place_of: impl Fn(u32) -> usize) -> Self {
        let mut sums = Self { which: vec![NONE; places], parts: Vec::new() };
        for &Arrival { part, weight, light } in arrivals {
            let which = &mut sums.which[place_of(part / PARTS as u32)];
            if *which == NONE {
                *which = sums.parts.len() as u32;
                sums.parts.push([[0.0; 2]; PARTS]);
            }
            let sum = &mut sums.parts[*which as usize][part as usize % PARTS];
            *sum = [sum[0] + weight, sum[1] + light];
        }
        sums
    }

    fn at(&self, place: usize) -> Option<Believed<'_>> {
        let which = self.which[place];
        (which != NONE).then(|| Believed(&self.parts[which as usize]))
    }
}

struct Believed<'a>(&'a Parts);

impl Believed<'_> {
    /// Of all parts, where there is enough to tell.
    fn mean(&self) -> Option<f32> {
        let [weight, light] = self.0.iter().fold([0.0; 2], |sum, part| [sum[0] + part[0], sum[1] + part[1]]);
        (weight >= BELIEVED).then(|| light / weight)
    }

    /// Of each part, where those known before count for so many rays.
    fn means(&self, before: &[f32; PARTS], count: f32) -> [f32; PARTS] {
        std::array::from_fn(|i| {
            let [weight, light] = self.0[i];
            (light + before[i] * count) / (weight + count)
        })
    }
}

/// Which directions diffuse surfaces draw, by place.
#[derive(Debug)]
pub struct Guide {
    grid: Grid,
    which: Vec<u32>,
    shares: Vec<Shares>,
}

impl Guide {
    /// What is known of a place.
    #[inline]
    pub(super) fn at(&self, from: &Receiver) -> Option<Known<'_>> {
        let side = self.grid.side(from);
        let shares = self.shares.get(self.which[side as usize] as usize)?;
        shares.prefetch();
        Some(Known { shares, side: side % SIDES as u32 })
    }
}

/// What a guide knows of a place.
#[derive(Clone, Copy)]
pub(super) struct Known<'a> {
    shares: &'a Shares,
    side: u32,
}

/// A guide at a vertex.
pub(super) struct Guided<'a> {
    shares: &'a Shares,
    /// From local x and y to the axes of the shares.
    turn: Mat2,
    /// The sign of the local z of the side that light is scattered to.
    side: f32,
    /// The first of the numbers, which choose a lobe, that draws from the diffuse one.
    first: f32,
}

impl<'a> Guided<'a> {
    /// For a model `at` a surface of a place of which something is known, seen as `from`, that has a diffuse lobe.
    #[inline]
    pub(super) fn new(known: &Known<'a>, from: &Receiver, frame: &Basis, at: &At) -> Option<Self> {
        let first = at.first_diffuse().filter(|first| *first < 1.0)?;
        let axes = Axes::about(from.n, known.side);
        let turn = Mat2::from_cols(axes.across(frame.s), axes.across(frame.t));
        Some(Self { shares: known.shares, turn, side: 1f32.copysign(from.n.dot(frame.n)), first })
    }

    /// What [`At::sample`] is for where diffuse directions are guided.
    pub(super) fn sample(&self, at: &At, u: f32, v: Vec2) -> Option<BsdfSample> {
        if u < self.first {
            let sample = at.sample(u, v)?;
            if sample.delta {
                return Some(sample);
            }
            let pdf = self.pdf(sample.pdf, sample.wo);
            return Some(BsdfSample { weight: sample.weight * (sample.pdf / pdf), pdf, ..sample });
        }
        let (v, density) = self.shares.draw(v);
        let d = cosine_hemisphere(v);
        let wo = (self.turn.transpose() * d.xy()).extend(d.z * self.side);
        let (value, pdf) = at.eval_pdf(wo);
        let pdf = pdf + self.more(wo, density);
        (pdf > 0.0 && pdf.is_finite()).then(|| BsdfSample { wo, weight: value / pdf, pdf, delta: false, eta: 1.0 })
    }

    /// Density of a direction that has `pdf` where diffuse directions are not guided.
    pub(super) fn pdf(&self, pdf: f32, wo: Vec3) -> f32 {
        pdf + self.more(wo, self.shares.density(square(self.turn * wo.xy())))
    }

    /// What a density of the two numbers adds to that of a direction.
    fn more(&self, wo: Vec3, density: f32) -> f32 {
        (1.0 - self.first) * wo.z.abs() * FRAC_1_PI * (density - 1.0)
    }
}

/// Axes about a normal, which turn as little as they can from one to another on the same side of a cell: those of Duff et al. 2017 where
/// z is the coordinate axis that the side is named for.
struct Axes {
    along: u32,
    basis: Basis,
}

impl Axes {
    fn about(n: Vec3, side: u32) -> Self {
        let along = side / 2;
        Self { along, basis: Basis::from_normal(turned(n, along)) }
    }

    /// Coordinates of a direction along the two that lie in the surface.
    fn across(&self, d: Vec3) -> Vec2 {
        self.basis.to_local(turned(d, self.along)).xy()
    }

    /// Numbers from which [`cosine_hemisphere`] makes a direction.
    fn numbers(&self, d: Vec3) -> Vec2 {
        square(self.across(d))
    }
}

/// Coordinates, with the one numbered `last` as the last one.
fn turned(v: Vec3, last: u32) -> Vec3 {
    match last {
        0 => v.yzx(),
        1 => v.zxy(),
        _ => v,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::math::spread_over_sphere;
    use crate::material::bsdf::{Bsdf, Distribution, Plastic, PlasticParams, Query, RoughPlastic};
    use crate::material::{Surface, Texture};
    use crate::transport::Sampler;
    use crate::transport::places::side_of;
    use crate::transport::shares::SIDE;

    /// Arrivals over a cube of two metres each way, with nothing in them.
    fn nothing() -> Arrivals {
        Arrivals::over((0..1000).map(|i| spread_over_sphere(i, 1000)).collect())
    }

    /// What `count` rays brought a surface that found them by cosine, where all light comes from within a cone about a direction.
    fn lit_from(sun: Vec3, from: &Receiver, count: u32) -> Arrivals {
        let mut arrivals = nothing();
        let basis = Basis::from_normal(from.n);
        for k in 0..count {
            let local = cosine_hemisphere(Sampler::new(7, k).next_2d());
            let d = basis.to_world(local);
            let light = if d.dot(sun) > 0.95 { 10.0 } else { 0.0 };
            arrivals.record(from, d, local.z * FRAC_1_PI, Rgb::splat(light));
        }
        arrivals
    }

    fn to_world(axes: &Axes, local: Vec3) -> Vec3 {
        // Twice more are three times: back to where it was.
        turned(turned(axes.basis.to_world(local), axes.along), axes.along)
    }

    #[test]
    fn axes_turn_little_and_tell_directions_apart() {
        for i in 0..500 {
            let n = spread_over_sphere(i, 500);
            let side = side_of(n);
            let axes = Axes::about(n, side);
            for k in 0..32 {
                let v = Sampler::new(i, k).next_2d();
                let d = to_world(&axes, cosine_hemisphere(v));
                assert!((d.dot(n) - (1.0 - square_of(v)).sqrt()).abs() < 1e-3, "{n}: {v} is {d}");
                let back = axes.numbers(d);
                assert!(back.distance(v) < 1e-3 || d.dot(n) < 0.05, "{n}: {v} comes back as {back}");
            }
            let other = (n + spread_over_sphere((7 * i + 3) % 500, 500) * 0.02).normalize();
            if side_of(other) == side {
                let apart = to_world(&Axes::about(other, side), Vec3::X).distance(to_world(&axes, Vec3::X));
                assert!(apart < 0.06, "{n} and {other}: {apart}");
            }
        }
    }

    fn guided<'a>(guide: &'a Guide, from: &Receiver, surface: &Surface, at: &At) -> Option<Guided<'a>> {
        Guided::new(&guide.at(from)?, from, &surface.frame, at)
    }

    /// The square of the radius at which two numbers lie on the disk.
    fn square_of(v: Vec2) -> f32 {
        (v * 2.0 - Vec2::ONE).abs().max_element().powi(2)
    }

    #[test]
    fn directions_are_drawn_where_light_came_from() {
        let from = Receiver { p: Vec3::new(0.1, 0.2, 0.3), n: Vec3::new(0.1, -0.2, 0.9).normalize() };
        let sun = (from.n + Vec3::X * 0.8).normalize();
        let guide = lit_from(sun, &from, 4096).guide();
        let surface = Surface::flat(from.p, from.n);
        let white = Bsdf::Diffuse(crate::material::bsdf::Diffuse { reflectance: Texture::Constant(Rgb::ONE) });
        let at = white.at(&surface, Vec3::Z, Query::default());
        let guided = guided(&guide, &from, &surface, &at).expect("it has seen much");
        let share = |guided: Option<&Guided>| {
            let towards = |k: &u32| {
                let [x, y] = Sampler::new(1, *k).next_2d().to_array();
                let v = Vec2::new(x, y);
                let sample = match guided {
                    Some(guided) => guided.sample(&at, 0.5, v),
                    None => at.sample(0.5, v),
                };
                surface.frame.to_world(sample.unwrap().wo).dot(sun) > 0.95
            };
            (0..4096).filter(towards).count() as f32 / 4096.0
        };
        // What is around a part counts with it, and a fifth goes anywhere.
        let [plain, learned] = [share(None), share(Some(&guided))];
        assert!(plain < 0.1 && learned > 0.45, "{plain} of the directions, {learned} by the guide");
        // Elsewhere nothing is known, nor for the back, nor for what scatters to both sides.
        for other in [Receiver { p: -from.p * 5.0, ..from }, Receiver { n: -from.n, ..from }, Receiver { n: Vec3::ZERO, ..from }]
        {
            assert!(guide.at(&other).is_none());
        }
        assert!(lit_from(sun, &from, 63).guide().at(&from).is_none(), "too few");
    }

    /// Models with a diffuse lobe.
    fn models() -> [Bsdf; 3] {
        let params = || PlasticParams {
            int_ior: 1.5,
            ext_ior: 1.0,
            nonlinear: true,
            diffuse_reflectance: Texture::Constant(Rgb::new(0.7, 0.4, 0.2)),
            specular_reflectance: Texture::Constant(Rgb::ONE),
        };
        let rough = RoughPlastic::new(params(), 0.2, Distribution::Ggx);
        [
            Bsdf::Diffuse(crate::material::bsdf::Diffuse { reflectance: Texture::Constant(Rgb::splat(0.5)) }),
            Bsdf::Plastic(Box::new(Plastic::new(params()).unwrap())),
            Bsdf::RoughPlastic(Box::new(rough.unwrap())),
        ]
    }

    #[test]
    fn guided_samples_have_the_density_that_they_say_and_the_same_mean() {
        let from = Receiver { p: Vec3::ZERO, n: Vec3::Y };
        let guide = lit_from(Vec3::new(0.6, 0.8, 0.0), &from, 4096).guide();
        let surface = Surface::flat(from.p, from.n);
        let wi = Vec3::new(0.3, -0.5, 0.8).normalize();
        for bsdf in models() {
            let at = bsdf.at(&surface, wi, Query::default());
            let guided = guided(&guide, &from, &surface, &at).unwrap();
            // The integral of the model times something uneven: guided, as ever, and by directions that are drawn evenly.
            let uneven = |wo: Vec3| if wo.x > 0.2 { 3.0 } else { 1.0 };
            let mean = |draw: &dyn Fn(f32, Vec2) -> Option<BsdfSample>| {
                let of = |k| {
                    let [x, y, lobe, _] = Sampler::new(5, k).next_4d();
                    draw(lobe, Vec2::new(x, y)).map_or(0.0, |s| f64::from(s.weight.x * uneven(s.wo)))
                };
                (0..1 << 14).map(of).sum::<f64>() / f64::from(1 << 14)
            };
            let [a, b] = [mean(&|u, v| guided.sample(&at, u, v)), mean(&|u, v| at.sample(u, v))];
            assert!((a / b - 1.0).abs() < 0.01, "{bsdf:?}: {a}, {b} without a guide");
            let mut total = 0.0;
            for k in 0..1 << 14 {
                let wo = cosine_hemisphere(Sampler::new(6, k).next_2d());
                let pdf = at.eval_pdf(wo).1;
                total += guided.pdf(pdf, wo) / (wo.z * FRAC_1_PI) - pdf / (wo.z * FRAC_1_PI);
                let [x, y, lobe, _] = Sampler::new(5, k).next_4d();
                let Some(s) = guided.sample(&at, lobe, Vec2::new(x, y)).filter(|s| !s.delta) else { continue };
                let (value, pdf) = at.eval_pdf(s.wo);
                let pdf = guided.pdf(pdf, s.wo);
                // Next to the border of two parts it may be the other one's.
                let near = (pdf / s.pdf - 1.0).abs() < 1e-3 || beside(&guided, s.wo);
                assert!(
                    near && (s.weight * s.pdf - value).abs().max_element() < 1e-3 * value.max_element().max(1.0),
                    "{bsdf:?}: {pdf} {s:?}"
                );
            }
            // What it adds to some directions it takes from others.
            assert!((total / (1 << 14) as f32).abs() < 0.01, "{bsdf:?}: {total}");
        }
    }

    /// Whether a direction is next to the border of two parts.
    fn beside(guided: &Guided, wo: Vec3) -> bool {
        let v = square(guided.turn * wo.xy()) * SIDE as f32;
        (v - v.round()).abs().min_element() < 1e-3
    }

    #[test]
    fn some_of_many_rays_are_remembered() {
        let from = Receiver { p: Vec3::ZERO, n: Vec3::Z };
        let mut some = nothing().empty(MOST * 4.0);
        (0..4000).for_each(|_| some.record(&from, Vec3::Z, FRAC_1_PI, Rgb::ONE));
        // A quarter, within five standard deviations.
        assert!((some.arrivals.len() as f32 - 1000.0).abs() < 137.0, "{}", some.arrivals.len());
        let mut all = nothing();
        all.absorb(&some);
        all.absorb(&some);
        assert_eq!(all.arrivals.len(), 2 * some.arrivals.len());
    }
}
