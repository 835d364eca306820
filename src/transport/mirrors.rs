//! Plane mirrors: light that comes by way of one arrives as if the mirror were a window, and the scene behind it again.
//!
//! *Ours*: a path finds a lamp in a mirror only where scattering happens to go there, so that a wall with a window's reflection on
//! it is full of bright dots. An emitter is therefore drawn in each of a scene's few large mirrors, too: for where the receiver seems
//! to be behind it, and weighted against scattering as any other emitter sample, where paths go by [`super::efficiency`]; all others
//! have twins on the GPU, which find such light by chance. Lamps without extent are left out, which no scattered ray can meet either:
//! what is computed stays what it is.

use super::light_tree::Receiver;
use super::lights::Near;
use super::met::Found;
use super::{Sampler, World, round_light};
use crate::base::math::{Basis, reflect};
use crate::base::ray::{Hit, Ray};
use crate::material::Surface;
use crate::material::bsdf::Bsdf;
use crate::material::bsdf::warp::cosine_hemisphere;
use crate::scene::normals::unit_normal;
use crate::scene::{Geometry, Object};
use glam::{Vec2, Vec3};

/// Most mirrors in which emitters are drawn; the largest.
const MOST: usize = 4;

/// Least area of a mirror, as a share of the square of the scene's diagonal, and of the largest mirror.
const LEAST: [f32; 2] = [1e-4, 0.1];

/// Rays that tell whether a side of a mirror is open: half of them must get farther than this share of the root of its area. The
/// inside of a pane is not.
const LOOKS: u32 = 64;
const OPEN: f32 = 0.1;

/// Planes of one object that are told apart (what curves has more), and of a scene that are looked at.
const PLANES: usize = 64;

/// Largest difference of unit normals in a plane, and of heights over it as a share of the scene's diagonal.
const EVEN: f32 = 1e-4;

/// A scene's large plane mirrors.
#[derive(Debug, Default)]
pub struct Mirrors {
    /// At most [`MOST`].
    planes: Vec<Mirror>,
    /// Around all emitters that are drawn in them.
    lamps: Ball,
}

/// A centre and a radius.
#[derive(Debug, Clone, Copy, Default)]
struct Ball {
    centre: Vec3,
    radius: f32,
}

/// A part of a plane that reflects.
#[derive(Debug)]
pub(super) struct Mirror {
    /// Its normal is that of the front.
    axes: Basis,
    /// n · x of the plane's points.
    height: f32,
    /// Least and greatest coordinates of its corners along the axes.
    corners: [Vec2; 2],
    /// Around it.
    ball: Ball,
    /// Whether front and back reflect.
    sides: [bool; 2],
    area: f32,
    /// Ascending.
    triangles: Vec<u32>,
}

impl Mirrors {
    /// Those of a world; none where no emitter would be drawn in them.
    pub(super) fn of(world: &World) -> Self {
        let World { scene, lights, .. } = world;
        let Some(lamps) = lamps(&scene.geometry, &lights.near) else { return Self::default() };
        let sides_of = |object: &Object| {
            let material = &scene.materials[object.material as usize];
            if material.opacity.is_some() { [false; 2] } else { sides(&material.bsdf) }
        };
        let objects = scene.geometry.objects.iter().map(|object| (object, sides_of(object)));
        let objects: Vec<_> = objects.filter(|(_, sides)| *sides != [false; 2]).collect();
        if objects.is_empty() {
            return Self::default();
        }
        let (low, high) = scene.geometry.bounds();
        let diagonal = low.distance(high);
        let of_object = |(object, sides)| planes(&scene.geometry, object, sides, EVEN * diagonal);
        let mut planes: Vec<Mirror> = objects.into_iter().flat_map(of_object).collect();
        planes.sort_by(|a, b| b.area.total_cmp(&a.area));
        planes.truncate(PLANES);
        let least = planes.first().map_or(0.0, |largest| (LEAST[0] * diagonal * diagonal).max(LEAST[1] * largest.area));
        planes.retain_mut(|plane| {
            plane.area >= least && {
                plane.sides = [0, 1].map(|side| plane.sides[side] && plane.is_open(world, side));
                plane.sides != [false; 2]
            }
        });
        planes.truncate(MOST);
        planes.iter_mut().for_each(|plane| plane.ball = plane.around());
        Self { planes, lamps }
    }

