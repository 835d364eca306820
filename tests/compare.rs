//! `compare` from the command line: numbers against scikit-image's, the report's files, exit codes, bad input.

use reprobe::base::math::Rgb;
use reprobe::io::ExrImage;
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

/// A part of a rendered frame (80 x 64, halves) and the same blurred: image.exr and reference.exr.
fn data(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/compare").join(name)
}

fn compare(a: &Path, b: &Path, out: &Path, more: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_reprobe"));
    command.arg("compare").args([a, b]).arg("-o").arg(out).args(more).output().unwrap()
}

fn message(output: &Output) -> String {
    assert_eq!(output.status.code(), Some(2), "{output:?}");
    let text = String::from_utf8_lossy(&output.stderr).into_owned();
    // What is begun is told before.
    let text = text.strip_prefix("compare ...\n").unwrap_or(&text).to_owned();
    assert!(text.starts_with("reprobe: error: ") && text.trim_end().lines().count() == 1, "{text}");
    text
}

fn write(path: &Path, size: [usize; 2], value: f32) {
    let pixels = vec![Rgb::splat(value); size[0] * size[1]];
    ExrImage::new(size[0], size[1]).with_rgb("", &pixels).write(path).unwrap();
}

#[test]
fn a_rendered_frame_measures_as_in_scikit_image() {
    let dir = tempfile::tempdir().unwrap();
    // numpy, and structural_similarity(gaussian_weights=True, sigma=1.5, use_sample_covariance=False, data_range=1), of
    // tests/data/compare at exposure 0 and 1.
    let expected: [(&str, [f64; 6]); 2] = [
        ("0", [0.079_480_31, 0.077_803_57, 0.120_336_55, 0.119_807_60, 0.202_572_60, 0.046_437_79]),
        ("1", [0.087_580_21, 0.085_508_65, 0.142_746_57, 0.141_773_30, 0.202_572_60, 0.046_437_79]),
    ];
    for (exposure, values) in expected {
        let output = compare(&data("image.exr"), &data("reference.exr"), dir.path(), &["--exposure", exposure]);
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        let json: Value = serde_json::from_slice(&std::fs::read(dir.path().join("metrics.json")).unwrap()).unwrap();
        let keys = ["rmse_rgb", "rmse_lum", "dssim_rgb", "dssim_lum", "rmse_linear", "relmse_linear"];
        for (key, value) in keys.into_iter().zip(values) {
            for found in [&json["frames"][0][key], &json["mean"][key]] {
                let found = found.as_f64().unwrap();
                assert!((found - value).abs() < 1e-5, "{key} at exposure {exposure}: {found} against {value}");
            }
        }
        assert_eq!(json["frames"][0]["name"], "image");
        assert!((0.02..0.3).contains(&json["mean"]["flip"].as_f64().unwrap()));
    }
    let page = std::fs::read_to_string(dir.path().join("index.html")).unwrap();
    assert!(page.contains("rmse_rgb"));
    let values = std::fs::read_to_string(dir.path().join("images/0000_values.js")).unwrap();
    assert!(values.starts_with("reprobeValues(0, \"iVBOR") && page.contains("function reprobeValues(number, png)"));
    for kind in ["image", "reference", "difference", "dssim", "flip"] {
        let picture = image::open(dir.path().join(format!("images/0000_{kind}.png"))).unwrap();
        assert_eq!((picture.width(), picture.height()), (80, 64), "{kind}");
    }
}

#[test]
fn thresholds_decide_the_exit_code() {
    let dir = tempfile::tempdir().unwrap();
    let run = |more: &[&str]| compare(&data("image.exr"), &data("reference.exr"), dir.path(), more).status.code();
    assert_eq!(run(&["--max-rmse", "0.08", "--max-dssim", "0.13"]), Some(0));
    assert_eq!(run(&["--max-rmse", "0.079"]), Some(1));
    assert_eq!(run(&["--max-dssim", "0.12"]), Some(1));
    assert_eq!(run(&["--max-rmse", "none"]), Some(2));
    assert!(dir.path().join("metrics.json").exists(), "a failed check still leaves its report");
}

