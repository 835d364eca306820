//! The house keeps its rules: arrows between rooms run down, methods do not know one another, and files stay short.
//!
//! Read from the source's text: every path that starts at `crate`, outside of test modules and comments.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

/// Rooms of the library from the ground up: each may look into those before it.
const FLOORS: [&str; 15] = [
    "base",
    "io",
    "material",
    "scene",
    "exchange",
    "transport",
    "surface",
    "lightmap",
    "view",
    "probe",
    "gpu",
    "method",
    "metric",
    "export",
    "plan",
];
/// Rooms that know no method, whatever stands above them.
const KNOW_NO_METHOD: [&str; 2] = ["gpu", "metric"];

/// A source file and its text without test modules.
struct Source {
    path: String,
    text: String,
}

impl Source {
    /// The paths that the code names after `crate::`, as lists of words; groups in braces count by what stands before them.
    fn paths(&self) -> Vec<Vec<&str>> {
        self.text.lines().filter(|line| !line.trim_start().starts_with("//")).flat_map(paths).collect()
    }
}

fn sources() -> Vec<Source> {
    fn walk(folder: &Path, found: &mut Vec<PathBuf>) {
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            match path.is_dir() {
                true => walk(&path, found),
                false => found.extend(path.extension().is_some_and(|e| e == "rs").then_some(path)),
            }
        }
    }
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut files = Vec::new();
    walk(&root, &mut files);
    files.sort();
    assert!(files.len() > 150, "found {} files only", files.len());
    let source = |file: PathBuf| {
        let text = std::fs::read_to_string(&file).unwrap();
        let text = text.split("#[cfg(test)]\nmod tests {").next().unwrap_or_default().to_owned();
        Source { path: file.strip_prefix(&root).unwrap().to_string_lossy().replace('\\', "/"), text }
    };
    let is_test = |s: &Source| s.path.ends_with("tests.rs") || s.path.ends_with("testing.rs");
    files.into_iter().map(source).filter(|s| !is_test(s)).collect()
}

fn paths(text: &str) -> Vec<Vec<&str>> {
    let start = "crate::";
    let is_word = |c: char| c.is_alphanumeric() || c == '_';
    let mut found = Vec::new();
    for (at, _) in text.match_indices(start) {
        if text[..at].ends_with(|c: char| is_word(c) || c == ':') {
            continue;
        }
        let mut words = Vec::new();
        let mut rest = &text[at + start.len()..];
        loop {
            let end = rest.find(|c| !is_word(c)).unwrap_or(rest.len());
            if end == 0 {
                break;
            }
            words.push(&rest[..end]);
            match rest[end..].strip_prefix("::") {
                Some(more) => rest = more,
                None => break,
            }
        }
        found.push(words);
    }
    found
}

/// The first folder or file of a path under src/.
fn room(path: &str) -> &str {
    path.split('/').next().unwrap_or_default()
}

#[test]
fn arrows_between_rooms_run_down() {
    let floor = |room: &str| FLOORS.iter().position(|r| *r == room);
    let mut up = Vec::new();
    let mut arrows = 0;
    for source in sources() {
        let path = &source.path;
        let Some(here) = floor(room(path)) else {
            assert!(
                ["lib.rs", "bin"].contains(&room(path)),
                "{path}: a room without a floor; give it one in this test and ARCHITECTURE.md"
            );
            continue;
        };
        for words in source.paths() {
            let Some(there) = words.first().and_then(|word| floor(word)) else { continue };
            arrows += 1;
            let is_up = there > here || (KNOW_NO_METHOD.contains(&FLOORS[here]) && FLOORS[there] == "method");
            if is_up {
                up.push(format!("{path} names {}", words.join("::")));
            }
        }
    }
    assert!(arrows > 500, "found {arrows} arrows only");
    assert!(up.is_empty(), "arrows that run up:\n{}", up.join("\n"));
}

