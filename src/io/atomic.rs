//! Outputs that appear whole or not at all: written beside their place under a temporary name, then renamed.

use crate::{Error, Result};
use std::fs::TryLockError;
use std::io::Write;
use std::path::Path;
use tempfile::NamedTempFile;

const PREFIX: &str = ".reprobe-";
const SUFFIX: &str = ".tmp";

/// Writes `bytes` to `path` in one step; makes the folder if need be.
pub fn write(path: &Path, bytes: &[u8]) -> Result<()> {
    let mut file = begin(path)?;
    file.write_all(bytes).map_err(|e| Error::io(path, e))?;
    finish(file, path)
}

/// A file beside `path`, in which its content is put together; makes the folder if need be.
pub(super) fn begin(path: &Path) -> Result<NamedTempFile> {
    let folder = match path.parent() {
        Some(p) if !p.as_os_str().is_empty() => p,
        _ => Path::new("."),
    };
    std::fs::create_dir_all(folder).map_err(|e| Error::io(folder, e))?;
    temporary(folder).map_err(|e| Error::io(path, e))
}

/// Gives the file its name.
pub(super) fn finish(file: NamedTempFile, path: &Path) -> Result<()> {
    file.as_file().sync_all().map_err(|e| Error::io(path, e))?;
    file.persist(path).map_err(|e| Error::io(path, e.error))?;
    Ok(())
}

/// A new file that is locked as long as it is written, so that [`sweep`] can tell it from those that nobody writes any more.
fn temporary(folder: &Path) -> std::io::Result<NamedTempFile> {
    let mut builder = tempfile::Builder::new();
    builder.prefix(PREFIX).suffix(SUFFIX);
    // A temporary file is private to its user; an output may be read and written by whom the umask lets.
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
    loop {
        let file = builder.tempfile_in(folder)?;
        match file.as_file().try_lock() {
            // Swept before it was locked.
            Err(TryLockError::WouldBlock) => {}
            Ok(()) if !file.path().exists() => {}
            // Where there are no locks, nothing is swept either.
            _ => return Ok(file),
        }
    }
}

/// Takes away what killed runs left half written beside a file `output`, or within a folder.
pub fn sweep(output: &Path) {
    let folder = if output.is_dir() { Some(output) } else { output.parent() };
    let folder = folder.map(|f| if f.as_os_str().is_empty() { Path::new(".") } else { f });
    let entries = folder.and_then(|folder| std::fs::read_dir(folder).ok());
    for entry in entries.into_iter().flatten().flatten() {
        let name = entry.file_name();
        let is_ours = name.to_str().is_some_and(|name| name.starts_with(PREFIX) && name.ends_with(SUFFIX));
        let is_left = || std::fs::File::open(entry.path()).is_ok_and(|file| file.try_lock().is_ok());
        if is_ours && is_left() {
            let _ = std::fs::remove_file(entry.path());
        }
    }
}

#[cfg(all(test, unix))]
mod tests {
    use std::os::unix::fs::PermissionsExt;

    #[test]
    fn an_output_has_the_permissions_of_any_new_file() {
        let folder = tempfile::tempdir().unwrap();
        let [ours, plain] = ["ours", "plain"].map(|name| folder.path().join(name));
        super::write(&ours, b"x").unwrap();
        std::fs::write(&plain, b"x").unwrap();
        let mode = |path| std::fs::metadata(path).unwrap().permissions().mode();
        assert_eq!(mode(ours), mode(plain));
    }

    #[test]
    fn what_killed_runs_left_is_swept_and_what_is_being_written_stays() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        for name in [".reprobe-a1b2.tmp", ".other-a1b2.tmp", "out.exr"] {
            std::fs::write(at(name), b"x").unwrap();
        }
        let live = super::temporary(folder.path()).unwrap();
        super::sweep(&at("out.exr"));
        assert!(!at(".reprobe-a1b2.tmp").exists() && at(".other-a1b2.tmp").exists() && at("out.exr").exists());
        assert!(live.path().exists());
        std::fs::write(at(".reprobe-c3d4.tmp"), b"x").unwrap();
        super::sweep(folder.path());
        assert!(!at(".reprobe-c3d4.tmp").exists() && live.path().exists());
    }
}
