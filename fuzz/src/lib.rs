//! Every reader of files that others write, called as a command calls it, and what must hold of all that it accepts: the body of each
//! fuzz target. `tests/fuzz.rs` of the main package runs the same on seeds and some changed ones.
//!
//! Each returns whether the file was accepted. Nothing is read or written but what is in memory.

use glam::Vec3;
use reprobe::exchange::mesh::{MeshFile, obj as obj_file, ply as ply_file, serialized as serialized_file};
use reprobe::exchange::{self, LoadOptions};
use reprobe::io::{ExrImage, Samples, layer};
use reprobe::material::image::{self as image_file, ReadOptions, Take};
use reprobe::probe::places::Places;
use reprobe::scene::summary::Summary;
use reprobe::scene::{Animation, Camera, Emitter, Scene, camera_path as path_file};
use std::alloc::{GlobalAlloc, Layout, System};
use std::path::Path;
use std::sync::OnceLock;

/// A target: its name, which is that of its folder of seeds too, and what it does.
pub type Target = (&'static str, fn(&[u8]) -> bool);

/// All of them.
pub const TARGETS: [Target; 11] = [
    ("xml", xml),
    ("json", json),
    ("gltf", gltf),
    ("obj", obj),
    ("ply", ply),
    ("serialized", serialized),
    ("image", image),
    ("exr", exr),
    ("camera_path", camera_path),
    ("lights", lights),
    ("probes", probes),
];

/// Most bytes that one allocation may take for inputs as small as these.
const MOST: usize = 400 << 20;

/// The system's memory, but for what no small file should ask for: that ends the process, and the fuzzer keeps the input.
struct Bounded;

#[global_allocator]
static MEMORY: Bounded = Bounded;

// SAFETY: all is the system's allocator's, or does not return.
unsafe impl GlobalAlloc for Bounded {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        check(layout.size());
        unsafe { System.alloc(layout) }
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        check(layout.size());
        unsafe { System.alloc_zeroed(layout) }
    }

    unsafe fn realloc(&self, at: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        check(size);
        unsafe { System.realloc(at, layout, size) }
    }

    unsafe fn dealloc(&self, at: *mut u8, layout: Layout) {
        unsafe { System.dealloc(at, layout) }
    }
}

fn check(size: usize) {
    if size > MOST {
        use std::io::Write as _;
        let _ = writeln!(std::io::stderr(), "an allocation of {size} bytes, expected at most {MOST}");
        std::process::abort();
    }
}

/// What was read; an error must name the file.
fn accepted<T>(path: &str, result: reprobe::Result<T>) -> Option<T> {
    result.map_err(|e| assert!(e.to_string().contains(path), "{e}: does not name {path}")).ok()
}

/// A Mitsuba scene in XML.
pub fn xml(data: &[u8]) -> bool {
    scene("scene.xml", data)
}

/// A Mitsuba scene as a dictionary.
pub fn json(data: &[u8]) -> bool {
    scene("scene.json", data)
}

/// A glTF scene, text or binary.
pub fn gltf(data: &[u8]) -> bool {
    scene("scene.glb", data)
}

fn scene(name: &str, data: &[u8]) -> bool {
    // A fine sphere takes as long as hundreds of other scenes: of those with round shapes, some.
    let round = |word: &str| data.windows(word.len()).any(|w| w == word.as_bytes());
    if !data.len().is_multiple_of(64) && ["sphere", "cylinder", "disk"].iter().any(|word| round(word)) {
        return false;
    }
    let scene = accepted(name, exchange::decode(Path::new(name), data.to_vec(), &LoadOptions::default()));
    scene.inspect(scene_holds).is_some()
}

fn scene_holds(scene: &Scene) {
    let g = &scene.geometry;
    let (vertices, triangles) = (g.positions.len(), g.triangles.len());
    assert!(triangles > 0 && !scene.hash.is_empty());
    assert_eq!((g.normals.len(), g.uvs.len(), g.triangle_object.len()), (vertices, vertices, triangles));
    assert!(g.positions.iter().all(|p| p.is_finite()));
    assert!(g.normals.iter().all(|n| n.is_finite() && n.length() < 1.01));
    assert!(g.uvs.iter().all(|uv| uv.is_finite()));
    let (mut first_triangle, mut first_vertex) = (0, 0);
    for (i, object) in g.objects.iter().enumerate() {
        assert_eq!((object.triangles.start, object.vertices.start), (first_triangle, first_vertex));
        (first_triangle, first_vertex) = (object.triangles.end, object.vertices.end);
        assert!((object.material as usize) < scene.materials.len());
        assert!(object.emitter.is_none_or(|e| (e as usize) < scene.emitters.len()));
        for t in object.triangles.start as usize..object.triangles.end as usize {
            assert_eq!(g.triangle_object[t] as usize, i);
            assert!(g.triangles[t].iter().all(|v| object.vertices.contains(v)));
        }
    }
    assert_eq!((first_triangle as usize, first_vertex as usize), (triangles, vertices));
    scene.emitters.iter().for_each(|emitter| emitter_holds(scene, emitter));
    scene.sensor.iter().for_each(camera_holds);
    Summary::of(scene);
}

