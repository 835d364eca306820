//! Frames of many lights against numerical integration.
//!
//! The reference is a path tracer whose indirect rays ignore what blocks them: a ray counts all surfaces that it passes.

use super::adaptive::Sampler as Pixels;
use super::arrival::{Arrival, Received};
use super::bounce::{Structure, light, sites};
use super::descend::Receiver;
use super::emit::{Site, direct};
use super::gather::Gather;
use super::params::{ManyLightParams, Sampling, Traversal};
use super::place::Place;
use super::points::place;
use super::shade::{Light, Shading};
use crate::base::clock::Clock;
use crate::base::math::{Basis, Rgb, hash_words, luminance, reflect};
use crate::exchange::{LoadOptions, load};
use crate::material::Surface;
use crate::material::bsdf::warp::{cosine_hemisphere, direction};
use crate::material::bsdf::{Lobes, Query};
use crate::surface::CurvatureMap;
use crate::transport::path::{PathParams, scattered};
use crate::transport::{Sampler, World};
use crate::view::gbuffer::{GBuffer, gbuffer};
use glam::Vec3;
use std::f32::consts::PI;

const SENSOR: &str = "<sensor type='perspective'><float name='fov' value='60'/>
    <transform name='to_world'><lookat origin='0, 0.2, 1.9' target='0, -0.3, 0' up='0, 1, 0'/></transform>
    <film type='hdrfilm'><integer name='width' value='64'/><integer name='height' value='48'/></film></sensor>";
const LAMP: &str =
    "<shape type='rectangle'><transform name='to_world'><rotate x='1' angle='90'/><scale value='0.5'/><translate y='1.9'/>
    </transform><bsdf type='diffuse'><rgb name='reflectance' value='0'/></bsdf>
    <emitter type='area'><rgb name='radiance' value='10'/></emitter></shape>";

/// A room of 4 x 4 x 4 m with a box in it, all of one material.
fn room(material: &str) -> World {
    let material = format!("<bsdf type='twosided'>{material}</bsdf>");
    let body = format!(
        "<shape type='cube'><transform name='to_world'><scale value='2'/></transform>{material}</shape>
        <shape type='cube'><transform name='to_world'><scale x='0.5' y='0.9' z='0.5'/><rotate y='1' angle='25'/>
        <translate x='-0.6' y='-1.1' z='-0.5'/></transform>{material}</shape>{LAMP}{SENSOR}"
    );
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("s.xml");
    std::fs::write(&path, format!("<scene version='3.0.0'>{body}</scene>")).unwrap();
    World::new(load(&path, &LoadOptions::default()).unwrap())
}

const DIFFUSE: &str = "<bsdf type='diffuse'><rgb name='reflectance' value='0.6, 0.5, 0.4'/></bsdf>";
/// No diffuse lobe at all; exponent 11.
const GLOSSY: &str = "<bsdf type='roughconductor'><string name='material' value='none'/><float name='alpha' value='0.2'/></bsdf>";
const BOTH: &str =
    "<bsdf type='roughplastic'><rgb name='diffuse_reflectance' value='0.4'/><float name='alpha' value='0.2'/></bsdf>";

/// A perfect mirror over a diffuse base.
const COATED: &str = "<bsdf type='plastic'><rgb name='diffuse_reflectance' value='0.4'/></bsdf>";

/// Brute force over `vpls` lights, one bounce.
fn plain(vpls: u32) -> ManyLightParams {
    ManyLightParams { vpls, bounces: 1, traversal: Traversal::Leaves, sampling: Sampling::Full, ..ManyLightParams::default() }
}

/// A frame's light, and a view of it.
struct Lit<'w> {
    world: &'w World,
    params: ManyLightParams,
    sites: Vec<Site<'w>>,
    structure: Structure,
    gather: Gather,
}

impl<'w> Lit<'w> {
    fn new(world: &'w World, params: &ManyLightParams) -> Self {
        Self::drawn(world, params, 3)
    }

    /// With another seed's lights.
    fn drawn(world: &'w World, params: &ManyLightParams, seed: u32) -> Self {
        let places = place(world, params.vpls, params.repulsion, seed);
        let sites = sites(world, &places, params);
        let structure = Structure::new(&sites, params, seed);
        let gather = light(world, (&sites, &structure), params, seed, &mut Clock::start());
        Self { world, params: *params, sites, structure, gather }
    }

