//! The path tracer against closed forms, and against itself by other routes.

mod room;

use glam::{Affine3A, DVec3, Vec2, Vec3};
use reprobe::base::math::Rgb;
use reprobe::base::progress::Silent;
use reprobe::base::ray::Ray;
use reprobe::material::bsdf::{
    Bsdf, Conductor, Diffuse, Distribution, Lobes, PlasticParams, Query, RoughConductor, RoughPlastic,
};
use reprobe::material::{Surface, Texture};
use reprobe::method::path_trace::{PathTraceParams, path_trace, path_trace_full};
use reprobe::scene::{Camera, Emitter};
use reprobe::transport::efficiency::{Start, Walk};
use reprobe::transport::light_tree::Receiver;
use reprobe::transport::lights::Lights;
use reprobe::transport::mirrors::Mirrors;
use reprobe::transport::path::{PathParams, radiance, scattered, trace_layers, transmitted_irradiance};
use reprobe::transport::{Sampler, World};
use reprobe::view::layers::LayerImages;
use room::{Room, two_sided};
use std::f32::consts::{FRAC_1_PI, FRAC_PI_4, PI};

/// Mean of independent estimates and the standard deviation of the mean, per channel.
struct Estimate {
    mean: Rgb,
    sigma: Rgb,
}

/// Averages `f` over `n` samples, in 64 batches of independent streams whose spread gives the noise.
fn estimate(n: u32, seed: u32, mut f: impl FnMut(&mut Sampler) -> Rgb) -> Estimate {
    const BATCHES: u32 = 64;
    let per_batch = n / BATCHES;
    let batch = |b| (0..per_batch).map(|i| f(&mut Sampler::new(reprobe::base::math::hash_words(&[seed, b]), i))).sum::<Rgb>();
    let means: Vec<Rgb> = (0..BATCHES).map(batch).map(|sum| sum / per_batch as f32).collect();
    let mean = means.iter().sum::<Rgb>() / BATCHES as f32;
    let variance = means.iter().map(|m| (*m - mean) * (*m - mean)).sum::<Rgb>() / (BATCHES * (BATCHES - 1)) as f32;
    Estimate { mean, sigma: Rgb::new(variance.x.sqrt(), variance.y.sqrt(), variance.z.sqrt()) }
}

impl Estimate {
    /// Within four standard deviations of `expected`, which must be under `most_noise` of it for the test to mean anything.
    #[track_caller]
    fn assert_is(&self, expected: Rgb, most_noise: f32) {
        self.assert_agrees(&Estimate { mean: expected, sigma: Rgb::ZERO }, most_noise);
    }

    #[track_caller]
    fn assert_agrees(&self, other: &Estimate, most_noise: f32) {
        for i in 0..3 {
            let sigma = self.sigma[i].hypot(other.sigma[i]);
            let (a, b) = (self.mean[i], other.mean[i]);
            assert!(sigma <= most_noise * b.abs() + 1e-6, "channel {i}: noise {sigma} of {b} hides everything");
            assert!(
                (a - b).abs() <= 4.0 * sigma + 1e-4 * b.abs() + 1e-6,
                "channel {i}: {a} where {b} is expected, sigma {sigma}"
            );
        }
    }
}

fn diffuse(albedo: f32) -> Bsdf {
    Bsdf::Diffuse(Diffuse { reflectance: Texture::Constant(Rgb::splat(albedo)) })
}

fn rough_plastic(alpha: f32) -> Bsdf {
    let params = PlasticParams {
        int_ior: 1.49,
        ext_ior: 1.0,
        nonlinear: false,
        diffuse_reflectance: Texture::Constant(Rgb::new(0.6, 0.4, 0.2)),
        specular_reflectance: Texture::Constant(Rgb::ONE),
    };
    Bsdf::RoughPlastic(Box::new(RoughPlastic::new(params, alpha, Distribution::Ggx).unwrap()))
}

/// A closed room with plastic floor and grey walls, lit by a lamp under the ceiling.
fn lit_room(floor: Bsdf) -> World {
    let mut room = Room::default();
    room.inward_box(Vec3::new(-1.0, 0.0, -1.0), Vec3::new(1.0, 2.0, 1.0), diffuse(0.5));
    room.rectangle(Vec3::new(0.0, 0.01, 0.0), Vec3::X * 0.9, Vec3::Z * -0.9, floor);
    let lamp = room.rectangle(Vec3::new(0.0, 1.9, 0.0), Vec3::X * 0.4, Vec3::Z * 0.3, diffuse(0.0));
    room.emit(lamp, Rgb::new(6.0, 5.0, 4.0));
    room.world()
}

