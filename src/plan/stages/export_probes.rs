//! `export-probes`.

use crate::base::clock::seconds;
use crate::base::named::words;
use crate::export::ktx2::{self, Texture};
use crate::export::probes::cube::{self, Mirror};
use crate::export::probes::{Around, Probe, volume};
use crate::io::{Provenance, atomic, json};
use crate::method::light_field_probes::probe::Light;
use crate::method::light_field_probes::store::{LightFieldSet, files};
use crate::plan::option::{stage, text};
use crate::plan::{Context, Outcome};
use crate::probe::store::set_hash;
use crate::{Error, Result};
use glam::Vec3;
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

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
    /// Writes light field probes as textures for engines.
    ExportProbes "export-probes"
    {
        /// Folder of light field probes.
        lightfield,
    }
    {
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

    /// Refuses a size that has no levels.
    pub fn check(&self) -> Result<()> {
        self.size().map(|_| ())
    }

    /// Reads the probes one by one, writes their textures.
    pub fn run(&self, cx: &Context) -> Result<Outcome> {
        let (size, mirror, clock) = (self.size()?, self.mirror.unwrap_or_default(), seconds());
        let set = LightFieldSet::read(&self.lightfield)?;
        std::fs::create_dir_all(&self.output).map_err(|e| Error::io(&self.output, e))?;
        let used = set.places.used();
        let parameters = json!({ "size": size, "mirror": mirror });
        let provenance = Provenance::new(Self::COMMAND, &set.provenance.scene, cx.seed, &parameters)
            .with_input("probes", set_hash(&self.lightfield, LIGHTFIELD)?);
        cx.progress().start("probes for engines", used.len() as u64);
        let mut around: Vec<Option<Around>> = vec![None; set.places.len()];
        let (mut entries, mut bytes) = (Vec::new(), 0);
        for &i in &used {
            let probe = read(&set, &self.lightfield, i)?;
            let names = [format!("{i:04}.ktx2"), format!("{i:04}_diffuse.ktx2")];
            bytes += self.write(&names[0], &cube::reflections(&probe, size, mirror), &provenance)?;
            bytes += self.write(&names[1], &cube::diffuse(&probe.around, mirror), &provenance)?;
            entries.push(json!({
                "position": set.places.position(i).to_array(), "reflections": names[0], "diffuse": names[1],
                "harmonics": probe.around.harmonics().map(|c| c.to_array())
            }));
            around[i] = Some(probe.around);
            cx.progress().advance(1);
        }
        cx.progress().finish();
        let mut table = json!({ "probes": entries, "mirror": mirror, "levels": size.ilog2() + 1 });
        if let Some(grid) = set.places.grid() {
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
/// The file that says what there is.
const TABLE: &str = "probes.json";
const VOLUME: &str = "volume.ktx2";

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