    fn shading(&self) -> Shading<'_> {
        let Self { world, sites, structure, gather, params, .. } = self;
        Shading { world, sites, structure, gather, params, seeds: [3, 0] }
    }

    /// Indirect light of a view's pixels, and which were sampled.
    fn view(&self, view: &GBuffer) -> (Vec<Light>, usize) {
        let shading = self.shading();
        let sample = |i: usize, p: &_| shading.light(i, p).0;
        let pixels = Pixels { view, params: &self.params, diagonal: 48f32.sqrt(), sample: &sample };
        let filled = pixels.fill();
        (filled.values, filled.sampled.into_iter().filter(|s| *s).count())
    }
}

fn view(world: &World) -> GBuffer {
    gbuffer(world, &CurvatureMap::flat(world.scene.geometry.positions.len()), world.scene.sensor.as_ref().unwrap())
}

fn rms(values: impl Iterator<Item = f32>) -> f32 {
    let (sum, count) = values.fold((0.0, 0), |(sum, count), x| (sum + x * x, count + 1));
    (sum / count as f32).sqrt()
}

fn layers(lit: &Lit, view: &GBuffer) -> ([Vec<Rgb>; 2], usize) {
    let (lights, count) = lit.view(view);
    (lit.shading().layers(view, &lights), count)
}

fn image([diffuse, glossy]: [Vec<Rgb>; 2]) -> Vec<Rgb> {
    diffuse.into_iter().zip(glossy).map(|(d, g)| d + g).collect()
}

/// RMS of a difference of images, and of the second of them.
fn difference(a: &[Rgb], b: &[Rgb]) -> (f32, f32) {
    (rms(a.iter().zip(b).map(|(a, b)| a.y - b.y)), rms(b.iter().map(|b| b.y)))
}

/// All surfaces along a ray that face it, whatever is in front of them.
fn along(world: &World, from: &Surface, d: Vec3, mut each: impl FnMut(&Surface)) {
    let mut at = *from;
    for _ in 0..32 {
        let Some(next) = world.intersect(&at.spawn(d)) else { return };
        each(&next);
        at = next;
    }
}

/// Irradiance of one bounce that ignores what blocks it, by rays over the hemisphere, and its standard error.
fn integrated(world: &World, site: &Site, samples: u32, stream: u32) -> (f32, f32) {
    let frame = Basis::from_normal(site.n);
    let query = Query { lobes: Lobes::DIFFUSE, ..Query::default() };
    let (mut sum, mut squares) = (0.0, 0.0);
    for i in 0..samples {
        let mut sampler = Sampler::new(stream, i);
        let d = frame.to_world(cosine_hemisphere(sampler.next_2d()));
        let mut radiance = 0.0;
        along(world, &site.surface, d, |hit| {
            radiance += scattered(world, hit, -d, query, None, &PathParams::DIRECT, &mut sampler.branch(1)).y;
        });
        sum += PI * radiance;
        squares += (PI * radiance).powi(2);
    }
    let (n, mean) = (samples as f32, sum / samples as f32);
    (mean, ((squares / n - mean * mean).max(0.0) / n).sqrt())
}

/// Irradiance at a point.
#[derive(Clone, Copy, Default)]
struct Irradiance(f32);

impl Received for Irradiance {
    fn add(&mut self, other: &Self, scale: f32) {
        self.0 += other.0 * scale;
    }

    fn weight(&self) -> f32 {
        self.0
    }
}

fn irradiance(gather: &Gather, site: &Site) -> f32 {
    let receive = |a: &Arrival| Irradiance(a.radiance.y * a.solid_angle * a.direction.dot(site.n).max(0.0));
    gather.at(&Receiver { p: site.surface.p, n: site.n, lobe: None }, receive, |_| true, 0).0.0
}

