//! A scene on the device: what kernels that follow light paths bind as their group 1 (shaders/scene.wgsl).

mod lights;
mod materials;
mod textures;

use super::Gpu;
use crate::lightmap::LightMap;
use crate::material::bsdf::{Distribution, albedo};
use crate::transport::World;
use crate::transport::facet::Facet;
use crate::{Error, Result};
use bytemuck::{Pod, Zeroable, cast_slice};
use lights::{emitters, environments, near};
use materials::{Models, tilts};
use obvhs::cwbvh::CwBvh;
use std::sync::Arc;
use textures::Textures;

/// What traces rays through a scene.
pub(crate) const RAYS: &str = concat!(
    include_str!("../../../shaders/math.wgsl"),
    include_str!("../../../shaders/random.wgsl"),
    include_str!("../../../shaders/scene.wgsl"),
    include_str!("../../../shaders/texture.wgsl"),
    include_str!("../../../shaders/surface.wgsl"),
    include_str!("../../../shaders/traverse.wgsl"),
);

/// What scatters light, after [`RAYS`].
pub(crate) const MATERIALS: &str = concat!(
    include_str!("../../../shaders/fresnel.wgsl"),
    include_str!("../../../shaders/microfacet.wgsl"),
    include_str!("../../../shaders/models.wgsl"),
    include_str!("../../../shaders/principled.wgsl"),
    include_str!("../../../shaders/bsdf.wgsl"),
    include_str!("../../../shaders/albedo.wgsl"),
);

/// What follows paths, after [`MATERIALS`].
pub(crate) const PATHS: &str = concat!(
    include_str!("../../../shaders/light_tree.wgsl"),
    include_str!("../../../shaders/envmap.wgsl"),
    include_str!("../../../shaders/lights.wgsl"),
    include_str!("../../../shaders/lightmap.wgsl"),
    include_str!("../../../shaders/path.wgsl"),
);

/// No texture, table or entry.
const NONE: u32 = u32::MAX;

/// Depth of the shader's stack. A node leaves at most one entry.
const STACK: usize = 32;

/// `SceneParams` of scene.wgsl.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct SceneParams {
    environments: u32,
    suns: u32,
    sun_list: u32,
    has_near: u32,
    sobol: u32,
    albedo: u32,
    light_width: u32,
    light_height: u32,
    light_back: u32,
}

/// Words that several bindings share, by their offsets.
#[derive(Default)]
struct Tables(Vec<u32>);

impl Tables {
    fn words(&mut self, words: impl IntoIterator<Item = u32>) -> u32 {
        let at = self.0.len() as u32;
        self.0.extend(words);
        at
    }

    fn floats(&mut self, values: impl IntoIterator<Item = f32>) -> u32 {
        self.words(values.into_iter().map(f32::to_bits))
    }
}

/// A scene's triangles, materials and emitters on a device.
#[derive(Clone)]
pub struct GpuScene {
    pub(crate) gpu: Arc<Gpu>,
    /// The bindings before `scene`, in order.
    fixed: Vec<wgpu::Buffer>,
    params: SceneParams,
    /// Bytes of the light map.
    light_bytes: u64,
    pub(crate) has_masks: bool,
    pub(crate) layout: wgpu::BindGroupLayout,
    pub(crate) group: wgpu::BindGroup,
}

/// Bindings of the group.
const BINDINGS: u32 = 16;

