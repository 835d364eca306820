//! What of the sky is seen from where: shares by which parts of an environment are drawn, learned from shadow rays.
//!
//! A room sees its environment through a window or two, and nearly all directions that are drawn by radiance alone end at walls. As in
//! Vévoda et al. 2018, "Bayesian online regression for adaptive direct illumination sampling", places learn what the emitters' parts
//! bring them. *Ours*: parts are the squares of a grid over the two numbers with which an environment is sampled, so that all of them
//! are drawn alike by radiance, and the grid's shares go on top; they are learned once a scene, at points that are spread over its
//! surfaces, so that images depend neither on threads nor on the order of paths. Every part keeps a share: the mean stays the same.
//!
//! In: a scene's surfaces and environments. Out: for a receiver, the density of the two numbers.

use super::light_tree::Receiver;
use super::places::{BOTH, Grid, SIDES};
use super::shares::{PARTS, Shares, part, smoothed};
use super::{Sampler, World};
use crate::base::math::{hash_words, luminance};
use crate::base::ray::Hit;
use crate::material::Surface;
use glam::{Vec2, Vec3};
use rayon::prelude::*;

/// Cells along the longest side of where the surfaces are.
const ACROSS: f32 = 16.0;

/// Points on surfaces.
const POINTS: u32 = 1 << 16;

/// Directions drawn in each part from each side of a cell, and how many sets of such there are: drawing them takes longer than a ray.
const DRAWN: usize = 4;
const SETS: usize = 16;

/// How many directions a part the mean of a block counts for.
const PRIOR: f32 = 0.5;

/// Share that goes to all parts alike, whatever they bring.
const EVEN: f32 = 0.1;

/// Marks the random numbers.
const SKY: u32 = 0x736b_7973;

/// Shares of the parts of each environment, by place.
#[derive(Debug)]
pub struct Outlook {
    pub(crate) grid: Grid,
    /// For each side of a cell, the first of its `shares`, one an environment; [`NONE`] where there is no surface.
    pub(crate) which: Vec<u32>,
    pub(crate) shares: Vec<Shares>,
    /// How many environments it is of.
    pub environments: usize,
}

const NONE: u32 = u32::MAX;

/// What each part brings: the mean square of luminance times cosine over density.
type Squares = Box<[f32; PARTS]>;

impl Outlook {
    /// Looks out from a world's surfaces; `None` where it has no environment to see or no surfaces to see it from.
    pub fn new(world: &World) -> Option<Self> {
        let environments = world.lights.environments.len();
        if environments == 0 {
            return None;
        }
        let hits = points(world)?;
        let grid = Grid::over(hits.iter().map(|hit| world.point(hit)).collect(), ACROSS);
        let cells = cells(world, &grid, &hits);
        let mut this = Self { which: vec![NONE; grid.cells() * SIDES], grid, shares: Vec::new(), environments };
        for e in 0..environments {
            let sets: Vec<Vec<Direction>> = (0..SETS).into_par_iter().map(|k| directions(world, e, k)).collect();
            let look = |points: &Vec<Point>| (points[0].side, look(world, points, &sets[points[0].side as usize % SETS]));
            let looked: Vec<(u32, Squares)> = cells.par_iter().map(look).collect();
            this.learn(&looked, e);
        }
        Some(this)
    }

    /// Takes in what the sides of cells see of one of the environments.
    fn learn(&mut self, looked: &[(u32, Squares)], environment: usize) {
        let environments = self.environments;
        let mut blocks: Vec<Option<(f32, Squares)>> = vec![None; self.which.len()];
        let mut both: Vec<Option<Squares>> = vec![None; self.grid.cells()];
        for (side, squares) in looked {
            let (count, sum) = blocks[self.grid.block(*side)].get_or_insert_with(|| (0.0, Box::new([0.0; PARTS])));
            *count += 1.0;
            add(sum, squares);
            add(both[*side as usize / SIDES].get_or_insert_with(|| Box::new([0.0; PARTS])), squares);
        }
        let of_side = |(side, squares): &(u32, Squares)| {
            let mut all = squares.clone();
            if let Some((count, sum)) = &blocks[self.grid.block(*side)] {
                for (mine, sum) in all.iter_mut().zip(sum.iter()) {
                    *mine = (*mine * DRAWN as f32 + sum / count * PRIOR) / (DRAWN as f32 + PRIOR);
                }
            }
            (*side, shares_of(&all))
        };
        let of_both = both
            .iter()
            .enumerate()
            .filter_map(|(cell, squares)| Some(((cell * SIDES + BOTH) as u32, shares_of(squares.as_ref()?))));
        let all: Vec<_> = looked.iter().map(of_side).chain(of_both).collect();
        for (i, (side, shares)) in all.into_iter().enumerate() {
            if environment == 0 {
                self.which[side as usize] = (i * environments) as u32;
                self.shares.extend(vec![shares; environments]);
            } else {
                self.shares[i * environments + environment] = shares;
            }
        }
    }

