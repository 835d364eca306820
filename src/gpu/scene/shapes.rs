//! Triangles on the device: those of the scene, and behind them those that a frame adds, each with a tree. Twin of what [`World`] traces.

use super::{NONE, STACK};
use crate::gpu::Gpu;
use crate::transport::World;
use crate::transport::bvh::Bvh;
use crate::transport::facet::Facet;
use crate::transport::world::Added;
use crate::{Error, Result};
use bytemuck::cast_slice;
use obvhs::cwbvh::CwBvh;
use obvhs::cwbvh::node::CwBvhNode;
use std::num::NonZeroU32;
use std::sync::Arc;

/// Entries of a node, and of a primitive.
const NODE: u32 = (size_of::<CwBvhNode>() / size_of::<Entry>()) as u32;
const PRIMITIVE: u32 = 3;

/// A vector of the tree.
type Entry = [u32; 4];
/// A facet's seven vectors.
type FacetWords = [u32; 28];

/// Triangles, as scene.wgsl has them.
#[derive(Clone)]
pub(super) struct Shapes {
    pub(super) tree: wgpu::Buffer,
    pub(super) facets: wgpu::Buffer,
    /// The first entry of the primitives.
    pub(super) corners: u32,
    /// The scene's own triangles.
    pub(super) triangles: u32,
    /// The root of the tree over what a frame adds; [`NONE`] where it adds nothing.
    pub(super) added: u32,
    /// Entries of the scene's own tree.
    entries: u32,
    /// Of each of the scene's objects, the emitter that its facets name.
    emitters: Arc<[Option<u32>]>,
}

impl Shapes {
    /// Of a scene, or of a frame of it.
    pub(super) fn new(gpu: &Gpu, world: &World) -> Result<Self> {
        let (nodes, primitives) = tree(world, &world.bvh)?;
        let corners = NODE * nodes.len() as u32;
        let entries = [cast_slice(&nodes), &primitives[..]].concat();
        let facets: Vec<FacetWords> = world.facets.iter().map(words_of).collect();
        let own = world.scene.geometry.objects.iter().filter(|o| o.triangles.end as usize <= facets.len());
        let emitter = |first: u32| world.facets.get(first as usize)?.emitter.map(|e| e.get() - 1);
        let scene = Self {
            tree: gpu.upload("the scene's tree", cast_slice(&entries))?,
            facets: gpu.upload("the scene's surfaces", cast_slice(&facets))?,
            corners,
            triangles: facets.len() as u32,
            added: NONE,
            entries: entries.len() as u32,
            emitters: own.map(|o| emitter(o.triangles.start)).collect(),
        };
        scene.at(gpu, world)
    }

    /// Those of a frame. The frame before is no longer of use: both share the buffers, as long as these have room.
    pub(super) fn at(&self, gpu: &Gpu, world: &World) -> Result<Self> {
        let mut shapes = Self { added: NONE, ..self.clone() };
        shapes.relight(gpu, world)?;
        if let Some(added) = &world.added {
            shapes.add(gpu, world, added)?;
        }
        Ok(shapes)
    }

    /// Has the facets of the scene's own objects name the frame's emitters.
    fn relight(&mut self, gpu: &Gpu, world: &World) -> Result<()> {
        let objects = || world.scene.geometry.objects.iter().zip(self.emitters.iter());
        if objects().all(|(object, emitter)| object.emitter == *emitter) {
            return Ok(());
        }
        for (object, _) in objects().filter(|(object, emitter)| object.emitter != **emitter) {
            let emitter = object.emitter.and_then(|e| NonZeroU32::new(e + 1));
            let [first, end] = [object.triangles.start, object.triangles.end].map(|t| t as usize);
            let mut facets = world.facets[first..end].to_vec();
            facets.iter_mut().for_each(|facet| facet.emitter = emitter);
            let facets: Vec<FacetWords> = facets.iter().map(words_of).collect();
            let place = (first * size_of::<FacetWords>()) as u64;
            gpu.checked(|| gpu.queue.write_buffer(&self.facets, place, cast_slice(&facets)))?;
        }
        self.emitters = objects().map(|(object, _)| object.emitter).collect();
        Ok(())
    }

