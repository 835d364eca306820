//! `export-probes`.

use crate::base::clock::seconds;
use crate::base::named::words;
use crate::export::ktx2::{self, Texture};
use crate::export::probes::cube::{self, Mirror};
use crate::export::probes::look::look;
use crate::export::probes::{Around, Probe, volume};
use crate::io::provenance::hash_file;
use crate::io::{Provenance, atomic, json};
use crate::lightmap::LightMap;
use crate::method::light_field_probes::probe::Light;
use crate::method::light_field_probes::store::{LightFieldSet, files};
use crate::method::radiance_probes::store::TransportSet;
use crate::plan::option::{stage, text};
use crate::plan::{Context, Outcome};
use crate::probe::places::Places;
use crate::probe::store::{ProbeStore, SET_FILE, set_hash, set_provenance};
use crate::transport::World;
use crate::{Error, Result};
use glam::Vec3;
use serde::de::IgnoredAny;
use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Texels along an edge of a cube of reflections.
pub const SIZE: u32 = 128;
/// The most of them.
const SIZE_MAX: u32 = 2048;

/// What engines are given.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Format {
    /// KTX 2.0, half floats.
    #[default]
    Ktx2,
}

words!(Format { Ktx2 "ktx2" });
text!(Format, Mirror);

stage! {
    /// Writes probes as textures for engines.
    ExportProbes "export-probes"
    {
        /// Folder of baked probes.
        probes,
    }
    {
        /// The scene, for probes that do not hold all light.
        "--scene" scene: Option<PathBuf>,
        /// Its light map, for these.
        "--lightmap" lightmap: Option<PathBuf>,
        /// Format of the textures.
        "--format" format: Option<Format>,
        /// Texels along an edge of a cube of reflections.
        "--size" size: Option<u32>,
        /// Which axis of a cube is turned round.
        "--mirror" mirror: Option<Mirror>,
        /// Folder for the textures.
        "--output" output: PathBuf,
    }
}

impl ExportProbes {
    fn size(&self) -> Result<u32> {
        match self.size.unwrap_or(SIZE) {
            size if size.is_power_of_two() && (2..=SIZE_MAX).contains(&size) => Ok(size),
            size => Err(Error::Request(format!("--size {size}: expected a power of two from 2 to {SIZE_MAX}"))),
        }
    }

    /// Refuses a size that has no levels, and a scene without its light.
    pub fn check(&self) -> Result<()> {
        if self.scene.is_some() != self.lightmap.is_some() {
            return Err(Error::Request("--scene, --lightmap: expected both or neither".into()));
        }
        self.size().map(|_| ())
    }

    /// Reads the probes one by one, writes their textures.
    pub fn run(&self, cx: &Context) -> Result<Outcome> {
        let (size, mirror, clock) = (self.size()?, self.mirror.unwrap_or_default(), seconds());
        let Source { places, used, provenance: from, mut kind } = self.source(cx)?;
        std::fs::create_dir_all(&self.output).map_err(|e| Error::io(&self.output, e))?;
        let parameters = json!({ "size": size, "mirror": mirror });
        let mut provenance = Provenance::new(Self::COMMAND, &from.scene, cx.seed, &parameters)
            .with_input("probes", set_hash(&self.probes, &from.stage)?);
        if let Some(lightmap) = &self.lightmap {
            provenance = provenance.with_input("lightmap", hash_file(lightmap)?);
        }
        cx.progress().start("probes for engines", used.len() as u64);
        let mut around: Vec<Option<Around>> = vec![None; places.len()];
        let (mut entries, mut bytes) = (Vec::new(), 0);
        for &i in &used {
            let probe = kind.probe(&self.probes, i, places.position(i))?;
            let names = [format!("{i:04}.ktx2"), format!("{i:04}_diffuse.ktx2")];
            bytes += self.write(&names[0], &cube::reflections(&probe, size, mirror), &provenance)?;
            bytes += self.write(&names[1], &cube::diffuse(&probe.around, mirror), &provenance)?;
            entries.push(json!({
                "position": places.position(i).to_array(), "reflections": names[0], "diffuse": names[1],
                "harmonics": probe.around.harmonics().map(|c| c.to_array())
            }));
            around[i] = Some(probe.around);
            cx.progress().advance(1);
        }
        cx.progress().finish();
        let mut table = json!({ "probes": entries, "mirror": mirror, "levels": size.ilog2() + 1 });
        if let Some(grid) = places.grid() {
            let texture = volume::volume(grid.counts, |i, normal| around[i].as_ref().map(|a| a.diffuse(normal)));
            bytes += self.write(VOLUME, &texture, &provenance)?;
            table["volume"] = extent(grid.origin, grid.spacing, grid.counts);
        }
        table["provenance"] = json!(provenance);
        json::write(&self.output.join(TABLE), &table)?;
        let (count, seconds, megabytes) = (used.len(), clock(), bytes as f64 / 1e6);
        let volume = if table["volume"].is_null() { "" } else { ", and a volume of diffuse light" };
        let output = self.output.display();
        Ok(Outcome {
            summary: format!("{output}: cubes of {count} probes{volume}; {megabytes:.1} MB in {seconds:.1} s"),
            figures: json!({ "probes": count, "volume": !table["volume"].is_null(), "bytes": bytes, "seconds": seconds }),
            ..Outcome::default()
        })
    }