#[test]
fn no_method_knows_another() {
    let mut wrong = Vec::new();
    for source in sources() {
        let path = &source.path;
        // The test that holds all kernels against their shaders names them all.
        if path.starts_with("method/contract/") {
            continue;
        }
        let Some(mine) = path.strip_prefix("method/").and_then(|p| p.split_once('/')).map(|(folder, _)| folder) else { continue };
        let methods: Vec<String> = std::fs::read_dir(Path::new(env!("CARGO_MANIFEST_DIR")).join("src/method"))
            .unwrap()
            .filter_map(|e| e.unwrap().file_name().into_string().ok())
            .filter(|name| !name.ends_with(".rs"))
            .collect();
        for words in source.paths().into_iter().filter(|words| words.first() == Some(&"method")) {
            let is_other = |word: &&str| methods.iter().any(|m| m == word) && *word != mine;
            if words.get(1).is_some_and(is_other) {
                wrong.push(format!("{path} names {}", words.join("::")));
            }
        }
    }
    assert!(wrong.is_empty(), "methods that know others:\n{}", wrong.join("\n"));
}

#[test]
fn the_binary_alone_sees_the_command_line() {
    for Source { path, text } in sources().into_iter().filter(|s| room(&s.path) != "bin") {
        for word in ["clap::", "indicatif::", "anyhow::"] {
            assert!(!text.contains(word), "{path} names {word}");
        }
    }
}

/// The binary's files name one another by `crate::`, and folders of the library by `reprobe::`.
#[test]
fn no_circle_joins_files_of_the_binary() {
    let mut arrows: BTreeMap<String, BTreeSet<String>> = BTreeMap::new();
    for source in sources().into_iter().filter(|s| room(&s.path) == "bin") {
        let name = source.path.rsplit('/').next().unwrap_or_default().trim_end_matches(".rs").to_owned();
        let others = source.paths().into_iter().filter_map(|words| Some((*words.first()?).to_owned()));
        arrows.entry(name).or_default().extend(others);
    }
    assert!(arrows.len() > 10);
    fn reaches(arrows: &BTreeMap<String, BTreeSet<String>>, from: &str, goal: &str, seen: &mut BTreeSet<String>) -> bool {
        let Some(next) = arrows.get(from) else { return false };
        next.iter().any(|n| n == goal || seen.insert(n.clone()) && reaches(arrows, n, goal, seen))
    }
    for name in arrows.keys() {
        assert!(!reaches(&arrows, name, name, &mut BTreeSet::new()), "{name} reaches itself");
    }
}

/// Longer functions, each with the reason.
const LONG_FUNCTIONS: [(&str, &str); 4] = [
    ("gpu/scene/materials.rs: add", "a table: an arm a scattering model"),
    ("method/contract/constants.rs: twins", "a table: an entry a shader"),
    ("plan/variant.rs: paper_ablations", "a table: an entry an experiment"),
    ("surface/meyer.rs: curvature", "one derivation, from a vertex's ring to its principal curvatures"),
];

#[test]
fn files_and_functions_can_be_held_in_the_head() {
    let (mut files, mut functions) = (Vec::new(), Vec::new());
    for Source { path, text } in sources() {
        let lines: Vec<&str> = text.lines().collect();
        if lines.len() >= 400 {
            files.push(format!("{path}: {} lines", lines.len()));
        }
        let mut start: Option<(usize, usize, &str)> = None;
        for (i, line) in lines.iter().enumerate() {
            let indent = line.len() - line.trim_start().len();
            let words = line.trim_start();
            let is_fn = ["fn ", "pub fn ", "pub(crate) fn ", "pub(super) fn ", "const fn ", "pub const fn ", "unsafe fn "];
            if start.is_none() && is_fn.iter().any(|f| words.starts_with(f)) {
                start = Some((i, indent, words));
            }
            if let Some((first, at, name)) = start
                && (words.starts_with('}') && indent == at || i == first && words.ends_with('}'))
            {
                let name = name.split(['(', '<']).next().unwrap_or_default().rsplit(' ').next().unwrap_or_default();
                let name = format!("{path}: {name}");
                if i + 1 - first > 60 && !LONG_FUNCTIONS.iter().any(|(long, _)| *long == name) {
                    functions.push(format!("{name}, {} lines", i + 1 - first));
                }
                start = None;
            }
        }
    }
    assert!(files.is_empty() && functions.is_empty(), "too long:\n{}\n{}", files.join("\n"), functions.join("\n"));
}
