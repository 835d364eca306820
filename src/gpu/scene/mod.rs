//! A scene on the device: what kernels that follow light paths bind as their group 1 (shaders/shared/scene.wgsl).

pub(crate) mod lights;
pub(crate) mod materials;
pub(crate) mod textures;

use super::Gpu;
use super::kernel::layout;
use super::spec::{Access, StructLayout, layout};
use crate::lightmap::LightMap;
use crate::material::bsdf::{Distribution, albedo};
use crate::scene::Emitter;
use crate::transport::World;
use crate::transport::facet::Facet;
use crate::{Error, Result};
use bytemuck::{Pod, Zeroable, cast_slice};
use lights::{emitters, environments, near};
use materials::{Models, tilts};
use obvhs::cwbvh::CwBvh;
use std::sync::Arc;
use textures::Textures;

/// No texture, table or entry.
pub(crate) const NONE: u32 = u32::MAX;

/// Words that frames may have more than the scene: a directional light each, of which an animation adds a thousand at most.
const ROOM: usize = 1024;

/// Depth of the shader's stack. A node leaves at most one entry.
pub(crate) const STACK: usize = 32;

/// `SceneParams` of scene.wgsl.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct SceneParams {
    materials: u32,
    models: u32,
    textures: u32,
    emitters: u32,
    near: u32,
    light_nodes: u32,
    environments: u32,
    environment_count: u32,
    has_near: u32,
    suns: u32,
    corners: u32,
    sun_list: u32,
    sobol: u32,
    albedo: u32,
    light_width: u32,
    light_height: u32,
    light_front: u32,
    light_back: u32,
    light_corners: u32,
}

/// The bindings of group 1.
pub(crate) const BINDINGS: [(&str, Access); 5] = [
    ("scene_params", Access::Uniform),
    ("tree", Access::Read),
    ("facets", Access::Read),
    ("words", Access::Read),
    ("records", Access::Read),
];
const PARAMS: StructLayout = layout!(SceneParams as "SceneParams" {
    materials, models, textures, emitters, near, light_nodes, environments, environment_count, has_near, suns, corners, sun_list, sobol,
    albedo, light_width, light_height, light_front, light_back, light_corners
});
/// The structs of scene.wgsl.
#[cfg_attr(not(test), allow(dead_code, reason = "read by the contract's test"))]
pub(crate) const STRUCTS: [&StructLayout; 3] = [&PARAMS, &textures::IMAGE, &lights::NEAR];
/// The records, as scene.wgsl's constants of these names have them.
#[cfg(test)]
pub(crate) const RECORDS: [&StructLayout; 6] =
    [&materials::MATERIAL, &materials::MODEL, &textures::TEXTURE, &lights::EMITTER, &lights::LIGHT_NODE, &lights::ENVIRONMENT];

/// Words that lie one after the other, found by their offsets.
#[derive(Default)]
pub(crate) struct Words(Vec<u32>);

impl Words {
    fn extend(&mut self, words: impl IntoIterator<Item = u32>) -> u32 {
        let at = self.0.len() as u32;
        self.0.extend(words);
        at
    }

    fn floats(&mut self, values: impl IntoIterator<Item = f32>) -> u32 {
        self.extend(values.into_iter().map(f32::to_bits))
    }
}

/// Lists of records, in rows of four words.
#[derive(Default)]
struct Records(Vec<[u32; 4]>);

impl Records {
    /// Adds a list; its first row.
    fn list<T: Pod>(&mut self, list: &[T]) -> u32 {
        let first = self.0.len() as u32;
        for record in list {
            self.0.extend(bytemuck::bytes_of(record).chunks(16).map(|bytes| {
                let mut row = [0; 16];
                row[..bytes.len()].copy_from_slice(bytes);
                bytemuck::cast::<[u8; 16], [u32; 4]>(row)
            }));
        }
        first
    }
}

/// A scene's triangles, materials and emitters on a device.
#[derive(Clone)]
pub struct GpuScene {
    pub(crate) gpu: Arc<Gpu>,
    tree: wgpu::Buffer,
    facets: wgpu::Buffer,
    words: wgpu::Buffer,
    records: wgpu::Buffer,
    /// Words before those of the light map.
    unlit_words: u64,
    params: SceneParams,
    pub(crate) has_masks: bool,
    pub(crate) layout: wgpu::BindGroupLayout,
    pub(crate) group: wgpu::BindGroup,
}

