//! place-probes, resmap and qhmap as commands, on a small scene.

use glam::Vec3;
use reprobe::exchange::load;
use reprobe::method::glossy_probes::seen::SeenBuffers;
use reprobe::probe::parameter_map::ParameterMap;
use reprobe::probe::placement::Placement;
use reprobe::probe::placement::{Density, ProbeGrid};
use reprobe::probe::places::Places;
use reprobe::probe::reach::{ReachParams, blocked, reach};
use reprobe::transport::World;
use std::path::Path;
use std::process::Command;

/// A room of 4 x 2 x 3 m about the origin with a glossy floor, a mirror on the wall at −Z, a closed box of 1 m at (1, −0.5, 0),
/// and in the wall at +X a window that is 0.4 m wide, 100 m before a screen.
fn scene(extra: &str) -> String {
    let cube = |x: f32, y: f32, z: f32, sx: f32, sy: f32, sz: f32, material: &str| {
        format!(
            r#"<shape type="cube"><transform name="to_world"><scale x="{sx}" y="{sy}" z="{sz}"/>
               <translate x="{x}" y="{y}" z="{z}"/></transform><ref id="{material}"/></shape>"#
        )
    };
    let mut shapes = String::new();
    shapes += &cube(0.0, -1.1, 0.0, 2.2, 0.1, 1.7, "floor");
    shapes += &cube(0.0, 1.1, 0.0, 2.2, 0.1, 1.7, "wall");
    shapes += &cube(0.0, 0.0, -1.6, 2.2, 1.0, 0.1, "mirror");
    shapes += &cube(0.0, 0.0, 1.6, 2.2, 1.0, 0.1, "wall");
    shapes += &cube(-2.1, 0.0, 0.0, 0.1, 1.0, 1.5, "wall");
    shapes += &cube(2.1, 0.0, -0.9, 0.1, 1.0, 0.7, "wall");
    shapes += &cube(2.1, 0.0, 0.9, 0.1, 1.0, 0.7, "wall");
    shapes += &cube(102.0, 0.0, 0.0, 0.1, 100.0, 100.0, "wall");
    shapes += &cube(1.0, -0.5, 0.0, 0.5, 0.5, 0.5, "wall");
    format!(
        r#"<scene version="3.0.0">
        <bsdf type="twosided" id="wall"><bsdf type="diffuse"/></bsdf>
        <bsdf type="twosided" id="floor"><bsdf type="roughplastic"><float name="alpha" value="0.2"/></bsdf></bsdf>
        <bsdf type="twosided" id="mirror"><bsdf type="conductor"/></bsdf>
        <sensor type="perspective"><float name="fov" value="70"/><transform name="to_world">
          <lookat origin="-1, 0, 0.5" target="1, 0, 0" up="0, 1, 0"/></transform></sensor>
        <emitter type="constant"/>
        {shapes}{extra}</scene>"#
    )
}

fn world(folder: &Path) -> World {
    let path = folder.join("scene.xml");
    std::fs::write(&path, scene("")).unwrap();
    World::opaque(load(&path, &Default::default()).unwrap()).0
}

#[test]
fn the_grid_fills_the_room_but_not_the_view_from_its_window() {
    let folder = tempfile::tempdir().unwrap();
    let world = world(folder.path());
    let camera = Vec3::new(-1.0, 0.0, 0.5);
    let (lower, upper) = reach(&world, &[camera], &ReachParams::default()).unwrap();
    assert!((lower - Vec3::new(-2.0, -1.0, -1.5)).abs().max_element() < 0.1, "{lower}");
    assert!((upper - Vec3::new(2.0, 1.0, 1.5)).abs().max_element() < 0.1, "{upper}");
    // Along a path, the box of the path, but not through walls.
    let path = [camera, Vec3::new(0.2, 0.3, 1.4)];
    let (lower, upper) = reach(&world, &path, &ReachParams::default()).unwrap();
    assert!((lower - Vec3::new(-1.5, -0.5, 0.0)).abs().max_element() < 1e-5, "{lower}");
    assert!((upper - Vec3::new(0.7, 0.8, 1.5)).abs().max_element() < 0.01, "{upper}");
}

#[test]
fn probes_inside_objects_and_behind_walls_are_blocked() {
    let folder = tempfile::tempdir().unwrap();
    let world = world(folder.path());
    let provenance = reprobe::io::Provenance::new("place-probes", "", 0, &0);
    let grid = ProbeGrid::in_box(Vec3::new(-3.0, -1.0, -1.5), Vec3::new(2.0, 1.0, 1.5), Density::Counts([10, 4, 3]), provenance)
        .unwrap();
    let found = blocked(&world, &grid, &[Vec3::new(-1.0, 0.0, 0.5)]);
    for i in 0..grid.len() {
        let p = grid.position(i);
        let in_box = (p - Vec3::new(1.0, -0.5, 0.0)).abs().max_element() < 0.5;
        let outside = p.x < -2.0;
        assert_eq!(found.contains(&(i as u32)), in_box || outside, "{p}");
    }
    assert!(found.len() > 20);
}

