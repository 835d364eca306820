//! The probe stages together, on a room whose reflections are known in closed form.

use glam::{Vec2, Vec3};
use reprobe::base::math::reflect;
use reprobe::base::progress::Silent;
use reprobe::exchange::{LoadOptions, load};
use reprobe::io::Provenance;
use reprobe::lightmap::lookup::sides;
use reprobe::lightmap::{Atlas, AtlasParams, DenoiseParams};
use reprobe::method::glossy_probes::bake::{Bake, ProbeBakeParams, Traced, bake_glossy, probe_geometry};
use reprobe::method::glossy_probes::candidates::{Candidates, WeightedProbe};
use reprobe::method::glossy_probes::coverage::{CoverageParams, SubPixels, covered_pixels};
use reprobe::method::glossy_probes::filter::FilterParams;
use reprobe::method::glossy_probes::footprint::{Footprint, FootprintParams};
use reprobe::method::glossy_probes::gather::{GatherParams, Gathered, SearchLevel, gather};
use reprobe::method::glossy_probes::perturb::Order;
use reprobe::method::glossy_probes::shown::shown;
use reprobe::method::glossy_probes::tiles::{Room, Tiles};
use reprobe::probe::file::{Probe, Texel};
use reprobe::probe::parameter_map::ParameterMap;
use reprobe::scene::{Camera, Scene};
use reprobe::surface::{CurvatureMap, CurvatureParams, curvature};
use reprobe::transport::World;
use reprobe::view::composite::{diffuse_layer, downsample, emission_layer};
use reprobe::view::gbuffer::{GBuffer, Pixel, gbuffer};
use reprobe::view::mirror::{Reflected, mirror_direction, mirror_hit, mirror_pass};
use reprobe::view::mirror_light::{add_mirrored, mirror_light_pass};

/// A wall of a room from -2 to 2 in x and y and 0 to 4 in z, as Mitsuba's rectangle turned and moved, glowing in its own colour.
fn wall(reflectance: &str, rotate: &str, translate: &str, radiance: &str) -> String {
    format!(
        r#"<shape type="rectangle"><transform name="to_world"><scale value="2"/>{rotate}<translate value="{translate}"/></transform>
        <bsdf type="diffuse"><rgb name="reflectance" value="{reflectance}"/></bsdf>
        <emitter type="area"><rgb name="radiance" value="{radiance}"/></emitter></shape>"#
    )
}

/// The room with `reflector` in it; its walls' radiances differ, so that each pixel of a mirror tells which wall it shows.
fn room(reflector: &str) -> Scene {
    room_of("0", reflector)
}