#[test]
fn the_sum_over_all_lights_tends_to_integration_that_ignores_what_blocks_light() {
    let world = room(DIFFUSE);
    let at = place(&world, 96, 8, 77);
    let receivers = sites(&world, &at, &plain(1));
    let expected: Vec<(f32, f32)> =
        receivers.iter().enumerate().map(|(i, s)| integrated(&world, s, 4096, hash_words(&[i as u32, 9]))).collect();
    let size = rms(expected.iter().map(|e| e.0));
    let noise = rms(expected.iter().map(|e| e.1)) / size;
    assert!(noise < 0.02, "the reference is too noisy to tell: {noise}");
    let errors = [512, 4096, 16_384].map(|vpls| {
        let lit = Lit::new(&world, &plain(vpls));
        let wrong = receivers.iter().zip(&expected).map(|(s, e)| (irradiance(&lit.gather, s) - e.0) / size);
        (wrong.clone().sum::<f32>() / receivers.len() as f32, rms(wrong))
    });
    let [(_, few), _, (bias, many)] = errors;
    assert!(few > 2.0 * many && many < 1.5 * noise + 0.01 && bias.abs() < 0.01, "(bias, error): {errors:?}, noise {noise}");
}

#[test]
fn places_are_where_the_sensor_may_see_and_share_the_area() {
    let world = room(DIFFUSE);
    let places = place(&world, 4000, 16, 1);
    // The room's inside, five sides of the box but for what stands on the floor, and the lamp from below.
    let visible = 6.0 * 16.0 - 1.0 + (4.0 * 1.8 + 1.0) + 1.0;
    let total: f32 = places.areas.iter().sum();
    assert!((total / visible - 1.0).abs() < 0.03, "{total}, {visible}");
    for (object, area) in [(0, 95.0), (1, 8.2), (2, 1.0)] {
        let is_its = |p: &Place| world.scene.geometry.triangle_object[p.triangle as usize] == object;
        let found: f32 = places.list.iter().zip(&places.areas).filter(|(p, _)| is_its(p)).map(|(_, area)| area).sum();
        assert!((found - area).abs() < 0.03 * area + 0.1, "object {object}: {found} of {area} m²");
    }
    let outside = places.list.iter().filter(|p| {
        let s = p.surface(&world);
        world.scene.geometry.triangle_object[p.triangle as usize] == 0 && (s.frame.n * p.side()).dot(s.p) > 0.0
    });
    assert_eq!(outside.count(), 0, "nobody sees the outside");
}

#[test]
fn a_threshold_of_nothing_is_the_sum_over_all_lights() {
    let world = room(BOTH);
    let view = view(&world);
    let params = ManyLightParams { bounces: 2, ..plain(1000) };
    let leaves = Lit::new(&world, &params).view(&view).0;
    let full = ManyLightParams { traversal: Traversal::Full, solid_angle: 0.0, ..params };
    assert!(leaves == Lit::new(&world, &full).view(&view).0);
    let open = ManyLightParams { traversal: Traversal::Cuts, min_cut: 1e6, max_cut: 0.0, ..full };
    assert!(leaves == Lit::new(&world, &open).view(&view).0);
}

/// The sum over all lights is itself an estimate: what clusters change is held against what another draw of the lights does.
#[test]
fn cuts_and_clusters_change_less_than_another_draw_of_the_lights() {
    let world = room(BOTH);
    let view = view(&world);
    let of = |traversal, seed| {
        let params = ManyLightParams { traversal, bounces: 2, ..plain(4096) };
        image(layers(&Lit::drawn(&world, &params, seed), &view).0)
    };
    let exact = of(Traversal::Leaves, 3);
    let (noise, size) = difference(&of(Traversal::Leaves, 4), &exact);
    // The difference of two draws has the variance of both.
    let noise = noise / 2f32.sqrt();
    for traversal in [Traversal::Full, Traversal::Cuts] {
        let (wrong, _) = difference(&of(traversal, 3), &exact);
        assert!(wrong < noise, "{traversal}: {wrong} of {size}, where a draw has {noise}");
    }
}