/// A ray that meets the floor of [`lit_room`] at a slant, where it mirrors the wall and part of the lamp's glow.
fn slanted_ray() -> Ray {
    Ray::new(Vec3::new(0.5, 1.0, 0.6), Vec3::new(-0.4, -1.0, -0.7).normalize())
}

const ONE_BOUNCE: PathParams = PathParams { max_depth: 1, rr_depth: 5 };

#[test]
fn a_furnace_glows_with_the_geometric_series() {
    let mut room = Room::default();
    let walls = room.inward_box(Vec3::splat(-1.0), Vec3::splat(1.0), diffuse(0.6));
    room.emit(walls, Rgb::new(1.0, 0.5, 2.0));
    let world = room.world();
    let ray = Ray::new(Vec3::new(0.1, 0.2, -0.3), Vec3::new(0.3, -0.5, 0.6).normalize());
    let params = PathParams::default();
    let total = Rgb::new(1.0, 0.5, 2.0) / (1.0 - 0.6);
    estimate(8192, 1, |s| radiance(&world, &ray, &params, s)).assert_is(total, 0.01);
    estimate(8192, 2, |s| trace_layers(&world, &ray, &params, s).diffuse).assert_is(total * 0.6, 0.01);
    let exact = trace_layers(&world, &ray, &params, &mut Sampler::new(1, 1));
    assert_eq!((exact.emission, exact.glossy), (Rgb::new(1.0, 0.5, 2.0), Rgb::ZERO));
}

/// Perfect mirrors leave a furnace's light as it is.
#[test]
fn known_diffuse_light_stands_in_for_the_paths_that_would_find_it() {
    let glow = Rgb::new(1.0, 0.5, 2.0);
    let mut room = Room::default();
    let walls = room.inward_box(Vec3::splat(-1.0), Vec3::splat(1.0), diffuse(0.6));
    room.emit(walls, glow);
    let silver = Conductor { eta: Rgb::ZERO, k: Rgb::ONE, specular_reflectance: Texture::Constant(Rgb::ONE) };
    let mirror = || room::two_sided(Bsdf::Conductor(silver.clone()));
    room.rectangle(Vec3::new(0.0, -0.5, 0.0), Vec3::X * 0.5, Vec3::Z * -0.5, mirror());
    room.rectangle(Vec3::new(0.0, 0.5, 0.0), Vec3::X * 0.5, Vec3::Z * 0.5, mirror());
    let world = room.world();
    // Down, up and down again between the mirrors, then out to a wall.
    let ray = Ray::new(Vec3::new(-0.45, 0.4, 0.0), Vec3::new(0.25, -1.0, 0.0).normalize());
    let surface = world.intersect(&ray).unwrap();
    let known = |s: &Surface, _: Vec3| if s.object == walls { glow * 0.6 / (1.0 - 0.6) } else { Rgb::ZERO };
    let query = Query { lobes: Lobes::NON_DIFFUSE, ..Query::default() };
    let no_roulette = PathParams { rr_depth: u32::MAX, ..PathParams::default() };
    let found = scattered(&world, &surface, -ray.d, query, Some(&known), &no_roulette, &mut Sampler::new(1, 1));
    assert!((found - glow / (1.0 - 0.6)).abs().max_element() < 1e-5, "{found}");
    estimate(8192, 21, |s| scattered(&world, &surface, -ray.d, query, None, &PathParams::default(), s)).assert_is(found, 0.01);
}

#[test]
fn a_wall_under_an_even_sky_shows_its_albedo() {
    let mut room = Room::default();
    room.rectangle(Vec3::ZERO, Vec3::X, -Vec3::Z, diffuse(0.7));
    room.light(Emitter::Constant { radiance: Rgb::new(1.0, 2.0, 3.0) });
    let world = room.world();
    let ray = Ray::new(Vec3::Y, Vec3::new(0.1, -1.0, 0.2).normalize());
    let params = PathParams::default();
    estimate(4096, 3, |s| radiance(&world, &ray, &params, s)).assert_is(Rgb::new(0.7, 1.4, 2.1), 0.01);
    let up = trace_layers(&world, &Ray::new(Vec3::Y, Vec3::Y), &params, &mut Sampler::new(0, 0));
    assert_eq!(up.emission, Rgb::new(1.0, 2.0, 3.0));
}