    /// How many there are.
    pub fn count(&self) -> usize {
        self.planes.len()
    }

    /// The mirrors that may show a lamp to a receiver, each with the receiver's image behind it.
    #[inline]
    pub(super) fn before(&self, receiver: &Receiver) -> impl Iterator<Item = (&Mirror, Receiver)> {
        self.planes.iter().filter_map(|mirror| {
            let behind = mirror.image(receiver)?;
            mirror.may_show(&self.lamps, &behind).then_some((mirror, behind))
        })
    }

    /// Where a ray seems to come from, and how it was found, that goes on from the surface of a mirror: from behind it. `None`
    /// elsewhere, and where no emitter sample in this mirror competes with it.
    #[inline]
    pub(super) fn behind(&self, s: &Surface, from: &Receiver, found: Found) -> Option<(Receiver, Found)> {
        if found.delta || found.mirrored {
            return None;
        }
        let mirror = self.planes.iter().find(|mirror| mirror.has(s.triangle))?;
        Some((mirror.image(from)?, Found { mirrored: true, ..found }))
    }
}

impl Mirror {
    /// Whether a triangle is a part of it.
    pub(super) fn has(&self, triangle: u32) -> bool {
        self.triangles.binary_search(&triangle).is_ok()
    }

    /// A receiver as a mirror shows it; `None` on a side that does not reflect.
    fn image(&self, of: &Receiver) -> Option<Receiver> {
        let n = self.axes.n;
        let above = n.dot(of.p) - self.height;
        let reflects = self.sides[usize::from(above < 0.0)] && above != 0.0;
        reflects.then(|| Receiver { p: of.p - 2.0 * above * n, n: self.reflected(of.n) })
    }

    /// Whether a straight way may lead from the image of a receiver through the mirror to something in a ball.
    fn may_show(&self, lamps: &Ball, from: &Receiver) -> bool {
        let [(mirror, a), (lamp, b)] = [&self.ball, lamps].map(|ball| ball.seen_from(from.p));
        // The cosine of the sum of both cones' angles.
        let widest = ((1.0 - a * a) * (1.0 - b * b)).sqrt() - a * b;
        a * a + b * b >= 1.0 || mirror.dot(lamp) >= widest
    }

    fn around(&self) -> Ball {
        let [low, high] = self.corners;
        let at = (low + high) * 0.5;
        Ball { centre: self.axes.s * at.x + self.axes.t * at.y + self.axes.n * self.height, radius: low.distance(high) * 0.5 }
    }

    /// Whether much can be seen from the front (0), or from the back (1).
    fn is_open(&self, world: &World, side: usize) -> bool {
        let near = OPEN * self.area.sqrt();
        let free = |i: &u32| {
            let [choice, x, y, lobe] = Sampler::new(side as u32, *i).next_4d();
            let triangle = self.triangles[(choice * self.triangles.len() as f32) as usize];
            let (u, v) = if x + y < 1.0 { (x, y) } else { (1.0 - x, 1.0 - y) };
            let surface = world.surface(&Hit { t: 0.0, triangle, u, v });
            let local = cosine_hemisphere(Vec2::new(lobe, (*i as f32 + 0.5) / LOOKS as f32));
            let d = self.axes.to_world(if side == 0 { local } else { -local });
            !world.occluded(&Ray { t_max: near, ..surface.spawn(d) })
        };
        (0..LOOKS).filter(free).count() as u32 >= LOOKS / 2
    }

    /// A direction as the mirror shows it.
    pub(super) fn reflected(&self, d: Vec3) -> Vec3 {
        -reflect(d, self.axes.n)
    }