    /// Puts a frame's triangles behind the scene's own, where their numbers say. Their nodes and primitives are numbered from the beginning of
    /// the buffer, so that kernels walk both trees alike.
    fn add(&mut self, gpu: &Gpu, world: &World, added: &Added) -> Result<()> {
        let facets: Vec<FacetWords> = added.facets.iter().map(words_of).collect();
        let before = u64::from(self.triangles) * size_of::<FacetWords>() as u64;
        self.facets = behind(gpu, &self.facets, before, before, cast_slice(&facets))?;
        let (mut nodes, primitives) = tree(world, &added.bvh)?;
        if primitives.is_empty() {
            return Ok(());
        }
        let root = self.entries.div_ceil(NODE);
        let nodes_end = NODE * (root + nodes.len() as u32);
        let first_primitive = (nodes_end - self.corners).div_ceil(PRIMITIVE);
        for node in &mut nodes {
            node.child_base_idx += root;
            node.primitive_base_idx += first_primitive;
        }
        let gap = self.corners + PRIMITIVE * first_primitive - nodes_end;
        let entries = [cast_slice(&nodes), &vec![Entry::default(); gap as usize], &primitives[..]].concat();
        let bytes = |entries: u32| u64::from(entries) * size_of::<Entry>() as u64;
        self.tree = behind(gpu, &self.tree, bytes(self.entries), bytes(NODE * root), cast_slice(&entries))?;
        self.added = root;
        Ok(())
    }
}

/// Writes `content` into a buffer, from the byte `at` on, or where it has no room into a larger one that begins with the same `kept` bytes.
fn behind(gpu: &Gpu, buffer: &wgpu::Buffer, kept: u64, at: u64, content: &[u8]) -> Result<wgpu::Buffer> {
    let mut buffer = buffer.clone();
    let size = at + content.len() as u64;
    if buffer.size() < size {
        // Trees of the same shapes are not of the same size in all frames.
        let larger = gpu.output("shapes of a frame", size + (content.len() as u64 / 8).next_multiple_of(16))?;
        gpu.checked(|| {
            let mut encoder = gpu.device.create_command_encoder(&Default::default());
            encoder.copy_buffer_to_buffer(&buffer, 0, &larger, 0, kept);
            gpu.queue.submit([encoder.finish()]);
        })?;
        buffer = larger;
    }
    gpu.checked(|| gpu.queue.write_buffer(&buffer, at, content))?;
    Ok(buffer)
}

/// A compressed tree's nodes and primitives, in the order of its leaves: the bits of a primitive's corners, with the triangle, its material if
/// that lets rays through, and its object.
fn tree(world: &World, bvh: &Bvh) -> Result<(Vec<CwBvhNode>, Vec<Entry>)> {
    let geometry = &world.scene.geometry;
    let (tree, triangles) = bvh.compressed(geometry);
    // An entry of the stack is the other tree's root.
    if depth(&tree) >= STACK {
        return Err(Error::Request(format!(
            "the scene's tree is {STACK} nodes deep or more, too deep for the GPU; use --device cpu"
        )));
    }
    let primitive = |&t: &u32| {
        let [a, b, c] = geometry.corners(t);
        let object = geometry.triangle_object[t as usize];
        let material = geometry.objects[object as usize].material;
        let masked = world.scene.materials[material as usize].opacity.is_some();
        let material = if masked { material } else { NONE };
        [(a, t), (b, material), (c, object)].map(|(p, word)| [p.x.to_bits(), p.y.to_bits(), p.z.to_bits(), word])
    };
    Ok((tree.nodes, triangles.iter().flat_map(primitive).collect()))
}

/// A facet's seven vectors.
fn words_of(facet: &Facet) -> FacetWords {
    let mut words = [0; 28];
    let vectors = facet.corners.iter().chain(&facet.normals).flat_map(|v| v.to_array());
    let floats = vectors.chain(facet.uvs.iter().flat_map(|v| v.to_array()));
    for (word, value) in words.iter_mut().zip(floats) {
        *word = value.to_bits();
    }
    words[24..].copy_from_slice(&[facet.object, facet.material, facet.emitter.map_or(0, |e| e.get()), facet.extent.to_bits()]);
    words
}

/// Nodes from the root to the deepest leaf.
fn depth(tree: &CwBvh) -> usize {
    let mut deepest = 0;
    let mut todo = vec![(0, 1)];
    while let Some((node, level)) = todo.pop() {
        let Some(node) = tree.nodes.get(node) else { continue };
        deepest = deepest.max(level);
        let children = node.imask.count_ones();
        todo.extend((0..children).map(|i| ((node.child_base_idx + i) as usize, level + 1)));
    }
    deepest
}
