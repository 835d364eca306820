//! What scenes hold that is odd, and what Mitsuba 3.9.1 makes of it (1024 samples a pixel): taken, with a warning where nothing else would tell.

use super::Folder;
use super::cases::{CAMERA, LIGHTS, QUAD, assert_mitsubas, render};
use reprobe::exchange::LoadOptions;

const CHECKER: &str = "<texture type='checkerboard' name='NAME'><rgb name='color0' value='0.9'/><rgb name='color1' value='0.1'/>
    <transform name='to_uv'><scale x='0.6' y='0.6'/></transform></texture>";
const TILES: &str = "<bsdf type='twosided'><bsdf type='diffuse'><texture type='checkerboard' name='reflectance'>
    <rgb name='color0' value='0.9,0.5,0.1'/><rgb name='color1' value='0.1'/><transform name='to_uv'><scale x='4' y='4'/></transform>
    </texture></bsdf></bsdf>";

/// Compares a scene's means with Mitsuba's.
fn check(what: &str, folder: &Folder, camera: &str, body: &str, expected: [f64; 3]) {
    let text = format!("<scene version='3.0.0'>{camera}{body}</scene>");
    assert_mitsubas(what, render(folder, text.as_bytes()), expected);
}

/// A rectangle with a scattering model, under a sky and a point light.
fn quad(bsdf: &str) -> String {
    format!("{LIGHTS}<shape type='rectangle'>{bsdf}</shape>")
}

/// The camera with other words in place of some of its own.
fn camera(from: &str, to: &str) -> String {
    assert!(CAMERA.contains(from));
    CAMERA.replacen(from, to, 1)
}

/// The warnings of a scene.
fn warnings(folder: &Folder, body: &str) -> String {
    folder.load_with(body, &LoadOptions::default()).unwrap().warnings.join("\n")
}

#[test]
fn colours_and_checkerboards_in_the_place_of_numbers() {
    for (what, bsdf, expected) in [
        ("mask", format!("<bsdf type='mask'>{}{QUAD}</bsdf>", CHECKER.replace("NAME", "opacity")), [0.9578, 0.8933, 0.8289]),
        (
            "mask by rgb",
            format!("<bsdf type='mask'><rgb name='opacity' value='0.8,0.5,0.1'/>{QUAD}</bsdf>"),
            [0.9360, 0.8476, 0.7592],
        ),
        (
            "blend by rgb",
            "<bsdf type='twosided'><bsdf type='blendbsdf'><rgb name='weight' value='0.8,0.5,0.1'/><bsdf type='diffuse'/>
            <bsdf type='diffuse'><rgb name='reflectance' value='0.9,0.1,0.1'/></bsdf></bsdf></bsdf>"
                .into(),
            [1.0391, 0.6856, 0.6856],
        ),
        (
            "alpha by rgb, GGX in capitals",
            "<bsdf type='roughconductor'><string name='distribution' value='GGX'/><rgb name='alpha' value='0.1,0.6,0.1'/></bsdf>"
                .into(),
            [1.3866, 1.3866, 1.3866],
        ),
    ] {
        check(what, &Folder::new(), CAMERA, &quad(&bsdf), expected);
    }
}

#[test]
fn spectra_and_metals() {
    let textured = format!("<bsdf type='conductor'>{}<rgb name='k' value='2,2,3'/></bsdf>", CHECKER.replace("NAME", "eta"));
    assert!(warnings(&Folder::new(), &quad(&textured)).contains("eta: of a texture the mean is taken"));
    // Reflectances above 1 are 1.
    let bright = "<bsdf type='diffuse'><spectrum name='reflectance' value='400:0.2, 500:0.6, 600:1.8, 700:1.6'/></bsdf>";
    check("spectrum", &Folder::new(), CAMERA, &quad(bright), [1.3358, 1.3358, 0.6808]);
}

#[test]
fn emitters_behind_thin_glass_are_hidden_as_mitsuba_hides_them() {
    let hides =
        camera("<integrator type='path'/>", "<integrator type='path'><boolean name='hide_emitters' value='true'/></integrator>");
    let pane = "<shape type='rectangle'><bsdf type='thindielectric'/><transform name='to_world'><translate z='0.5'/></transform></shape>";
    let sky = format!("{LIGHTS}{pane}<shape type='sphere'><float name='radius' value='0.5'/>{QUAD}</shape>");
    check("sky", &Folder::new(), &hides, &sky, [0.1160, 0.0935, 0.0712]);
    let lamp = format!(
        "{pane}<shape type='sphere'><float name='radius' value='0.5'/><emitter type='area'><rgb name='radiance' value='3'/></emitter>
        </shape><shape type='rectangle'>{QUAD}<transform name='to_world'><scale value='3'/><translate z='-1'/></transform></shape>"
    );
    check("lamp", &Folder::new(), &hides, &lamp, [0.4177, 0.3862, 0.3549]);
}

