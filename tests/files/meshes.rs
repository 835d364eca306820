//! Mesh files as people write them, and shapes of several shapes.

use super::Folder;
use glam::{Vec2, Vec3};
use reprobe::exchange::mesh::{MeshFile, obj, ply};
use reprobe::material::bsdf::Bsdf;
use reprobe::scene::Scene;
use reprobe::transport::World;
use std::path::Path;
use std::time::Instant;

fn read_ply(text: impl AsRef<[u8]>) -> MeshFile {
    ply::parse(text.as_ref(), Path::new("a.ply")).unwrap_or_else(|e| panic!("{e}"))
}

fn header(vertex: &str, face: &str) -> String {
    let vertex: String = vertex.split(' ').map(|name| format!("property float {name}\n")).collect();
    format!(
        "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n{vertex}element face 1\n\
         property list uchar int vertex_indices\n{face}end_header\n"
    )
}

#[test]
fn texture_coordinates_go_by_many_names() {
    for names in ["u v", "s t", "texture_u texture_v", "texture_s texture_t", "tx ty"] {
        let text = header(names, "") + "0 0 0 .1 .2\n1 0 0 .3 .4\n0 1 0 .5 .6\n3 0 1 2\n";
        assert_eq!(read_ply(text).mesh.uvs, [[0.1, 0.2], [0.3, 0.4], [0.5, 0.6]].map(Vec2::from), "{names}");
    }
}

/// MeshLab gives each corner of a face its own: where they differ, a vertex is there once for each.
#[test]
fn texture_coordinates_of_faces_take_vertices_apart() {
    let text = "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\nproperty uchar red\n\
        property uchar green\nproperty uchar blue\nelement face 2\nproperty list uchar int vertex_indices\nproperty list uchar float texcoord\n\
        end_header\n0 0 0 0 0 0\n1 0 0 255 255 255\n1 1 0 0 0 0\n0 1 0 0 0 0\n3 0 1 2 6 0 0 1 0 1 1\n3 0 2 3 6 0 0 .5 .5 0 1\n";
    let MeshFile { mesh, attributes } = read_ply(text);
    assert_eq!(mesh.triangles, [[0, 1, 2], [0, 3, 4]], "vertex 0 is shared, vertex 2 is not");
    assert_eq!(mesh.positions[3], mesh.positions[2]);
    assert_eq!((mesh.uvs[2], mesh.uvs[3]), (Vec2::ONE, Vec2::splat(0.5)));
    assert_eq!((attributes[0].values.len(), attributes[0].values[1]), (5, Vec3::ONE));
}

#[test]
fn ascii_ply_may_be_laid_out_in_any_way() {
    let plain = header("u v", "") + "0 0 0 .1 .2\n1 0 0 .3 .4\n0 1 0 .5 .6\n3 0 1 2\n";
    let expected = read_ply(&plain);
    let body = plain.split("end_header\n").nth(1).unwrap();
    let head = &plain[..plain.len() - body.len()];
    for (what, text) in [
        ("CRLF", plain.replace('\n', "\r\n")),
        ("CR", plain.replace('\n', "\r")),
        ("no last newline", plain.trim_end().to_owned()),
        ("blank lines", plain.replace('\n', "\n\n").replacen("\n\n", "\n", 1)),
        ("one line", format!("{head}{}", body.replace('\n', " "))),
        ("wrapped", format!("{head}{}", body.replace(' ', "\n"))),
        ("tabs and spaces", format!("{head}{}", body.replace(' ', " \t  ").replace('\n', "  \n "))),
        ("comments", format!("{head}comment one\n{}", body.replace("1 0 0", "# two\n1 0 0"))),
        ("comments above", plain.replace("element face", "comment x y\nobj_info z\nelement face")),
        ("trailing words", format!("{plain}\n\n")),
    ] {
        let found = read_ply(&text);
        assert_eq!(
            (found.mesh.positions, found.mesh.uvs, found.mesh.triangles),
            (expected.mesh.positions.clone(), expected.mesh.uvs.clone(), expected.mesh.triangles.clone()),
            "{what}"
        );
    }
    let message = ply::parse(plain.replace("1 0 0", "1 o 0").as_bytes(), Path::new("a.ply")).unwrap_err().to_string();
    assert!(message.starts_with("a.ply:13: found \"o\""), "{message}");
}

