//! `export-gltf`.

use crate::base::clock::seconds;
use crate::export::gltf;
use crate::io::provenance::hash_file;
use crate::io::{Provenance, atomic};
use crate::lightmap::LightMap;
use crate::plan::option::stage;
use crate::plan::{Context, Outcome};
use crate::{Error, Result};
use serde_json::json;
use std::path::PathBuf;

stage! {
    /// Writes a scene, and its light map, as a GLB file.
    ExportGltf "export-gltf"
    {
        /// The scene.
        scene,
    }
    {
        /// Its light map.
        "--lightmap" lightmap: Option<PathBuf>,
        /// The file to write.
        "--output" output: PathBuf,
    }
}

impl ExportGltf {
    /// Refuses a name that viewers would not open.
    pub fn check(&self) -> Result<()> {
        match self.output.extension() {
            Some(ending) if ending.eq_ignore_ascii_case("glb") => Ok(()),
            _ => Err(Error::input(&self.output, "expected a name that ends in .glb")),
        }
    }

    /// Reads the scene, writes the file.
    pub fn run(&self, cx: &Context) -> Result<Outcome> {
        self.check()?;
        let clock = seconds();
        // What a light map was baked for has no transmissive shapes.
        let world = self.lightmap.is_some().then(|| cx.opaque_world(&self.scene)).transpose()?;
        let loaded = if world.is_none() { Some(cx.load_scene(&self.scene)?) } else { None };
        let Some(scene) = world.as_ref().map(|w| &w.scene).or(loaded.as_ref()) else {
            return Err(Error::input(&self.scene, "no scene was read"));
        };
        let map = self.lightmap.as_ref().map(|path| LightMap::load(path, scene)).transpose()?;
        let mut provenance = Provenance::new(Self::COMMAND, &scene.hash, cx.seed, &json!({}));
        if let Some(path) = &self.lightmap {
            provenance = provenance.with_input("lightmap", hash_file(path)?);
        }
        let exported = gltf::glb(scene, map.as_ref(), &json!(provenance))?;
        exported.warnings.iter().for_each(|warning| cx.listener.warn(&format!("{}: {warning}", self.scene.display())));
        atomic::write(&self.output, &exported.bytes)?;
        let (shapes, triangles) = (scene.geometry.objects.len(), scene.geometry.triangles.len());
        let gltf::Exported { bytes, materials, behind, .. } = exported;
        let (megabytes, seconds) = (bytes.len() as f64 / 1e6, clock());
        let light = match &map {
            Some(map) => format!(", a light map of {} x {} texels", map.size[0], map.size[1]),
            None => String::new(),
        };
        let output = self.output.display();
        Ok(Outcome {
            summary: format!(
                "{output}: {shapes} shapes of {triangles} triangles, {materials} materials{light}; {megabytes:.1} MB in {seconds:.1} s"
            ),
            figures: json!({
                "shapes": shapes, "triangles": triangles, "materials": materials, "behind": behind, "bytes": bytes.len(), "seconds": seconds
            }),
            ..Outcome::default()
        })
    }
}