fn emitter_holds(scene: &Scene, emitter: &Emitter) {
    let shines = |radiance: &Vec3| radiance.is_finite() && radiance.min_element() >= 0.0;
    let unit = |direction: &Vec3| (direction.length() - 1.0).abs() < 1e-3;
    assert!(
        match emitter {
            Emitter::Area { object, .. } => (*object as usize) < scene.geometry.objects.len(),
            Emitter::Envmap { scale, to_world, .. } => scale.is_finite() && to_world.is_finite(),
            Emitter::Constant { radiance } => shines(radiance),
            Emitter::Point { position, intensity } => position.is_finite() && shines(intensity),
            Emitter::Spot { position, direction, intensity, cutoff_rad, beam_rad, .. } => {
                position.is_finite() && unit(direction) && shines(intensity) && (0.0..=*cutoff_rad).contains(beam_rad)
            }
            Emitter::Projector { position, direction, cutoff_rad, .. } => {
                position.is_finite() && unit(direction) && cutoff_rad.is_finite()
            }
            Emitter::Sun { direction, up, angle_rad, radiance } => {
                unit(direction) && unit(up) && *angle_rad > 0.0 && shines(radiance)
            }
            Emitter::Directional { direction, irradiance } => unit(direction) && shines(irradiance),
        },
        "{emitter:?}"
    );
}

fn camera_holds(camera: &Camera) {
    assert!(camera.to_world.is_finite(), "{camera:?}");
    assert!(camera.size.iter().all(|n| (1..=65_536).contains(n)), "{camera:?}");
    assert!(camera.focal_px().is_normal() && camera.focal_px() > 0.0, "{camera:?}");
    assert!(camera.axis_px().is_finite() && camera.aperture_radius.is_finite(), "{camera:?}");
}

/// A mesh in OBJ.
pub fn obj(data: &[u8]) -> bool {
    mesh_holds(accepted("mesh.obj", obj_file::parse(data, Path::new("mesh.obj"))))
}

/// A mesh in PLY.
pub fn ply(data: &[u8]) -> bool {
    mesh_holds(accepted("mesh.ply", ply_file::parse(data, Path::new("mesh.ply"))))
}

/// The first two meshes of Mitsuba's own format.
pub fn serialized(data: &[u8]) -> bool {
    let path = "mesh.serialized";
    let [first, second] = [0, 1].map(|i| mesh_holds(accepted(path, serialized_file::parse(data, i, Path::new(path)))));
    first || second
}

fn mesh_holds(file: Option<MeshFile>) -> bool {
    let Some(MeshFile { mesh, attributes }) = file else { return false };
    let vertices = mesh.positions.len();
    assert!([0, vertices].contains(&mesh.normals.len()) && [0, vertices].contains(&mesh.uvs.len()));
    assert!(mesh.triangles.iter().flatten().all(|&v| (v as usize) < vertices));
    assert!(mesh.positions.iter().chain(&mesh.normals).all(|p| p.is_finite()));
    assert!(mesh.uvs.iter().all(|uv| uv.is_finite()));
    for attribute in &attributes {
        let count = if attribute.is_of_faces() { mesh.triangles.len() } else { vertices };
        assert_eq!(attribute.values.len(), count, "{}", attribute.name);
        assert!(attribute.values.iter().all(|v| v.is_finite()), "{}", attribute.name);
    }
    true
}

/// An image of any format; its length says what of it is taken. One that begins like none is a TGA, which begins as it likes.
pub fn image(data: &[u8]) -> bool {
    let take = [Take::Color, Take::Linear, Take::Channel(0), Take::Channel(3)][data.len() % 4];
    let options = ReadOptions { take, allow_truncated: data.len() & 4 != 0 };
    let Some((image, _)) = accepted("image.tga", image_file::decode(Path::new("image.tga"), data, options)) else { return false };
    assert!(image.width > 0 && image.height > 0);
    // Of many pixels some.
    let count = image.width * image.height;
    for i in (0..count).step_by(1 + count / 4096).chain([count - 1]) {
        assert!(image.pixel(i % image.width, i / image.width).is_finite(), "pixel {i}");
    }
    true
}