#[test]
fn lenses_and_axes() {
    let lens = |radius: &str| {
        let words = format!("<sensor type='thinlens'><float name='aperture_radius' value='{radius}'/>");
        camera("<sensor type='perspective'>", &words)
    };
    check("focused at the far plane", &Folder::new(), &lens("0.3"), &quad(TILES), [0.8660, 0.6808, 0.4955]);
    check("no aperture", &Folder::new(), &lens("0"), &quad(TILES), [0.8624, 0.6730, 0.4835]);
    let axis = camera("<float name='fov' value='40'/>", "<float name='fov' value='40'/><string name='fov_axis' value='Y'/>");
    check("fov_axis in capitals", &Folder::new(), &axis, &quad(QUAD), [0.9227, 0.8161, 0.7095]);
}

#[test]
fn spheres_of_odd_scales_and_radii() {
    let stretched = "<transform name='to_world'><scale x='1' y='0.5' z='0.7'/></transform>";
    for (what, inside, expected) in [
        ("stretched", stretched, [0.9125, 0.7414, 0.5703]),
        ("negative radius", "<float name='radius' value='-0.7'/>", [0.9463, 0.8701, 0.7938]),
    ] {
        let body = format!("{LIGHTS}<shape type='sphere'>{inside}{QUAD}</shape>");
        check(what, &Folder::new(), CAMERA, &body, expected);
    }
    let body = format!("<shape type='sphere'>{stretched}</shape>");
    assert!(warnings(&Folder::new(), &body).contains("a sphere keeps its shape"));
}

#[test]
fn meshes_of_odd_corners_and_of_none() {
    // Mitsuba leaves what a corner lacks as it finds it in memory.
    let mixed = "v -1 -1 0\nv 1 -1 0\nv 1 1 0\nv -1 1 0\nvt 0.1 0.2\nvt 0.9 0.8\nf 1/1 2 3/2\nf 1/1 3 4/2\n";
    let folder = Folder::new().with("m.obj", mixed);
    let scene = folder.load("<shape type='obj'><string name='filename' value='m.obj'/></shape>");
    assert_eq!((scene.geometry.triangles.len(), scene.warnings.len()), (2, 1), "{:?}", scene.warnings);
    let empty = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\nELEMENTend_header\n0 0 0\n1 0 0\n0 1 0\n";
    for faces in ["element face 0\nproperty list uchar int vertex_indices\n", ""] {
        let folder = Folder::new().with("m.ply", empty.replace("ELEMENT", faces));
        let lamp = "<shape type='ply'><string name='filename' value='m.ply'/><emitter type='area'/></shape>";
        let scene = folder.load(&format!("{}{lamp}", quad(QUAD)));
        assert!(scene.warnings.join("").contains("\"m\" has no faces"), "{:?}", scene.warnings);
        assert_eq!((scene.geometry.objects.len(), scene.emitters.len()), (1, 2));
    }
}

#[test]
fn emitters_that_are_odd() {
    let spot = "<emitter type='spot'><transform name='to_world'><lookat origin='0,0,3' target='0,0,0' up='0,1,0'/></transform>
        <float name='cutoff_angle' value='15'/><float name='beam_width' value='25'/><rgb name='intensity' value='20'/></emitter>";
    let body = format!("{spot}<shape type='rectangle'>{QUAD}</shape>");
    let scene = Folder::new().load(&body);
    assert!(scene.warnings.join("").contains("beam_width = 25: the light ends at 15 degrees"), "{:?}", scene.warnings);
    let idle = "<emitter type='area' id='lamp'/>";
    assert!(warnings(&Folder::new(), &quad(QUAD).replace("<shape", &format!("{idle}<shape"))).contains("lights nothing"));
    let folder = Folder::new();
    let body = "<shape type='rectangle'><emitter type='directionalarea'/></shape>";
    assert!(folder.error(body).contains("directionalarea"));
    folder.load_with(body, &LoadOptions { skip_unsupported: true, ..LoadOptions::default() }).unwrap();
}

#[test]
fn what_is_given_twice_or_changes_nothing_is_told() {
    for (body, expected) in [
        (
            "<shape type='sphere'><float name='radius' value='1'/><float name='radius' value='2'/></shape>",
            "radius is given again",
        ),
        (
            "<sensor type='perspective'><film type='hdrfilm'><string name='pixel_format' value='luminance'/></film></sensor>",
            "pixel_format = luminance",
        ),
        (
            "<sensor type='perspective'><film type='hdrfilm'><float name='shutter' value='2'/></film></sensor>",
            "unknown property \"shutter\"",
        ),
    ] {
        let found = warnings(&Folder::new(), &format!("{body}<shape type='cube'/>"));
        assert!(found.contains(expected), "{found}");
    }
}

/// Copies of a group's spheres are as many spheres: each is met as one.
#[test]
fn crowds_by_instances() {
    let instance = |i: usize| {
        format!("<shape type='instance'><ref id='g'/><transform name='to_world'><translate x='{}'/></transform></shape>", 3 * i)
    };
    let group = "<shape type='shapegroup' id='g'><shape type='sphere'/><shape type='cylinder'/></shape>";
    let body = format!("{group}{}", (0..500).map(instance).collect::<String>());
    let geometry = Folder::new().load(&body).geometry;
    assert_eq!(geometry.rounds.len(), 1000);
    assert!(geometry.triangles.len() < 400_000, "{}", geometry.triangles.len());
}
