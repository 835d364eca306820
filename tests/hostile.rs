//! Files that mean harm, given to the program: one line of error, exit code 2, in little time and memory. What a reader alone can show
//! is tested beside it, and `tests/fuzz.rs` looks for what nobody has thought of.
#![cfg(unix)]

use flate2::{Compression, Crc, write::ZlibEncoder};
use reprobe::io::ExrImage;
use std::io::Write;
use std::path::PathBuf;
use std::process::Command;
use std::time::{Duration, Instant};
use tempfile::TempDir;

/// Most memory that the program may map, kilobytes: itself, and what a small file needs.
const MEMORY: u32 = 1_000_000;
/// Longest time, beside all other tests.
const LONGEST: Duration = Duration::from_secs(30);

const CAMERA: &str =
    "<sensor type='perspective'><transform name='to_world'><lookat origin='0,0,4' target='0,0,0' up='0,1,0'/></transform>
    <film type='hdrfilm'><integer name='width' value='8'/><integer name='height' value='8'/></film></sensor>";

struct Folder(TempDir);

impl Folder {
    fn at(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn add(&self, name: &str, content: impl AsRef<[u8]>) {
        std::fs::write(self.at(name), content).unwrap();
    }

    fn add_pipe(&self, name: &str) {
        assert!(Command::new("mkfifo").arg(self.at(name)).status().unwrap().success());
    }
}

/// A folder with a room that has `body` in it, and a file.
fn with(body: &str, file: &str, content: &[u8]) -> Folder {
    let f = Folder(tempfile::tempdir().unwrap());
    f.add("scene.xml", format!("<scene version='3.0.0'>{CAMERA}<shape type='cube'/><emitter type='constant'/>{body}</scene>"));
    if !file.is_empty() {
        f.add(file, content);
    }
    f
}

/// Runs a command within bounds that must refuse its input, with one line that says `expected`.
fn refused(f: &Folder, args: &str, expected: &str) {
    let bounded = format!("ulimit -v {MEMORY}; exec \"$0\" --threads 2 {args}");
    let start = Instant::now();
    let output =
        Command::new("sh").args(["-c", &bounded, env!("CARGO_BIN_EXE_reprobe")]).current_dir(f.0.path()).output().unwrap();
    let message = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(2), "{args}: {message}");
    assert!(message.contains(expected), "{args}: {message}\nexpected {expected}");
    assert_eq!(message.lines().count(), 1, "{message}");
    assert!(message.len() < 1000, "{message}");
    assert!(start.elapsed() < LONGEST, "{args}: {:?}", start.elapsed());
}

fn bitmap(file: &str) -> String {
    let texture = format!("<texture type='bitmap' name='reflectance'><string name='filename' value='{file}'/></texture>");
    format!("<shape type='cube'><bsdf type='diffuse'>{texture}</bsdf></shape>")
}

fn mesh(file: &str) -> String {
    let kind = file.rsplit('.').next().unwrap();
    format!("<shape type='{kind}'><string name='filename' value='{file}'/></shape>")
}

#[test]
fn names_that_stand_for_names_do_not_grow() {
    let doubled: String = (1..60).map(|i| format!("<default name='a{i}_' value='$a{}_$a{0}_'/>", i - 1)).collect();
    let body = format!("<default name='a0_' value='0123456789'/>{doubled}<shape type='cube' id='$a59_'/>");
    refused(&with(&body, "", &[]), "info scene.xml", "scene.xml:2: the parameters stand for more than");
    // Each a copy of all before it would be.
    let many: String = (0..3000).map(|_| "<float name='a' value='1'/>").collect();
    let aliases: String = (0..3000).map(|i| format!("<alias id='a' as='b{i}'/>")).collect();
    let body = format!("<shape type='cube' id='a'>{many}</shape>{aliases}");
    refused(&with(&body, "", &[]), "info scene.xml", "alias: more than");
    // An entity stands for itself, so that this one names nothing that there is.
    let levels: String = (1..40).map(|i| format!("<!ENTITY a{i} '&a{};&a{0};'>", i - 1)).collect();
    let scene = format!("<!DOCTYPE scene [<!ENTITY a0 'ha'>{levels}]><scene version='3.0.0'>{}</scene>", bitmap("&a39;"));
    let f = with("", "", &[]);
    f.add("scene.xml", scene);
    refused(&f, "info scene.xml", "no file \"&a39;\"");
}

