//! From the plugin tree to a [`Scene`].

use super::Scene;
use crate::Result;
use std::path::Path;

/// What the command line says about loading.
#[derive(Debug, Clone)]
pub struct LoadOptions {
    /// Multiplies all lengths (`--unit-scale`).
    pub unit_scale: f32,
    /// Values for the scene's `$name` parameters, over its `default`s.
    pub defines: Vec<(String, String)>,
}

impl Default for LoadOptions {
    fn default() -> Self {
        Self { unit_scale: 1.0, defines: Vec::new() }
    }
}

/// Loads a Mitsuba XML file, or its JSON form.
pub fn load(_path: &Path, _options: &LoadOptions) -> Result<Scene> {
    todo!()
}
