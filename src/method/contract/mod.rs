//! For tests: whether shaders and Rust agree, by naga and without a GPU.
//!
//! Every kernel's text is assembled, parsed and validated, and held against its record: entry point, workgroup, bindings, the structs that they
//! hold, and how many storage buffers there are. Every constant of every file has a twin in `constants.rs` or says that it has none.

mod constants;
mod kernels;
mod module;

use crate::gpu::scene;
use crate::gpu::source::{FILES, assemble, resolve};
use crate::gpu::spec::{Access, KernelSpec};
use constants::check_constants;
use kernels::KERNELS;
use module::{Parsed, check_kernel};
use std::collections::BTreeSet;
use std::path::Path;

/// A kernel's problems, its own text given.
fn problems(spec: &KernelSpec, text: &str) -> Vec<String> {
    match Parsed::new(text) {
        Ok(parsed) => check_kernel(spec, &parsed),
        Err(error) => vec![error],
    }
}

fn text_of(file: &str) -> &'static str {
    FILES.iter().find(|(name, _)| *name == file).expect("a file of the list").1
}

fn kernel(file: &str) -> &'static KernelSpec {
    KERNELS.iter().find(|spec| spec.file == file).expect("a kernel of the list")
}

#[test]
fn kernels_are_as_their_records_say() {
    assert!(KERNELS.len() > 20, "{} kernels", KERNELS.len());
    let found: Vec<String> = KERNELS
        .iter()
        .flat_map(|spec| problems(spec, &assemble(spec.file).unwrap()).into_iter().map(|p| format!("{}: {p}", spec.file)))
        .collect();
    assert!(found.is_empty(), "{}", found.join("\n"));
}

#[test]
fn every_file_is_reached_by_a_kernel_and_every_kernel_is_listed_once() {
    let mut reached = BTreeSet::new();
    for spec in KERNELS {
        reached.extend(resolve(FILES, spec.file).unwrap());
    }
    let left: Vec<_> = FILES.iter().map(|(name, _)| *name).filter(|name| !reached.contains(name)).collect();
    assert!(left.is_empty(), "no kernel of kernels.rs needs {left:?}");
    let mut listed: Vec<_> = KERNELS.iter().map(|spec| spec.file).collect();
    listed.sort_unstable();
    let with_entry: Vec<_> = FILES.iter().filter(|(_, text)| text.contains("@compute")).map(|(name, _)| *name).collect();
    assert_eq!(listed, with_entry);
}

#[test]
fn constants_are_their_twins() {
    let mut checked = BTreeSet::new();
    let mut found = Vec::new();
    for spec in KERNELS {
        let files: Vec<_> = resolve(FILES, spec.file).unwrap().into_iter().filter(|file| !checked.contains(file)).collect();
        if !files.is_empty() {
            let parsed = Parsed::new(&assemble(spec.file).unwrap()).unwrap();
            found.extend(files.iter().flat_map(|file| check_constants(file, text_of(file), &parsed.module)));
            checked.extend(files);
        }
    }
    assert!(found.is_empty(), "{}", found.join("\n"));
}

#[test]
fn every_kernel_names_its_twin() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    for spec in KERNELS {
        let line = format!("// Twin of {}.", spec.twin);
        assert_eq!(text_of(spec.file).lines().next(), Some(line.as_str()), "the first line of shaders/{}", spec.file);
        let (path, function) = spec.twin.split_once(": ").expect("FILE: FUNCTION");
        let source = std::fs::read_to_string(root.join(path)).unwrap_or_else(|e| panic!("{}: {path}: {e}", spec.file));
        let there = [format!("fn {function}("), format!("fn {function}<")].iter().any(|f| source.contains(f));
        assert!(there, "{}: {path} has no function {function}", spec.file);
    }
}

/// What the checker says of a kernel whose text has `to` in place of `from`.
fn broken(file: &str, from: &str, to: &str) -> Vec<String> {
    let text = assemble(kernel(file).file).unwrap();
    assert!(text.contains(from), "{file} has no \"{from}\"");
    problems(kernel(file), &text.replace(from, to))
}