/// The same, of walls that reflect as well.
fn room_of(reflectance: &str, reflector: &str) -> Scene {
    let turn = |x: i32, y: i32, angle: i32| format!(r#"<rotate x="{x}" y="{y}" z="0" angle="{angle}"/>"#);
    let walls = [
        wall(reflectance, "", "0,0,0", "1,0,0"),
        wall(reflectance, &turn(0, 1, 180), "0,0,4", "0,2,0"),
        wall(reflectance, &turn(0, 1, 90), "-2,0,2", "0,0,3"),
        wall(reflectance, &turn(0, 1, -90), "2,0,2", "4,4,0"),
        wall(reflectance, &turn(1, 0, -90), "0,-2,2", "0,5,5"),
        wall(reflectance, &turn(1, 0, 90), "0,2,2", "6,0,6"),
    ];
    let xml = format!(r#"<scene version="3.0.0">{}{reflector}</scene>"#, walls.concat());
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("room.xml");
    std::fs::write(&path, xml).unwrap();
    load(&path, &LoadOptions::default()).unwrap()
}

const MIRROR: &str = r#"<bsdf type="twosided"><bsdf type="conductor"><string name="material" value="none"/></bsdf></bsdf>"#;

struct Setup {
    world: World,
    curvature: CurvatureMap,
    probes: Vec<Probe>,
}

impl Setup {
    /// Eight probes around `centre`, `spacing` apart, plain lat-long of `width` texels.
    fn new(scene: Scene, centre: Vec3, spacing: f32, width: u32) -> Self {
        let curvature = curvature(&scene.geometry, &CurvatureParams::default(), &Silent);
        let (world, left_out) = World::opaque(scene);
        assert_eq!(left_out, 0);
        let params = ProbeBakeParams { spp: 4, ..ProbeBakeParams::default() };
        let probes = (0..8u32)
            .map(|i| {
                let corner = Vec3::new((i & 1) as f32, (i >> 1 & 1) as f32, (i >> 2) as f32) - 0.5;
                let mut probe = probe_geometry(&world, centre + corner * spacing, ParameterMap::identity([width, width / 2]));
                let bake = Bake { world: &world, params: &params, seed: 0, lightmap: None, device: None };
                bake_glossy(&bake, &mut probe, i, &|_| true, &Silent).unwrap();
                probe
            })
            .collect();
        Self { world, curvature, probes }
    }

    fn view(&self, origin: Vec3, target: Vec3) -> (GBuffer, Vec<Reflected>) {
        let camera = Camera::look_at(origin, target, Vec3::Y, 1.0, [64, 48]);
        let view = gbuffer(&self.world, &self.curvature, &camera);
        let mirror = |p: &reprobe::view::gbuffer::Pixel| mirror_hit(&self.world, &p.surface, p.wo);
        let reflected =
            view.pixels.iter().map(|p| p.as_ref().filter(|p| p.alpha.is_some()).map_or(Reflected::NONE, mirror)).collect();
        (view, reflected)
    }

    fn gather(&self, view: &GBuffer, reflected: &[Reflected], params: &GatherParams) -> Vec<Gathered> {
        self.gather_with(view, reflected, params, false)
    }

    fn gather_with(&self, view: &GBuffer, reflected: &[Reflected], params: &GatherParams, mirror_light: bool) -> Vec<Gathered> {
        let candidates: Vec<_> = self.probes.iter().map(|p| Candidates::new(&self.world, p, Some(0.5), mirror_light)).collect();
        let probes = self.probes.iter().zip(&candidates).enumerate();
        let weighted: Vec<_> =
            probes.map(|(index, (probe, candidates))| WeightedProbe { index, probe, candidates, weight: 0.125 }).collect();
        gather(&self.world, view, reflected, &weighted, 0.5, params)
    }

    /// Radiance of the emitter of this material; black for others.
    fn emission(&self, material: u16) -> Vec3 {
        let object = self.world.scene.geometry.objects.iter().find(|o| o.material == u32::from(material) && o.emitter.is_some());
        object.map_or(Vec3::ZERO, |_| self.expected(&Reflected { point: Vec3::ZERO, material }))
    }

    /// What a mirror pixel should show: the radiance of the wall that its mirror ray meets.
    fn expected(&self, reflected: &Reflected) -> Vec3 {
        let m = &self.world.scene.materials;
        let walls = self.world.scene.geometry.objects.iter().position(|o| o.material == u32::from(reflected.material)).unwrap();
        assert!(m.len() > usize::from(reflected.material));
        [
            Vec3::new(1., 0., 0.),
            Vec3::new(0., 2., 0.),
            Vec3::new(0., 0., 3.),
            Vec3::new(4., 4., 0.),
            Vec3::new(0., 5., 5.),
            Vec3::new(6., 0., 6.),
        ][walls]
    }
}

/// Fractions of mirror pixels that show the right wall, and that found any sample. Pixels within `EDGE` of one that shows something
/// else are left out: there a texel may see either side.
fn score(setup: &Setup, view: &GBuffer, reflected: &[Reflected], params: &GatherParams) -> (f64, f64) {
    const EDGE: i32 = 3;
    let gathered = setup.gather(view, reflected, params);
    let [width, height] = view.size().map(|n| n as i32);
    let shows = |x: i32, y: i32| reflected[(y.clamp(0, height - 1) * width + x.clamp(0, width - 1)) as usize].material;
    let is_wall = |m: u16| setup.world.scene.geometry.objects.iter().any(|o| o.material == u32::from(m) && o.emitter.is_some());
    let (mut right, mut served, mut total) = (0u32, 0u32, 0u32);
    for i in 0..width * height {
        let (x, y) = (i % width, i / width);
        let m = shows(x, y);
        let inside = (-EDGE..=EDGE).all(|dy| (-EDGE..=EDGE).all(|dx| shows(x + dx, y + dy) == m));
        if !is_wall(m) || !inside {
            continue;
        }
        let (r, g) = (&reflected[i as usize], &gathered[i as usize]);
        total += 1;
        served += u32::from(g.energy.is_finite());
        right += u32::from((g.color - setup.expected(r)).abs().max_element() < 0.01);
    }
    assert!(total > 150, "the view sees {total} mirror pixels away from edges");
    (f64::from(right) / f64::from(total), f64::from(served) / f64::from(total))
}

#[test]
fn a_plane_mirror_shows_the_room_at_every_pixel() {
    let scene = room(&format!(
        r#"<shape type="rectangle"><transform name="to_world"><translate value="0,0,0.1"/></transform>{MIRROR}</shape>"#
    ));
    let setup = Setup::new(scene, Vec3::new(0.2, 0.1, 2.0), 0.6, 256);
    let (view, reflected) = setup.view(Vec3::new(0.3, 0.05, 2.1), Vec3::new(0.0, 0.0, 0.0));
    let (right, served) = score(&setup, &view, &reflected, &GatherParams::default());
    assert!(right > 0.995, "{right}");
    assert!(served > 0.999, "{served}");
}

#[test]
fn the_paraboloid_serves_a_mirror_sphere_better_than_its_tangent_planes() {
    let sphere = format!(
        r#"<shape type="sphere"><point name="center" x="0" y="0" z="1.2"/><float name="radius" value="0.8"/>{MIRROR}</shape>"#
    );
    let setup = Setup::new(room(&sphere), Vec3::new(0.2, 0.1, 2.9), 0.6, 256);
    let (view, reflected) = setup.view(Vec3::new(0.3, 0.05, 2.95), Vec3::new(0.0, 0.0, 1.2));
    let (whole, served) = score(&setup, &view, &reflected, &GatherParams::default());
    assert!(whole > 0.99, "{whole}");
    assert!(served > 0.98, "{served}");
    // The search makes up for what the prediction lacks; without it, the prediction's own energy tells.
    let mean_energy = |order, newton| {
        let mut params = GatherParams { search: vec![SearchLevel { radius: 0, step: 0.0 }], ..GatherParams::default() };
        (params.perturb.order, params.perturb.newton) = (order, newton);
        let gathered = setup.gather(&view, &reflected, &params);
        let energies: Vec<f32> = gathered.iter().filter(|g| g.energy.is_finite()).map(|g| g.energy).collect();
        energies.iter().sum::<f32>() / energies.len() as f32
    };
    let (solved, second, flat) = (mean_energy(Order::Second, 3), mean_energy(Order::Second, 0), mean_energy(Order::Plane, 0));
    assert!(solved < 0.95 * second && second < 0.6 * flat, "Newton {solved}, second order {second}, plane {flat}");
}

/// Some rows at a time or pass after pass, in a view whose last rows and columns fill no tile: the same bits, in memory used before as well.
#[test]
fn passes_over_some_rows_leave_what_those_over_the_whole_view_do() {
    let lobe = r#"<bsdf type="roughconductor"><string name="material" value="none"/><float name="alpha" value="0.2"/></bsdf>"#;
    let scene = room_of(
        "0.5",
        &format!(
            r#"<shape type="sphere"><point name="center" x="-0.6" y="0" z="0.6"/><float name="radius" value="0.4"/>{MIRROR}</shape>
               <shape type="rectangle"><transform name="to_world"><translate value="0.4,0,0.1"/></transform>{lobe}</shape>"#
        ),
    );
    let setup = Setup::new(scene, Vec3::new(0.2, 0.1, 2.0), 0.6, 64);
    let geometry = &setup.world.scene.geometry;
    let atlas = Atlas::build(geometry, &|_| true, &AtlasParams { texel: Some(0.1), ..Default::default() }).unwrap();
    let colours = (0..atlas.size[0] * atlas.size[1]).map(|i| Vec3::new((i % 7) as f32, (i % 5) as f32, (i % 3) as f32)).collect();
    let map = sides(geometry, &atlas, colours, None);
    let candidates: Vec<_> = setup.probes.iter().map(|p| Candidates::new(&setup.world, p, Some(0.5), true)).collect();
    let of = |(index, (probe, candidates))| WeightedProbe { index, probe, candidates, weight: 0.125 };
    let probes: Vec<_> = setup.probes.iter().zip(&candidates).enumerate().map(of).collect();
    let (footprint, filter) = (Footprint::new(&FootprintParams::default()), FilterParams::default());
    let tiles = Tiles {
        world: &setup.world,
        curvature: &setup.curvature,
        lightmap: Some(&map),
        mirrors: Some(&map),
        probes: &probes,
        roughness_scale: 0.5,
        gather: &GatherParams::default(),
        footprint: Some(&footprint),
        filter: &filter,
        previous: None,
    };
    let mut room = Room::default();
    for origin in [Vec3::new(0.3, 0.05, 2.1), Vec3::new(0.2, 0.1, 2.0)] {
        let camera = Camera::look_at(origin, Vec3::ZERO, Vec3::new(0.2, 1.0, 0.0), 1.0, [61, 45]);
        let view = gbuffer(&setup.world, &setup.curvature, &camera);
        let (reflected, mirrored) = mirror_light_pass(&setup.world, &map, &view);
        let whole = tiles.whole(&camera);
        let filtered = whole.filtered(&filter);
        let gathered = whole.buffers().gathered;
        let (mut planes, tally) = tiles.run(&camera, &mut room);
        assert_eq!(planes.shown, shown(&view, &reflected));
        assert_eq!(planes.mirrored, mirrored);
        assert_eq!(planes.emission, emission_layer(&view));
        assert_eq!(planes.diffuse, diffuse_layer(&setup.world.scene, &view, &map));
        assert_eq!(planes.glossy, gathered.iter().map(|g| g.color).collect::<Vec<_>>());
        let is_unserved =
            |(p, g): &(&Option<Pixel>, &Gathered)| p.as_ref().is_some_and(|p| p.alpha.is_some()) && g.energy.is_infinite();
        assert_eq!(tally.unserved, view.pixels.iter().zip(&gathered).filter(is_unserved).count());
        assert!(tally.unserved * 10 < gathered.len(), "{} pixels without a sample", tally.unserved);
        room.filter(61, &mut planes.glossy, &filter);
        assert_eq!(planes.glossy, filtered);
        let changed = filtered.iter().zip(&gathered).filter(|(f, g)| (**f - g.color).length() > 1e-3).count();
        assert!(changed * 20 > filtered.len(), "the filter changes {changed} pixels");
        room.take(planes);
    }
}

#[test]
fn coverage_antialiases_edges_and_what_mirrors_show_of_them() {
    let scene = room(&format!(
        r#"<shape type="sphere"><point name="center" x="-0.6" y="0" z="0.6"/><float name="radius" value="0.4"/>{MIRROR}</shape>
           <shape type="rectangle"><transform name="to_world"><scale value="0.6"/><translate value="0.4,0,0.1"/></transform>{MIRROR}</shape>"#
    ));
    let setup = Setup::new(scene, Vec3::new(0.2, 0.1, 2.0), 0.6, 16);
    let camera = Camera::look_at(Vec3::new(0.3, 0.05, 2.1), Vec3::ZERO, Vec3::new(0.2, 1.0, 0.0), 1.0, [64, 48]);
    // What ideal passes would find at each of n x n rays a pixel.
    let ideal = |n: u32| {
        let fine = Camera { size: camera.size.map(|s| s * n), ..camera.clone() };
        let view = gbuffer(&setup.world, &setup.curvature, &fine);
        let reflected = mirror_pass(&setup.world, &view);
        let shown = |r: &Reflected| if *r == Reflected::NONE || r.is_sky() { Vec3::ZERO } else { setup.emission(r.material) };
        let glossy: Vec<Vec3> = reflected.iter().map(shown).collect();
        let emission: Vec<Vec3> = view.pixels.iter().map(|p| p.as_ref().map_or(Vec3::ZERO, |p| p.emission)).collect();
        (view, reflected, glossy, emission)
    };
    let down = |layer: &[Vec3], n: u32| downsample(layer, camera.size.map(|s| (s * n) as usize), n as usize);
    let (.., glossy, emission) = ideal(12);
    let truth = [down(&glossy, 12), down(&emission, 12)];
    let rmse = |a: &[Vec3], b: &[Vec3]| {
        let sum: f32 = a.iter().zip(b).map(|(a, b)| a.distance_squared(*b)).sum();
        (sum / a.len() as f32).sqrt()
    };
    for n in [1, 2] {
        let (view, reflected, glossy, emission) = ideal(n);
        let plain = [down(&glossy, n), down(&emission, n)];
        let sub = SubPixels { shown: &shown(&view, &reflected), glossy: &glossy, size: view.size(), n: n as usize };
        let mut better = plain.clone();
        let covered = covered_pixels(&setup.world, None, false, &camera, &sub, &CoverageParams::default());
        assert!(covered.len() * 2 < better[0].len(), "{} of {} pixels count as edges", covered.len(), better[0].len());
        for (i, pixel) in covered {
            (better[0][i], better[1][i]) = (pixel.glossy, pixel.emission);
        }
        for (layer, name) in ["glossy", "emission"].into_iter().enumerate() {
            let (before, after) = (rmse(&plain[layer], &truth[layer]), rmse(&better[layer], &truth[layer]));
            assert!(after < 0.6 * before, "{name}, {n} x {n}: {before} before, {after} after");
        }
        assert!(covered_pixels(&setup.world, None, false, &camera, &sub, &CoverageParams { rays: 0 }).is_empty());
    }
}

#[test]
fn what_perfect_mirrors_show_of_lamps_needs_no_texels() {
    let plate = r#"<shape type="rectangle"><transform name="to_world"><scale value="0.5"/><rotate y="1" angle="180"/><translate value="0.9,0.4,3.2"/></transform>
        <bsdf type="roughconductor"><string name="material" value="none"/><float name="alpha" value="0.2"/></bsdf></shape>"#;
    let mirror = format!(
        r#"<shape type="rectangle"><transform name="to_world"><scale value="1.5"/><translate value="0,0,0.1"/></transform>{MIRROR}</shape>"#
    );
    let scene = room_of("0.5", &(mirror + plate));
    let mut setup = Setup::new(scene, Vec3::new(0.2, 0.1, 2.0), 0.6, 64);
    // A light map of many colours, finer than the probes.
    let atlas = AtlasParams { texel: Some(0.1), ..Default::default() };
    let atlas = Atlas::build(&setup.world.scene.geometry, &|_| true, &atlas).unwrap();
    let texels = atlas.size[0] * atlas.size[1];
    let colours = (0..texels).map(|i| Vec3::new((i % 7) as f32, (i % 5) as f32, (i % 3) as f32)).collect();
    let map = sides(&setup.world.scene.geometry, &atlas, colours, None);
    let params = ProbeBakeParams { spp: 4, ..ProbeBakeParams::default() };
    let bake = Bake { world: &setup.world, params: &params, seed: 0, lightmap: Some(&map), device: None };
    assert!(bake.tells_mirrored());
    for (i, probe) in setup.probes.iter_mut().enumerate() {
        bake_glossy(&bake, probe, i as u32, &|_| true, &Silent).unwrap();
    }
    let is_wall = |m: u16| setup.world.scene.geometry.objects.iter().any(|o| o.material == u32::from(m) && o.emitter.is_some());
    let told: Vec<&Texel> = setup.probes.iter().flat_map(|p| &p.texels).filter(|t| t.mirrored() != Vec3::ZERO).collect();
    assert!(told.len() > 1000 && told.iter().all(|t| is_wall(t.reflected_material)), "{}: the plate does not glow", told.len());
    assert!(told.iter().all(|t| (t.glossy() - t.mirrored()).length() < 1e-2));

    let (view, reflected) = setup.view(Vec3::new(0.3, 0.05, 2.1), Vec3::ZERO);
    let (_, shown) = mirror_light_pass(&setup.world, &map, &view);
    let wrong = |glossy: &[Vec3]| {
        let wall = |i: &usize| view.pixels[*i].as_ref().is_some_and(|p| p.alpha == Some(0.0)) && is_wall(reflected[*i].material);
        let pixels: Vec<usize> = (0..glossy.len()).filter(wall).collect();
        let differs = |i: &&usize| {
            let p = view.pixels[**i].as_ref().unwrap();
            let ray = p.surface.spawn(reflect(p.wo, p.normal));
            let hit = setup.world.intersect(&ray).unwrap();
            let light = setup.emission(reflected[**i].material) + map.diffuse_radiance(&setup.world.scene, &hit, -ray.d);
            (glossy[**i] - light).length() > 0.01
        };
        (pixels.iter().filter(differs).count(), pixels.len())
    };
    let gathered = |mirror_light: bool| -> Vec<Vec3> {
        let all = setup.gather_with(&view, &reflected, &GatherParams::default(), mirror_light);
        all.iter().map(|g| g.color).collect()
    };
    let (plain, lit) = (wrong(&gathered(false)), wrong(&add_mirrored(&gathered(true), shown)));
    assert!(plain.1 > 500 && plain.0 > 500, "{plain:?}: nothing to be cured");
    assert_eq!(lit.0, 0, "of {}", lit.1);
}

#[test]
fn a_room_of_mirrors_shows_its_lamp_from_mirror_to_mirror() {
    let mirror = r#"<bsdf type="twosided"><bsdf type="conductor"><string name="material" value="none"/>
        <rgb name="specular_reflectance" value="0.8"/></bsdf></bsdf>"#;
    let xml = format!(
        r#"<scene version="3.0.0"><shape type="cube">{mirror}</shape><shape type="rectangle"><transform name="to_world">
        <scale value="0.3"/><rotate x="1" angle="90"/><translate value="0.1,0.95,-0.1"/></transform>
        <bsdf type="diffuse"><rgb name="reflectance" value="0"/></bsdf>
        <emitter type="area"><rgb name="radiance" value="10"/></emitter></shape></scene>"#
    );
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("mirrors.xml");
    std::fs::write(&path, xml).unwrap();
    let scene = load(&path, &LoadOptions::default()).unwrap();
    let curvature = curvature(&scene.geometry, &CurvatureParams::default(), &Silent);
    let world = World::new(scene);
    let atlas = Atlas::build(&world.scene.geometry, &|_| true, &AtlasParams { texel: Some(0.5), ..Default::default() }).unwrap();
    let dark = vec![Vec3::ZERO; (atlas.size[0] * atlas.size[1]) as usize];
    let map = sides(&world.scene.geometry, &atlas, dark, None);

    let camera = Camera::look_at(Vec3::new(0.4, -0.2, 0.7), Vec3::new(-0.3, 0.1, -0.5), Vec3::Y, 1.0, [64, 48]);
    let view = gbuffer(&world, &curvature, &camera);
    let (_, shown) = mirror_light_pass(&world, &map, &view);
    // Each ray to its end: what is left after a hundred mirrors is nothing.
    let to_the_end = |p: &Pixel| {
        let (mut surface, mut wo, mut throughput) = (p.surface, p.wo, 0.8);
        for _ in 0..100 {
            let ray = surface.spawn(mirror_direction(&surface, wo));
            let hit = world.intersect(&ray).unwrap();
            if hit.emitter.is_some() {
                return throughput * world.lights.emitted(&world.scene, &hit, -ray.d).x;
            }
            (surface, wo, throughput) = (hit, -ray.d, 0.8 * throughput);
        }
        0.0
    };
    let mirrors = || view.pixels.iter().zip(&shown).filter_map(|(p, shown)| p.as_ref().map(|p| (p, shown)));
    let (shown, all) =
        mirrors().filter(|(p, _)| p.alpha == Some(0.0)).fold((0.0, 0.0), |(a, b), (p, shown)| (a + shown.x, b + to_the_end(p)));
    // 0.8 to the power of 17 is 2 %.
    assert!(shown <= all && shown > 0.95 * all, "{shown} of {all}");
}

#[test]
fn samples_are_of_the_pixels_roughness_where_that_varies() {
    let plate = r#"<shape type="rectangle"><transform name="to_world"><scale value="1.5"/><translate value="0,0,0.1"/></transform>
        <bsdf type="roughconductor"><string name="material" value="none"/><texture type="checkerboard" name="alpha">
          <rgb name="color0" value="0.05"/><rgb name="color1" value="0.25"/><transform name="to_uv"><scale value="4"/></transform>
        </texture></bsdf></shape>"#;
    let setup = Setup::new(room(plate), Vec3::new(0.2, 0.1, 2.0), 0.6, 128);
    let (view, reflected) = setup.view(Vec3::new(0.3, 0.05, 2.1), Vec3::ZERO);
    let candidates: Vec<_> = setup.probes.iter().map(|p| Candidates::new(&setup.world, p, None, false)).collect();
    let of_another = |roughness_penalty: f32| {
        let params = GatherParams { roughness_penalty, ..GatherParams::default() };
        let gathered = setup.gather(&view, &reflected, &params);
        let differs = |(pixel, g): (&Option<Pixel>, &Gathered)| {
            let (alpha, (probe, texel)) = (pixel.as_ref()?.alpha?, g.best?);
            let there = candidates[probe].directions[setup.probes[probe].index_at(texel)].alpha;
            Some((there - alpha).abs() > 0.1)
        };
        let all: Vec<bool> = view.pixels.iter().zip(&gathered).filter_map(differs).collect();
        assert!(all.len() > 1000, "{}", all.len());
        all.iter().filter(|&&d| d).count() as f64 / all.len() as f64
    };
    let (without, with) = (of_another(0.0), of_another(1.0));
    assert!(without > 0.2 && with < 0.2 * without, "{without} of the samples are of another roughness, {with} with the penalty");
}

#[test]
fn a_probe_survives_its_file() {
    let scene = room(&format!(
        r#"<shape type="rectangle"><transform name="to_world"><translate value="0,0,0.1"/></transform>{MIRROR}</shape>"#
    ));
    let (triangles, materials) = (scene.geometry.triangles.len(), scene.materials.len());
    let setup = Setup::new(scene, Vec3::new(0.2, 0.1, 2.0), 0.6, 64);
    let probe = &setup.probes[3];
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("0003.exr");
    let image = probe.to_image(Provenance::new("bake-probes", "abc", 0, &()));
    image.write(&path).unwrap();
    let read = reprobe::io::ExrImage::read(&path).unwrap();
    let back = Probe::from_image(&path, &read, probe.map.clone(), probe.position, triangles, materials).unwrap();
    assert_eq!(back.texels, probe.texels);
    let error = Probe::from_image(&path, &read, probe.map.clone(), probe.position, 3, materials).unwrap_err().to_string();
    assert!(error.contains("reflector.triangle") && error.contains("0003.exr"), "{error}");
}

#[test]
fn threads_do_not_change_a_bit_of_a_bake() {
    let rough = r#"<shape type="rectangle"><transform name="to_world"><translate value="0,0,0.1"/></transform>
        <bsdf type="roughconductor"><float name="alpha" value="0.2"/></bsdf></shape>"#;
    let bake = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| Setup::new(room(rough), Vec3::new(0.2, 0.1, 2.0), 0.6, 32))
            .probes
            .into_iter()
            .map(|p| p.texels)
            .collect::<Vec<_>>()
    };
    let one = bake(1);
    assert!(one.iter().flatten().any(|t| t.glossy() != Vec3::ZERO));
    assert_eq!(one, bake(4));
}

