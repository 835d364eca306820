//! `evaluate` from the command line: what it bakes, keeps, measures and refuses.

mod folder;

use folder::Folder;
use reprobe::base::math::Rgb;
use reprobe::io::ExrImage;
use serde_json::Value;

const SCENE: &str = r#"<scene version="3.0.0">
    <bsdf type="twosided" id="wall"><bsdf type="diffuse"><rgb name="reflectance" value="0.6, 0.5, 0.4"/></bsdf></bsdf>
    <shape type="cube"><transform name="to_world"><scale value="2"/></transform><ref id="wall"/></shape>
    <shape type="sphere"><point name="center" x="0" y="-0.6" z="0"/><float name="radius" value="0.5"/>
      <bsdf type="roughconductor"><float name="alpha" value="0.1"/></bsdf></shape>
    <shape type="rectangle"><transform name="to_world"><rotate x="1" angle="90"/><scale value="0.5"/><translate y="1.9"/></transform>
      <emitter type="area"><rgb name="radiance" value="12, 11, 10"/></emitter></shape>
    </scene>"#;

const PATH: &str = r#"{"fov": 70, "size": [24, 16], "frames": [
    {"origin": [0, 0, 1.5], "target": [0, -0.5, 0]}, {"origin": [0.2, 0.1, 1.4], "target": [0, -0.5, 0]},
    {"origin": [0.4, 0.1, 1.4], "target": [0, -0.5, 0]}]}"#;

/// Small bakes for all methods.
const SMALL: &str = "--size 24x16 --supersample 1 --reference-spp 4 --bake place-probes:--count=8 --bake qhmap:--size=32x16 \
    --bake bake-probes:--spp=2 --bake bake-lightmap:--spp=2 --bake bake-lightmap:--texels=2000";

fn folder() -> Folder {
    Folder::with(SCENE, PATH)
}

fn command(args: &str) -> String {
    format!("evaluate scene.xml --path path.json -o out {args}")
}

fn figures(f: &Folder, args: &str) -> Value {
    serde_json::from_str(&f.success(&command(&format!("{args} --json")))).unwrap()
}

fn read_json(f: &Folder, name: &str) -> Value {
    serde_json::from_slice(&std::fs::read(f.at(name)).unwrap()).unwrap()
}

/// One message, exit code 2.
fn refusal(f: &Folder, args: &str) -> String {
    f.refusal(&command(args))
}

#[test]
fn variants_share_bakes_are_measured_alike_and_a_second_run_keeps_everything() {
    let f = folder();
    let command = format!(
        "{SMALL} --methods glossy-probes,path-trace --variant one=glossy-probes,gather.probes=1 --variant fast=path-trace,--spp=1 \
         --variant flat=glossy-probes,qhmap:--lat-long,gather.perturb.order=plane --variant paper=glossy-probes,--paper"
    );
    let first = figures(&f, &command);
    let evaluation = std::fs::read(f.at("out/evaluation.json")).unwrap();
    let json = read_json(&f, "out/evaluation.json");
    let names: Vec<&str> = json["methods"].as_array().unwrap().iter().map(|m| m["name"].as_str().unwrap()).collect();
    assert_eq!(names, ["glossy-probes", "path-trace", "one", "fast", "flat", "paper"]);
    for layer in ["glossy", "full"] {
        let of = |name: &str, key: &str| first["methods"][name][layer][key].as_f64().unwrap();
        // 64 samples against one, whose standard error is 8 times as large.
        assert!(of("path-trace", "rmse_linear") < of("fast", "rmse_linear"), "{layer}");
        for key in ["rmse_rgb", "rmse_lum", "dssim_rgb", "dssim_lum", "flip", "change"] {
            assert!(names.iter().all(|name| of(name, key) > 0.0), "{layer} {key}");
        }
        let frames = json["methods"][0]["layers"][layer]["frames"].as_array().unwrap();
        assert_ne!(of("glossy-probes", "rmse_rgb"), of("one", "rmse_rgb"), "one probe of several");
        assert!(frames.len() == 3 && frames[0]["change"].is_null() && frames[2]["change"].is_number());
    }
    let bakes = |costs: &Value| -> Vec<(String, usize)> {
        let of = |s: &Value| (s["stage"].as_str().unwrap().to_owned(), s["methods"].as_array().unwrap().len());
        costs["stages"].as_array().unwrap().iter().map(of).collect()
    };
    let stages = bakes(&first["costs"]);
    let probes: Vec<usize> = stages.iter().filter(|s| s.0 == "bake-probes").map(|s| s.1).collect();
    assert_eq!(probes, [3, 1], "one set of probes for three variants, one for the lat-long map");
    assert!(stages.contains(&("bake-lightmap".into(), 4)));
    let set = read_json(&f, "out/bakes/probes/set.json");
    assert_eq!(
        set["views"]["alternatives"].as_array().unwrap().len(),
        1,
        "one probe's texels are among eight's; the paper's are not"
    );
    let page = std::fs::read_to_string(f.at("out/index.html")).unwrap();
    assert!(page.contains("data:image/jpeg;base64,") && page.contains("\"rmse_rgb\""));
    let tables = std::fs::read_to_string(f.at("out/evaluation.md")).unwrap();
    for part in ["| paper |", "| bake-probes |", "| gather |", "Error, glossy layer", "| 32 x 16 |"] {
        assert!(tables.contains(part), "{part}: {tables}");
    }

    let second = figures(&f, &command);
    assert!(std::fs::read(f.at("out/evaluation.json")).unwrap() == evaluation);
    assert_eq!(bakes(&second["costs"]), stages);
    for name in names {
        let time = |run: &Value| run["costs"]["methods"][name]["frame_ms"].as_f64().unwrap();
        assert!(time(&first) > 0.0 && time(&first) == time(&second), "{name}: kept frames keep their times");
    }
    let seconds = |run: &Value| run["costs"]["stages"][5]["seconds"].as_f64().unwrap();
    assert_eq!(seconds(&first), seconds(&second));
}

