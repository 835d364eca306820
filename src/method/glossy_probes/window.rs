//! Eight texels of a probe at a time: their energies (Eq. 1), and the least of a window of them.

use super::candidates::WeightedProbe;
use super::gather_params::{GatherParams, MAX_RADIUS, SearchLevel};
use super::samples::Sample;
use crate::base::simd::Simd;
use crate::base::simd::functions::{acos, atan2};
use crate::base::simd::lane::{F8, M8, V2, V3};
use crate::view::mirror::{Reflected, SKY};
use glam::{Vec2, Vec3};
use std::f32::consts::{PI, TAU};

/// What a search looks for: what the energy compares, at the view.
pub(crate) struct Target {
    /// n, unit shading normal facing the viewer.
    pub(crate) normal: Vec3,
    /// Unit direction of the reflected ray, from the reflector's position r to R.
    pub(crate) direction: Vec3,
    /// R, what a mirror there shows.
    pub(crate) reflected: Reflected,
    /// Material of the reflector.
    pub(crate) material: u32,
    /// Its microfacet alpha.
    pub(crate) alpha: f32,
    /// The pixel's place in its tile, rows from the top.
    pub(crate) place: usize,
}

/// Eight of them, field by field.
pub(crate) struct Targets {
    normal: [[f32; 8]; 3],
    direction: [[f32; 8]; 3],
    point: [[f32; 8]; 3],
    alpha: [f32; 8],
    reflected: [u32; 8],
    material: [u32; 8],
}

impl Targets {
    /// One to eight; the first again in the lanes that are left over.
    pub(crate) fn new(targets: &[Target]) -> Self {
        let lane = |i: usize| targets.get(i).unwrap_or(&targets[0]);
        let axes = |get: fn(&Target) -> Vec3| [0, 1, 2].map(|axis| std::array::from_fn(|i| get(lane(i))[axis]));
        Self {
            normal: axes(|t| t.normal),
            direction: axes(|t| t.direction),
            point: axes(|t| t.reflected.point),
            alpha: std::array::from_fn(|i| lane(i).alpha),
            reflected: std::array::from_fn(|i| lane(i).reflected.material.into()),
            material: std::array::from_fn(|i| lane(i).material),
        }
    }
}

/// What eight lanes look for, each its own or all the same.
pub(crate) struct Sought<S: Simd> {
    normal: V3<S>,
    direction: V3<S>,
    point: V3<S>,
    alpha: F8<S>,
    reflected: S::I,
    pub(crate) material: S::I,
    is_sky: M8<S>,
}

impl<S: Simd> Sought<S> {
    #[inline(always)]
    pub(crate) fn one(s: S, target: &Target) -> Self {
        let reflected = s.splat_ids(target.reflected.material.into());
        Self {
            normal: V3::splat(s, target.normal),
            direction: V3::splat(s, target.direction),
            point: V3::splat(s, target.reflected.point),
            alpha: F8::splat(s, target.alpha),
            reflected,
            material: s.splat_ids(target.material),
            is_sky: M8(s, s.same_ids(reflected, s.splat_ids(SKY.into()))),
        }
    }

    #[inline(always)]
    pub(crate) fn eight(s: S, targets: &Targets) -> Self {
        let reflected = s.load_ids(&targets.reflected);
        Self {
            normal: V3::load(s, &targets.normal),
            direction: V3::load(s, &targets.direction),
            point: V3::load(s, &targets.point),
            alpha: F8::load(s, &targets.alpha),
            reflected,
            material: s.load_ids(&targets.material),
            is_sky: M8(s, s.same_ids(reflected, s.splat_ids(SKY.into()))),
        }
    }
}

/// The samples of one level, in steps from its centre.
pub(crate) struct Window {
    pub(crate) step: f32,
    /// Rows from the top, without the centre.
    pub(crate) places: Vec<[f32; 2]>,
    /// Rows from the top, eight at a time; the first of them again in what is left over of the last eight.
    all: Vec<[[f32; 8]; 2]>,
    /// Without the centre.
    around: Vec<[[f32; 8]; 2]>,
}