    fn shares(&self, environment: usize, receiver: &Receiver) -> Option<&Shares> {
        let first = self.which[self.grid.side(receiver) as usize];
        (first != NONE).then(|| &self.shares[first as usize + environment])
    }

    /// What becomes of two uniform numbers for an environment, and their density.
    pub fn draw(&self, environment: usize, receiver: &Receiver, v: Vec2) -> (Vec2, f32) {
        self.shares(environment, receiver).map_or((v, 1.0), |shares| shares.draw(v))
    }

    /// Density of two numbers that [`Outlook::draw`] returns.
    pub fn density(&self, environment: usize, receiver: &Receiver, v: impl FnOnce() -> Vec2) -> f32 {
        self.shares(environment, receiver).map_or(1.0, |shares| shares.density(v()))
    }
}

/// By the root of the mean square of what each part brings, which has the least variance.
fn shares_of(squares: &Squares) -> Shares {
    Shares::new(&smoothed(squares).map(f32::sqrt), EVEN)
}

fn add(sum: &mut Squares, more: &Squares) {
    sum.iter_mut().zip(more.iter()).for_each(|(sum, more)| *sum += more);
}

/// Points spread over a world's surfaces by their areas.
fn points(world: &World) -> Option<Vec<Hit>> {
    let geometry = &world.scene.geometry;
    let mut total = 0.0;
    let running: Vec<f64> = (0..geometry.triangles.len() as u32)
        .map(|t| {
            total += if geometry.round(t).is_some() { 0.0 } else { f64::from(geometry.area_normal(t).length()) };
            total
        })
        .collect();
    if !(total > 0.0 && total.is_finite()) {
        return None;
    }
    let point = |i: u32| {
        let [x, y, shift, _] = Sampler::new(SKY, i).next_4d();
        let at = (f64::from(i) + f64::from(shift)) / f64::from(POINTS) * total;
        let triangle = running.partition_point(|&sum| sum <= at).min(running.len() - 1) as u32;
        let root = x.sqrt();
        Hit { t: 0.0, triangle, u: root * (1.0 - y), v: root * y }
    };
    Some((0..POINTS).into_par_iter().map(point).collect())
}

/// A point of a side of a cell.
struct Point {
    side: u32,
    n: Vec3,
    surface: Surface,
}

/// The points of each side of a cell that has any, in the order of the sides.
fn cells(world: &World, grid: &Grid, hits: &[Hit]) -> Vec<Vec<Point>> {
    let of = |hit: &Hit| {
        let surface = world.surface(hit);
        [surface.frame.n, -surface.frame.n].map(|n| Point { side: grid.side(&Receiver { p: surface.p, n }), n, surface })
    };
    let mut points: Vec<Point> = hits.par_iter().flat_map_iter(of).collect();
    points.sort_by_key(|point| point.side);
    let mut cells: Vec<Vec<Point>> = Vec::new();
    for point in points {
        match cells.last_mut().filter(|cell| cell[0].side == point.side) {
            Some(cell) => cell.push(point),
            None => cells.push(vec![point]),
        }
    }
    cells
}

/// A direction into an environment.
struct Direction {
    part: usize,
    wi: Vec3,
    /// Luminance over density.
    light: f32,
}

/// One of the sets of directions: as many in each part.
fn directions(world: &World, environment: usize, set: usize) -> Vec<Direction> {
    let stream = hash_words(&[SKY, environment as u32, set as u32]);
    let draw = |k| {
        let v = Sampler::new(stream, k).next_2d();
        let environment = &world.lights.environments[environment];
        let (wi, pdf, radiance) = environment.sample(v);
        let light = if environment.has_parts() { luminance(radiance) / pdf } else { 0.0 };
        Direction { part: part(v), wi, light: if light.is_finite() { light } else { 0.0 } }
    };
    (0..(PARTS * DRAWN) as u32).map(draw).collect()
}

