//! The files that a scene names: each is read once, all in parallel, and hashed.

use super::params::Ids;
use super::tree::{Kind, Node, Param, Value};
use crate::material::image;
use crate::material::image::Image;
use crate::scene::mesh as shapes;
use crate::scene::mesh::Mesh;
use crate::{Error, Result};
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// What to make of a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Use {
    Obj,
    Ply,
    Serialized(u32),
    Image { raw: bool },
}

enum Content {
    Mesh(Arc<Mesh>),
    Image(Arc<Image>),
}

/// Meshes and images by file.
pub struct Assets {
    contents: BTreeMap<(PathBuf, Use), Content>,
    hashes: BTreeMap<PathBuf, blake3::Hash>,
}

impl Assets {
    /// Reads every file under `children`. The error, if any, is that of the first bad file in scene order.
    pub fn load(children: &[Param]) -> Result<Self> {
        let mut uses = Vec::new();
        walk(children, &mut |node| {
            if let Some(file) = file_of(node) {
                uses.extend(use_of(node).map(|u| (file.to_owned(), u)));
            }
        });
        let mut files: Vec<PathBuf> = uses.iter().map(|(f, _)| f.clone()).collect();
        first_of_each(&mut uses);
        first_of_each(&mut files);
        let contents: Vec<Result<Content>> = uses.par_iter().map(|(file, u)| read(file, *u)).collect();
        let contents = contents.into_iter().collect::<Result<Vec<_>>>()?;
        let hashes: Vec<Result<blake3::Hash>> = files.par_iter().map(|f| hash(f)).collect();
        let hashes = hashes.into_iter().collect::<Result<Vec<_>>>()?;
        Ok(Self { contents: uses.into_iter().zip(contents).collect(), hashes: files.into_iter().zip(hashes).collect() })
    }

    /// The mesh of a shape plugin that names a file.
    pub fn mesh(&self, node: &Node) -> Result<Arc<Mesh>> {
        match self.content(node)? {
            Content::Mesh(mesh) => Ok(mesh.clone()),
            Content::Image(_) => Err(node.at.error("found an image, expected a mesh")),
        }
    }

    /// The image of a plugin that names a file.
    pub fn image(&self, node: &Node) -> Result<Arc<Image>> {
        match self.content(node)? {
            Content::Image(image) => Ok(image.clone()),
            Content::Mesh(_) => Err(node.at.error("found a mesh, expected an image")),
        }
    }

    /// The hash of a file's bytes.
    pub fn hash(&self, file: &Path) -> Option<&blake3::Hash> {
        self.hashes.get(file)
    }

    fn content(&self, node: &Node) -> Result<&Content> {
        let key = file_of(node).zip(use_of(node)).map(|(file, u)| (file.to_owned(), u));
        let found = key.and_then(|key| self.contents.get(&key));
        found.ok_or_else(|| node.at.error(format!("{} has no \"filename\"", node.plugin)))
    }
}

/// Every plugin under `children`, parents before their children, in file order.
pub fn walk<'a>(children: &'a [Param], visit: &mut dyn FnMut(&'a Node)) {
    for child in children {
        if let Value::Plugin(node) = &child.value {
            visit(node);
            walk(&node.params, visit);
        }
    }
}

/// Every plugin with an id; two of the same id are an error.
pub fn ids(children: &[Param]) -> Result<Ids<'_>> {
    let mut ids = Ids::new();
    let mut result = Ok(());
    walk(children, &mut |node| {
        if let Some(id) = &node.id
            && let Some(first) = ids.insert(id, node)
            && result.is_ok()
        {
            let before = format!("{}:{}", first.at.file.display(), first.at.line);
            result = Err(node.at.error(format!("the id \"{id}\" is given twice, first at {before}")));
        }
    });
    result.map(|()| ids)
}

fn file_of(node: &Node) -> Option<&Path> {
    node.params.iter().rev().find_map(|p| match &p.value {
        Value::File(f) => Some(f.as_path()),
        _ => None,
    })
}

fn use_of(node: &Node) -> Option<Use> {
    let integer = |name: &str| {
        node.params.iter().rev().find_map(|p| match p.value {
            Value::Integer(i) if p.name == name => Some(i),
            _ => None,
        })
    };
    Some(match (node.kind, node.plugin.as_str()) {
        (Kind::Shape, "obj") => Use::Obj,
        (Kind::Shape, "ply") => Use::Ply,
        (Kind::Shape, "serialized") => Use::Serialized(integer("shape_index").and_then(|i| i.try_into().ok()).unwrap_or(0)),
        (Kind::Texture, "bitmap") => Use::Image { raw: is_raw(node) },
        (Kind::Emitter, "envmap") => Use::Image { raw: false },
        _ => return None,
    })
}

/// Whether a bitmap's integers are linear: `raw`, or 0.6's `gamma` of 1.
fn is_raw(node: &Node) -> bool {
    node.params.iter().any(|p| match (p.name.as_str(), &p.value) {
        ("raw", Value::Bool(b)) => *b,
        ("gamma", Value::Float(g)) => *g == 1.0,
        ("gamma", Value::Integer(g)) => *g == 1,
        _ => false,
    })
}

fn read(file: &Path, what: Use) -> Result<Content> {
    Ok(match what {
        Use::Obj => Content::Mesh(Arc::new(shapes::obj::load(file)?)),
        Use::Ply => Content::Mesh(Arc::new(shapes::ply::load(file)?)),
        Use::Serialized(index) => Content::Mesh(Arc::new(shapes::serialized::load(file, index as usize)?)),
        Use::Image { raw } => Content::Image(Arc::new(image::read(file, raw)?)),
    })
}

fn hash(file: &Path) -> Result<blake3::Hash> {
    let mut hasher = blake3::Hasher::new();
    let opened = std::fs::File::open(file).map_err(|e| Error::io(file, e))?;
    hasher.update_reader(opened).map_err(|e| Error::io(file, e))?;
    Ok(hasher.finalize())
}

/// Leaves out repetitions; what remains stays in order.
fn first_of_each<T: Clone + Ord>(items: &mut Vec<T>) {
    let mut seen = std::collections::BTreeSet::new();
    items.retain(|item| seen.insert(item.clone()));
}
