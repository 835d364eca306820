//! The files that a scene names: each is read once, all in parallel.

use super::params::Ids;
use super::tree::{Kind, Node, Param, Value};
use crate::exchange::mesh::{MeshAttribute, MeshFile, obj, ply, serialized};
use crate::material::image;
use crate::material::image::Image;
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
    Mesh(Arc<Mesh>, Vec<MeshAttribute>),
    Image(Arc<Image>),
}

/// Meshes and images by file.
pub struct Assets {
    contents: BTreeMap<(PathBuf, Use), Content>,
    warnings: Vec<String>,
}

impl Assets {
    /// Reads every file under `children`. The error, if any, tells of all bad files in scene order.
    pub fn load(children: &[Param], allow_truncated: bool) -> Result<Self> {
        let mut uses = Vec::new();
        walk(children, &mut |node| {
            if let Some(file) = file_of(node) {
                uses.extend(use_of(node).map(|u| (file.to_owned(), u)));
            }
        });
        first_of_each(&mut uses);
        let read_all: Vec<_> = uses.par_iter().map(|(file, u)| read(file, *u, allow_truncated)).collect();
        let (contents, odd): (Vec<_>, Vec<_>) = Error::gather(read_all)?.into_iter().unzip();
        let warnings = odd.into_iter().flatten().collect();
        Ok(Self { contents: uses.into_iter().zip(contents).collect(), warnings })
    }

    /// What was odd about the files, but no error.
    pub fn warnings(&self) -> &[String] {
        &self.warnings
    }

    /// The mesh of a shape plugin that names a file.
    pub fn mesh(&self, node: &Node) -> Result<Arc<Mesh>> {
        match self.content(node)? {
            Content::Mesh(mesh, _) => Ok(mesh.clone()),
            Content::Image(_) => Err(node.at.error("found an image, expected a mesh")),
        }
    }

    /// What the mesh of a shape plugin that names a file says of its vertices and faces.
    pub fn attributes(&self, node: &Node) -> &[MeshAttribute] {
        match self.content(node) {
            Ok(Content::Mesh(_, attributes)) => attributes,
            _ => &[],
        }
    }

    /// The image of a plugin that names a file.
    pub fn image(&self, node: &Node) -> Result<Arc<Image>> {
        match self.content(node)? {
            Content::Image(image) => Ok(image.clone()),
            Content::Mesh(..) => Err(node.at.error("found a mesh, expected an image")),
        }
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

/// What a file holds, and what is odd about it.
fn read(file: &Path, what: Use, allow_truncated: bool) -> Result<(Content, Vec<String>)> {
    let mesh = |file: MeshFile| (Content::Mesh(Arc::new(file.mesh), file.attributes), Vec::new());
    Ok(match what {
        Use::Obj => mesh(obj::load(file)?),
        Use::Ply => mesh(ply::load(file)?),
        Use::Serialized(index) => mesh(serialized::load(file, index as usize)?),
        Use::Image { raw } => {
            let take = if raw { image::Take::Linear } else { image::Take::Color };
            let (image, odd) = image::read(file, image::ReadOptions { take, allow_truncated })?;
            (Content::Image(Arc::new(image)), odd)
        }
    })
}

/// Leaves out repetitions; what remains stays in order.
fn first_of_each<T: Clone + Ord>(items: &mut Vec<T>) {
    let mut seen = std::collections::BTreeSet::new();
    items.retain(|item| seen.insert(item.clone()));
}