#[test]
fn folders_go_together_by_file_name() {
    let dir = tempfile::tempdir().unwrap();
    let [a, b, out] = ["a", "b", "out"].map(|n| dir.path().join(n));
    for i in 0..3 {
        write(&a.join(format!("{i:04}.exr")), [12, 11], 0.1 * i as f32);
        write(&b.join(format!("{i:04}.exr")), [12, 11], 0.1);
    }
    std::fs::write(a.join("timings.json"), "{}").unwrap();
    let output = compare(&a, &b, &out, &["--json"]);
    let json: Value = serde_json::from_slice(&output.stdout).unwrap();
    let linear: Vec<f64> = (0..3).map(|i| json["frames"][i]["rmse_linear"].as_f64().unwrap()).collect();
    assert!(linear.iter().zip([0.1, 0.0, 0.1]).all(|(x, y)| (x - y).abs() < 1e-6), "{linear:?}");

    std::fs::remove_file(b.join("0002.exr")).unwrap();
    let text = message(&compare(&a, &b, &out, &[]));
    assert!(text.contains("no 0002.exr") && text.contains("2 frames here, 3 there"), "{text}");
    let text = message(&compare(&b, &a, &out, &[]));
    assert!(text.contains("no 0002.exr"), "{text}");
}

#[test]
fn what_does_not_fit_together_is_refused_with_both_names() {
    let dir = tempfile::tempdir().unwrap();
    let file = |name: &str| dir.path().join(name);
    write(&file("a.exr"), [12, 11], 0.5);
    write(&file("wide.exr"), [13, 11], 0.5);
    write(&file("tiny.exr"), [10, 11], 0.5);
    write(&file("nan.exr"), [12, 11], f32::NAN);
    std::fs::write(file("text.exr"), "not an image").unwrap();
    let out = file("out");
    let refused = |a: &str, b: &str, more: &[&str]| message(&compare(&file(a), &file(b), &out, more));

    let text = refused("a.exr", "wide.exr", &[]);
    assert!(text.contains("a.exr: has 12 x 11 pixels") && text.contains("wide.exr has 13 x 11:"), "{text}");
    assert!(refused("tiny.exr", "tiny.exr", &[]).contains("at least 11 x 11"));
    assert!(refused("a.exr", "nan.exr", &[]).contains("nan.exr: pixel (0, 0)"));
    assert!(refused("a.exr", "text.exr", &[]).contains("text.exr: not a readable EXR file"));
    assert!(refused("a.exr", "gone.exr", &[]).contains("gone.exr: no such file"));
    assert!(refused("a.exr", ".", &[]).contains("is a folder"));
    let text = refused("a.exr", "a.exr", &["--layer", "glossy"]);
    assert!(text.contains("\"glossy.R\" is missing"), "{text}");
    assert!(!out.exists(), "nothing is written for inputs that are refused");
}

#[test]
fn a_second_reference_takes_the_noise_out() {
    let dir = tempfile::tempdir().unwrap();
    let [a, b, c, out] = ["a.exr", "b.exr", "c.exr", "out"].map(|n| dir.path().join(n));
    // Opposite errors of the references: as much noise as can be, and none in common.
    write(&a, [12, 11], 0.5);
    write(&b, [12, 11], 0.45);
    write(&c, [12, 11], 0.55);
    let second = c.to_string_lossy();
    let output = compare(&a, &b, &out, &["--second-reference", &second, "--json"]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let json: Value = serde_json::from_slice(&std::fs::read(out.join("metrics.json")).unwrap()).unwrap();
    assert!(json["mean"]["rmse_rgb"].as_f64().unwrap() > 0.02);
    assert_eq!(json["without_noise"]["rmse_rgb"], 0.0);
    assert_eq!(json["frames"][0]["without_noise"], json["without_noise"]);
    assert_eq!(json["provenance"]["inputs"].as_object().unwrap().len(), 3);

    let same = b.to_string_lossy();
    let text = message(&compare(&a, &b, &out, &["--second-reference", &same]));
    assert!(text.contains("another seed"), "{text}");
}