#[test]
fn what_a_probe_sees_has_the_room_s_depths_and_materials() {
    let folder = tempfile::tempdir().unwrap();
    let world = world(folder.path());
    let seen = SeenBuffers::cast(&world, Vec3::ZERO, [64, 32]);
    let at = |x: usize, y: usize| seen.texels[y * 64 + x].unwrap();
    let down = at(3, 31);
    assert!((down.depth * down.facing - 1.0).abs() < 1e-4 && down.normal.abs_diff_eq(Vec3::Y, 1e-5));
    assert_eq!(down.alpha, Some(0.2));
    let ahead = at(0, 15);
    assert!((ahead.depth * ahead.facing - 1.5).abs() < 1e-4 && ahead.normal.abs_diff_eq(Vec3::Z, 1e-5));
    assert_eq!((ahead.alpha, at(32, 15).alpha), (Some(0.0), None));
}

fn reprobe(folder: &Path, args: &[&str]) -> (Option<i32>, String, String) {
    let output = Command::new(env!("CARGO_BIN_EXE_reprobe")).current_dir(folder).args(args).output().unwrap();
    let text = |b: &[u8]| String::from_utf8_lossy(b).into_owned();
    (output.status.code(), text(&output.stdout), text(&output.stderr))
}

fn succeeds(folder: &Path, args: &[&str]) -> serde_json::Value {
    let (code, out, err) = reprobe(folder, args);
    assert_eq!(code, Some(0), "{args:?}: {err}");
    serde_json::from_str(&out).unwrap_or_default()
}

const PATH: &str = r#"{"fov": 70, "size": [64, 32], "frames": [
    {"origin": [-1, 0, 0.5], "target": [1, 0, 0], "up": [0, 1, 0]},
    {"origin": [0, 0.25, 0.5], "target": [1, 0, 0], "up": [0, 1, 0]}]}"#;

const RESMAP: [&str; 8] = ["resmap", "scene.xml", "--probes", "probes.json", "--size", "64x32", "--json", "-o"];
const QHMAP: [&str; 5] = ["qhmap", "--size", "128x64", "--json", "-o"];

/// All three stages in a folder, with `threads` threads.
fn make(folder: &Path, threads: &str) {
    std::fs::write(folder.join("scene.xml"), scene("")).unwrap();
    std::fs::write(folder.join("path.json"), PATH).unwrap();
    let path = ["--path", "path.json"];
    let probes = ["place-probes", "scene.xml", "--grid", "2x1x2", "-o", "probes.json", "--threads", threads, "--json"];
    let figures = succeeds(folder, &[&probes[..], &path].concat());
    // The two cameras' box and half a metre around it.
    assert_eq!(figures["bounds"], serde_json::json!([[-1.5, -0.5, 0.0], [0.5, 0.75, 1.0]]));
    succeeds(folder, &[&RESMAP[..], &["resmap", "--threads", threads]].concat());
    succeeds(folder, &[&QHMAP[..], &["qhmap", "resmap", "--threads", threads]].concat());
}

#[test]
fn stages_follow_each_other_and_one_thread_equals_many() {
    let (one, many) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    make(one.path(), "1");
    make(many.path(), "3");
    let mut compared = 0;
    for stage in ["resmap", "qhmap"] {
        for entry in std::fs::read_dir(one.path().join(stage)).unwrap() {
            let path = entry.unwrap().path();
            let other = many.path().join(stage).join(path.file_name().unwrap());
            assert!(std::fs::read(&path).unwrap() == std::fs::read(&other).unwrap(), "{} differs", path.display());
            compared += 1;
        }
    }
    assert_eq!(compared, 4 + 1 + 8 + 1);
    let (map, provenance) = ParameterMap::load(&one.path().join("qhmap"), 3).unwrap();
    assert_eq!((map.size, map.mesh), ([128, 64], [64, 32]));
    assert_eq!(provenance.inputs.keys().collect::<Vec<_>>(), ["probes", "resmap"]);
}

