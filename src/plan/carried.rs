//! Where outputs came from that are neither EXR nor JSON: pictures, videos, textures, exported scenes and pages.

use crate::Result;
use crate::export::{gltf, ktx2};
use crate::io::{Provenance, png, video};
use crate::metric::page_provenance;
use std::path::Path;

/// Kinds of such outputs, by their ending.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// PNG.
    Picture,
    /// MP4, WebM, GIF.
    Video,
    /// KTX 2.0.
    Texture,
    /// GLB.
    Scene,
    /// HTML.
    Page,
}

impl Kind {
    const ALL: [(&str, Self); 7] = [
        ("png", Self::Picture),
        ("mp4", Self::Video),
        ("webm", Self::Video),
        ("gif", Self::Video),
        ("ktx2", Self::Texture),
        ("glb", Self::Scene),
        ("html", Self::Page),
    ];

    /// The kind of a file of that name; `None` of any other.
    pub fn of(path: &Path) -> Option<Self> {
        let ending = path.extension()?;
        Self::ALL.iter().find(|(name, _)| ending.eq_ignore_ascii_case(name)).map(|(_, kind)| *kind)
    }

    /// In a word.
    pub fn name(self) -> &'static str {
        match self {
            Self::Picture => "picture",
            Self::Video => "video",
            Self::Texture => "texture",
            Self::Scene => "scene",
            Self::Page => "page",
        }
    }
}

/// What a file carries besides what it shows.
#[derive(Debug, Clone, PartialEq)]
pub struct Carried {
    /// Width and height, and depth where it has one; empty where reading it would take decoding.
    pub size: Vec<u32>,
    /// Where it came from; `None` where somebody else wrote it.
    pub provenance: Option<Provenance>,
}

/// What a file of a kind carries.
///
/// # Errors
/// It cannot be read, or is no such file.
pub fn read(path: &Path, kind: Kind) -> Result<Carried> {
    let (size, provenance) = match kind {
        Kind::Picture => {
            let (size, provenance) = png::read_provenance(path)?;
            (size.to_vec(), provenance)
        }
        Kind::Texture => {
            let (size, provenance) = ktx2::read_provenance(path)?;
            (size.into_iter().filter(|n| *n > 0).collect(), provenance)
        }
        Kind::Video => (Vec::new(), video::read_provenance(path)?),
        Kind::Scene => (Vec::new(), gltf::read_provenance(path)?),
        Kind::Page => (Vec::new(), page_provenance(path)?),
    };
    Ok(Carried { size, provenance })
}
