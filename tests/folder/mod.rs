//! A folder with a scene and a camera path, and the program run in it.

use std::path::PathBuf;
use std::process::{Command, Output};

/// Gone when the test ends.
pub struct Folder(pub tempfile::TempDir);

impl Folder {
    /// With `scene.xml` and `path.json`.
    pub fn with(scene: &str, path: &str) -> Self {
        let f = Self(tempfile::tempdir().unwrap());
        std::fs::write(f.at("scene.xml"), scene).unwrap();
        std::fs::write(f.at("path.json"), path).unwrap();
        f
    }

    pub fn at(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    pub fn reprobe(&self, args: &str) -> Output {
        Command::new(env!("CARGO_BIN_EXE_reprobe")).args(args.split_whitespace()).current_dir(self.0.path()).output().unwrap()
    }

    /// Runs a command that must succeed; its result.
    pub fn success(&self, args: &str) -> String {
        let output = self.reprobe(args);
        assert!(output.status.success(), "{args}: {}", text(&output.stderr));
        text(&output.stdout)
    }

    /// Runs a command that must refuse its input: exit code 2, one clear message, no panic. Returns the message.
    pub fn refusal(&self, args: &str) -> String {
        let output = self.reprobe(args);
        let message = text(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{args}: {message}");
        assert!(message.contains("error") && !message.contains("panicked") && !message.contains("RUST_BACKTRACE"), "{message}");
        message
    }
}

pub fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}