#[test]
fn probes_off_the_grid_are_in_the_room_the_same_for_any_threads_and_serve_other_stages() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    std::fs::write(folder.join("scene.xml"), scene("")).unwrap();
    let place = |method: &str, threads: &str, output: &str, more: &[&str]| {
        let args = ["place-probes", "scene.xml", "--method", method, "--threads", threads, "--json", "-o", output];
        succeeds(folder, &[&args[..], more].concat())
    };
    for method in ["sdf", "medial-axis"] {
        let more = ["--count", "5", "--refine", "1", "--picture", "plan.png"];
        let figures = place(method, "1", "a.json", &more);
        let read = |name: &str| std::fs::read(folder.join(name)).unwrap();
        if method == "sdf" {
            place(method, "2", "b.json", &more);
            assert!(read("a.json") == read("b.json"), "{method}");
        }
        let places = Places::read(&folder.join("a.json")).unwrap();
        assert_eq!((places.method().to_string().as_str(), places.positions().len()), (method, 5));
        for p in places.positions() {
            assert!(p.abs().cmplt(Vec3::new(2.0, 1.0, 1.5)).all(), "{p} is outside");
            assert!((p - Vec3::new(1.0, -0.5, 0.0)).abs().max_element() > 0.5, "{p} is in the box");
        }
        let share = |which: &str| figures[which]["coverage"].as_f64().unwrap();
        assert!(share("before") > 0.9 && share("after") >= share("before") && figures["count"] == 5, "{figures}");
        assert!(read("plan.png").starts_with(b"\x89PNG"));
    }
    // Glossy probes may stand anywhere.
    succeeds(folder, &["resmap", "scene.xml", "--probes", "a.json", "--size", "32x16", "-o", "r"]);
    succeeds(folder, &["qhmap", "r", "-o", "q"]);
    succeeds(folder, &["bake-probes", "scene.xml", "--probes", "a.json", "--qhmap", "q", "--spp", "1", "-o", "baked"]);
    assert!(std::fs::read_to_string(folder.join("baked/set.json")).unwrap().contains("\"method\": \"medial-axis\""));
    let grid =
        succeeds(folder, &["place-probes", "scene.xml", "--grid", "3x2x2", "--picture", "plan.png", "-o", "g.json", "--json"]);
    assert!((0.5..1.0).contains(&grid["coverage"].as_f64().unwrap()), "{grid}");
    assert!(Places::read(&folder.join("g.json")).unwrap().method() == Placement::Grid);
}

#[test]
fn sparse_probes_stand_evenly_in_the_room_and_say_how_far_they_reach() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    std::fs::write(folder.join("scene.xml"), scene("")).unwrap();
    let place = |threads: &str, output: &str, more: &[&str]| {
        let args = ["place-probes", "scene.xml", "--method", "voxel", "--threads", threads, "--json", "-o", output];
        succeeds(folder, &[&args[..], more].concat())
    };
    let read = |name: &str| std::fs::read(folder.join(name)).unwrap();
    // The room is 4 x 2 x 3 m.
    let more = ["--spacing", "1", "--picture", "plan.png", "--coverage-picture", "coverage.png"];
    let figures = place("1", "a.json", &more);
    place("2", "b.json", &more[..2]);
    assert!(read("a.json") == read("b.json"));
    assert!(read("plan.png").starts_with(b"\x89PNG") && read("coverage.png").starts_with(b"\x89PNG"));
    let number = |name: &str| figures[name].as_f64().unwrap();
    assert_eq!((number("count"), number("supported")), (24.0, 1.0), "{figures}");
    assert!(number("candidates") > 5000.0 && number("seen") > 0.97 && number("seconds") > 0.0, "{figures}");
    let places = Places::read(&folder.join("a.json")).unwrap();
    assert_eq!((places.method(), places.len()), (Placement::Voxel, 24));
    assert!((places.radius().unwrap() - number("radius") as f32).abs() < 1e-6 && (1.0..3.0).contains(&number("radius")));
    for p in places.positions() {
        assert!(p.abs().cmplt(Vec3::new(2.2, 1.0, 1.5)).all(), "{p} is outside");
        assert!((p - Vec3::new(1.0, -0.5, 0.0)).abs().max_element() > 0.5, "{p} is in the box");
    }
    // Other stages take them, and leave the radius alone.
    assert_eq!(place("2", "few.json", &["--count", "2"])["count"], 2);
    succeeds(folder, &["resmap", "scene.xml", "--probes", "few.json", "--size", "32x16", "-o", "r"]);
    assert!(reprobe(folder, &["info", "few.json"]).0 == Some(0));
}

