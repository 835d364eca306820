//! Whole renders, by the command that users type, against Mitsuba 3.9.1 at 1024 samples a pixel.

use super::{Folder, pattern, pattern_png};
use reprobe::io::ExrImage;
use std::path::Path;
use std::process::Command;

const SEEDS: u32 = 6;
const SPP: u32 = 48;
/// Mitsuba's samples a pixel; its means are rounded to four digits.
const REFERENCE_SPP: u32 = 1024;
const ROUNDING: f64 = 5e-5;

pub const CAMERA: &str = "<integrator type='path'/><sensor type='perspective'><float name='fov' value='40'/>
    <transform name='to_world'><lookat origin='0.3,0.5,4' target='0,0,0' up='0,1,0'/></transform>
    <film type='hdrfilm'><integer name='width' value='48'/><integer name='height' value='36'/><rfilter type='box'/></film></sensor>";
pub const LIGHTS: &str = "<emitter type='constant'><rgb name='radiance' value='1,1,1'/></emitter><emitter type='point'>
    <point name='position' x='0.5' y='1' z='3'/><rgb name='intensity' value='20,20,20'/></emitter>";
pub const QUAD: &str = "<bsdf type='twosided'><bsdf type='diffuse'><rgb name='reflectance' value='0.5,0.3,0.1'/></bsdf></bsdf>";
const TEXTURED: &str = "<bsdf type='twosided'><bsdf type='diffuse'><texture type='bitmap' name='reflectance'>
    <string name='filename' value='pattern.png'/><string name='filter_type' value='nearest'/></texture></bsdf></bsdf>";

fn scene(body: &str) -> String {
    format!("<scene version='3.0.0'>{CAMERA}{body}</scene>")
}

/// A scene's text, rendered by [`means`].
pub fn render(folder: &Folder, text: &[u8]) -> [(f64, f64); 3] {
    std::fs::write(folder.path("scene.xml"), text).unwrap();
    means(folder, &folder.path("scene.xml"))
}

/// Means of red, green and blue over the image, and their standard deviations by noise.
fn means(folder: &Folder, file: &Path) -> [(f64, f64); 3] {
    let means: Vec<[f64; 3]> = (0..SEEDS)
        .map(|seed| {
            let out = folder.path(&format!("out{seed}"));
            let done = Command::new(env!("CARGO_BIN_EXE_reprobe"))
                .arg("render-path")
                .arg(file)
                .args(["--method", "path-trace", "--layers", "full", "--device", "cpu", "--quiet"])
                .args(["--spp", &SPP.to_string(), "--seed", &seed.to_string(), "-o"])
                .arg(&out)
                .output()
                .unwrap();
            let said = String::from_utf8_lossy(&done.stderr).into_owned();
            assert!(done.status.success() && said.lines().all(|line| line.starts_with("reprobe: warning: ")), "{said}");
            let file = out.join("0000.exr");
            let pixels = ExrImage::read(&file).unwrap().rgb(&file, "").unwrap();
            let sum: glam::DVec3 = pixels.iter().map(|p| p.as_dvec3()).sum();
            (sum / pixels.len() as f64).to_array()
        })
        .collect();
    let n = f64::from(SEEDS);
    [0, 1, 2].map(|c| {
        let mean = means.iter().map(|m| m[c]).sum::<f64>() / n;
        let variance = means.iter().map(|m| (m[c] - mean).powi(2)).sum::<f64>() / (n - 1.0);
        // Mitsuba's noise is taken to be that of as many samples of ours.
        let of_reference = variance * f64::from(SPP) / f64::from(REFERENCE_SPP);
        (mean, (variance / n + of_reference).sqrt())
    })
}

pub fn assert_mitsubas(what: &str, found: [(f64, f64); 3], expected: [f64; 3]) {
    for ((found, deviation), expected) in found.into_iter().zip(expected) {
        // Six seeds tell the deviation to a third of itself: six of them, where four would do if it were known.
        let allowed = 6.0 * deviation + ROUNDING + 1e-4;
        assert!((found - expected).abs() < allowed, "{what}: {found:.5}, Mitsuba {expected}, allowed {allowed:.5}");
        assert!(allowed < 0.01 * expected + 3e-4, "{what}: the tolerance {allowed} shows nothing");
    }
}