#[test]
fn glossy_light_alone_goes_from_glossy_to_glossy() {
    let world = room(GLOSSY);
    let view = view(&world);
    let sum = |params: ManyLightParams| {
        let [diffuse, glossy] = layers(&Lit::new(&world, &params), &view).0;
        assert!(diffuse.iter().all(|c| *c == Rgb::ZERO));
        glossy.iter().map(|c| luminance(*c)).sum::<f32>() / glossy.len() as f32
    };
    let exact = sum(plain(4096));
    let filtered = sum(ManyLightParams { traversal: Traversal::Cuts, ..plain(4096) });
    assert!(exact > 0.02 && (filtered / exact - 1.0).abs() < 0.1, "{filtered}, {exact}");
    assert_eq!(sum(ManyLightParams { lobes: 0, ..plain(4096) }), 0.0);
    let two = sum(ManyLightParams { bounces: 2, ..plain(4096) });
    assert!(two > 1.3 * exact, "a second bounce between metals: {two}, {exact}");
}

/// A perfect mirror sends on what its ray finds, whether that is drawn from its lobe or known; without rays its lobe is gathered for.
#[test]
fn a_mirror_has_one_ray() {
    let world = room(COATED);
    let view = view(&world);
    let of = |mirror_rays, mirror_samples| {
        let lit = Lit::new(&world, &ManyLightParams { mirror_rays, mirror_samples, ..plain(1000) });
        let (followed, count) = lit.shading().followed(&view);
        let [_, gathered] = layers(&lit, &view).0;
        (followed, count, rms(gathered.iter().map(|c| c.y)))
    };
    let (known, drawn, none) = (of(4, 0), of(4, 3), of(0, 0));
    let (wrong, size) = difference(&known.0, &drawn.0);
    assert!(size > 0.0 && wrong < 0.01 * size, "{wrong} of {size}");
    assert!(known.1 > view.pixels.len() / 2 && known.2 == 0.0);
    assert!(none.1 == 0 && none.0.iter().all(|c| *c == Rgb::ZERO) && none.2 > 0.0);
}

/// Brute force over many glossy lights against rays through the receiver's lobe to what they meet, each lit and reflecting as a light would.
#[test]
fn glossy_sums_tend_to_integration() {
    let world = room(GLOSSY);
    let view = view(&world);
    let params = plain(16_384);
    let lit = Lit::new(&world, &params);
    let shading = lit.shading();
    let (mut found, mut expected, mut variance) = (0.0, 0.0, 0.0);
    for i in (0..view.pixels.len()).step_by(97) {
        let Some(p) = view.pixels[i].as_ref().filter(|p| p.alpha.is_some()) else { continue };
        let exponent = super::emit::exponent(p.alpha.unwrap(), &params);
        let mirrored = reflect(p.wo, p.normal);
        let frame = Basis::from_normal(mirrored);
        let (mut sum, mut squares) = (0.0, 0.0);
        for k in 0..400 {
            let mut sampler = Sampler::new(hash_words(&[i as u32, 5]), k);
            let u = sampler.next_2d();
            let d = frame.to_world(direction(u.x.powf(1.0 / (exponent + 1.0)), u.y));
            let mut radiance = 0.0;
            if d.dot(p.normal) > 0.0 {
                along(&world, &p.surface, d, |hit| {
                    let back = hit.frame.n.dot(d) > 0.0;
                    let at = Place { triangle: hit.triangle, barycentric: hit.barycentric, back };
                    let site = Site::new(&world, &at, 1.0, &params);
                    let emission = direct(&world, &[site], 16, hash_words(&[i as u32, k]))[0];
                    radiance += emission.lobes.filtered()[0].radiance(params.kernel, -d).y;
                });
            }
            sum += radiance / 400.0;
            squares += radiance * radiance / 400.0;
        }
        expected += sum;
        variance += (squares - sum * sum).max(0.0) / 400.0;
        found += shading.light(i, p).0.glossy.y;
    }
    let noise = variance.sqrt() / expected;
    assert!(noise < 0.03 && (found / expected - 1.0).abs() < 3.0 * noise + 0.01, "{found}, {expected}, noise {noise}");
}