#[test]
fn devices_and_pipes_are_no_files() {
    refused(&with("", "", &[]), "info /dev/zero --json", "/dev/zero: is a device, expected a file");
    for name in ["/dev/zero", "../../../../../../../../dev/zero", "pipe.png"] {
        let f = with(&bitmap(name), "", &[]);
        f.add_pipe("pipe.png");
        refused(&f, "info scene.xml", &format!("no file \"{name}\""));
        let gltf = format!(r#"{{"asset":{{"version":"2.0"}},"buffers":[{{"byteLength":4,"uri":"{name}"}}]}}"#);
        f.add("scene.gltf", gltf);
        refused(&f, "info scene.gltf", "is no regular file");
    }
    let f = with("", "lights.json", br#"{"objects": [{"type": "mesh", "filename": "pipe.obj", "position": [0, 0, 0]}]}"#);
    f.add_pipe("pipe.obj");
    refused(&f, "render-path scene.xml --lights lights.json --method path-trace -o out", "is no regular file");
}

/// The head of a mesh of 2^31 vertices, and a name that goes on for ever when it is unpacked.
#[test]
fn meshes_that_claim_to_be_large() {
    let ply = |encoding: &str| {
        let head = "element vertex 2147483648\nproperty float x\nproperty float y\nproperty float z\nend_header\n";
        format!("ply\nformat {encoding} 1.0\n{head}0 0 0\n").into_bytes()
    };
    let serialized = |content: &dyn Fn(&mut dyn Write)| {
        let mut stream = ZlibEncoder::new(vec![0x1c, 4, 4, 0], Compression::best());
        stream.write_all(&0u32.to_le_bytes()).unwrap();
        content(&mut stream);
        [stream.finish().unwrap(), vec![0; 8], vec![1, 0, 0, 0]].concat()
    };
    let vertices = serialized(&|out| {
        out.write_all(b"name\0").unwrap();
        out.write_all(&[0x8000_0000u64.to_le_bytes(), 1u64.to_le_bytes()].concat()).unwrap();
        out.write_all(&vec![0; 50_000_000]).unwrap();
    });
    let name = serialized(&|out| out.write_all(&vec![b'a'; 100_000_000]).unwrap());
    for (file, content, expected) in [
        ("m.ply", ply("ascii"), "declares 2147483648 elements"),
        ("m.ply", ply("binary_little_endian"), "declares 2147483648 elements"),
        ("m.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 2147483647\n".to_vec(), "index 2147483647"),
        ("m.serialized", vertices, "the positions end after 50000000 of 25769803776 bytes"),
        ("m.serialized", name, "the name has more than"),
    ] {
        refused(&with(&mesh(file), file, &content), "info scene.xml", expected);
    }
}

#[test]
fn elements_of_a_mesh_are_given_once() {
    let head = "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\n";
    for (more, expected) in [
        ("element vertex 1\n".to_owned(), "expected each element once"),
        ((0..5000).map(|i| format!("element e{i} 10\n")).collect(), "expected each element once, and few of them"),
        ((0..5000).map(|i| format!("property float p{i}\n")).collect(), "expected fewer properties"),
    ] {
        let content = format!("{head}{more}end_header\n0 0 0\n");
        refused(&with(&mesh("m.ply"), "m.ply", content.as_bytes()), "info scene.xml", expected);
    }
}

fn png(side: u32) -> Vec<u8> {
    let chunk = |kind: &[u8], data: &[u8]| {
        let body = [kind, data].concat();
        let mut crc = Crc::new();
        crc.update(&body);
        [&(data.len() as u32).to_be_bytes()[..], &body, &crc.sum().to_be_bytes()].concat()
    };
    let side = side.to_be_bytes();
    let head = chunk(b"IHDR", &[&side[..], &side, &[8, 2, 0, 0, 0]].concat());
    [b"\x89PNG\r\n\x1a\n", &head[..], &chunk(b"IDAT", b"\x78\x9c"), &chunk(b"IEND", b"")].concat()
}

fn bmp(side: u32) -> Vec<u8> {
    let side = side.to_le_bytes();
    let info = [&40u32.to_le_bytes()[..], &side, &side, &[1, 0, 24, 0], &[0; 24]].concat();
    [b"BM", &[0; 8][..], &54u32.to_le_bytes(), &info].concat()
}

fn exr(side: i32) -> Vec<u8> {
    let mut bytes = ExrImage::new(1, 1).with_f32("Y", vec![1.0]).encode("a.exr".as_ref()).unwrap();
    let end = (side - 1).to_le_bytes();
    for name in [&b"dataWindow\0box2i\0"[..], b"displayWindow\0box2i\0"] {
        let at = bytes.windows(name.len()).position(|w| w == name).unwrap() + name.len() + 4 + 8;
        bytes[at..at + 8].copy_from_slice(&[end, end].concat());
    }
    bytes
}

/// An image of two channels, of which one has a sample for all pixels.
fn sampled_exr(side: i32) -> Vec<u8> {
    let mut bytes = exr(side);
    let name = b"Y\0\x02\0\0\0\0\0\0\0";
    let at = bytes.windows(name.len()).position(|w| w == name).unwrap() + name.len();
    bytes[at..at + 8].copy_from_slice(&[(1i32 << 20).to_le_bytes(); 2].concat());
    bytes
}

#[test]
fn images_that_claim_to_be_large() {
    let hdr = |side: u32| format!("#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y {side} +X {side}\n").into_bytes();
    let pfm = |side: u32| format!("PF\n{side} {side}\n-1\n").into_bytes();
    let pgm = |side: u32| format!("P5\n{side} {side}\n255\n").into_bytes();
    for (file, large, larger) in [
        ("a.png", png(20_000), png(100_000)),
        ("a.bmp", bmp(20_000), bmp(100_000)),
        ("a.hdr", hdr(20_000), hdr(100_000)),
        ("a.pfm", pfm(20_000), pfm(100_000)),
        ("a.pgm", pgm(20_000), pgm(100_000)),
        ("a.exr", exr(16_000), exr(100_000)),
        ("b.exr", sampled_exr(16_000), sampled_exr(100_000)),
    ] {
        for content in [large, larger] {
            refused(&with(&bitmap(file), file, &content), "info scene.xml", file);
            if file.ends_with(".exr") {
                refused(&with("", file, &content), &format!("info {file}"), file);
            }
        }
    }
}

#[test]
fn paths_and_lights_of_endless_frames() {
    let key = |t: f64| format!(r#"{{"time": {t}, "origin": [0, 0, 5], "target": [0, 0, 0]}}"#);
    let path = format!(r#"{{"fov": 60, "fps": 1000, "size": [8, 8], "keyframes": [{}, {}]}}"#, key(0.0), key(1e6));
    let f = with("", "path.json", path.as_bytes());
    refused(&f, "render-path scene.xml --path path.json --method path-trace -o out", "1000000001 frames are more than");
    refused(&f, "place-probes scene.xml --path path.json -o probes.json", "1000000001 frames are more than");
    let key = |t: f64| format!(r#"{{"time": {t}, "position": [0, 0, 5]}}"#);
    let lights = format!(
        r#"{{"fps": 1000, "lights": [{{"type": "point", "intensity": [1, 1, 1], "keyframes": [{}, {}]}}]}}"#,
        key(0.0),
        key(1e6)
    );
    let f = with("", "lights.json", lights.as_bytes());
    refused(
        &f,
        "render-path scene.xml --lights lights.json --method path-trace -o out",
        "1000000000 frames until the last keyframe",
    );
}