#[test]
fn lamps_by_reference() {
    let body = format!(
        "<shape type='rectangle'>{QUAD}<ref id='lamp'/></shape>
        <emitter type='area' id='lamp'><rgb name='radiance' value='2,1,0.5'/></emitter>"
    );
    assert_mitsubas("area by reference", render(&Folder::new(), scene(&body).as_bytes()), [1.2223, 0.6112, 0.3056]);
}

#[test]
fn lamps_that_the_camera_does_not_see() {
    let hides = |body: &str| {
        let hidden = "<integrator type='path'><boolean name='hide_emitters' value='true'/></integrator>";
        scene(body).replace("<integrator type='path'/>", hidden).into_bytes()
    };
    let sky = hides(&format!("{LIGHTS}<shape type='rectangle'>{QUAD}</shape>"));
    assert_mitsubas("sky", render(&Folder::new(), &sky), [0.4737, 0.2842, 0.0947]);
    let lamp = "<shape type='sphere'><transform name='to_world'><scale value='0.3'/><translate z='1'/></transform>
        <emitter type='area'><rgb name='radiance' value='3'/></emitter></shape>";
    let lamp = hides(&format!("<shape type='rectangle'>{QUAD}</shape>{lamp}"));
    assert_mitsubas("lamp", render(&Folder::new(), &lamp), [0.0432, 0.0259, 0.0086]);
}

#[test]
fn shifted_lenses() {
    let shift = "<float name='fov' value='40'/><float name='principal_point_offset_x' value='0.2'/>
        <float name='principal_point_offset_y' value='-0.1'/>";
    let text = scene(&format!("{LIGHTS}<shape type='rectangle'>{QUAD}</shape>"));
    let text = text.replace("<float name='fov' value='40'/>", shift);
    assert_mitsubas("principal point", render(&Folder::new(), text.as_bytes()), [0.8776, 0.7032, 0.5288]);
}

/// Red, green and blue of a line such as "| `scene.xml` | mean R, G, B = 0.8776, 0.7032, 0.5288 (48 x 36) | ...".
fn told(line: &str) -> Option<(&str, [f64; 3])> {
    let mut cells = line.split('|').map(str::trim).skip(1);
    let name = cells.next()?.strip_prefix('`')?.strip_suffix('`')?;
    let numbers = cells.next()?.strip_prefix("mean R, G, B = ")?.split(" (").next()?;
    let numbers: Vec<f64> = numbers.split(", ").map(|n| n.parse().unwrap()).collect();
    Some((name, numbers.try_into().unwrap()))
}

/// The inputs that users sent, each in a folder with a README that tells Mitsuba's means.
#[test]
fn cases_of_users() {
    let cases = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/cases");
    let Ok(entries) = std::fs::read_dir(&cases) else {
        println!("skipped: no {}", cases.display());
        return;
    };
    let mut count = 0;
    for folder in entries.map(|entry| entry.unwrap().path()) {
        let readme = std::fs::read_to_string(folder.join("README.md")).unwrap();
        for (name, expected) in readme.lines().filter_map(told) {
            assert_mitsubas(&format!("{}/{name}", folder.display()), means(&Folder::new(), &folder.join(name)), expected);
            count += 1;
        }
    }
    assert!(count >= 12, "{count}");
}

#[test]
fn booleans_in_capitals() {
    let flag = "<boolean name='flip_normals' value='False'/>";
    let text = scene(&format!("{LIGHTS}<shape type='rectangle'>{QUAD}{flag}</shape>"));
    assert_mitsubas("False", render(&Folder::new(), text.as_bytes()), [0.8625, 0.6730, 0.4836]);
}

#[test]
fn document_types_blank_lines_and_encodings() {
    let body = scene(&format!("{LIGHTS}<!-- a -- b --><shape type='rectangle'>{QUAD}</shape>"));
    let latin = [b"<?xml version='1.0' encoding='ISO-8859-1'?><!-- \xe9 -->", body.as_bytes()].concat();
    let wide = format!("\u{feff}<?xml version='1.0' encoding='utf-16'?>{body}");
    let wide: Vec<u8> = wide.encode_utf16().flat_map(u16::to_le_bytes).collect();
    let plain = |before: &str| format!("{before}{body}").into_bytes();
    for (what, text) in [
        ("document type", plain("<?xml version='1.0'?>\n<!DOCTYPE scene>\n")),
        ("blank line", plain("\n<?xml version='1.0'?>\n")),
        ("Latin-1", latin),
        ("UTF-16", wide),
    ] {
        assert_mitsubas(what, render(&Folder::new(), &text), [0.8625, 0.6730, 0.4836]);
    }
}

