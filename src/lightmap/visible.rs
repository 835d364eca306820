//! Which samples of a texel belong to what an eye can see of it.
//!
//! Light maps leak where a texel reaches under a box, through a wall or behind a picture: the hidden part is dark (or lit
//! by another room) and the texel's mean smears it over the visible part. *Ours*, in order:
//! - a sample whose first ray meets the inner side of a solid is *inside* it and does not count;
//! - a sample whose every ray ends within [`CONTACT_TEXELS`] is pressed against something: it counts only where its texel
//!   has nothing better, and such a texel takes the light of its neighbours in the open, if it has any;
//! - the others fall into regions that can see each other just above the surface. Of several regions a texel keeps the
//!   largest that gets any light, and of those one from which the sensor is seen in two segments, if there is one.

use super::Atlas;
use super::adjacency::NONE;
use super::solid::Orientation;
use super::texels::{Point, Texels};
use crate::base::math::{Basis, hash_words};
use crate::base::ray::{Hit, Ray};
use crate::material::Surface;
use crate::transport::{Sampler, World};
use glam::{Vec2, Vec3};
use std::f32::consts::TAU;

/// A surface with nothing but other surfaces within this distance is in contact.
pub const CONTACT_TEXELS: f32 = 0.25;

/// How far above the surface two samples must see each other.
const LIFT_TEXELS: f32 = 0.2;

/// What a sample point can see.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Sight {
    /// Inside a solid.
    Inside,
    /// Pressed against other geometry.
    Contact,
    /// Open.
    Open,
}

/// What the tests need to know of the scene.
pub struct Visibility<'a> {
    /// Scene and rays.
    pub world: &'a World,
    /// The atlas.
    pub atlas: &'a Atlas,
    /// Its covered texels.
    pub texels: &'a Texels,
    /// The scene's solids.
    pub orientation: &'a Orientation,
}

impl Visibility<'_> {
    /// The surface at a sample point.
    pub fn surface(&self, point: Point) -> Surface {
        let hit = Hit { t: 0.0, triangle: point.triangle, u: point.barycentric.x, v: point.barycentric.y };
        self.world.surface(&hit)
    }

    /// The surface at `u` in [0, 1)² of a texel's covered part.
    pub fn sample(&self, texel: usize, u: Vec2) -> Surface {
        self.surface(self.texels.point(&self.world.scene.geometry, self.atlas, texel, u))
    }

    /// Sorts a sample point by short rays over its hemisphere; most points need just one.
    pub fn view(&self, surface: &Surface, back: bool, sampler: &mut Sampler) -> Sight {
        let frame = Basis::from_normal(facing(surface, back));
        let turn = sampler.next_2d();
        for i in 0..4 {
            // Four directions 27 to 63 degrees from the normal, a quarter turn apart.
            let phi = (turn.x + 0.25 * i as f32) * TAU;
            let sin2 = 0.2 + 0.6 * (turn.y + 0.25 * (i * 2 % 4) as f32 + 0.125 * (i / 2) as f32).fract();
            let (sin, cos) = (sin2.sqrt(), (1.0 - sin2).sqrt());
            let d = frame.to_world(Vec3::new(sin * phi.cos(), sin * phi.sin(), cos));
            let Some(hit) = self.world.closest(&surface.spawn(d)) else { return Sight::Open };
            if self.meets_inner_side(&hit, d) {
                return Sight::Inside;
            }
            if hit.t * cos > CONTACT_TEXELS * self.atlas.texel {
                return Sight::Open;
            }
        }
        Sight::Contact
    }

    fn meets_inner_side(&self, hit: &Hit, d: Vec3) -> bool {
        let outwards = f32::from(self.orientation[hit.triangle as usize]);
        outwards * d.dot(self.world.scene.geometry.area_normal(hit.triangle)) > 0.0
    }

    /// Whether nothing but their own charts stands between two points, just above the surface.
    pub fn together(&self, a: &Surface, b: &Surface, back: bool) -> bool {
        let lift = LIFT_TEXELS * self.atlas.texel;
        let (from, to) = (a.p + facing(a, back) * lift, b.p + facing(b, back) * lift);
        let Some(d) = (to - from).try_normalize() else { return true };
        let ray = Ray { t_max: from.distance(to), ..Ray::new(from, d) };
        let chart = |t: u32| self.atlas.triangle_chart[t as usize];
        let own = [chart(a.triangle), chart(b.triangle)];
        self.world.closest(&ray).is_none_or(|hit| chart(hit.triangle) != NONE && own.contains(&chart(hit.triangle)))
    }

    /// Whether some surface seen from `surface` (16 rays) is seen by the sensor too.
    pub fn near_sensor(&self, surface: &Surface, back: bool) -> bool {
        let Some(eye) = self.world.scene.sensor.as_ref().map(|s| s.position()) else { return false };
        let n = facing(surface, back);
        let frame = Basis::from_normal(n);
        if n.dot(eye - surface.p) > 0.0 && !self.world.occluded(&surface.spawn_to(eye)) {
            return true;
        }
        (0..16).any(|i| {
            let u = Sampler::new(hash_words(&[0x5e_11]), i).next_2d();
            let (sin, cos) = (u.x.sqrt(), (1.0 - u.x).sqrt());
            let d = frame.to_world(Vec3::new(sin * (u.y * TAU).cos(), sin * (u.y * TAU).sin(), cos));
            self.world.intersect(&surface.spawn(d)).is_some_and(|next| {
                let sees = next.ng.dot(-d) * next.ng.dot(eye - next.p) > 0.0;
                sees && !self.world.occluded(&next.spawn_to(eye))
            })
        })
    }
}

/// The geometric normal, turned to the side of the shading normal (`back`: away from it).
pub fn facing(surface: &Surface, back: bool) -> Vec3 {
    let same = surface.ng.dot(surface.frame.n) >= 0.0;
    if same == back { -surface.ng } else { surface.ng }
}
