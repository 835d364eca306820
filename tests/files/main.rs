//! Files that people have: what is read, what is odd, and what is an error.

mod cases;
mod images;
mod materials;
mod meshes;
mod odd;
mod sunsky;
mod text;
mod unsupported;

use reprobe::exchange::{LoadOptions, load};
use reprobe::scene::Scene;
use std::fs;
use std::path::PathBuf;
use tempfile::TempDir;

/// A folder with a scene's files.
struct Folder(TempDir);

impl Folder {
    fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    fn with(self, name: &str, content: impl AsRef<[u8]>) -> Self {
        fs::write(self.path(name), content).unwrap();
        self
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn load_with(&self, body: &str, options: &LoadOptions) -> reprobe::Result<Scene> {
        fs::write(self.path("s.xml"), format!("<scene version='3.0.0'>{body}</scene>")).unwrap();
        load(&self.path("s.xml"), options)
    }

    fn load(&self, body: &str) -> Scene {
        self.load_with(body, &LoadOptions::default()).unwrap_or_else(|e| panic!("{e}"))
    }

    fn error(&self, body: &str) -> String {
        match self.load_with(body, &LoadOptions::default()) {
            Ok(_) => panic!("loaded: {body}"),
            Err(e) => e.to_string(),
        }
    }
}

/// Pixel (x, y) of a pattern that tells its places apart, 8 x 8 bytes of red, green, blue.
fn pattern(x: u32, y: u32) -> [u8; 3] {
    [30 + 28 * x as u8, 30 + 28 * y as u8, if (x + y).is_multiple_of(2) { 40 } else { 200 }]
}

fn pattern_png() -> Vec<u8> {
    let mut png = std::io::Cursor::new(Vec::new());
    let image = image::RgbImage::from_fn(8, 8, |x, y| image::Rgb(pattern(x, y)));
    image.write_to(&mut png, image::ImageFormat::Png).unwrap();
    png.into_inner()
}