#[test]
fn texel_coordinates_wrap_around_and_stop_at_the_poles() {
    let map = ParameterMap::identity([8, 4]);
    let probe = Probe { position: Vec3::ZERO, size: [8, 4], texels: vec![reprobe::probe::file::Texel::EMPTY; 32], map };
    assert_eq!(probe.index(-1, 0), 7);
    assert_eq!(probe.index(8, 3), 24);
    assert_eq!(probe.index(0, 9), 24);
    assert!(std::ptr::eq(probe.texel(Vec2::new(-0.5, -2.0)), &raw const probe.texels[7]));
}

/// What was traced of a reflector on the room's wall, and the glossy colours of the probe before it.
fn baked(reflector: &str, params: &ProbeBakeParams, seed: u32) -> (Traced, Vec<Vec3>) {
    let lift = r#"<transform name="to_world"><translate value="0,0,0.1"/></transform>"#;
    let (world, _) = World::opaque(room(&format!(r#"<shape type="rectangle">{lift}{reflector}</shape>"#)));
    let mut probe = probe_geometry(&world, Vec3::new(0.2, 0.1, 2.0), ParameterMap::identity([64, 32]));
    let bake = Bake { world: &world, params, seed, lightmap: None, device: None };
    let traced = bake_glossy(&bake, &mut probe, 0, &|_| true, &Silent).unwrap();
    (traced, probe.texels.iter().map(|t| t.glossy()).collect())
}

#[test]
fn noise_goes_and_what_mirrors_show_stays() {
    let denoise = Some(DenoiseParams::default());
    let of = |reflector: &str, spp: u32, denoise, seed| {
        baked(reflector, &ProbeBakeParams { spp, denoise, ..ProbeBakeParams::default() }, seed).1
    };
    assert_eq!(of(MIRROR, 4, denoise, 1), of(MIRROR, 4, None, 1));

    let rough = r#"<bsdf type="roughconductor"><float name="alpha" value="0.3"/><string name="material" value="none"/></bsdf>"#;
    let exact = of(rough, 2048, None, 2);
    let error = |found: &[Vec3]| {
        let lit = found.iter().zip(&exact).filter(|(_, e)| e.element_sum() > 0.0);
        let (sum, count) = lit.fold((0.0, 0), |(sum, n), (f, e)| (sum + ((*f - *e) / e.element_sum()).length_squared(), n + 1));
        (sum / count as f32).sqrt()
    };
    let (noisy, clean) = (error(&of(rough, 8, None, 1)), error(&of(rough, 8, denoise, 1)));
    assert!(clean < 0.6 * noisy, "{clean} of {noisy}");
}

#[test]
fn adaptive_sampling_spends_paths_where_they_are_needed() {
    const ERROR: f32 = 0.1;
    const MOST: u32 = 1024;
    let bake = |reflector: &str, error: Option<f32>, seed: u32| {
        baked(reflector, &ProbeBakeParams { spp: MOST, error, roughness_scale: 0.5, ..ProbeBakeParams::default() }, seed)
    };
    let (mirror, _) = bake(MIRROR, Some(ERROR), 1);
    assert!(mirror.texels > 40 && mirror.paths == 8 * mirror.texels, "a mirror's paths all agree: {mirror:?}");

    let rough = r#"<bsdf type="roughconductor"><float name="alpha" value="0.4"/><string name="material" value="none"/></bsdf>"#;
    let (adaptive, found) = bake(rough, Some(ERROR), 1);
    let (full, exact) = bake(rough, None, 2);
    assert_eq!((adaptive.texels, full.paths), (full.texels, u64::from(MOST) * full.texels));
    assert!(adaptive.paths < full.paths / 4, "{adaptive:?} of {full:?}");
    assert_eq!(bake(rough, Some(ERROR), 1).1, found);
    let lit: Vec<_> = found.iter().zip(&exact).filter(|(_, e)| e.element_sum() > 0.0).collect();
    let sum = |pick: &dyn Fn(&(&Vec3, &Vec3)) -> f32| lit.iter().map(pick).sum::<f32>();
    let square = sum(&|(f, e)| ((f.element_sum() - e.element_sum()) / e.element_sum()).powi(2)) / lit.len() as f32;
    // Stratified samples do better than the variance of independent ones says.
    assert!((0.2 * ERROR..1.2 * ERROR).contains(&square.sqrt()), "{}", square.sqrt());
    let bias = sum(&|(f, _)| f.element_sum()) / sum(&|(_, e)| e.element_sum()) - 1.0;
    assert!(bias.abs() < 0.01, "{bias}");
}