#[test]
fn direct_light_of_a_rectangle_is_its_form_factor() {
    let mut room = Room::default();
    room.rectangle(Vec3::ZERO, Vec3::X * 5.0, Vec3::Z * -5.0, diffuse(0.5));
    let lamp = room.rectangle(Vec3::new(0.0, 1.5, 0.0), Vec3::X * 0.8, Vec3::Z * 0.6, diffuse(0.0));
    room.emit(lamp, Rgb::splat(4.0));
    let world = room.world();
    let foot = Vec3::new(0.3, 0.0, -0.2);
    let ray = Ray::new(Vec3::new(2.0, 1.0, 0.0), (foot - Vec3::new(2.0, 1.0, 0.0)).normalize());
    // Differential element facing a parallel rectangle, corner by corner (Howell's catalogue, B-4).
    let corner = |x: f32, z: f32| {
        let (a, b) = (x / 1.5, z / 1.5);
        let (ra, rb) = ((1.0 + a * a).sqrt(), (1.0 + b * b).sqrt());
        0.5 * FRAC_1_PI * (a / ra * (b / ra).atan() + b / rb * (a / rb).atan())
    };
    let factor = corner(0.8 - 0.3, 0.6 + 0.2) + corner(0.8 + 0.3, 0.6 + 0.2) + corner(0.5, 0.4) + corner(1.1, 0.4);
    let found = estimate(8192, 4, |s| radiance(&world, &ray, &ONE_BOUNCE, s));
    found.assert_is(Rgb::splat(0.5 * 4.0 * factor), 0.005);
}

#[test]
fn emitter_samples_bsdf_samples_and_both_agree() {
    let metal = |alpha| {
        let metal =
            Conductor { eta: Rgb::splat(0.2), k: Rgb::new(3.0, 2.5, 2.0), specular_reflectance: Texture::Constant(Rgb::ONE) };
        let alpha = Texture::Constant(Rgb::splat(alpha));
        Bsdf::RoughConductor(Box::new(RoughConductor {
            metal,
            alpha_u: alpha.clone(),
            alpha_v: alpha,
            distribution: Distribution::Ggx,
        }))
    };
    for (i, floor) in [diffuse(0.5), metal(0.3), rough_plastic(0.2)].into_iter().enumerate() {
        let world = lit_room(floor);
        let ray = Ray::new(Vec3::new(0.5, 1.0, 0.5), Vec3::new(-0.5, -1.0, -0.5).normalize());
        let surface = world.intersect(&ray).unwrap();
        let wi = surface.frame.to_local(-ray.d);
        let bsdf = world.scene.bsdf(&surface);
        let seed = 10 * i as u32;
        let both = estimate(16384, seed, |s| scattered(&world, &surface, -ray.d, Query::default(), None, &ONE_BOUNCE, s));
        let emitters = estimate(65536, seed + 1, |s| {
            let [x, y, u, _] = s.next_4d();
            match world.lights.sample(&world.scene, &Receiver { p: surface.p, n: surface.frame.n }, u, Vec2::new(x, y)) {
                Some(l) if !world.occluded(&surface.spawn_to(l.point)) => {
                    bsdf.eval(&surface, wi, surface.frame.to_local(l.wi), Query::default()) * l.weight
                }
                _ => Rgb::ZERO,
            }
        });
        both.assert_agrees(&emitters, 0.03);
        // A world that does not know its emitters has nothing to weigh against.
        let mut blind = world;
        blind.lights = Lights::default().into();
        let bsdfs = estimate(65536, seed + 2, |s| scattered(&blind, &surface, -ray.d, Query::default(), None, &ONE_BOUNCE, s));
        both.assert_agrees(&bsdfs, 0.03);
    }
}