/// Names and values: Mitsuba 3.9.1, `traverse` of the same files; its bytes are 0 to 255, ours sRGB as its 16-bit integers are.
#[test]
fn attributes_have_mitsubas_names() {
    let one = |vertex: &str, face: &str, values: &str, faces: &str| {
        let rows: String = ["0 0 0", "1 0 0", "0 1 0"].iter().map(|p| format!("{p} {values}\n")).collect();
        let file = read_ply(header(vertex, face).replace("property float \n", "") + &rows + faces);
        file.attributes.into_iter().map(|a| (a.name, a.values[0])).collect::<Vec<_>>()
    };
    let triple = Vec3::new(0.1, 0.2, 0.3);
    let triangle = "3 0 1 2\n";
    for (names, values, expected) in [
        ("r g b", ".1 .2 .3", ("vertex_color", triple)),
        ("red green blue", ".1 .2 .3", ("vertex_color", triple)),
        ("foo_x foo_y foo_z", ".1 .2 .3", ("vertex_foo", triple)),
        ("foo_r foo_g foo_b", ".1 .2 .3", ("vertex_foo_color", triple)),
        ("foo_0", ".1", ("vertex_foo", Vec3::splat(0.1))),
    ] {
        assert_eq!(one(names, "", values, triangle), [(expected.0.to_owned(), expected.1)], "{names}");
    }
    assert!(one("foo", "", ".1", triangle).is_empty());
    let colors = "property uchar red\nproperty uchar green\nproperty uchar blue\n";
    let found = one("", colors, "", "3 0 1 2 255 0 128\n");
    assert!(found[0].0 == "face_color" && (found[0].1 - Vec3::new(1.0, 0.0, 0.21586)).length() < 1e-5, "{found:?}");
}

#[test]
fn backslashes_join_the_lines_of_an_obj_file() {
    let joined = "v 0 0 0\nv 1 0 0\nv 1 1 0.5\nv 0 1 0\nvt 0 0\nvt 1 0\nf 1/1 2/2 3/1 4/2\n";
    let expected = obj::parse(joined.as_bytes(), Path::new("a.obj")).unwrap().mesh;
    for text in [
        joined.replace(' ', " \\\n"),
        joined.replace(' ', "\\\r\n "),
        joined.replace("1 1 0.5", "1\\\n\\\n 1 \\  \n0.5"),
        joined.replace("v 1 0 0", "# a folder: C:\\\nv 1 0 0"),
        joined.trim_end().to_owned() + " \\",
    ] {
        let found = obj::parse(text.as_bytes(), Path::new("a.obj")).unwrap_or_else(|e| panic!("{text}\n{e}")).mesh;
        assert_eq!(
            (found.positions, found.uvs, found.triangles),
            (expected.positions.clone(), expected.uvs.clone(), expected.triangles.clone())
        );
    }
    let message = obj::parse(b"v 0 0 0\nv 1 \\\n\\\nx 0\n", Path::new("a.obj")).unwrap_err().to_string();
    assert!(message.starts_with("a.obj:2: found \"v 1"), "{message}");
}

/// The format's text: a vertex's w is the weight of rational curves and surfaces; Mitsuba 3.9.1 passes it over as well.
#[test]
fn weights_of_obj_vertices_move_nothing_and_colours_are_kept() {
    let read = |text: &str| obj::parse(text.as_bytes(), Path::new("a.obj")).unwrap();
    let file = read("v 0 0 0 1\nv 2 0 0 2\nv 0 1 0 1\nf 1 2 3\n");
    assert_eq!(file.mesh.positions[1], Vec3::new(2.0, 0.0, 0.0));
    assert!(file.attributes.is_empty());
    let file = read("v 0 0 0\nv 2 0 0 .1 .2 .3\nv 0 1 0 1 0 0\nf 3 2 1\n");
    assert_eq!(file.attributes[0].values, [Vec3::X, Vec3::new(0.1, 0.2, 0.3), Vec3::ONE]);
}

#[test]
fn polygons_of_a_million_corners_take_linear_time() {
    let n = 1_000_000;
    let corner = |i: usize| std::f32::consts::TAU * i as f32 / n as f32;
    let points: String = (0..n).map(|i| format!("v {} {} 0\n", corner(i).cos(), corner(i).sin())).collect();
    let face: String = (1..=n).map(|i| format!(" {i}")).collect();
    let start = Instant::now();
    let mesh = obj::parse(format!("{points}f{face}\n").as_bytes(), Path::new("a.obj")).unwrap().mesh;
    assert_eq!(mesh.triangles.len(), n - 2);
    let folder = Folder::new().with("p.obj", format!("{points}f{face}\n"));
    folder.load("<shape type='obj'><string name='filename' value='p.obj'/></shape><emitter type='constant'/>");
    assert!(start.elapsed().as_secs() < 30, "{:?}", start.elapsed());
}

/// Reflectance where a ray down -z at (x, y) meets the scene.
fn seen(world: &World, x: f32, y: f32) -> Vec3 {
    let s = world.intersect(&reprobe::base::ray::Ray::new(Vec3::new(x, y, 5.0), Vec3::NEG_Z)).unwrap();
    match world.scene.bsdf(&s) {
        Bsdf::Diffuse(d) => d.reflectance.at(&s),
        other => panic!("{other:?}"),
    }
}