#[test]
fn adaptive_sampling_samples_few_pixels_and_bilateral_a_sixteenth() {
    let world = room(BOTH);
    let camera = world.scene.sensor.as_ref().unwrap();
    let camera = crate::scene::Camera { size: [320, 240], ..camera.clone() };
    let view = gbuffer(&world, &CurvatureMap::flat(world.scene.geometry.positions.len()), &camera);
    let of = |sampling| {
        let lit = Lit::new(&world, &ManyLightParams { sampling, traversal: Traversal::Cuts, bounces: 2, ..plain(4096) });
        layers(&lit, &view)
    };
    let (full, all) = of(Sampling::Full);
    let (bilateral, sixteenth) = of(Sampling::Bilateral);
    let (adaptive, few) = of(Sampling::Adaptive);
    assert_eq!((all, sixteenth), (320 * 240, 80 * 60));
    assert!(few < all / 5, "{few} of {all}");
    let [full, bilateral, adaptive] = [full, bilateral, adaptive].map(image);
    let ((a, size), (b, _)) = (difference(&adaptive, &full), difference(&bilateral, &full));
    assert!(a < 0.03 * size && b < 0.2 * size, "adaptive {a}, bilateral {b}, of {size}, {few} pixels");
}

#[test]
fn shadow_rays_give_the_sum_of_what_is_seen() {
    const STREAMS: u32 = 64;
    let world = room(DIFFUSE);
    let shadowed = ManyLightParams { shadow_rays: 4, ..plain(1024) };
    let lit = Lit::new(&world, &shadowed);
    let emissions = direct(&world, &lit.sites, shadowed.light_samples, 3);
    let at = place(&world, 40, 8, 5);
    let (mut expected, mut found, mut unshadowed) = (0.0, 0.0, 0.0);
    for (k, site) in sites(&world, &at, &shadowed).iter().enumerate() {
        let seen = |light: &Site| !world.occluded(&site.surface.spawn_to(light.surface.p));
        for (light, emission) in lit.sites.iter().zip(&emissions) {
            let to = light.surface.p - site.surface.p;
            let (distance, w) = (to.length(), to.normalize());
            let area = light.spot().area;
            let radius = (area / PI).sqrt();
            let cos = -light.n.dot(w);
            let near = distance < super::disc::FAR * radius;
            let solid_angle = match near {
                _ if cos <= 0.0 => 0.0,
                true => super::disc::solid_angle(distance / radius, cos),
                false => area * cos / (distance * distance),
            };
            let sent = emission.diffuse.y * solid_angle * w.dot(site.n).max(0.0);
            unshadowed += sent;
            expected += if seen(light) { sent } else { 0.0 };
        }
        let receive = |a: &Arrival| Irradiance(a.radiance.y * a.solid_angle * a.direction.dot(site.n).max(0.0));
        let is_seen = |light: u32| seen(&lit.sites[lit.structure.tree.order[light as usize] as usize]);
        let once = |s| {
            lit.gather
                .at(&Receiver { p: site.surface.p, n: site.n, lobe: None }, receive, is_seen, hash_words(&[k as u32, s]))
                .0
                .0
        };
        found += (0..STREAMS).map(once).sum::<f32>() / STREAMS as f32;
    }
    assert!(expected < 0.97 * unshadowed, "something is hidden: {expected} of {unshadowed}");
    assert!((found / expected - 1.0).abs() < 0.02, "{found}, {expected}");
}

#[test]
fn spherical_lights_send_what_points_do_and_more_evenly_near_by() {
    let world = room(DIFFUSE);
    let of = |sphere| Lit::new(&world, &ManyLightParams { sphere, ..plain(2048) });
    let (points, spheres) = (of(0.0), of(2.0));
    let at = place(&world, 400, 8, 5);
    let receivers = sites(&world, &at, &plain(1));
    let all = |lit: &Lit| receivers.iter().map(|s| irradiance(&lit.gather, s)).collect::<Vec<f32>>();
    let (a, b) = (all(&points), all(&spheres));
    let (sum_a, sum_b) = (a.iter().sum::<f32>(), b.iter().sum::<f32>());
    assert!((sum_b / sum_a - 1.0).abs() < 0.03, "{sum_b}, {sum_a}");
    assert!(a != b);
}

#[test]
fn frames_are_the_same_on_any_number_of_threads() {
    let world = room(BOTH);
    let view = view(&world);
    let params = ManyLightParams { vpls: 1500, shadow_rays: 2, bounces: 2, ..ManyLightParams::default() };
    let on = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| Lit::new(&world, &params).view(&view))
    };
    assert!(on(1) == on(3));
}