/// The windows of a search.
pub(crate) fn windows(levels: &[SearchLevel]) -> Vec<Window> {
    let eights = |places: &[[f32; 2]]| {
        let eight = |some: &[[f32; 2]]| [0, 1].map(|axis| std::array::from_fn(|i| some.get(i).unwrap_or(&some[0])[axis]));
        places.chunks(8).map(eight).collect()
    };
    let window = |level: &SearchLevel| {
        let radius = level.radius.clamp(0, MAX_RADIUS);
        let square = (-radius..=radius).flat_map(|y| (-radius..=radius).map(move |x| [x as f32, y as f32]));
        let all: Vec<_> = square.collect();
        let around: Vec<_> = all.iter().copied().filter(|at| *at != [0.0; 2]).collect();
        Window { step: level.step, all: eights(&all), around: eights(&around), places: around }
    };
    levels.iter().map(window).collect()
}

/// A probe's texels and its parameterisation.
pub(crate) struct Texels<'a, S: Simd> {
    pub(crate) s: S,
    position: Vec3,
    size: [f32; 2],
    /// Texels in a row.
    row: S::I,
    /// Its lists, as numbers.
    seen: &'a [f32],
    directions: &'a [f32],
    forward: &'a [f32],
    mesh: [f32; 2],
    /// Factors on the search's steps, at half the resolution.
    scale: &'a [Vec2],
    half: [u32; 2],
    material_penalty: f32,
    roughness_penalty: f32,
}

impl<'a, S: Simd> Texels<'a, S> {
    #[inline(always)]
    pub(crate) fn new(s: S, w: &'a WeightedProbe, params: &GatherParams) -> Self {
        let (probe, candidates) = (w.probe, w.candidates);
        Self {
            s,
            position: probe.position,
            size: [probe.size[0] as f32, probe.size[1] as f32],
            row: s.splat_ids(probe.size[0]),
            seen: bytemuck::cast_slice(&candidates.seen),
            directions: bytemuck::cast_slice(&candidates.directions),
            forward: bytemuck::cast_slice(&probe.map.forward),
            mesh: [probe.map.mesh[0] as f32, probe.map.mesh[1] as f32],
            scale: &candidates.scale,
            half: [probe.size[0].div_ceil(2), probe.size[1].div_ceil(2)],
            material_penalty: params.material_penalty,
            roughness_penalty: params.roughness_penalty,
        }
    }

    /// The texel coordinates at which the probe sees eight points, as [`crate::probe::parameter_map::ParameterMap::texel_from_direction`]
    /// has them, and a bit for each that lies in some direction.
    #[inline(always)]
    pub(crate) fn towards(&self, points: V3<S>) -> (V2<S>, u32) {
        let s = self.s;
        let d = points - V3::splat(s, self.position);
        let inverse = F8::splat(s, 1.0) / d.dot(d).sqrt();
        let valid = inverse.is_finite() & inverse.above(0.0);
        let d = d * valid.choose(inverse, F8::splat(s, 0.0));
        let turn = atan2(d.x, -d.z) / TAU;
        let turn = turn.below(0.0).choose(turn + 1.0, turn);
        let u = turn.below(1.0).choose(turn, F8::splat(s, 0.0));
        let v = (acos(d.y.clamp(-1.0, 1.0)) / PI).clamp(0.0, 1.0);
        let p = self.forward_at(V2 { x: u, y: v });
        let x = (p.x - p.x.floor()) * self.size[0];
        let x = x.below(self.size[0]).choose(x, F8::splat(s, 0.0));
        (V2 { x, y: p.y.clamp(0.0, 1.0) * self.size[1] }, valid.bits())
    }