#[test]
fn the_layers_add_up_to_the_unsplit_image() {
    let world = lit_room(rough_plastic(0.15));
    let (ray, params) = (slanted_ray(), PathParams::default());
    let whole = estimate(32768, 5, |s| radiance(&world, &ray, &params, s));
    let sum = estimate(16384, 6, |s| trace_layers(&world, &ray, &params, s).sum());
    sum.assert_agrees(&whole, 0.02);
    let one = trace_layers(&world, &ray, &params, &mut Sampler::new(1, 2));
    assert!(one.diffuse != Rgb::ZERO && one.emission == Rgb::ZERO);
}

#[test]
fn the_light_map_quantity_times_the_views_factor_is_the_diffuse_layer() {
    for floor in [rough_plastic(0.15), diffuse(0.4)] {
        let world = lit_room(floor);
        let (ray, params) = (slanted_ray(), PathParams::default());
        let surface = world.intersect(&ray).unwrap();
        let wi = surface.frame.to_local(-ray.d);
        let out = world.scene.bsdf(&surface).diffuse_out(&surface, wi);
        let stored = estimate(16384, 7, |s| transmitted_irradiance(&world, &surface, false, None, &params, s) * out * FRAC_1_PI);
        let query = Query { lobes: Lobes::DIFFUSE, ..Query::default() };
        let layer = estimate(16384, 8, |s| scattered(&world, &surface, -ray.d, query, None, &params, s));
        stored.assert_agrees(&layer, 0.02);
    }
}

#[test]
fn the_back_of_a_two_sided_wall_gathers_the_light_behind_it() {
    let mut room = Room::default();
    room.rectangle(Vec3::ZERO, Vec3::X, -Vec3::Z, room::two_sided(diffuse(0.5)));
    let lamp = room.rectangle(Vec3::new(0.0, -1.0, 0.0), Vec3::X * 100.0, Vec3::Z * -100.0, diffuse(0.0));
    room.emit(lamp, Rgb::splat(2.0));
    let world = room.world();
    let surface = world.intersect(&Ray::new(Vec3::Y, Vec3::NEG_Y)).unwrap();
    let gather = |back| estimate(4096, 9, |s| transmitted_irradiance(&world, &surface, back, None, &PathParams::default(), s));
    gather(false).assert_is(Rgb::ZERO, 0.0);
    gather(true).assert_is(Rgb::splat(2.0 * PI), 0.02);
}

#[test]
fn a_mirror_shows_the_lamp_in_the_glossy_layer() {
    let mut room = Room::default();
    let mirror = Conductor { eta: Rgb::ZERO, k: Rgb::ONE, specular_reflectance: Texture::Constant(Rgb::splat(0.9)) };
    room.rectangle(Vec3::ZERO, Vec3::X, -Vec3::Z, Bsdf::Conductor(mirror));
    let lamp = room.rectangle(Vec3::Y * 2.0, Vec3::X * 0.5, Vec3::Z * 0.5, diffuse(0.0));
    room.emit(lamp, Rgb::splat(3.0));
    let world = room.world();
    let layers = trace_layers(&world, &Ray::new(Vec3::Y, Vec3::NEG_Y), &PathParams::default(), &mut Sampler::new(1, 1));
    assert!((layers.glossy - Rgb::splat(2.7)).abs().max_element() < 1e-4, "{layers:?}");
    assert_eq!((layers.diffuse, layers.emission), (Rgb::ZERO, Rgb::ZERO));
}

fn mirror(reflectance: Rgb) -> Bsdf {
    let specular_reflectance = Texture::Constant(reflectance);
    Bsdf::Conductor(Conductor { eta: Rgb::ZERO, k: Rgb::ONE, specular_reflectance })
}

/// [`radiance`] of a surface that does not emit, by paths that draw emitters in mirrors.
fn walked(world: &World, ray: &Ray, params: &PathParams, sampler: &mut Sampler) -> Rgb {
    let mut walk = Walk { world, params, plan: None, lessons: None };
    let numbers = walk.numbers(sampler);
    let surface = world.seen(ray).unwrap();
    walk.scattered(numbers, &surface, -ray.d, Query::default(), Start::seen(Rgb::ONE), sampler).light
}

