//! What the bake knows of a scene: its receivers, its probes, and which of the latter see which of the former.
//!
//! *Paper* (§3.2): V(Γ(x, ω), p), whether a probe sees the point that a receiver sees, for every ray of every receiver and every probe.
//! *Ours*: points that receivers see lie on the surfaces that are receivers themselves; so it is asked once a texel and probe, at four points
//! of the texel, and looked up: a tenth of the rays, and a share in place of yes or no at the edge of a shadow.

use crate::base::math::Basis;
use crate::base::progress::Progress;
use crate::lightmap::adjacency::NONE;
use crate::lightmap::receivers::{POINTS, Receiver};
use crate::lightmap::visible::facing;
use crate::lightmap::{Atlas, Plan};
use crate::material::Surface;
use crate::material::bsdf::warp::cosine_hemisphere;
use crate::probe::support;
use crate::transport::World;
use glam::{Vec2, Vec3};
use rayon::prelude::*;

/// A receiver that is none.
pub const NO_RECEIVER: u32 = u32::MAX;

/// Rays by which a receiver looks for others.
const LOOKS: u32 = 32;

/// Receivers by pixel of the atlas, and places of surfaces in it.
pub struct Receivers {
    /// All of them.
    pub list: Vec<Receiver>,
    /// Receiver of each pixel's front and back; [`NO_RECEIVER`] where there is none.
    index: [Vec<u32>; 2],
    /// Each triangle's corners in texels; NaN for those without light.
    corners: Vec<[Vec2; 3]>,
    /// Chart of each triangle.
    charts: Vec<u32>,
    size: [u32; 2],
}

impl Receivers {
    /// Of an atlas of `world`'s surfaces.
    pub fn new(world: &World, atlas: &Atlas, list: Vec<Receiver>) -> Self {
        let corners = atlas.all_corners(&world.scene.geometry);
        let index = Default::default();
        Self { list: Vec::new(), index, corners, charts: atlas.triangle_chart.clone(), size: atlas.size }.of(list)
    }

    /// Others of the same atlas.
    fn of(self, list: Vec<Receiver>) -> Self {
        let mut index = [(); 2].map(|()| vec![NO_RECEIVER; (self.size[0] * self.size[1]) as usize]);
        for (i, r) in list.iter().enumerate() {
            index[usize::from(r.back)][r.pixel as usize] = i as u32;
        }
        Self { list, index, ..self }
    }

    /// The receiver at a surface, on the side that `towards` points to; where its texel is none (pressed against something, say) one beside it.
    pub fn at(&self, surface: &Surface, towards: Vec3) -> Option<u32> {
        let chart = *self.charts.get(surface.triangle as usize)?;
        if chart == NONE {
            return None;
        }
        let [a, b, c] = self.corners[surface.triangle as usize];
        let p = a + (b - a) * surface.barycentric.x + (c - a) * surface.barycentric.y;
        let index = &self.index[usize::from(surface.frame.n.dot(towards) < 0.0)];
        let [w, h] = self.size.map(i64::from);
        let (x, y) = (p.x as i64, p.y as i64);
        let around = [(0, 0), (1, 0), (-1, 0), (0, 1), (0, -1), (1, 1), (-1, 1), (1, -1), (-1, -1)];
        around.iter().find_map(|(dx, dy)| {
            let (x, y) = (x + dx, y + dy);
            let found = ((0..w).contains(&x) && (0..h).contains(&y)).then(|| index[(y * w + x) as usize])?;
            let is_of_chart = |r: u32| self.charts[self.list[r as usize].points[0].triangle as usize] == chart;
            (found != NO_RECEIVER && is_of_chart(found)).then_some(found)
        })
    }

    /// The surface at a point of a receiver.
    pub fn surface(&self, world: &World, receiver: u32, point: usize) -> Surface {
        self.list[receiver as usize].surface(world, point)
    }
}

/// What is baked from.
pub struct Ground<'a> {
    /// The scene.
    pub world: &'a World,
    /// Its receivers.
    pub receivers: Receivers,
    /// Where the probes stand, metres.
    pub probes: Vec<Vec3>,
    /// Radius of their support, metres.
    pub radius: f32,
    /// How many of a receiver's points each probe sees, receiver by receiver.
    seen: Vec<u8>,
}

impl<'a> Ground<'a> {
    /// Asks which probe sees which receiver, and leaves out receivers that no light of probes can come to: those that no probe sees, and that
    /// see none which one does. `radius`: how far probes reach; by default so far that ten of them reach a receiver on average, and one at least.
    pub fn new(plan: &Plan, world: &'a World, probes: Vec<Vec3>, radius: Option<f32>, progress: &dyn Progress) -> Self {
        let all = Receivers::new(world, &plan.atlas, plan.receivers());
        let count = all.list.len() as u32;
        progress.start("what probes see", u64::from(count));
        let row = |r: u32| -> Vec<u8> {
            let surfaces: [Surface; POINTS] = std::array::from_fn(|k| all.surface(world, r, k));
            let back = all.list[r as usize].back;
            progress.advance(1);
            probes.iter().map(|&p| surfaces.iter().filter(|s| sees(world, p, s, back)).count() as u8).collect()
        };
        let rows: Vec<Vec<u8>> = (0..count).into_par_iter().map(row).collect();
        progress.finish();
        let is_seen = |r: u32| rows[r as usize].iter().any(|&n| n > 0);
        let is_lit = |&r: &u32| is_seen(r) || sees_any(world, &all, r, &is_seen);
        let kept: Vec<u32> = (0..count).into_par_iter().filter(is_lit).collect();
        let seen = kept.iter().flat_map(|&r| rows[r as usize].iter().copied()).collect();
        let list = kept.iter().map(|&r| all.list[r as usize]).collect();
        let receivers = all.of(list);
        let radius = radius.unwrap_or_else(|| {
            let places: Vec<Vec3> = receivers.list.iter().map(|r| r.surface(world, 0).p).collect();
            support::radius(&probes, &places, support::OVERLAP)
        });
        Self { world, receivers, probes, radius, seen }
    }

    /// How many of [`POINTS`] points of a receiver each probe sees.
    pub fn seen(&self, receiver: u32) -> &[u8] {
        &self.seen[receiver as usize * self.probes.len()..][..self.probes.len()]
    }
}

/// Whether a receiver sees one that some probe sees.
fn sees_any(world: &World, receivers: &Receivers, r: u32, is_seen: &dyn Fn(u32) -> bool) -> bool {
    let surface = receivers.surface(world, r, 0);
    let frame = Basis::from_normal(facing(&surface, receivers.list[r as usize].back));
    (0..LOOKS).any(|i| {
        let u = Vec2::new((i as f32 + 0.5) / LOOKS as f32, (0.618_034 * i as f32).fract());
        let d = frame.to_world(cosine_hemisphere(u));
        world.intersect(&surface.spawn(d)).and_then(|hit| receivers.at(&hit, -d)).is_some_and(is_seen)
    })
}

/// Whether a probe sees one side of a surface.
fn sees(world: &World, probe: Vec3, surface: &Surface, back: bool) -> bool {
    facing(surface, back).dot(probe - surface.p) > 0.0 && !world.occluded(&surface.spawn_to(probe))
}