    /// Probe coordinates of lat-long coordinates in [0, 1]. Bilinear within each quad of the mesh.
    #[inline(always)]
    fn forward_at(&self, at: V2<S>) -> V2<S> {
        let (s, [w, h]) = (self.s, self.mesh);
        let (x, y) = (at.x * w, at.y * h);
        let (cx, cy) = (x.floor().min(F8::splat(s, w - 1.0)), y.floor().min(F8::splat(s, h - 1.0)));
        let t = V2 { x: x - cx, y: y - cy };
        let vertex = s.add_ids(s.mul_ids(cy.ids(), s.splat_ids(w as u32 + 1)), cx.ids());
        let upper = s.shift_up::<1>(vertex);
        let lower = s.add_ids(upper, s.splat_ids(2 * (w as u32 + 1)));
        let mix = Mix { t: t.x, rest: t.x * -1.0 + 1.0 };
        let (top, bottom) = (mix.of(s.fours(self.forward, upper)), mix.of(s.fours(self.forward, lower)));
        top * (t.y * -1.0 + 1.0) + bottom * t.y
    }

    /// Factor on the steps about a texel coordinate.
    #[inline(always)]
    fn scale_at(&self, at: Vec2) -> Vec2 {
        let [w, h] = self.half;
        let (x, y) = (((at.x * 0.5).max(0.0) as u32).min(w - 1), ((at.y * 0.5).max(0.0) as u32).min(h - 1));
        self.scale[(y * w + x) as usize]
    }

    /// Indices of the texels that hold continuous coordinates (wraps in u, clamps in v).
    #[inline(always)]
    fn indices(&self, x: F8<S>, y: F8<S>) -> S::I {
        let [w, h] = self.size;
        let s = self.s;
        let (mut column, row) = (x.floor(), y.floor().clamp(0.0, h - 1.0));
        if (column.below(0.0) | !column.below(w)).bits() != 0 {
            column = (column - (column / w).floor() * w).clamp(0.0, w - 1.0);
        }
        s.add_ids(s.mul_ids(row.ids(), self.row), column.ids())
    }

    /// E of Eq. 1 of eight texel coordinates, and where it is below `limit` and the reflectors are of one material; `None` where it is nowhere.
    /// Zero is a perfect match; at most (3 + s_e) s_a.
    #[inline(always)]
    pub(crate) fn energies(&self, x: F8<S>, y: F8<S>, limit: F8<S>, sought: &Sought<S>) -> Option<(M8<S>, F8<S>)> {
        let s = self.s;
        let texel = self.indices(x, y);
        let (s_a, s_b, same) = self.reflected(texel, sought);
        // The reflected hit alone rules most texels out.
        let candidates = same & (s_a * s_b).less(limit);
        if candidates.bits() == 0 {
            return None;
        }
        let at = s.mul_ids(texel, s.splat_ids(7));
        let [nx, ny, nz, dx] = s.fours(self.directions, at);
        let [_, dy, dz, alpha] = s.fours(self.directions, s.add_ids(at, s.splat_ids(3)));
        let normal = V3 { x: F8(s, nx), y: F8(s, ny), z: F8(s, nz) };
        let direction = V3 { x: F8(s, dx), y: F8(s, dy), z: F8(s, dz) };
        let s_c = sought.normal.dot(normal) * -1.0 + 1.0;
        let s_d = sought.direction.dot(direction) * -1.0 + 1.0;
        let (both, differs) = (sought.alpha + F8(s, alpha), (sought.alpha - F8(s, alpha)).abs());
        let s_e = both.above(0.0).choose(differs * self.roughness_penalty / both, F8::splat(s, 0.0));
        let energy = s_a * (s_b + s_c.clamp(0.0, 1.0) + s_d.clamp(0.0, 1.0) + s_e);
        Some((candidates & energy.less(limit), energy))
    }