impl GpuScene {
    /// Uploads what `world` is made of.
    pub fn new(gpu: Arc<Gpu>, world: &World) -> Result<Self> {
        let available = gpu.device.limits().max_storage_buffers_per_shader_stage;
        if available < BINDINGS + 4 {
            return Err(Error::Request(format!(
                "GPU \"{}\" binds {available} buffers to a kernel, too few for a scene; use --device cpu",
                gpu.adapter.name
            )));
        }
        if let Some(material) = world.scene.materials.iter().find(|m| tilts(&m.bsdf) > 1) {
            return Err(Error::Request(format!(
                "material \"{}\": the GPU has no bump or normal map within another; use --device cpu",
                material.name
            )));
        }
        let (nodes, corners) = tree(world)?;
        let facets: Vec<[u32; 28]> = world.facets.iter().map(words).collect();
        let (mut textures, mut tables) = (Textures::default(), Tables::default());
        let sobol = tables.words((0..16).flat_map(|i| (0..4).map(move |d| sobol_burley::parts::sobol_rev(1 << (31 - i), d))));
        let albedos = [Distribution::Beckmann, Distribution::Ggx].map(|d| albedo::table(d).iter().flat_map(|v| v.to_array()));
        let albedo = tables.floats(albedos.into_iter().flatten());
        let mut models = Models { list: Vec::new(), textures: &mut textures, tables: &mut tables };
        let materials: Vec<_> = world.scene.materials.iter().map(|m| models.material(m)).collect();
        let models = models.list;
        let emitters = emitters(world, &mut textures, &mut tables);
        let environments = environments(world, &mut textures, &mut tables);
        let sun_list = tables.words(world.lights.suns.iter().copied());
        let params = SceneParams {
            environments: environments.len() as u32,
            suns: world.lights.suns.len() as u32,
            sun_list,
            has_near: u32::from(!world.lights.tree.is_empty()),
            sobol,
            albedo,
            light_width: 0,
            light_height: 0,
            light_back: NONE,
        };
        let near = near(world);
        let tree = &world.lights.tree;
        let content: [(&str, &[u8]); 13] = [
            ("the scene's tree", cast_slice(&nodes.nodes)),
            ("the scene's triangles", cast_slice(&corners)),
            ("the scene's surfaces", cast_slice(&facets)),
            ("the scene's materials", cast_slice(&materials)),
            ("the scene's scattering models", cast_slice(&models)),
            ("the scene's textures", cast_slice(&textures.list)),
            ("the textures' pixels", cast_slice(&textures.pixels)),
            ("the scene's tables", cast_slice(&tables.0)),
            ("the scene's emitters", cast_slice(&emitters)),
            ("the scene's lamps", cast_slice(&near)),
            ("the hierarchy of lamps", cast_slice(&tree.nodes)),
            ("the lamps' places", cast_slice(&tree.place)),
            ("the environments", cast_slice(&environments)),
        ];
        let fixed = content.iter().map(|(label, bytes)| gpu.upload(label, bytes)).collect::<Result<Vec<_>>>()?;
        let layout = gpu.checked(|| layout(&gpu.device, "scene", BINDINGS, 0))?;
        let has_masks = world.scene.materials.iter().any(|m| m.opacity.is_some());
        let group = group(&gpu, &layout, &fixed, params, &[], &[])?;
        Ok(Self { gpu, fixed, params, light_bytes: 0, has_masks, layout, group })
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
        let floats = |side: &[crate::base::math::Rgb]| side.iter().flat_map(|c| c.to_array()).collect::<Vec<f32>>();
        let mut texels = floats(&map.front);
        let light_back = map.back.as_ref().map_or(NONE, |_| texels.len() as u32);
        texels.extend(map.back.iter().flat_map(|back| floats(back)));
        let [light_width, light_height] = map.size;
        let params = SceneParams { light_width, light_height, light_back, ..self.params };
        let corners: Vec<[f32; 2]> = map.corners.iter().flatten().map(|p| p.to_array()).collect();
        let group = group(&self.gpu, &self.layout, &self.fixed, params, &texels, &corners)?;
        let (gpu, layout) = (self.gpu.clone(), self.layout.clone());
        let light_bytes = (size_of_val(texels.as_slice()) + size_of_val(corners.as_slice())) as u64;
        Ok(Self { gpu, fixed: self.fixed.clone(), params, light_bytes, has_masks: self.has_masks, layout, group })
    }

    /// What it takes on the device, bytes.
    pub(crate) fn bytes(&self) -> u64 {
        self.fixed.iter().map(wgpu::Buffer::size).sum::<u64>() + self.light_bytes
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

/// A layout of `reads` buffers to read, and after them `writes` to write.
pub(crate) fn layout(device: &wgpu::Device, label: &str, reads: u32, writes: u32) -> wgpu::BindGroupLayout {
    let entries: Vec<_> = (0..reads + writes)
        .map(|binding| wgpu::BindGroupLayoutEntry {
            binding,
            visibility: wgpu::ShaderStages::COMPUTE,
            ty: wgpu::BindingType::Buffer {
                ty: wgpu::BufferBindingType::Storage { read_only: binding < reads },
                has_dynamic_offset: false,
                min_binding_size: None,
            },
            count: None,
        })
        .collect();
    device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor { label: Some(label), entries: &entries })
}

fn group(
    gpu: &Gpu,
    layout: &wgpu::BindGroupLayout,
    fixed: &[wgpu::Buffer],
    params: SceneParams,
    light_texels: &[f32],
    light_corners: &[[f32; 2]],
) -> Result<wgpu::BindGroup> {
    let params = gpu.upload("the scene's parameters", bytemuck::bytes_of(&params))?;
    let texels = gpu.upload("the light map", cast_slice(light_texels))?;
    let corners = gpu.upload("the light map's charts", cast_slice(light_corners))?;
    let buffers: Vec<_> = fixed.iter().chain([&params, &texels, &corners]).collect();
    gpu.checked(|| gpu.group(layout, &buffers))
}

/// The compressed tree, and three vectors a primitive: the bits of its corners, with the triangle, its material if that lets rays through,
/// and its object.
fn tree(world: &World) -> Result<(CwBvh, Vec<[u32; 4]>)> {
    let geometry = &world.scene.geometry;
    let (tree, triangles) = world.bvh.compressed(geometry);
    if depth(&tree) > STACK {
        return Err(Error::Request(format!(
            "the scene's tree is more than {STACK} nodes deep, too deep for the GPU; use --device cpu"
        )));
    }
    let corners = triangles
        .iter()
        .flat_map(|&t| {
            let [a, b, c] = geometry.corners(t);
            let object = geometry.triangle_object[t as usize];
            let material = geometry.objects[object as usize].material;
            let masked = world.scene.materials[material as usize].opacity.is_some();
            let material = if masked { material } else { NONE };
            [(a, t), (b, material), (c, object)].map(|(p, word)| [p.x.to_bits(), p.y.to_bits(), p.z.to_bits(), word])
        })
        .collect();
    Ok((tree, corners))
}

/// A facet's seven vectors.
fn words(facet: &Facet) -> [u32; 28] {
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gpu::layout::check;
    use crate::transport::light_tree::Node;

    #[test]
    fn structs_are_laid_out_as_in_the_shader() {
        check!(RAYS, SceneParams as "SceneParams" {
            environments, suns, sun_list, has_near, sobol, albedo, light_width, light_height, light_back
        });
        check!(RAYS, Node as "LightNode" {
            centre, radius_sq, axis, cos_spread, sin_spread, cos_reach, power, children, parent
        });
    }
}