/// A floor with a wall at x = -1 that is a mirror, and, where that is wanted, another at z = -1; and a lamp over it that shines down.
fn mirrored_floor(floor: Bsdf, reflectance: Rgb, corner: bool) -> World {
    let mut room = Room::default();
    room.rectangle(Vec3::ZERO, Vec3::X * 5.0, Vec3::Z * -5.0, floor);
    room.rectangle(Vec3::new(-1.0, 2.0, 0.0), Vec3::Z * -5.0, Vec3::Y * 2.0, mirror(reflectance));
    if corner {
        room.rectangle(Vec3::new(0.0, 2.0, -1.0), Vec3::X * 5.0, Vec3::Y * 2.0, mirror(reflectance));
    }
    let lamp = room.rectangle(Vec3::new(-0.1, 1.5, 0.0), Vec3::X * 0.4, Vec3::Z * 0.6, diffuse(0.0));
    room.emit(lamp, Rgb::splat(4.0));
    room.world()
}

#[test]
fn light_by_way_of_a_mirror_is_that_of_the_lamps_image() {
    let reflectance = Rgb::new(0.9, 0.6, 0.3);
    let world = mirrored_floor(diffuse(0.5), reflectance, false);
    assert_eq!(world.mirrors.count(), 1);
    let foot = Vec3::new(-0.4, 0.0, 0.1);
    let ray = Ray::new(foot + Vec3::Y, Vec3::NEG_Y);
    // Differential element below a parallel rectangle, whose edges lie so far from it in x and z (Howell's catalogue, B-4).
    let corner = |x: f32, z: f32| {
        let (a, b) = (x / 1.5, z / 1.5);
        let (ra, rb) = ((1.0 + a * a).sqrt(), (1.0 + b * b).sqrt());
        0.5 * FRAC_1_PI * (a / ra * (b / ra).atan() + b / rb * (a / rb).atan())
    };
    let factor = |x: [f32; 2]| {
        let strip = |z: f32| corner(x[1], z) - corner(x[0], z);
        strip(0.6 - 0.1) + strip(0.6 + 0.1)
    };
    // The lamp reaches from -.5 to .3, its image from -2.3 to -1.5.
    let (direct, image) = (factor([-0.1, 0.7]), factor([-1.9, -1.1]));
    let params = PathParams { max_depth: 2, ..PathParams::default() };
    let found = estimate(8192, 4, |s| walked(&world, &ray, &params, s));
    found.assert_is(0.5 * 4.0 * (Rgb::splat(direct) + reflectance * image), 0.005);
}

#[test]
fn emitters_drawn_in_mirrors_change_the_noise_alone() {
    let endless = PathParams::default();
    for (seed, floor, corner) in
        [(1, diffuse(0.7), false), (2, diffuse(0.7), true), (3, rough_plastic(0.15), true), (4, mirror(Rgb::splat(0.8)), true)]
    {
        let mut world = mirrored_floor(floor, Rgb::splat(0.9), corner);
        let ray = Ray::new(Vec3::new(0.4, 1.0, 1.0), Vec3::new(-0.4, -1.0, -0.6).normalize());
        let with = estimate(16384, seed, |s| walked(&world, &ray, &endless, s));
        world.mirrors = Mirrors::default();
        let without = estimate(16384, 10 + seed, |s| walked(&world, &ray, &endless, s));
        with.assert_agrees(&without, 0.02);
        with.assert_agrees(&estimate(16384, 20 + seed, |s| radiance(&world, &ray, &endless, s)), 0.02);
        if seed < 3 {
            assert!(with.sigma.x < 0.5 * without.sigma.x, "{} where scattering alone has {}", with.sigma, without.sigma);
        }
    }
}

#[test]
fn panes_reflect_outside_and_lamps_without_extent_are_not_drawn() {
    let pane = |lamp: bool| {
        let mut room = Room::default();
        room.rectangle(Vec3::NEG_Y, Vec3::X * 2.0, Vec3::Z * -2.0, diffuse(0.5));
        // Its faces' fronts are outside, but they reflect on both sides.
        for side in [-1.0, 1.0] {
            room.rectangle(Vec3::Z * 0.01 * side, Vec3::X * side, Vec3::Y, two_sided(mirror(Rgb::ONE)));
        }
        if lamp {
            let lamp = room.rectangle(Vec3::Y * 3.0, Vec3::X * 0.4, Vec3::Z * 0.4, diffuse(0.0));
            room.emit(lamp, Rgb::ONE);
        } else {
            room.light(Emitter::Point { position: Vec3::Y * 3.0, intensity: Rgb::ONE });
        }
        room.world()
    };
    assert_eq!(pane(true).mirrors.count(), 2);
    let world = pane(false);
    assert_eq!(world.mirrors.count(), 0);
}