/// An EXR file with its layers, which reads the same when it was written anew.
pub fn exr(data: &[u8]) -> bool {
    let path = Path::new("layers.exr");
    let Some(image) = accepted("layers.exr", ExrImage::from_bytes(path, data)) else { return false };
    let count = image.width * image.height;
    for (name, samples) in &image.channels {
        let found = match samples {
            Samples::F16(v) => v.len(),
            Samples::F32(v) => v.len(),
            Samples::U32(v) => v.len(),
        };
        assert_eq!(found, count, "{name}");
    }
    accepted("layers.exr", image.picture(path));
    assert!(layer::layers(&image).len() <= image.channels.len());
    let names: std::collections::BTreeSet<_> = image.channels.iter().map(|(name, _)| name).collect();
    // A file is written with each name once, and with names that everybody can read.
    let written = names.len() == image.channels.len() && !names.is_empty() && names.iter().all(|name| name.is_ascii());
    if written && count * image.channels.len() <= 4096 {
        let written = image.encode(path).unwrap_or_else(|e| panic!("{e}"));
        let again = ExrImage::from_bytes(path, &written).unwrap_or_else(|e| panic!("{e}"));
        assert_eq!((again.width, again.height), (image.width, image.height));
        assert_eq!(bits(&again), bits(&image));
    }
    true
}

/// All channels by name, with the numbers' bits, as what is no number equals nothing.
fn bits(image: &ExrImage) -> Vec<(&str, Vec<u32>)> {
    let of = |samples: &Samples| match samples {
        Samples::F16(v) => v.iter().map(|x| u32::from(x.to_bits())).collect(),
        Samples::F32(v) => v.iter().map(|x| x.to_bits()).collect(),
        Samples::U32(v) => v.clone(),
    };
    let mut channels: Vec<_> = image.channels.iter().map(|(name, samples)| (name.as_str(), of(samples))).collect();
    channels.sort();
    channels
}

/// A camera path, of a scene with a sensor.
pub fn camera_path(data: &[u8]) -> bool {
    let Ok(text) = std::str::from_utf8(data) else { return false };
    let sensor = room().sensor.as_ref();
    let Some(cameras) = accepted("path.json", path_file::parse(Path::new("path.json"), text, sensor, 1.0)) else { return false };
    assert!(!cameras.is_empty());
    // Of many cameras some.
    cameras.iter().step_by(1 + cameras.len() / 1000).chain(cameras.last()).for_each(camera_holds);
    true
}

/// Lights, surfaces and objects that move, in a scene.
pub fn lights(data: &[u8]) -> bool {
    let Ok(text) = std::str::from_utf8(data) else { return false };
    let scene = room();
    let Some(animation) = accepted("lights.json", Animation::parse(Path::new("lights.json"), text, scene)) else { return false };
    let last = animation.frames().saturating_sub(1);
    [0, last].iter().for_each(|&frame| scene_holds(&animation.scene_at(scene, frame)));
    true
}

/// A small scene with a lamp and a camera.
fn room() -> &'static Scene {
    static ROOM: OnceLock<Scene> = OnceLock::new();
    ROOM.get_or_init(|| {
        let text = include_bytes!("room.xml");
        exchange::decode(Path::new("room.xml"), text.to_vec(), &LoadOptions::default()).unwrap_or_else(|e| panic!("{e}"))
    })
}

/// Places of probes, which read the same when they were written anew.
pub fn probes(data: &[u8]) -> bool {
    let Ok(text) = std::str::from_utf8(data) else { return false };
    let path = Path::new("probes.json");
    let Some(places) = accepted("probes.json", Places::parse(path, text)) else { return false };
    assert!(!places.is_empty() && places.positions().iter().all(|p| p.is_finite()));
    assert!(places.used().iter().all(|&i| i < places.len()));
    let around = places.around(places.position(0));
    assert!(around.iter().all(|w| w.probe < places.len() && w.weight >= 0.0), "{around:?}");
    assert!((around.iter().map(|w| w.weight).sum::<f32>() - 1.0).abs() < 1e-3, "{around:?}");
    let written = serde_json::to_string(&places).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(Places::parse(path, &written).unwrap_or_else(|e| panic!("{e}")), places);
    true
}
