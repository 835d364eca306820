//! Where an output came from: what a later stage compares before it trusts its inputs.

use crate::{Error, Result};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::Path;

/// Carried by every output, as the EXR attribute `provenance` or the JSON object of that name.
/// Seconds, host, device, threads and paths stay out of it, so that the same inputs give the same bits.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Provenance {
    /// Version of the program.
    pub version: String,
    /// The subcommand that wrote the output.
    pub stage: String,
    /// All its parameters.
    pub parameters: serde_json::Value,
    /// The seed.
    pub seed: u32,
    /// [`crate::scene::Scene::hash`] of the scene; empty where no scene was read.
    pub scene: String,
    /// Content hashes of the other inputs, by role ("probes", "qhmap", "lightmap", ...).
    pub inputs: BTreeMap<String, String>,
}

impl Provenance {
    /// Provenance of `stage`'s output, without inputs as yet.
    pub fn new(stage: &str, scene: &str, seed: u32, parameters: &impl Serialize) -> Self {
        Self {
            version: env!("CARGO_PKG_VERSION").into(),
            stage: stage.into(),
            parameters: serde_json::to_value(parameters).unwrap_or_default(),
            seed,
            scene: scene.into(),
            inputs: BTreeMap::new(),
        }
    }

    /// Adds an input's content hash.
    pub fn with_input(mut self, role: &str, hash: String) -> Self {
        self.inputs.insert(role.into(), hash);
        self
    }

    /// Refuses an input that was made from another scene.
    pub fn check_scene(&self, path: &Path, scene: &str) -> Result<()> {
        if self.scene == scene {
            return Ok(());
        }
        Err(Error::input(
            path,
            format!(
                "made from another scene (its hash {}, this scene's {}); run {} again",
                short(&self.scene),
                short(scene),
                self.stage
            ),
        ))
    }

    /// Refuses an input whose own input `role` is not the file at hand (`hash`).
    pub fn check_input(&self, path: &Path, role: &str, hash: &str) -> Result<()> {
        let found = self.inputs.get(role).map_or("", String::as_str);
        if found == hash {
            return Ok(());
        }
        Err(Error::input(
            path,
            format!(
                "made with other {role} (their hash {}, those given {}); run {} again",
                short(found),
                short(hash),
                self.stage
            ),
        ))
    }
}

fn short(hash: &str) -> &str {
    if hash.is_empty() { "none" } else { hash.get(..12).unwrap_or(hash) }
}

/// Content hash of a file: blake3, hex.
pub fn hash_file(path: &Path) -> Result<String> {
    Ok(hash_of(&std::fs::read(path).map_err(|e| Error::io(path, e))?))
}

/// The same of its bytes.
pub fn hash_of(bytes: &[u8]) -> String {
    blake3::hash(bytes).to_hex().to_string()
}