    /// The set, and what is needed to see by it.
    fn source(&self, cx: &Context) -> Result<Source> {
        let path = self.probes.join(SET_FILE);
        let provenance = set_provenance(&self.probes, "bake-lightfield, bake-probes or bake-transport")?;
        if provenance.stage == LIGHTFIELD {
            if self.scene.is_some() {
                return Err(Error::Request("--scene, --lightmap: light field probes hold all light by themselves".into()));
            }
            let set = LightFieldSet::read(&self.probes)?;
            return Ok(Source { places: set.places.clone(), used: set.places.used(), provenance, kind: Kind::LightField(set) });
        }
        let (Some(scene), Some(lightmap)) = (&self.scene, &self.lightmap) else {
            let message = format!(
                "{} hold no diffuse light: give --scene SCENE and --lightmap FILE, whose light they see",
                provenance.stage
            );
            return Err(Error::input(&self.probes, message));
        };
        let world = cx.opaque_world(scene)?;
        let lightmap = LightMap::load(lightmap, &world.scene)?;
        let (places, used, glossy) = match provenance.stage.as_str() {
            GLOSSY => {
                let store = ProbeStore::<IgnoredAny>::open(&self.probes, &world.scene, 1)?;
                if store.set.views.is_some() {
                    cx.listener.warn(&format!(
                        "{}: baked for the views of a path: other glossy texels are black; bake without --for-path for all",
                        self.probes.display()
                    ));
                }
                let used = (0..store.set.places.len()).filter(|&i| !store.set.files[i].is_empty()).collect();
                (store.set.places.clone(), used, Some(store))
            }
            TRANSPORT => {
                let set = TransportSet::read(&self.probes)?;
                set.provenance.check_scene(&path, &world.scene.hash)?;
                (set.places.clone(), set.places.used(), None)
            }
            other => {
                let message = format!("was written by {other}: expected a folder of {LIGHTFIELD}, {GLOSSY} or {TRANSPORT}");
                return Err(Error::input(&path, message));
            }
        };
        Ok(Source { places, used, provenance, kind: Kind::Lit { world, lightmap, glossy } })
    }

    /// Writes a texture, unless somebody else's file has its name; returns its bytes.
    fn write(&self, name: &str, texture: &Texture, provenance: &Provenance) -> Result<usize> {
        let path = self.output.join(name);
        if std::fs::read(&path).is_ok_and(|found| !ktx2::is_ours(&found[..found.len().min(4096)])) {
            return Err(Error::input(&path, "was not written by reprobe: remove it, or give the output another name"));
        }
        let bytes = texture.encode(provenance);
        atomic::write(&path, &bytes)?;
        Ok(bytes.len())
    }
}

/// The stage that the probes come from.
pub(super) const LIGHTFIELD: &str = "bake-lightfield";
/// Others.
const GLOSSY: &str = "bake-probes";
const TRANSPORT: &str = "bake-transport";
/// The file that says what there is.
const TABLE: &str = "probes.json";
const VOLUME: &str = "volume.ktx2";

/// Where probes come from.
struct Source {
    places: Places,
    /// Those that there are.
    used: Vec<usize>,
    provenance: Provenance,
    kind: Kind,
}

enum Kind {
    LightField(LightFieldSet),
    Lit { world: Arc<World>, lightmap: LightMap, glossy: Option<ProbeStore<IgnoredAny>> },
}

impl Kind {
    fn probe(&mut self, folder: &Path, i: usize, position: Vec3) -> Result<Probe> {
        match self {
            Self::LightField(set) => read(set, folder, i),
            Self::Lit { world, lightmap, glossy } => {
                let glossy = glossy.as_mut().map(|store| store.probe(i)).transpose()?;
                Ok(look(world, lightmap, position, glossy.as_deref()))
            }
        }
    }
}

fn read(set: &LightFieldSet, folder: &Path, i: usize) -> Result<Probe> {
    let [_, light, around] = set.images(folder, i)?;
    let [_, light_path, around_path] = files(folder, i);
    let light = Light::new(&light.rgb(&light_path, "radiance")?, set.bake.size as usize);
    let around = Around { irradiance: around.rgb(&around_path, "irradiance")?, size: around.width };
    Ok(Probe { light, around })
}

/// The box that a volume's texels fill: half a spacing more than its probes on all sides.
fn extent(origin: [f32; 3], spacing: [f32; 3], counts: [u32; 3]) -> Value {
    let (origin, spacing) = (Vec3::from(origin), Vec3::from(spacing));
    let size = spacing * glam::UVec3::from(counts).as_vec3();
    let middle = origin - 0.5 * spacing + 0.5 * size;
    json!({ "file": VOLUME, "counts": counts, "center": middle.to_array(), "size": size.to_array() })
}