#[test]
fn given_bakes_and_a_given_reference_are_used_as_they_are() {
    let f = folder();
    figures(&f, &format!("{SMALL} --bakes shared"));
    std::fs::remove_dir_all(f.at("out")).unwrap();
    for frame in 0..3 {
        let image = ExrImage::new(24, 16).with_rgb("glossy", &[Rgb::splat(0.1); 24 * 16]);
        image.write(&f.at("given").join(format!("{frame:04}.exr"))).unwrap();
    }
    let given =
        "--probes shared/probes --lightmap shared/lightmap.exr --curvature shared/curvature.exr --size 24x16 --supersample 1";
    let figures = figures(&f, &format!("{given} --reference given --frames 0,2"));
    let layers = &figures["methods"]["glossy-probes"];
    assert!(layers["glossy"]["rmse_rgb"].is_number() && layers["full"].is_null(), "only the layer that the reference has");
    assert!(layers["glossy"]["change"].is_null(), "frames 0 and 2 are no neighbours");
    assert!(!f.at("out/bakes").exists() && figures["costs"]["stages"].as_array().unwrap().is_empty());
    assert!(figures["costs"]["methods"]["glossy-probes"]["probes"]["baked"].as_u64().unwrap() > 0);
    let message = refusal(&f, &format!("{given} --reference given --reference-spp 3"));
    assert!(message.contains("cannot be used with"), "{message}");
    let message = refusal(&f, "--size 48x32 --reference given");
    assert!(message.contains("24 x 16") && message.contains("48 x 32"), "{message}");
    std::fs::remove_file(f.at("given/0002.exr")).unwrap();
    let message = refusal(&f, &format!("{given} --reference given"));
    assert!(message.contains("0002.exr") && message.contains("every frame"), "{message}");
}

#[test]
fn wrong_requests_are_refused_before_anything_is_baked() {
    let f = folder();
    for (args, expected) in [
        ("--methods magic", "[possible values: glossy-probes, glossy-probes-rays, path-trace,"),
        ("--methods all,ulr", "ulr: two methods have this name"),
        ("--methods ulr --second-reference b", "--reference <DIR>"),
        ("--methods ulr --reference a --reference-pair", "cannot be used with"),
        ("--variant a=glossy-probes --variant a=path-trace", "two methods have this name"),
        ("--variant a=path-trace,--sppp=3", "--sppp"),
        ("--variant a=glossy-probes,bake-probes:--sppp=3", "--sppp"),
        ("--bake compare:--layer=glossy", "the stage one of"),
        ("--ablations paper --only everything", "full-roughness"),
        ("--exposure 99", "-32 to 32"),
        ("--reference nowhere", "nowhere"),
    ] {
        let message = refusal(&f, args);
        assert!(message.contains(expected), "{args}: {message}");
    }
    assert!(!f.at("out").exists());
    let dry = |args: &str| String::from_utf8_lossy(&f.reprobe(&command(&format!("{args} --dry-run"))).stdout).into_owned();
    let text = dry("--ablations paper");
    for part in
        ["--lat-long", "--roughness-scale 0.5", "--count 6 ", "--count 24 ", "--alternative", "--seed 1", "footprint=null"]
    {
        assert!(text.contains(part), "{part}: {text}");
    }
    let text = dry("--methods lightmap-rt,path-trace");
    assert!(text.contains("bake-lightmap") && !text.contains("bake-probes") && !text.contains("place-probes"), "{text}");
    let text = dry("--methods glossy-probes,ulr");
    assert!(text.contains("bake-probes") && !text.contains("--for-path"), "ulr wants any texel: {text}");
    let text = dry("--methods all --reference-pair");
    for part in [
        "--set rays.per_pixel=24 --output out/frames/glossy-probes-rays",
        "--output out/frames/path-trace-filter",
        "--output out/frames/many-light",
        "reprobe bake-transport",
        "--output out/second-reference",
    ] {
        assert!(text.contains(part), "{part}: {text}");
    }
    assert!(!f.at("out").exists());
}

