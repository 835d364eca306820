//! `set.json`: written last into a folder of numbered files, so that its presence says that the folder is complete.

use crate::io::{ExrImage, Provenance, json};
use crate::{Error, Result};
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// What a folder of `NNNN.exr` files holds.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ProbeSet {
    /// Number of files, 0000 to count − 1.
    pub count: usize,
    /// Width and height of each, pixels.
    pub size: [u32; 2],
    /// Where they came from: the same in every file.
    pub provenance: Provenance,
}

impl ProbeSet {
    /// The file in `folder`.
    pub fn path(folder: &Path) -> PathBuf {
        folder.join("set.json")
    }

    /// Marks `folder` as complete.
    pub fn write(&self, folder: &Path) -> Result<()> {
        json::write(&Self::path(folder), self)
    }

    /// Reads what a complete folder holds. `stage` is the subcommand that should have written it.
    pub fn read(folder: &Path, stage: &str) -> Result<Self> {
        let path = Self::path(folder);
        let text = std::fs::read_to_string(&path).map_err(|e| match e.kind() {
            std::io::ErrorKind::NotFound => {
                Error::input(folder, format!("has no set.json: not a complete output of {stage}; run {stage} (again)"))
            }
            _ => Error::io(&path, e),
        })?;
        let set: Self = json::parse(&path, &text)?;
        if set.provenance.stage != stage {
            return Err(Error::input(&path, format!("written by {}, expected {stage}", set.provenance.stage)));
        }
        Ok(set)
    }

    /// Takes the mark away where it stands for something else than `provenance`, before files are replaced.
    /// True where the folder is complete already.
    pub fn is_complete_or_unmark(&self, folder: &Path, stage: &str) -> Result<bool> {
        if Self::read(folder, stage).is_ok_and(|found| found == *self) {
            return Ok(true);
        }
        let path = Self::path(folder);
        match std::fs::remove_file(&path) {
            Err(e) if e.kind() != std::io::ErrorKind::NotFound => Err(Error::io(&path, e)),
            _ => Ok(false),
        }
    }
}

/// A file of a set, of its size where one is given.
///
/// # Errors
/// It cannot be read, or is of another size or another run than `set.json` says.
pub fn read_member(path: &Path, size: Option<[u32; 2]>, provenance: &Provenance) -> Result<ExrImage> {
    let image = ExrImage::read(path)?;
    let [w, h] = [image.width as u32, image.height as u32];
    if let Some([sw, sh]) = size.filter(|size| *size != [w, h]) {
        return Err(Error::input(path, format!("{w} x {h} pixels, expected {sw} x {sh} as set.json says")));
    }
    if image.provenance(path)? != provenance {
        return Err(Error::input(path, format!("from another run than its set.json says; run {} again", provenance.stage)));
    }
    Ok(image)
}

/// `NNNN.exr` in a folder.
pub fn numbered(folder: &Path, index: usize) -> PathBuf {
    folder.join(format!("{index:04}.exr"))
}