/// Values: Mitsuba 3.9.1's `eval_attribute` is linear in the barycentric weights, and constant over a face.
#[test]
fn mesh_attributes_colour_each_shape_by_its_own_file() {
    let file = |c: &str| {
        let face = "property float red\nproperty float green\nproperty float blue\n";
        header("r g b", face) + &format!("0 0 0 {c} 0 0\n1 0 0 0 {c} 0\n0 1 0 0 0 {c}\n3 0 1 2 .7 .8 .9\n")
    };
    let folder = Folder::new().with("a.ply", file("1")).with("b.ply", file("0.5"));
    let attribute = |name: &str, scale: &str| {
        format!(
            "<bsdf type='diffuse' id='{name}'><texture type='mesh_attribute' name='reflectance'><string name='name' value='{name}'/>{scale}</texture></bsdf>"
        )
    };
    let shape = |file: &str, id: &str, x: f32, flip: bool| {
        format!(
            "<shape type='ply'><string name='filename' value='{file}'/><boolean name='flip_normals' value='{flip}'/>
            <transform name='to_world'><translate x='{x}'/></transform><ref id='{id}'/></shape>"
        )
    };
    let scene = folder.load(
        &[
            attribute("vertex_color", ""),
            attribute("face_color", "<float name='scale' value='0.5'/>"),
            shape("a.ply", "vertex_color", 0.0, false),
            shape("b.ply", "vertex_color", 2.0, true),
            shape("a.ply", "face_color", 4.0, false),
            "<emitter type='constant'/>".into(),
        ]
        .concat(),
    );
    assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
    let world = World::new(scene);
    for (x, expected) in [(0.0, [0.5, 0.2, 0.3]), (2.0, [0.25, 0.1, 0.15]), (4.0, [0.35, 0.4, 0.45])] {
        let found = seen(&world, x + 0.2, 0.3);
        assert!((found - Vec3::from(expected)).length() < 1e-5, "{x}: {found}");
    }
    let message = folder.error(&format!("{}{}", attribute("vertex_foo", ""), shape("a.ply", "vertex_foo", 0.0, false)));
    assert!(message.contains("has no attribute \"vertex_foo\": it has vertex_color, face_color"), "{message}");
}

fn box_of(scene: &Scene, object: usize) -> (Vec3, Vec3) {
    let range = scene.geometry.objects[object].vertices.clone();
    let points = &scene.geometry.positions[range.start as usize..range.end as usize];
    points.iter().fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(lo, hi), &p| (lo.min(p), hi.max(p)))
}

#[test]
fn groups_are_seen_through_their_instances() {
    let scene = Folder::new().load(
        "<shape type='shapegroup' id='g'><shape type='cube'><transform name='to_world'><scale value='0.5'/><translate x='1'/></transform></shape>
            <shape type='rectangle'/></shape>
        <shape type='instance'><ref id='g'/><transform name='to_world'><scale value='2'/><translate y='3'/></transform></shape>
        <shape type='instance'><ref id='g'/><transform name='to_world'><scale x='-1'/></transform></shape>
        <shape type='merge'><shape type='disk'/><shape type='merge'><shape type='cube'/></shape></shape><emitter type='constant'/>",
    );
    assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
    let names: Vec<&str> = scene.geometry.objects.iter().map(|o| o.name.as_str()).collect();
    assert_eq!(names, ["cube", "rectangle", "cube", "rectangle", "disk", "cube"]);
    assert_eq!(box_of(&scene, 0), (Vec3::new(1.0, 2.0, -1.0), Vec3::new(3.0, 4.0, 1.0)));
    assert_eq!(box_of(&scene, 2), (Vec3::new(-1.5, -0.5, -0.5), Vec3::new(-0.5, 0.5, 0.5)));
    // A mirrored instance keeps outsides outside.
    for object in [0usize, 2] {
        let triangles = scene.geometry.objects[object].triangles.clone();
        let (lo, hi) = box_of(&scene, object);
        for t in triangles {
            let outward = scene.geometry.corners(t)[0] - (lo + hi) / 2.0;
            assert!(scene.geometry.area_normal(t).dot(outward) > 0.0);
        }
    }
    // Seven tenfold references would be ten million shapes.
    let mut bomb = String::from("<shape type='rectangle' id='m0'/>");
    for i in 1..20 {
        bomb += &format!("<shape type='merge' id='m{i}'>{}</shape>", format!("<ref id='m{}'/>", i - 1).repeat(10));
    }
    for (body, expected) in [
        (&*bomb, "more than 1000000 shapes or"),
        ("<shape type='instance'/>", "found 0 shapes, expected one shapegroup"),
        ("<shape type='merge' id='m'><ref id='m'/></shape>", "nested more than 64 deep"),
        (
            "<shape type='shapegroup' id='g'><ref id='i'/></shape><shape type='instance' id='i'><ref id='g'/></shape>",
            "an instance within an instance",
        ),
    ] {
        let message = Folder::new().error(body);
        assert!(message.contains(expected), "{message}");
    }
}

#[test]
fn too_many_copies_are_an_error_not_a_full_memory() {
    let mut obj = String::from("v 0 0 0\nv 1 0 0\nv 0 1 0\n");
    obj += &"f 1 2 3\n".repeat(400_000);
    let instances = "<shape type='instance'><ref id='g'/></shape>".repeat(200);
    let message = Folder::new().with("a.obj", obj).error(&format!(
        "<shape type='shapegroup' id='g'><shape type='obj'><string name='filename' value='a.obj'/></shape></shape>{instances}"
    ));
    assert!(message.contains("expected at most 50000000: instances are copied"), "{}", &message[..message.len().min(300)]);
}