impl GpuScene {
    /// Uploads what `world` is made of.
    pub fn new(gpu: Arc<Gpu>, world: &World) -> Result<Self> {
        check(world)?;
        let (tree, corners) = tree(world)?;
        let facets: Vec<[u32; 28]> = world.facets.iter().map(words_of).collect();
        let (mut records, mut words) = (Records::default(), Words::default());
        let params = SceneParams { corners, ..params(world, &mut records, &mut words)? };
        let tree = gpu.upload("the scene's tree", cast_slice(&tree))?;
        let facets = gpu.upload("the scene's surfaces", cast_slice(&facets))?;
        words.extend([0; ROOM]);
        let unlit_words = words.0.len() as u64;
        let words = gpu.upload("the scene's textures", cast_slice(&words.0))?;
        let records = gpu.upload("the scene's materials and emitters", cast_slice(&records.0))?;
        let layout = gpu.checked(|| layout(&gpu.device, "scene", BINDINGS.iter().map(|(_, access)| *access)))?;
        let group = group(&gpu, &layout, params, [&tree, &facets, &words, &records])?;
        let has_masks = world.scene.materials.iter().any(|m| m.opacity.is_some());
        Ok(Self { gpu, tree, facets, words, records, unlit_words, params, has_masks, layout, group })
    }

    /// A scene on a device, with a light map where there is one.
    pub fn lit(gpu: Arc<Gpu>, world: &World, lightmap: Option<&LightMap>) -> Result<Self> {
        let scene = Self::new(gpu, world)?;
        match lightmap {
            Some(map) => scene.with_lightmap(map),
            None => Ok(scene),
        }
    }

    /// The same scene with a light map to look diffuse light up in.
    pub fn with_lightmap(&self, map: &LightMap) -> Result<Self> {
        let gpu = &self.gpu;
        let unlit = self.unlit_words as u32;
        let texels = |side: &[crate::base::math::Rgb]| side.iter().flat_map(|c| c.to_array()).collect::<Vec<f32>>();
        let mut light = Words::default();
        let light_front = unlit + light.floats(texels(&map.front));
        let light_back = map.back.as_ref().map_or(NONE, |back| unlit + light.floats(texels(back)));
        let light_corners = unlit + light.floats(map.corners.iter().flatten().flat_map(|p| p.to_array()));
        let [light_width, light_height] = map.size;
        let params = SceneParams { light_width, light_height, light_front, light_back, light_corners, ..self.params };
        let before = self.unlit_words * size_of::<u32>() as u64;
        let light: &[u8] = cast_slice(&light.0);
        let words = gpu.output("the scene's textures and light map", before + light.len() as u64)?;
        gpu.checked(|| {
            let mut encoder = gpu.device.create_command_encoder(&Default::default());
            encoder.copy_buffer_to_buffer(&self.words, 0, &words, 0, before);
            gpu.queue.write_buffer(&words, before, light);
            gpu.queue.submit([encoder.finish()]);
        })?;
        let group = group(gpu, &self.layout, params, [&self.tree, &self.facets, &words, &self.records])?;
        Ok(Self { words, params, group, ..self.clone() })
    }

    /// Of a scene with a light map: the same triangles with the materials and emitters of a frame's world, and the light map as it is. The
    /// scene itself is no longer of use: both share what lies before the light map, which is written anew.
    ///
    /// # Errors
    /// The frame adds shapes, or makes some emit that do not in the scene.
    pub(crate) fn at(&self, world: &World) -> Result<Self> {
        check(world)?;
        let gpu = &self.gpu;
        let (mut records, mut words) = (Records::default(), Words::default());
        let fresh = params(world, &mut records, &mut words)?;
        if words.0.len() as u64 > self.unlit_words {
            return Err(Error::Request("--lights: a frame's textures are more than the scene's; use --device cpu".into()));
        }
        let SceneParams { corners, light_width, light_height, light_front, light_back, light_corners, .. } = self.params;
        let params = SceneParams { corners, light_width, light_height, light_front, light_back, light_corners, ..fresh };
        gpu.checked(|| gpu.queue.write_buffer(&self.words, 0, cast_slice(&words.0)))?;
        let records = gpu.upload("the scene's materials and emitters", cast_slice(&records.0))?;
        let group = group(gpu, &self.layout, params, [&self.tree, &self.facets, &self.words, &records])?;
        Ok(Self { records, params, group, ..self.clone() })
    }

    /// What it takes on the device, bytes.
    pub(crate) fn bytes(&self) -> u64 {
        [&self.tree, &self.facets, &self.words, &self.records].map(wgpu::Buffer::size).iter().sum()
    }

    /// The buffer that the light map lies in, and the word where it begins: three floats a texel, all of the front and then of the back.
    pub(crate) fn light_words(&self) -> (&wgpu::Buffer, u32) {
        (&self.words, self.params.light_front)
    }

    /// Whether there is a light map to look diffuse light up in.
    pub(crate) fn has_lightmap(&self) -> bool {
        self.params.light_width > 0
    }