#[test]
fn radiance_pictures_of_another_name() {
    let mut hdr = b"#?RGBE\nFORMAT=32-bit_rle_rgbe\n\n-Y 8 +X 8\n".to_vec();
    for (y, x) in (0..8).flat_map(|y| (0..8).map(move |x| (y, x))) {
        let color = pattern(x, y).map(|c| f32::from(c) / 255.0 * 4.0 + 0.05);
        let exponent = color.iter().fold(0f32, |a, &b| a.max(b)).log2().floor() as i32 + 1;
        hdr.extend(color.map(|c| (c * 2f32.powi(8 - exponent)) as u8));
        hdr.push((exponent + 128) as u8);
    }
    let folder = Folder::new().with("sky.hdr", hdr);
    let body = format!(
        "<emitter type='envmap'><string name='filename' value='sky.hdr'/></emitter><shape type='rectangle'>{QUAD}</shape>"
    );
    assert_mitsubas("#?RGBE", render(&folder, scene(&body).as_bytes()), [1.5490, 1.2224, 0.8920]);
}

#[test]
fn wide_gamut_textures() {
    use exr::prelude::*;
    let folder = Folder::new();
    let color = |p: Vec2<usize>| {
        let [r, g, b] = pattern(p.x() as u32 / 2, p.y() as u32 / 2).map(|c| 3.0 * (f32::from(c) / 255.0).powi(2) + 0.05);
        (r, g, b)
    };
    let mut image = Image::from_channels((16, 16), SpecificChannels::rgb(color));
    image.attributes.chromaticities = Some(attribute::Chromaticities {
        red: Vec2(0.708, 0.292),
        green: Vec2(0.17, 0.797),
        blue: Vec2(0.131, 0.046),
        white: Vec2(0.3127, 0.329),
    });
    image.write().to_file(folder.path("wide.exr")).unwrap();
    let body = "<shape type='rectangle'><bsdf type='diffuse'/><emitter type='area'><texture type='bitmap' name='radiance'>
        <string name='filename' value='wide.exr'/><string name='filter_type' value='nearest'/></texture></emitter></shape>";
    assert_mitsubas("Rec. 2020", render(&folder, scene(body).as_bytes()), [0.6181, 0.6344, 0.6149]);
}

#[test]
fn texture_coordinates_of_scanners() {
    let ply = "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\nproperty float texture_u\n\
        property float texture_v\nelement face 2\nproperty list uchar int vertex_indices\nend_header\n\
        -1 -1 0 0 0\n1 -1 0 1 0\n1 1 0.3 1 1\n-1 1 0 0 1\n3 0 1 2\n3 0 2 3\n";
    let folder = Folder::new().with("mesh.ply", ply).with("pattern.png", pattern_png());
    let body = format!("{LIGHTS}<shape type='ply'><string name='filename' value='mesh.ply'/>{TEXTURED}</shape>");
    assert_mitsubas("texture_u", render(&folder, scene(&body).as_bytes()), [0.6822, 0.6956, 0.6668]);
}

#[test]
fn continued_lines_of_a_mesh() {
    let obj = "v -1 -1 0\nv 1 -1 0\nv 1 1 \\\n 0.3\nv -1 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nf 1/1 2/2 \\\n3/3 4/4\n";
    let folder = Folder::new().with("mesh.obj", obj).with("pattern.png", pattern_png());
    let body = format!("{LIGHTS}<shape type='obj'><string name='filename' value='mesh.obj'/>{TEXTURED}</shape>");
    assert_mitsubas("continued", render(&folder, scene(&body).as_bytes()), [0.6822, 0.6185, 0.6677]);
}

#[test]
fn spectra_as_plugins() {
    let uniform = "<emitter type='constant'><rgb name='radiance' value='1,1,1'/></emitter><shape type='rectangle'><bsdf type='twosided'>
        <bsdf type='diffuse'><spectrum name='reflectance' type='uniform'><float name='value' value='0.3'/></spectrum></bsdf></bsdf></shape>";
    assert_mitsubas("uniform", render(&Folder::new(), scene(uniform).as_bytes()), [0.5722; 3]);
    let d65 = "<shape type='rectangle'><bsdf type='diffuse'/><emitter type='area'><spectrum name='radiance' type='d65'/></emitter></shape>";
    assert_mitsubas("d65", render(&Folder::new(), scene(d65).as_bytes()), [0.6112; 3]);
}