    /// The lane of least energy among eight texel coordinates, and that energy, where it is below `limit`. Of equals the first.
    #[inline(always)]
    fn best(&self, x: F8<S>, y: F8<S>, limit: f32, sought: &Sought<S>) -> Option<(usize, f32)> {
        let s = self.s;
        let (better, energy) = self.energies(x, y, F8::splat(s, limit), sought)?;
        if better.bits() == 0 {
            return None;
        }
        let energy = better.choose(energy, F8::splat(s, f32::INFINITY));
        let least = energy.least();
        let lane = (!F8::splat(s, least).less(energy)).bits().trailing_zeros();
        Some((lane as usize & 7, least))
    }

    /// s_a and s_b, the distance of the reflected hits, m, at most 1; and which reflectors are of the material sought. Two hits at
    /// infinity differ by the chord between their directions, as at a distance of 1 m; one at infinity and one not are as far apart as the
    /// energy can say.
    #[inline(always)]
    fn reflected(&self, texel: S::I, sought: &Sought<S>) -> (F8<S>, F8<S>, M8<S>) {
        let s = self.s;
        let [x, y, z, materials] = s.fours(self.seen, s.shift_up::<2>(texel));
        let words = s.bits(materials);
        let reflected = s.and_ids(words, s.splat_ids(0xffff));
        let one = F8::splat(s, 1.0);
        let s_a = M8(s, s.same_ids(reflected, sought.reflected)).choose(one, F8::splat(s, self.material_penalty));
        let d = V3 { x: F8(s, x), y: F8(s, y), z: F8(s, z) } - sought.point;
        let distance = d.dot(d).sqrt().min(one);
        let is_sky = M8(s, s.same_ids(reflected, s.splat_ids(SKY.into())));
        let alike = (is_sky & sought.is_sky) | !(is_sky | sought.is_sky);
        (s_a, alike.choose(distance, one), M8(s, s.same_ids(s.shift_down::<16>(words), sought.material)))
    }

    /// Factors on the steps about eight texel coordinates.
    #[inline(always)]
    pub(crate) fn scales(&self, at: V2<S>) -> V2<S> {
        let (s, [w, h]) = (self.s, self.half);
        let x = (at.x * 0.5).clamp(0.0, (w - 1) as f32).ids();
        let y = (at.y * 0.5).clamp(0.0, (h - 1) as f32).ids();
        let place = s.shift_up::<1>(s.add_ids(s.mul_ids(y, s.splat_ids(w)), x));
        let [x, y, ..] = s.fours(bytemuck::cast_slice(self.scale), place);
        V2 { x: F8(s, x), y: F8(s, y) }
    }

    /// The texel coordinate of least energy around `centre`, coarse level first. Only texels whose reflector is of the target's material
    /// count; `None` where there is none.
    #[inline(always)]
    pub(crate) fn search(&self, levels: &[Window], centre: Vec2, target: &Target) -> Option<Sample> {
        let s = self.s;
        let sought = Sought::one(s, target);
        let mut found = Sample { energy: f32::INFINITY, texel: centre };
        for level in levels {
            let centre = found.texel;
            let step = self.scale_at(centre) * level.step;
            let places = if found.energy < f32::INFINITY { &level.around } else { &level.all };
            for [x, y] in places {
                let at_x = F8::load(s, x) * step.x + centre.x;
                let at_y = F8::load(s, y) * step.y + centre.y;
                if let Some((lane, energy)) = self.best(at_x, at_y, found.energy, &sought) {
                    found = Sample { energy, texel: Vec2::new(centre.x + step.x * x[lane], centre.y + step.y * y[lane]) };
                }
            }
            if found.energy == f32::INFINITY {
                return None;
            }
        }
        Some(found)
    }
}

/// Between the ends of an edge, each two numbers.
struct Mix<S: Simd> {
    t: F8<S>,
    rest: F8<S>,
}

impl<S: Simd> Mix<S> {
    #[inline(always)]
    fn of(&self, [ax, ay, bx, by]: [S::F; 4]) -> V2<S> {
        let s = self.t.0;
        V2 { x: F8(s, ax) * self.rest + F8(s, bx) * self.t, y: F8(s, ay) * self.rest + F8(s, by) * self.t }
    }
}