    /// Whether the way from an image behind the mirror, in a unit direction and so far, may lead through it.
    pub(super) fn is_passed(&self, from: &Receiver, d: Vec3, distance: f32) -> bool {
        let t = (self.height - self.axes.n.dot(from.p)) / self.axes.n.dot(d);
        if !(t > 0.0 && t < distance) {
            return false;
        }
        let at = in_plane(&self.axes, from.p + d * t);
        at.cmpge(self.corners[0]).all() && at.cmple(self.corners[1]).all()
    }
}

impl Ball {
    /// The unit direction to its centre, and the sine of the angle to its edge from there; 1 within it.
    fn seen_from(&self, p: Vec3) -> (Vec3, f32) {
        let to = self.centre - p;
        let inverse = to.length_recip();
        (to * inverse, (self.radius * inverse).min(1.0))
    }
}

/// A ball around all emitters that have an extent; `None` where none has.
fn lamps(geometry: &Geometry, near: &[Near]) -> Option<Ball> {
    let corners = |near: &Near| match near {
        Near::Triangle(triangle) => Some(triangle.bounds(geometry, 0.0).corners),
        Near::Round(round) => Some(round_light::bounds(&geometry.rounds[*round as usize], 0.0).corners),
        Near::Delta(_) => None,
    };
    let [low, high] = near.iter().filter_map(corners).reduce(|[a, b], [c, d]| [a.min(c), b.max(d)])?;
    Some(Ball { centre: (low + high) * 0.5, radius: low.distance(high) * 0.5 })
}

fn in_plane(axes: &Basis, p: Vec3) -> Vec2 {
    Vec2::new(axes.s.dot(p), axes.t.dot(p))
}

/// Whether a model is a mirror to those before it and behind it.
fn sides(bsdf: &Bsdf) -> [bool; 2] {
    let is_mirror = |bsdf: &Bsdf| matches!(bsdf, Bsdf::Conductor(_));
    match bsdf {
        Bsdf::TwoSided(both) => [is_mirror(&both.front), is_mirror(&both.back)],
        one => [is_mirror(one), false],
    }
}

/// The planes that an object's flat triangles lie in, the first [`PLANES`] of them; `thin` is how far apart heights in one plane may be.
fn planes(geometry: &Geometry, object: &Object, sides: [bool; 2], thin: f32) -> Vec<Mirror> {
    let mut planes: Vec<Mirror> = Vec::new();
    for triangle in object.triangles.clone().filter(|&t| geometry.round(t).is_none()) {
        let corners = geometry.corners(triangle);
        let Some(n) = front(geometry, triangle) else { continue };
        let height = n.dot(corners[0]);
        let same = |plane: &Mirror| plane.axes.n.distance(n) < EVEN && (plane.height - height).abs() < thin;
        let found = planes.iter().position(same).unwrap_or(planes.len());
        if found == planes.len() {
            if planes.len() == PLANES {
                continue;
            }
            let (axes, corners) = (Basis::from_normal(n), [Vec2::INFINITY, Vec2::NEG_INFINITY]);
            let (ball, triangles) = (Ball::default(), Vec::new());
            planes.push(Mirror { axes, height, corners, ball, sides, area: 0.0, triangles });
        }
        let plane = &mut planes[found];
        plane.triangles.push(triangle);
        plane.area += 0.5 * geometry.area_normal(triangle).length();
        for at in corners.map(|p| in_plane(&plane.axes, p)) {
            plane.corners = [plane.corners[0].min(at - thin), plane.corners[1].max(at + thin)];
        }
    }
    planes
}

/// The unit normal of a triangle's front; `None` where it is shaded as if it curved.
fn front(geometry: &Geometry, triangle: u32) -> Option<Vec3> {
    let ng = unit_normal(geometry.corners(triangle))?;
    let normals = geometry.shading_normals(triangle, ng);
    let n = ng * 1f32.copysign(ng.dot(normals[0]));
    normals.iter().all(|other| other.distance(n) < EVEN).then_some(n)
}