#[test]
fn point_spot_and_sun_light_a_floor_by_their_closed_forms() {
    let (position, direction) = (Vec3::new(0.0, 2.0, 0.0), Vec3::NEG_Y);
    let white = Rgb::splat(10.0);
    let cutoff_rad = FRAC_PI_4;
    let spot = Emitter::Spot { position, direction, intensity: white, cutoff_rad, beam_rad: 0.0, pattern: None };
    let slant = Vec3::new(1.0, -1.0, 0.0).normalize();
    // At (1, 0, 0): distance √5, cosine 2/√5; the spot has fallen by its angle atan(1/2) over the cutoff.
    let falling = 10.0 * 2.0 / 5f32.powf(1.5);
    let cases = [
        (Emitter::Point { position, intensity: white }, falling),
        (spot, falling * (1.0 - 0.5f32.atan() / cutoff_rad)),
        (Emitter::Directional { direction: slant, irradiance: white }, 10.0 * 0.5f32.sqrt()),
    ];
    for (emitter, irradiance) in cases {
        let mut room = Room::default();
        room.rectangle(Vec3::ZERO, Vec3::X * 3.0, Vec3::Z * -3.0, diffuse(0.8));
        room.light(emitter.clone());
        let world = room.world();
        let ray = Ray::new(Vec3::new(1.0, 1.0, 0.0), Vec3::NEG_Y);
        let found = radiance(&world, &ray, &ONE_BOUNCE, &mut Sampler::new(4, 4));
        let expected = 0.8 * FRAC_1_PI * irradiance;
        assert!((found - expected).abs().max_element() < 1e-4, "{emitter:?}: {found}, expected {expected}");
    }
}

#[test]
fn a_strip_between_lamp_and_floor_casts_a_shadow() {
    let mut room = Room::default();
    room.rectangle(Vec3::ZERO, Vec3::X * 3.0, Vec3::Z * -3.0, diffuse(0.8));
    room.rectangle(Vec3::Y, Vec3::X * 0.2, Vec3::Z * -0.2, diffuse(0.8));
    room.light(Emitter::Point { position: Vec3::Y * 2.0, intensity: Rgb::ONE });
    let world = room.world();
    let at = |x: f32| {
        let (eye, foot) = (Vec3::new(x, 0.5, 0.0), Vec3::new(x, 0.0, 0.0));
        radiance(&world, &Ray::new(eye, (foot - eye).normalize()), &ONE_BOUNCE, &mut Sampler::new(1, 0))
    };
    assert_eq!(at(0.1), Rgb::ZERO);
    assert!(at(0.5).x > 0.0);
}

#[test]
fn one_thread_equals_many() {
    let world = lit_room(rough_plastic(0.15));
    let camera = Camera::look_at(Vec3::new(0.8, 1.0, 0.8), Vec3::ZERO, Vec3::Y, 1.2, [24, 16]);
    for spp in [4, 20] {
        let params = PathTraceParams { spp, ..PathTraceParams::default() };
        let with = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| path_trace(&world, &camera, &params, 5, 0, &Silent))
        };
        let one = with(1);
        assert!(one == with(7), "{spp} samples");
        assert!(one != path_trace(&world, &camera, &params, 6, 0, &Silent), "the seed counts");
        assert!(one != path_trace(&world, &camera, &params, 5, 1, &Silent), "the frame counts");
        assert!(one.full().iter().all(|c| c.is_finite() && c.min_element() >= 0.0 && *c != Rgb::ZERO));
    }
}