#[test]
fn the_checker_sees_a_wrong_struct() {
    let said = |from, to, expected: &str| {
        let found = broken("glossy_probes/fill.wgsl", from, to).join("\n");
        assert!(found.contains(expected), "{found}");
    };
    // Renamed, swapped, of another size, and one that the record lacks.
    said("aperture_radius: f32", "aperture: f32", "Camera: member \"aperture\" at 28, in Rust \"aperture_radius\" at 28");
    said(
        "    height: u32,\n    has_previous: u32,",
        "    has_previous: u32,\n    height: u32,",
        "Params: member \"has_previous\" at 84",
    );
    said("    padding0: u32,\n}\n\nconst", "    padding0: vec4<u32>,\n}\n\nconst", "Params: 112 bytes, in Rust 96");
    said(
        "previous_glossy: array<vec4<f32>>;",
        "previous_glossy: array<Own>;\nstruct Own { rgb: vec3<f32> }",
        "previous_glossy: struct Own is not",
    );
    let spec = KernelSpec { structs: &[&scene::lights::EMITTER], ..copy(kernel("shared/closest.wgsl")) };
    let found = problems(&spec, &assemble(spec.file).unwrap()).join("\n");
    assert!(
        found.contains("struct Ray is not in the record") && found.contains("no buffer holds the record's struct EMITTER"),
        "{found}"
    );
}

fn copy(spec: &KernelSpec) -> KernelSpec {
    let KernelSpec { file, twin, workgroup, scene, bindings, structs } = *spec;
    KernelSpec { file, twin, workgroup, scene, bindings, structs }
}

#[test]
fn the_checker_sees_a_wrong_binding() {
    let said = |from: &str, to: &str, expected: &str| {
        let found = broken("glossy_probes/filter_pass.wgsl", from, to).join("\n");
        assert!(found.contains(expected), "{found}");
    };
    said("@binding(3) var<storage, read> source", "@binding(5) var<storage, read> source", "binding 3");
    said(
        "var<storage, read> source",
        "var<storage, read_write> source",
        "binding 3: expected source (Read), found source (ReadWrite)",
    );
    said(
        "var<uniform> filter_params",
        "var<storage, read> filter_params",
        "binding 0: expected filter_params (Uniform), found filter_params (Read)",
    );
    said("fn filter_pass(", "fn filter_passes(", "entry point");
    said("@workgroup_size(16, 4)", "@workgroup_size(8, 4)", "workgroup");
    let closest = copy(kernel("shared/closest.wgsl"));
    let text = assemble(closest.file).unwrap();
    let alone = problems(&KernelSpec { scene: false, ..copy(&closest) }, &text).join("\n");
    assert!(alone.contains("uses the scene"), "{alone}");
    let copied = problems(&closest, &text.replace("scene = scene_params;", "")).join("\n");
    assert!(copied.contains("scene = scene_params"), "{copied}");
    let many = KernelSpec { bindings: &[("rays", Access::Read); 5], ..closest };
    assert!(problems(&many, &text).join("\n").contains("9 storage buffers"));
}

#[test]
fn the_checker_sees_a_wrong_constant_and_a_new_one() {
    let file = "shared/path.wgsl";
    let said = |from: &str, to: &str, expected: &str| {
        let (own, whole) = (text_of(file), assemble("shared/follow.wgsl").unwrap());
        assert!(own.contains(from));
        let parsed = Parsed::new(&whole.replace(from, to)).unwrap();
        let found = check_constants(file, &own.replace(from, to), &parsed.module).join("\n");
        assert!(found.contains(expected) && (expected.is_empty() == found.is_empty()), "\"{found}\"");
    };
    let cap = "const ROULETTE_CAP: f32 = 0.98;";
    said(cap, cap, "");
    said(cap, "const ROULETTE_CAP: f32 = 0.97;", "shared/path.wgsl: ROULETTE_CAP");
    said(cap, &format!("{cap}\nconst OTHER: u32 = 1u;"), "shared/path.wgsl: OTHER has no twin");
    said(cap, &format!("{cap}\nconst OTHER: u32 = 1u; // Own."), "");
    said("const ROULETTE_MERCY: f32 = 4.0;", "const ROULETTE_MERCY: f32 = 4.0; // Own.", "has a twin");
    let parsed = Parsed::new(&assemble("shared/follow.wgsl").unwrap()).unwrap();
    let found = check_constants(file, "", &parsed.module).join("\n");
    assert!(found.contains("shared/path.wgsl: no constant ROULETTE_CAP"), "{found}");
}