#[test]
fn a_reference_noisier_than_what_it_judges_is_a_warning() {
    let f = folder();
    let size = "--size 24x16 --reference-spp 4";
    let output = f.reprobe(&command(&format!("{size} --variant three=path-trace,--spp=3 --variant four=path-trace,--spp=4")));
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{said}");
    assert!(said.contains("four has 4 samples a pixel, its reference 4") && said.contains("--reference-spp some 32"), "{said}");
    assert!(!said.contains("three has"), "{said}");
}

/// One subcommand's numbers are the other's.
#[test]
fn errors_without_the_references_noise_are_those_of_compare() {
    let f = folder();
    let small = "--size 24x16 --variant two=path-trace,--spp=2 --variant four=path-trace,--spp=4 --reference-spp 4";
    let figures = figures(&f, &format!("{small} --reference-pair"));
    let json = read_json(&f, "out/evaluation.json");
    for (method, name) in ["two", "four"].into_iter().enumerate() {
        for layer in ["glossy", "full"] {
            let references = "out/reference --second-reference out/second-reference";
            f.success(&format!("compare out/frames/{name} {references} --layer {layer} -o report"));
            let theirs = read_json(&f, "report/metrics.json");
            let ours = &json["methods"][method]["layers"][layer];
            for key in ["rmse_rgb", "rmse_lum", "dssim_rgb", "dssim_lum", "noise_rmse_rgb"] {
                assert_eq!(ours["mean"]["without_noise"][key], theirs["without_noise"][key], "{name} {layer} {key}");
                for frame in 0..3 {
                    let [mine, other] = [&ours["frames"][frame], &theirs["frames"][frame]].map(|f| &f["without_noise"][key]);
                    assert!(mine.is_number() && mine == other, "{name} {layer} {key} {frame}: {mine} {other}");
                }
            }
            let change = |frame: usize| &ours["frames"][frame]["without_noise"]["change_rms"];
            assert!(change(0).is_null() && change(1).is_number() && change(2).is_number());
            assert_eq!(figures["methods"][name][layer]["without_noise"], ours["mean"]["without_noise"]);
        }
    }
    let mean = |key: &str| figures["methods"]["four"]["full"]["without_noise"][key].as_f64().unwrap();
    let noisy = figures["methods"]["four"]["full"]["rmse_rgb"].as_f64().unwrap();
    assert!(mean("rmse_rgb") < 0.95 * noisy && mean("noise_rmse_rgb") > 0.0, "{} {noisy}", mean("rmse_rgb"));
    let tables = std::fs::read_to_string(f.at("out/evaluation.md")).unwrap();
    for part in ["| clean RMSE RGB |", "Least clean RMSE RGB", "- two: path-trace, --spp=2", "4 samples a pixel, with two seeds"]
    {
        assert!(tables.contains(part), "{part}: {tables}");
    }

    // The same two, given; and what is not a second reference.
    let given = |second: &str| {
        format!("--size 24x16 --variant two=path-trace,--spp=2 --reference out/reference --second-reference {second}")
    };
    let said = f.success(&format!("evaluate scene.xml --path path.json -o again {}", given("out/second-reference")));
    assert!(said.contains("clean RMSE") && said.contains("change"), "{said}");
    assert_eq!(read_json(&f, "again/evaluation.json")["methods"][0], json["methods"][0]);
    let message = refusal(&f, &given("out/reference"));
    assert!(message.contains("another seed"), "{message}");
    std::fs::remove_file(f.at("out/second-reference/0001.exr")).unwrap();
    let message = refusal(&f, &given("out/second-reference"));
    assert!(message.contains("second-reference/0001.exr") && message.contains("every frame"), "{message}");
}