    /// The device's name.
    pub fn device(&self) -> &str {
        &self.gpu.adapter.name
    }
}

/// An error where a world has what no kernel knows.
fn check(world: &World) -> Result<()> {
    if let Some(material) = world.scene.materials.iter().find(|m| tilts(&m.bsdf) > 1) {
        return Err(Error::Request(format!(
            "material \"{}\": the GPU has no bump or normal map within another; use --device cpu",
            material.name
        )));
    }
    if !world.scene.geometry.rounds.is_empty() {
        return Err(Error::Request(format!(
            "{} spheres, cylinders and disks are too many for fine meshes, and the GPU has no round shapes; use --device cpu",
            world.scene.geometry.rounds.len()
        )));
    }
    if world.added.is_some() || world.relit {
        let message = "the GPU has no shapes and no area lights beside those of the scene file; use --device cpu";
        return Err(Error::Request(message.into()));
    }
    let is_pattern = |e: &Emitter| matches!(e, Emitter::Projector { .. } | Emitter::Spot { pattern: Some(_), .. });
    if world.scene.emitters.iter().any(is_pattern) {
        let message = "the GPU has no projector and no spot with a texture; use --device cpu";
        return Err(Error::Request(message.into()));
    }
    Ok(())
}

fn group(gpu: &Gpu, layout: &wgpu::BindGroupLayout, params: SceneParams, buffers: [&wgpu::Buffer; 4]) -> Result<wgpu::BindGroup> {
    let params = gpu.uniform("the scene's parameters", &params)?;
    let [tree, facets, words, records] = buffers;
    gpu.checked(|| gpu.group(layout, &[&params, tree, facets, words, records]))
}

/// Fills the lists of records and of words; where they begin. Without a light map.
fn params(world: &World, records: &mut Records, words: &mut Words) -> Result<SceneParams> {
    let sobol = words.extend((0..16).flat_map(|i| (0..4).map(move |d| sobol_burley::parts::sobol_rev(1 << (31 - i), d))));
    let albedos = [Distribution::Beckmann, Distribution::Ggx].map(|d| albedo::table(d).iter().flat_map(|v| v.to_array()));
    let albedo = words.floats(albedos.into_iter().flatten());
    let sun_list = words.extend(world.lights.suns.iter().copied());
    let mut textures = Textures::default();
    let mut models = Models { list: Vec::new(), textures: &mut textures, words: &mut *words };
    let materials: Vec<_> = world.scene.materials.iter().map(|m| models.material(m)).collect();
    let models = models.list;
    let emitters = emitters(world, &mut textures, words);
    let environments = environments(world, &mut textures, words);
    if let Some(what) = textures.unknown {
        return Err(Error::Request(format!("the GPU has no {what}; use --device cpu")));
    }
    Ok(SceneParams {
        materials: records.list(&materials),
        models: records.list(&models),
        textures: records.list(&textures.list),
        emitters: records.list(&emitters),
        near: records.list(&near(world)),
        light_nodes: records.list(&world.lights.tree.nodes),
        environments: records.list(&environments),
        environment_count: environments.len() as u32,
        has_near: u32::from(!world.lights.tree.is_empty()),
        suns: world.lights.suns.len() as u32,
        corners: 0,
        sun_list,
        sobol,
        albedo,
        light_width: 0,
        light_height: 0,
        light_front: NONE,
        light_back: NONE,
        light_corners: NONE,
    })
}

/// The compressed tree, five entries a node, and from the given entry on three vectors a primitive: the bits of its corners, with the
/// triangle, its material if that lets rays through, and its object.
fn tree(world: &World) -> Result<(Vec<[u32; 4]>, u32)> {
    let geometry = &world.scene.geometry;
    let (tree, triangles) = world.bvh.compressed(geometry);
    if depth(&tree) > STACK {
        return Err(Error::Request(format!(
            "the scene's tree is more than {STACK} nodes deep, too deep for the GPU; use --device cpu"
        )));
    }
    let mut entries: Vec<[u32; 4]> = cast_slice(&tree.nodes).to_vec();
    let corners = entries.len() as u32;
    entries.extend(triangles.iter().flat_map(|&t| {
        let [a, b, c] = geometry.corners(t);
        let object = geometry.triangle_object[t as usize];
        let material = geometry.objects[object as usize].material;
        let masked = world.scene.materials[material as usize].opacity.is_some();
        let material = if masked { material } else { NONE };
        [(a, t), (b, material), (c, object)].map(|(p, word)| [p.x.to_bits(), p.y.to_bits(), p.z.to_bits(), word])
    }));
    Ok((entries, corners))
}

/// A facet's seven vectors.
fn words_of(facet: &Facet) -> [u32; 28] {
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
