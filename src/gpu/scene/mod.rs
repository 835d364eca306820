//! A scene on the device: what kernels that follow light paths bind as their group 1 (shaders/shared/scene.wgsl).

pub(crate) mod lights;
pub(crate) mod materials;
mod shapes;
pub(crate) mod textures;

use super::Gpu;
use super::kernel::layout;
use super::spec::{Access, StructLayout, layout};
use crate::lightmap::LightMap;
use crate::material::bsdf::{Distribution, albedo};
use crate::scene::Emitter;
use crate::transport::World;
use crate::{Error, Result};
use bytemuck::{Pod, Zeroable, cast_slice};
use lights::{emitters, environments, near, outlook};
use materials::{Models, tilts};
use shapes::Shapes;
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
    triangles: u32,
    added: u32,
    sun_list: u32,
    sobol: u32,
    albedo: u32,
    light_width: u32,
    light_height: u32,
    light_front: u32,
    light_back: u32,
    light_corners: u32,
    outlook: u32,
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
    materials, models, textures, emitters, near, light_nodes, environments, environment_count, has_near, suns, corners, triangles,
    added, sun_list, sobol, albedo, light_width, light_height, light_front, light_back, light_corners, outlook
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
    shapes: Shapes,
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
        let shapes = Shapes::new(&gpu, world)?;
        let (mut records, mut words) = (Records::default(), Words::default());
        let params = params(world, &shapes, &mut records, &mut words)?;
        words.extend([0; ROOM]);
        let unlit_words = words.0.len() as u64;
        let words = gpu.upload("the scene's textures", cast_slice(&words.0))?;
        let records = gpu.upload("the scene's materials and emitters", cast_slice(&records.0))?;
        let layout = gpu.checked(|| layout(&gpu.device, "scene", BINDINGS.iter().map(|(_, access)| *access)))?;
        let group = group(&gpu, &layout, params, &shapes, [&words, &records])?;
        let has_masks = world.scene.materials.iter().any(|m| m.opacity.is_some());
        Ok(Self { gpu, shapes, words, records, unlit_words, params, has_masks, layout, group })
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
        let group = group(gpu, &self.layout, params, &self.shapes, [&words, &self.records])?;
        Ok(Self { words, params, group, ..self.clone() })
    }

    /// The scene of a frame, whose world this is, with the light map that there is. The scene itself, or the frame before, is no longer of use:
    /// both share what lies before the light map, and the triangles, which are written anew where they differ.
    pub(crate) fn at(&self, world: &World) -> Result<Self> {
        check(world)?;
        let gpu = &self.gpu;
        let shapes = self.shapes.at(gpu, world)?;
        let (mut records, mut words) = (Records::default(), Words::default());
        let fresh = params(world, &shapes, &mut records, &mut words)?;
        if words.0.len() as u64 > self.unlit_words {
            return Err(Error::Request("--lights: a frame's textures are more than the scene's; use --device cpu".into()));
        }
        let SceneParams { light_width, light_height, light_front, light_back, light_corners, .. } = self.params;
        let params = SceneParams { light_width, light_height, light_front, light_back, light_corners, ..fresh };
        gpu.checked(|| gpu.queue.write_buffer(&self.words, 0, cast_slice(&words.0)))?;
        let records = gpu.upload("the scene's materials and emitters", cast_slice(&records.0))?;
        let group = group(gpu, &self.layout, params, &shapes, [&self.words, &records])?;
        Ok(Self { shapes, records, params, group, ..self.clone() })
    }

    /// What it takes on the device, bytes.
    pub(crate) fn bytes(&self) -> u64 {
        [&self.shapes.tree, &self.shapes.facets, &self.words, &self.records].map(wgpu::Buffer::size).iter().sum()
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
    let is_pattern = |e: &Emitter| matches!(e, Emitter::Projector { .. } | Emitter::Spot { pattern: Some(_), .. });
    if world.scene.emitters.iter().any(is_pattern) {
        let message = "the GPU has no projector and no spot with a texture; use --device cpu";
        return Err(Error::Request(message.into()));
    }
    Ok(())
}

fn group(
    gpu: &Gpu,
    layout: &wgpu::BindGroupLayout,
    params: SceneParams,
    Shapes { tree, facets, .. }: &Shapes,
    [words, records]: [&wgpu::Buffer; 2],
) -> Result<wgpu::BindGroup> {
    let params = gpu.uniform("the scene's parameters", &params)?;
    gpu.checked(|| gpu.group(layout, &[&params, tree, facets, words, records]))
}

/// Fills the lists of records and of words; where they begin. Without a light map.
fn params(world: &World, shapes: &Shapes, records: &mut Records, words: &mut Words) -> Result<SceneParams> {
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
        corners: shapes.corners,
        triangles: shapes.triangles,
        added: shapes.added,
        sun_list,
        sobol,
        albedo,
        light_width: 0,
        light_height: 0,
        light_front: NONE,
        light_back: NONE,
        light_corners: NONE,
        outlook: outlook(world, words),
    })
}
