//! Eight mirror paths at a time, moved to another eye: the series of [`super::perturb`], whose text says what is computed.

use super::perturb::{MAX_STEP, MIN_DISTANCE, Order, PerturbParams, Perturbation};
use crate::base::simd::lane::{F8, M8, V2, V3};
use crate::base::simd::{Kernel, Lanes, Simd};
use glam::Vec3;

/// Eight paths from one eye, field by field.
pub(crate) struct Paths {
    frame: [[[f32; 8]; 3]; 3],
    x: [[f32; 8]; 3],
    e: [[f32; 8]; 3],
    inv_rp: [f32; 8],
    inv_rq: [f32; 8],
    k: [[f32; 8]; 2],
    /// Column by column.
    g_inverse: [[f32; 8]; 4],
    /// The eye.
    p: Vec3,
    params: PerturbParams,
}

impl Perturbation {
    /// x': where the reflector shows the same point q to the eye at `p`. Always finite for finite input.
    pub fn reflection_point(&self, p: Vec3) -> Vec3 {
        let [x, y, z] = Lanes::chosen().run(Points { paths: &Paths::new(&[*self; 8]), p }).map(|axis| axis[0]);
        Vec3::new(x, y, z)
    }
}

/// Their points x' for the eye at `p`, axis by axis.
struct Points<'a> {
    paths: &'a Paths,
    p: Vec3,
}

impl Kernel for Points<'_> {
    type Output = [[f32; 8]; 3];

    #[inline(always)]
    fn run<S: Simd>(self, s: S) -> [[f32; 8]; 3] {
        let V3 { x, y, z } = self.paths.reflection_points(s, self.p);
        [x.array(), y.array(), z.array()]
    }
}

impl Paths {
    /// Of eight that begin at the same eye.
    pub(crate) fn new(paths: &[Perturbation; 8]) -> Self {
        let of = |get: &dyn Fn(&Perturbation) -> f32| std::array::from_fn(|i| get(&paths[i]));
        let axes = |get: &dyn Fn(&Perturbation) -> Vec3| std::array::from_fn(|axis| of(&|path| get(path)[axis]));
        Self {
            frame: [axes(&|path| path.frame.s), axes(&|path| path.frame.t), axes(&|path| path.frame.n)],
            x: axes(&|path| path.x),
            e: axes(&|path| path.e),
            inv_rp: of(&|path| path.inv_rp),
            inv_rq: of(&|path| path.inv_rq),
            k: [of(&|path| path.k.x), of(&|path| path.k.y)],
            g_inverse: std::array::from_fn(|i| of(&|path| path.g_inverse.to_cols_array()[i])),
            p: paths[0].p,
            params: paths[0].params,
        }
    }

    /// x' of each: where the reflector shows the same point q to the eye at `p`. Always finite for finite input.
    #[inline(always)]
    pub(crate) fn reflection_points<S: Simd>(&self, s: S, p: Vec3) -> V3<S> {
        let lanes = Loaded::new(s, self);
        let dp = lanes.to_local(V3::splat(s, p - self.p));
        let first = lanes.first_order(dp);
        let (plane_first, rise) = lanes.plane(dp);
        let is_exact = self.params.exact_plane;
        let mut u = if is_exact { first - plane_first + plane_first / (rise + 1.0) } else { first };
        if self.params.order == Order::Second {
            let half = F8::splat(s, 0.5);
            let second = lanes.second_order(dp, first) * half;
            let rest = if is_exact { second + plane_first * rise } else { second };
            let limit = first.dot(first).sqrt() * self.params.second_order_limit;
            let squared = rest.dot(rest);
            let is_long = limit.less(squared.sqrt()) & (limit * limit).less(squared);
            u = u + is_long.choose2(rest / squared.sqrt() * limit, rest);
        }
        let zero = V2 { x: F8::splat(s, 0.0), y: F8::splat(s, 0.0) };
        u = u.is_finite().choose2(u, zero);
        let is_curved = lanes.is_curved();
        if self.params.newton > 0 && is_curved.bits() != 0 {
            let end = lanes.to_local(V3::splat(s, p) - lanes.x);
            u = is_curved.choose2(lanes.newton(u, end, self.params.newton), u);
        }
        let height = (lanes.k.x * u.x * u.x + lanes.k.y * u.y * u.y) * -0.5;
        lanes.x + lanes.to_world(V3 { x: u.x, y: u.y, z: height })
    }
}