/// What is seen in a set of directions, from points at random.
fn look(world: &World, points: &[Point], directions: &[Direction]) -> Squares {
    let mut squares: Squares = Box::new([0.0; PARTS]);
    for (k, direction) in directions.iter().enumerate() {
        let Point { n, surface, .. } = &points[hash_words(&[points[0].side, k as u32]) as usize % points.len()];
        let value = direction.light * n.dot(direction.wi);
        if value > 0.0 && !world.occluded(&surface.spawn(direction.wi)) {
            squares[direction.part] += value * value / DRAWN as f32;
        }
    }
    squares
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::math::Rgb;
    use crate::material::bsdf::{Bsdf, Diffuse};
    use crate::material::image::Image;
    use crate::material::{Material, Texture};
    use crate::scene::{Emitter, Object, Scene};
    use glam::Affine3A;
    use std::sync::Arc;

    fn room(environment: Emitter) -> World {
        room_with(environment, 0.5)
    }

    /// A room of 4 x 4 x 4 metres with a square hole, of so many metres from its middle to its edges, in the wall at +x, under an environment.
    fn room_with(environment: Emitter, hole: f32) -> World {
        let mut scene = Scene { emitters: vec![environment], ..Scene::default() };
        let bsdf = Bsdf::Diffuse(Diffuse { reflectance: Texture::Constant(Rgb::splat(0.5)) });
        scene.materials.push(Material { name: "wall".into(), bsdf, opacity: None });
        let g = Arc::make_mut(&mut scene.geometry);
        let mut wall = |centre: Vec3, x: Vec3, y: Vec3| {
            let first = g.positions.len() as u32;
            g.positions.extend([centre - x - y, centre + x - y, centre + x + y, centre - x + y]);
            g.normals.extend([x.cross(y).normalize(); 4]);
            g.uvs.extend([Vec2::ZERO; 4]);
            g.triangles.extend([[first, first + 1, first + 2], [first, first + 2, first + 3]]);
            g.triangle_object.extend([0; 2]);
        };
        let [x, y, z] = [Vec3::X, Vec3::Y, Vec3::Z].map(|axis| axis * 2.0);
        for (out, a, b) in [(-x, y, z), (y, x, z), (-y, x, z), (z, x, y), (-z, x, y)] {
            wall(out, a, b);
        }
        let (beside, half) = (0.5 + hole / 4.0, 0.5 - hole / 4.0);
        for (out, a, b) in
            [(y, y * half, z), (-y, y * half, z), (z, y * (hole / 2.0), z * half), (-z, y * (hole / 2.0), z * half)]
        {
            wall(x + out * beside, a, b);
        }
        let (triangles, vertices) = (g.triangles.len() as u32, g.positions.len() as u32);
        g.objects.push(Object {
            name: "room".into(),
            triangles: 0..triangles,
            vertices: 0..vertices,
            material: 0,
            emitter: None,
            face_normals: true,
            has_uvs: false,
        });
        World::new(scene)
    }

    /// A sky that is brighter above, with a sun in it.
    fn sky() -> Emitter {
        let (width, height) = (64, 32);
        let pixel = |i: usize| match (i % width, i / width) {
            (20, 10) => Rgb::splat(200.0),
            (_, y) => Rgb::new(0.5, 0.7, 1.0) * (1.0 - y as f32 / height as f32),
        };
        let image = Arc::new(Image::new(width, height, (0..width * height).map(pixel).collect()));
        Emitter::Envmap { image, scale: 1.0, to_world: Affine3A::from_rotation_y(0.3) }
    }

    fn even() -> Emitter {
        Emitter::Constant { radiance: Rgb::new(1.0, 2.0, 3.0) }
    }

    /// Points of the floor that face up.
    fn receivers() -> impl Iterator<Item = Receiver> {
        (0..64).map(|i| {
            let [x, y] = [i % 8, i / 8].map(|k| k as f32 * 0.45 - 1.6);
            Receiver { p: Vec3::new(x, -1.999, y), n: Vec3::Y }
        })
    }

    /// Mean of the sky's light at the receivers, its standard error and the share of directions that were not blocked.
    fn light(world: &World) -> [f64; 3] {
        let (mut sum, mut squares, mut seen, mut count) = (0.0, 0.0, 0.0, 0.0);
        for (i, receiver) in receivers().enumerate() {
            let mut of_one = 0.0;
            for k in 0..1024 {
                let [x, y, choice, _] = Sampler::new(i as u32, k).next_4d();
                let Some(light) = world.lights.sample(&world.scene, &receiver, choice, Vec2::new(x, y)) else { continue };
                let pdf = world.lights.pdf_environment(&receiver, light.wi);
                assert!((light.pdf / pdf - 1.0).abs() < 0.05, "{}: {} and {pdf}", light.wi, light.pdf);
                let cos = light.wi.dot(receiver.n).max(0.0);
                let free = !world.occluded(&crate::base::ray::Ray::new(receiver.p, light.wi));
                seen += f64::from(free);
                of_one += if free { f64::from(luminance(light.weight) * cos) } else { 0.0 } / 1024.0;
            }
            (sum, squares, count) = (sum + of_one, squares + of_one * of_one, count + 1.0);
        }
        [sum / count, squares, seen / count / 1024.0]
    }

    #[test]
    fn rooms_draw_what_their_windows_show_and_the_mean_stays() {
        for environment in [sky(), even()] {
            let plain = room(environment.clone());
            let [mean, _, seen] = light(&plain);
            let [same, _, more] = light(&room(environment).with_outlook());
            assert!(more > 4.0 * seen, "{more} of the directions are free, {seen} without");
            assert!((same / mean - 1.0).abs() < 0.03, "{same}, not {mean}");
        }
    }

    #[test]
    fn a_sun_through_a_small_hole_is_not_starved() {
        // A window of 30 cm, and a sun of some ten degrees in a dim sky that shines through it onto the floor.
        let image = (0..64 * 32).map(|i| if i == 9 * 64 + 15 { Rgb::splat(100.0) } else { Rgb::splat(0.1) }).collect();
        let sky = Emitter::Envmap { image: Arc::new(Image::new(64, 32, image)), scale: 1.0, to_world: Affine3A::IDENTITY };
        let squares = |world: World| {
            let mut sum = 0.0;
            for i in 0..4096 {
                let [x, y] = [i % 64, i / 64].map(|k| k as f32 / 16.0 - 1.97);
                let receiver = Receiver { p: Vec3::new(x, -1.999, y), n: Vec3::Y };
                for k in 0..64 {
                    let [x, y, choice, _] = Sampler::new(i, k).next_4d();
                    let light = world.lights.sample(&world.scene, &receiver, choice, Vec2::new(x, y)).unwrap();
                    if !world.occluded(&crate::base::ray::Ray::new(receiver.p, light.wi)) {
                        sum += f64::from(luminance(light.weight) * light.wi.y.max(0.0)).powi(2);
                    }
                }
            }
            sum
        };
        let [plain, learned] = [squares(room_with(sky.clone(), 0.15)), squares(room_with(sky, 0.15).with_outlook())];
        assert!(plain > 0.0 && learned < 0.7 * plain, "mean square {learned}, {plain} by radiance alone");
    }

    #[test]
    fn threads_do_not_change_it_and_without_a_sky_there_is_none() {
        let shares = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let world = pool.install(|| room(sky()).with_outlook());
            let outlook = world.lights.outlook.as_ref().unwrap();
            (outlook.which.clone(), outlook.shares.iter().map(|s| bytemuck::bytes_of(s).to_vec()).collect::<Vec<_>>())
        };
        assert_eq!(shares(1), shares(3));
        let point = Emitter::Point { position: Vec3::ZERO, intensity: Rgb::ONE };
        assert!(room(point).with_outlook().lights.outlook.is_none());
    }

    #[test]
    fn a_sun_is_drawn_as_ever() {
        let sun = Emitter::Sun { direction: Vec3::X, up: Vec3::Y, angle_rad: 0.01, radiance: Rgb::splat(1e4) };
        let world = room(sun).with_outlook();
        let outlook = world.lights.outlook.as_ref().unwrap();
        for receiver in receivers() {
            let v = Vec2::new(0.3, 0.7);
            let (same, density) = outlook.draw(0, &receiver, v);
            assert!(same.distance(v) < 1e-5 && density == 1.0, "{same}, {density}");
        }
    }
}