#[test]
fn options_of_another_method_of_placement_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    std::fs::write(folder.join("scene.xml"), scene("")).unwrap();
    std::fs::write(folder.join("photograph.png"), b"\x89PNG").unwrap();
    for (args, expected) in [
        (&["--method", "sdf", "--grid", "2x2x2"][..], "--grid: --method sdf has no use for it; grid has"),
        (&["--method", "medial-axis", "--spacing", "1"], "--spacing: --method medial-axis has no use for it; grid, voxel have"),
        (&["--refine", "3"], "--refine: --method grid has no use for it; sdf, medial-axis have"),
        (&["--method", "grid", "--coverage", "0.5"], "--coverage: --method grid has no use for it"),
        (&["--method", "sdf", "--margin", "1"], "--margin: --method sdf has no use for it; grid has"),
        (&["--method", "sdf", "--count", "0"], "--count 0: expected from 1 to"),
        (&["--method", "sdf", "--coverage", "0"], "--coverage 0: expected a share above 0"),
        (&["--method", "sdf", "--coverage", "1.5"], "--coverage 1.5: expected a share above 0, at most 1"),
        (&["--method", "sdf", "--coverage", "nan"], "--coverage NaN: expected a share"),
        (&["--method", "sdf", "--refine", "1000000"], "--refine 1000000: expected at most"),
        (&["--method", "voxel", "--coverage", "0.9"], "--coverage: --method voxel has no use for it; sdf, medial-axis have"),
        (&["--method", "voxel", "--refine", "3"], "--refine: --method voxel has no use for it; sdf, medial-axis have"),
        (&["--method", "voxel", "--grid", "2x2x2"], "--grid: --method voxel has no use for it; grid has"),
        (&["--method", "voxel", "--margin", "1"], "--margin: --method voxel has no use for it; grid has"),
        (&["--method", "voxel", "--count", "0"], "--count 0: expected from 1 to"),
        (&["--method", "voxel", "--spacing", "0"], "--spacing 0: expected a positive number of metres"),
        (&["--method", "voxel", "--spacing", "nan"], "--spacing NaN: expected a positive number of metres"),
        (&["--method", "voxel", "--spacing", "0.001"], "expected from 1 to 10000 in all"),
        (&["--method", "tetrahedra"], "expected grid, sdf, medial-axis, voxel"),
        (&["--picture", "plan.jpg"], "plan.jpg: expected a name that ends in .png"),
        (&["--picture", "photograph.png"], "photograph.png: was not written by reprobe"),
    ] {
        let (code, _, err) = reprobe(folder, &[&["place-probes", "scene.xml", "-o", "p.json"], args].concat());
        assert!(code == Some(2) && err.contains(expected) && !err.contains("panicked"), "{args:?}: {err}");
        assert!(!folder.join("p.json").exists());
    }
}

#[test]
fn finished_maps_are_kept_and_others_replaced() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    make(folder, "1");
    let again = |extra: &[&str]| succeeds(folder, &[&RESMAP[..], &["resmap"], extra].concat())["kept"].clone();
    assert_eq!(again(&[]), 4);
    // A killed run: no mark, one file missing, one from other parameters.
    std::fs::remove_file(folder.join("resmap/set.json")).unwrap();
    std::fs::remove_file(folder.join("resmap/0001.exr")).unwrap();
    let (code, _, err) = reprobe(folder, &["qhmap", "resmap", "-o", "other"]);
    assert!(code == Some(2) && err.contains("not a complete output of resmap"), "{err}");
    assert_eq!(again(&[]), 3);
    assert_eq!(again(&["--blur-sigma", "2"]), 0);
    assert_eq!(succeeds(folder, &[&QHMAP[..], &["qhmap", "resmap"]].concat())["kept"], 0);
}

#[test]
fn inputs_from_elsewhere_and_nonsense_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    make(folder, "1");
    std::fs::write(folder.join("scene.xml"), scene(r#"<shape type="sphere"/>"#)).unwrap();
    let (code, _, err) = reprobe(folder, &[&RESMAP[..], &["resmap"]].concat());
    assert!(code == Some(2) && err.contains("probes.json: made from another scene"), "{err}");

    std::fs::write(folder.join("resmap/0002.exr"), b"nonsense").unwrap();
    let (code, _, err) = reprobe(folder, &[&QHMAP[..], &["q2", "resmap"]].concat());
    assert!(code == Some(2) && err.contains("0002.exr") && !folder.join("q2/set.json").exists(), "{err}");

    for args in [
        &["place-probes", "scene.xml", "-o", "p.json", "--grid", "0x1x1"][..],
        &["place-probes", "scene.xml", "-o", "p.json", "--grid", "7x6"],
        &["place-probes", "scene.xml", "-o", "p.json", "--spacing=-1"],
        &["place-probes", "scene.xml", "-o", "p.json", "--bounds=1,1,1,0,0,0"],
        &["resmap", "scene.xml", "--probes", "absent.json", "-o", "r"],
        &["qhmap", "absent", "-o", "q"],
        &["qhmap", "resmap", "-o", "q", "--epsilon", "nan"],
    ] {
        let (code, _, err) = reprobe(folder, args);
        assert_eq!(code, Some(2), "{args:?}: {err}");
        assert!(!err.contains("panicked"), "{args:?}: {err}");
    }
}