/// [`Paths`] in registers.
struct Loaded<S: Simd> {
    frame: [V3<S>; 3],
    x: V3<S>,
    e: V3<S>,
    inv_rp: F8<S>,
    inv_rq: F8<S>,
    k: V2<S>,
    g_inverse: [F8<S>; 4],
}

impl<S: Simd> Loaded<S> {
    #[inline(always)]
    fn new(s: S, paths: &Paths) -> Self {
        let Paths { frame: [d1, d2, n], x, e, inv_rp, inv_rq, k, g_inverse: [g0, g1, g2, g3], .. } = paths;
        Self {
            frame: [V3::load(s, d1), V3::load(s, d2), V3::load(s, n)],
            x: V3::load(s, x),
            e: V3::load(s, e),
            inv_rp: F8::load(s, inv_rp),
            inv_rq: F8::load(s, inv_rq),
            k: V2 { x: F8::load(s, &k[0]), y: F8::load(s, &k[1]) },
            g_inverse: [F8::load(s, g0), F8::load(s, g1), F8::load(s, g2), F8::load(s, g3)],
        }
    }

    #[inline(always)]
    fn to_local(&self, v: V3<S>) -> V3<S> {
        V3 { x: self.frame[0].dot(v), y: self.frame[1].dot(v), z: self.frame[2].dot(v) }
    }

    #[inline(always)]
    fn to_world(&self, v: V3<S>) -> V3<S> {
        self.frame[0] * v.x + self.frame[1] * v.y + self.frame[2] * v.z
    }

    #[inline(always)]
    fn is_curved(&self) -> M8<S> {
        let zero = F8::splat(self.x.x.0, 0.0);
        zero.less(self.k.x.abs()) | zero.less(self.k.y.abs())
    }

    /// G⁻¹ v.
    #[inline(always)]
    fn solve(&self, v: V2<S>) -> V2<S> {
        let [a, b, c, d] = self.g_inverse;
        V2 { x: a * v.x + c * v.y, y: b * v.x + d * v.y }
    }

    /// J Δp in the tangents.
    #[inline(always)]
    fn first_order(&self, dp: V3<S>) -> V2<S> {
        let moved = (dp - self.e * self.e.dot(dp)) * self.inv_rp;
        self.solve(moved.truncate())
    }

    /// The plane's J Δp, and ε: by how much the eye's way to the plane and on to q's image grows.
    #[inline(always)]
    fn plane(&self, dp: V3<S>) -> (V2<S>, F8<S>) {
        let whole = self.inv_rp + self.inv_rq;
        let first = (dp.truncate() - self.e.truncate() * (dp.z / self.e.z)) * (self.inv_rp / whole);
        // 1 / (r_p + r_q); an eye behind the plane counts as one just before it.
        let inv_sum = self.inv_rp * self.inv_rq / whole;
        let least = F8::splat(dp.z.0, -(1.0 - 1e-3)) / self.inv_rp;
        (first, (dp.z / self.e.z).max(least) * inv_sum)
    }

    /// One end's part of [`Self::second_order`]: its direction, how the way to it changes, and its inverse distance.
    #[inline(always)]
    fn second_order_of(&self, e: V3<S>, v: V3<S>, inv_r: F8<S>, bend: (V2<S>, F8<S>)) -> V2<S> {
        let along = e.dot(v);
        let pv = (v - e * along) * inv_r;
        let grown = (pv.truncate() * (along + along) + e.truncate() * v.dot(pv)) * inv_r - bend.0 * (pv.z + pv.z);
        // Tᵀ P n = -e_t cos θ / r.
        grown + e.truncate() * (bend.1 * inv_r * e.z)
    }

