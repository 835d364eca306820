//! `export-gltf`.

use crate::base::clock::seconds;
use crate::export::gltf::{self, Bakes};
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
        /// Its ambient occlusion.
        "--ao" ao: Option<PathBuf>,
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
        let scene = &cx.load_scene(&self.scene)?;
        let map = self.lightmap.as_ref().map(|path| LightMap::load(path, scene)).transpose()?;
        let openness = self.ao.as_ref().map(|path| LightMap::load_openness(path, scene)).transpose()?;
        if let (Some(light), Some(open), Some(path)) = (&map, &openness, &self.ao)
            && !light.is_laid_out_as(open)
        {
            return Err(Error::input(
                path,
                "its texels lie elsewhere than the light map's: bake both with the same --texels or --texel",
            ));
        }
        let mut provenance = Provenance::new(Self::COMMAND, &scene.hash, cx.seed, &json!({}));
        for (name, path) in [("lightmap", &self.lightmap), ("ao", &self.ao)] {
            if let Some(path) = path {
                provenance = provenance.with_input(name, hash_file(path)?);
            }
        }
        let exported = gltf::glb(scene, Bakes { light: map.as_ref(), openness: openness.as_ref() }, &json!(provenance))?;
        exported.warnings.iter().for_each(|warning| cx.listener.warn(&format!("{}: {warning}", self.scene.display())));
        atomic::write(&self.output, &exported.bytes)?;
        let (shapes, triangles) = (scene.geometry.objects.len(), scene.geometry.triangles.len());
        let gltf::Exported { bytes, materials, behind, kept, pages, .. } = exported;
        let (megabytes, seconds) = (bytes.len() as f64 / 1e6, clock());
        let texels = |map: &LightMap, what: &str| format!(", {what} of {} x {} texels", map.size[0], map.size[1]);
        let light = [map.map(|m| texels(&m, "a light map")), openness.map(|m| texels(&m, "ambient occlusion"))];
        let own = (kept > 0).then(|| format!(", {kept} shapes' own layout on {pages} textures"));
        let light: String = light.into_iter().chain([own]).flatten().collect();
        let output = self.output.display();
        Ok(Outcome {
            summary: format!(
                "{output}: {shapes} shapes of {triangles} triangles, {materials} materials{light}; {megabytes:.1} MB in {seconds:.1} s"
            ),
            figures: json!({
                "shapes": shapes, "triangles": triangles, "materials": materials, "behind": behind, "own_layout": kept, "pages": pages,
                "bytes": bytes.len(), "seconds": seconds
            }),
            ..Outcome::default()
        })
    }
}