#[test]
fn paths_that_go_by_efficiency_carry_the_same_light() {
    let world = lit_room(rough_plastic(0.15));
    let camera = Camera::look_at(Vec3::new(0.8, 1.0, 0.8), Vec3::ZERO, Vec3::Y, 1.2, [24, 16]);
    let means = |efficiency: bool, pick: fn(&LayerImages) -> &[Rgb]| -> Vec<DVec3> {
        let params = PathTraceParams { spp: 48, efficiency, ..PathTraceParams::default() };
        let mean = |image: &[Rgb]| image.iter().map(|c| c.as_dvec3()).sum::<DVec3>() / image.len() as f64;
        (0..12).map(|seed| mean(pick(&path_trace(&world, &camera, &params, seed, 0, &Silent)))).collect()
    };
    let full = |efficiency: bool| -> Vec<DVec3> {
        let params = PathTraceParams { spp: 48, efficiency, ..PathTraceParams::default() };
        let render = |seed| path_trace_full(&world, &camera, &params, seed, 0, &Silent);
        (0..12).map(|seed| render(seed).iter().map(|c| c.as_dvec3()).sum::<DVec3>() / 384.0).collect()
    };
    let spread = |values: &[DVec3]| {
        let n = values.len() as f64;
        let mean = values.iter().sum::<DVec3>() / n;
        (mean, values.iter().map(|v| (v - mean) * (v - mean)).sum::<DVec3>() / (n * (n - 1.0)))
    };
    for (what, by, without) in [
        ("diffuse", means(true, |l| &l.diffuse), means(false, |l| &l.diffuse)),
        ("glossy", means(true, |l| &l.glossy), means(false, |l| &l.glossy)),
        ("full", full(true), full(false)),
    ] {
        assert!(by != without, "{what}: both were made alike");
        let ((a, noise_a), (b, noise_b)) = (spread(&by), spread(&without));
        let sigma = (noise_a + noise_b).map(f64::sqrt);
        assert!((sigma / b).max_element() < 0.004, "{what}: noise {sigma} of {b} hides everything");
        assert!(((a - b).abs() / sigma).max_element() < 4.0, "{what}: {a} where throughput says {b}, sigma {sigma}");
    }
}

#[test]
fn a_turned_sky_lights_from_where_it_is_seen() {
    // Upper half bright, turned so that its zenith is +X: a wall facing +X gets it all, one facing -X the dark half.
    let rows = 64;
    let pixel = |y: usize| if y < rows / 2 { Rgb::splat(2.0) } else { Rgb::ZERO };
    let image = reprobe::material::image::Image::new(4, rows, (0..4 * rows).map(|i| pixel(i / 4)).collect());
    let image = std::sync::Arc::new(image);
    let to_world = Affine3A::from_rotation_z(-std::f32::consts::FRAC_PI_2);
    for (side, expected) in [(1.0, 1.0), (-1.0, 0.0)] {
        let mut room = Room::default();
        room.rectangle(Vec3::ZERO, Vec3::Y * side, Vec3::Z, diffuse(0.5));
        room.light(Emitter::Envmap { image: image.clone(), scale: 1.0, to_world });
        let world = room.world();
        let ray = Ray::new(Vec3::X * side, Vec3::X * -side);
        let found = estimate(4096, 12, |s| radiance(&world, &ray, &PathParams::default(), s)).mean;
        // One row in 63 between the halves is a ramp.
        assert!((found - Rgb::splat(expected)).abs().max_element() < 0.02, "side {side}: {found}");
    }
}

#[test]
fn paths_by_efficiency_end_where_roulette_never_would() {
    // A box whose walls all glow and reflect .9, from within: ten times what they emit, whichever way one looks.
    let mut room = Room::default();
    let walls = room.inward_box(Vec3::splat(-1.0), Vec3::splat(1.0), diffuse(0.9));
    room.emit(walls, Rgb::ONE);
    let world = room.world();
    let camera = Camera::look_at(Vec3::ZERO, Vec3::new(0.3, 0.2, 1.0), Vec3::Y, 1.2, [12, 8]);
    let endless = PathParams { max_depth: u32::MAX, rr_depth: u32::MAX };
    let params = PathTraceParams { spp: 32, path: endless, efficiency: true, ..PathTraceParams::default() };
    let render =
        |seed| path_trace_full(&world, &camera, &params, seed, 0, &Silent).iter().map(|c| f64::from(c.x)).sum::<f64>() / 96.0;
    let means: Vec<f64> = (0..12).map(render).collect();
    let mean = means.iter().sum::<f64>() / 12.0;
    let sigma = (means.iter().map(|m| (m - mean).powi(2)).sum::<f64>() / (12.0 * 11.0)).sqrt();
    assert!(sigma < 0.1 && (mean - 10.0).abs() < 4.0 * sigma + 1e-3, "{mean} ± {sigma} where walls give 10");
}
