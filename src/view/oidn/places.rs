//! Where the library may lie.
//!
//! In: the environment's variables. Out: files to try, in order.

use std::ffi::OsString;
use std::path::{Path, PathBuf};

/// The library's file, of the second version's interface.
pub(super) const FILE: &str = if cfg!(windows) {
    "OpenImageDenoise.dll"
} else if cfg!(target_os = "macos") {
    "libOpenImageDenoise.2.dylib"
} else {
    "libOpenImageDenoise.so.2"
};
/// The variable that says where it lies; nothing else is looked at then.
pub(super) const DIR: &str = "OIDN_DIR";
/// Where pip's package `pyoidn` has it.
const IN_PACKAGE: &str = "pyoidn/oidn/lib";

/// Files to try, all but the bare name, which the system looks up, being there.
pub(super) fn places(variable: &dyn Fn(&str) -> Option<OsString>) -> Vec<PathBuf> {
    if let Some(folder) = variable(DIR) {
        let folder = PathBuf::from(folder);
        let below = ["", "lib", "lib64", "bin", IN_PACKAGE].map(|below| folder.join(below).join(FILE));
        return below.into_iter().filter(|file| file.is_file()).collect();
    }
    let active = ["VIRTUAL_ENV", "CONDA_PREFIX"].into_iter().filter_map(variable).map(PathBuf::from);
    let mut files: Vec<PathBuf> = active.flat_map(|prefix| packages(&prefix)).collect();
    files.push(FILE.into());
    files.extend(pythons(variable).iter().flat_map(|prefix| packages(prefix)));
    files
}

/// Prefixes of the Pythons that a shell would find, and of the user's own packages.
fn pythons(variable: &dyn Fn(&str) -> Option<OsString>) -> Vec<PathBuf> {
    let path = variable("PATH").unwrap_or_default();
    let mut prefixes: Vec<PathBuf> = std::env::split_paths(&path).filter_map(|bin| Some(bin.parent()?.into())).collect();
    let home = variable("HOME").map(PathBuf::from);
    prefixes.extend(home.iter().map(|home| home.join(".local")));
    let pyenv = variable("PYENV_ROOT").map(PathBuf::from).or_else(|| Some(home?.join(".pyenv")));
    prefixes.extend(pyenv.into_iter().flat_map(|root| folders(&root.join("versions"), "")));
    prefixes
}

/// The library in the packages of the Pythons at a prefix.
fn packages(prefix: &Path) -> Vec<PathBuf> {
    let mut sites = vec![prefix.join("Lib/site-packages")];
    for python in folders(&prefix.join("lib"), "python3") {
        sites.extend(["site-packages", "dist-packages"].map(|site| python.join(site)));
    }
    sites.iter().map(|site| site.join(IN_PACKAGE).join(FILE)).filter(|file| file.is_file()).collect()
}

/// Folders in `parent` whose names begin so, in the order of their names.
fn folders(parent: &Path, start: &str) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(parent).into_iter().flatten().flatten();
    let mut found: Vec<PathBuf> =
        entries.filter(|e| e.file_name().to_string_lossy().starts_with(start)).map(|e| e.path()).collect();
    found.sort();
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    fn put(file: &Path) -> PathBuf {
        std::fs::create_dir_all(file.parent().unwrap()).unwrap();
        std::fs::write(file, "no library").unwrap();
        file.into()
    }

    #[test]
    fn a_virtual_environment_comes_before_the_system_and_other_pythons_after() {
        let folder = tempfile::tempdir().unwrap();
        let root = folder.path();
        let site = |prefix: &str| put(&root.join(prefix).join("lib/python3.11/site-packages").join(IN_PACKAGE).join(FILE));
        let (active, on_path) = (site("venv"), site("usr"));
        let (users, pyenv) = (site("home/.local"), site("home/.pyenv/versions/3.11.7"));
        let variable = |name: &str| match name {
            "VIRTUAL_ENV" => Some(root.join("venv").into()),
            "PATH" => Some(std::env::join_paths([root.join("nowhere/bin"), root.join("usr/bin")]).unwrap()),
            "HOME" => Some(root.join("home").into()),
            _ => None,
        };
        assert_eq!(places(&variable), [active, FILE.into(), on_path, users, pyenv]);
        assert_eq!(places(&|_| None), [PathBuf::from(FILE)]);
    }

    #[test]
    fn the_named_folder_is_the_only_one_looked_at() {
        let folder = tempfile::tempdir().unwrap();
        let variable = |name: &str| match name {
            DIR | "VIRTUAL_ENV" => Some(folder.path().into()),
            _ => None,
        };
        put(&folder.path().join("lib/python3.12/site-packages").join(IN_PACKAGE).join(FILE));
        assert!(places(&variable).is_empty());
        let below = put(&folder.path().join("lib").join(FILE));
        let here = put(&folder.path().join(FILE));
        assert_eq!(places(&variable), [here, below]);
    }
}