    /// [Δp]ᵀ H [Δp] in the tangents, `u` being J Δp.
    #[inline(always)]
    fn second_order(&self, dp: V3<S>, u: V2<S>) -> V2<S> {
        let zero = F8::splat(dp.z.0, 0.0);
        let s = V3 { x: u.x, y: u.y, z: zero };
        let bend = V2 { x: self.k.x * u.x, y: self.k.y * u.y };
        let bent = (bend, u.dot(bend));
        let at_p = self.second_order_of(self.e, s - dp, self.inv_rp, bent);
        let at_q = self.second_order_of(self.to_q(), s, self.inv_rq, bent);
        let solved = self.solve(at_p + at_q);
        V2 { x: -solved.x, y: -solved.y }
    }

    #[inline(always)]
    fn to_q(&self) -> V3<S> {
        V3 { x: -self.e.x, y: -self.e.y, z: self.e.z }
    }

    /// The point of least |F| among `u` and the Newton steps from it, for the eye at `p` (local).
    #[inline(always)]
    fn newton(&self, mut u: V2<S>, p: V3<S>, steps: u32) -> V2<S> {
        let lanes = u.x.0;
        let one = F8::splat(lanes, 1.0);
        let farthest = F8::splat(lanes, MAX_STEP) / self.k.x.abs().max(self.k.y.abs());
        let (mut best, mut least) = (u, F8::splat(lanes, f32::INFINITY));
        // Which have not yet met a singular matrix.
        let mut goes_on = u.x.is_finite();
        for step in 0..=steps {
            let bend = V2 { x: self.k.x * u.x, y: self.k.y * u.y };
            let s = V3 { x: u.x, y: u.y, z: u.dot(bend) * -0.5 };
            // Both ends times their inverse distance from x, as q may be at infinity.
            let a = self.end(p - s, one, bend);
            let b = self.end(self.to_q() - s * self.inv_rq, self.inv_rq, bend);
            let slope = a.slope + b.slope;
            let (h11, h12, h22) = (a.h11 + b.h11, a.h12 + b.h12, a.h22 + b.h22);
            // On a steep slope a step in u is a longer one along the surface.
            let size = slope.dot(slope) / (bend.dot(bend) + 1.0);
            let is_better = goes_on & size.less(least);
            (best, least) = (is_better.choose2(u, best), is_better.choose(size, least));
            if step == steps {
                break;
            }
            let du = V2 { x: h22 * slope.x - h12 * slope.y, y: h11 * slope.y - h12 * slope.x } / (h11 * h22 - h12 * h12);
            goes_on = goes_on & du.is_finite();
            let (limit, length) = (farthest + u.dot(u).sqrt() * 0.5, du.dot(du).sqrt());
            let du = limit.less(length).choose2(du * (limit / length), du);
            u = goes_on.choose2(u - du, u);
        }
        best
    }

    /// What an end of the path adds to F and its derivative, where the surface bends by `bend`.
    #[inline(always)]
    fn end(&self, a: V3<S>, inverse: F8<S>, bend: V2<S>) -> End<S> {
        let lanes = inverse.0;
        let one = F8::splat(lanes, 1.0);
        let inv_length = one / a.dot(a).sqrt().max(F8::splat(lanes, MIN_DISTANCE));
        let (e, inv_r) = (a * inv_length, inverse * inv_length);
        // Along ∂s = (1, 0, -bend.x) and (0, 1, -bend.y).
        let along = V2 { x: e.x - e.z * bend.x, y: e.y - e.z * bend.y };
        End {
            slope: V2 { x: -along.x, y: -along.y },
            h11: (bend.x * bend.x + 1.0 - along.x * along.x) * inv_r + self.k.x * e.z,
            h12: (bend.x * bend.y - along.x * along.y) * inv_r,
            h22: (bend.y * bend.y + 1.0 - along.y * along.y) * inv_r + self.k.y * e.z,
        }
    }
}

/// -F, and ∂F/∂u.
struct End<S: Simd> {
    slope: V2<S>,
    h11: F8<S>,
    h12: F8<S>,
    h22: F8<S>,
}
