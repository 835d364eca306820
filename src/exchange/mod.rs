//! Files that scenes come in, read into [`crate::scene`]'s types.

pub mod animation;
mod finish;
pub mod gltf;
pub mod mesh;
pub mod mitsuba;

use crate::Result;
use crate::io;
use crate::scene::Scene;
use std::path::Path;

/// Most triangles of a scene whose meshes stand in it as copies: some 10 GB.
const MAX_TRIANGLES: usize = 50_000_000;

/// What the command line says about loading.
#[derive(Debug, Clone, Default)]
pub struct LoadOptions {
    /// Multiplies all lengths (`--unit-scale`); `None` chooses what [`crate::scene::units::metric`] says.
    pub unit_scale: Option<f32>,
    /// Values for the scene's `$name` parameters, over its `default`s.
    pub defines: Vec<(String, String)>,
    /// Leave out, with a warning, what is not supported (`--skip-unsupported`).
    pub skip_unsupported: bool,
    /// Take images whose files end early, with a warning (`--allow-truncated`).
    pub allow_truncated: bool,
}

/// Loads a scene: Mitsuba XML, Mitsuba's dictionary form as JSON, or glTF, as the file's name says.
pub fn load(path: &Path, options: &LoadOptions) -> Result<Scene> {
    decode(path, io::read(path)?, options)
}

/// [`load`], of a file that is in memory: messages call it `path`, and what it names is looked for beside that.
pub fn decode(path: &Path, bytes: Vec<u8>, options: &LoadOptions) -> Result<Scene> {
    match is_gltf(path) {
        true => gltf::decode(path, &bytes, options),
        false => mitsuba::load::decode(path, bytes, options),
    }
}

/// Whether a file's name is that of a glTF scene.
pub fn is_gltf(path: &Path) -> bool {
    path.extension().is_some_and(|e| e.eq_ignore_ascii_case("gltf") || e.eq_ignore_ascii_case("glb"))
}
