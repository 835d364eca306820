//! `--lights`: what changes from frame to frame, and what provenance says of it.

use crate::Result;
use crate::io::Provenance;
use crate::io::provenance::hash_file;
use crate::scene::{Animation, Scene};
use std::path::Path;

/// Reads the file, if there is one; its content, and that of the meshes that it names, become inputs.
pub fn load(file: Option<&Path>, scene: &Scene, mut provenance: Provenance) -> Result<(Option<Animation>, Provenance)> {
    let Some(file) = file else { return Ok((None, provenance)) };
    let animation = Animation::load(file, scene)?;
    provenance = provenance.with_input("lights", hash_file(file)?);
    for (i, mesh) in animation.files.iter().enumerate() {
        provenance = provenance.with_input(&format!("lights.mesh{i}"), hash_file(mesh)?);
    }
    Ok((Some(animation), provenance))
}
