//! Outputs that would destroy something: an input of the same command, or a file that no stage wrote.

use crate::export::gltf;
use crate::io::{ExrImage, HEAD, is_sealed, png, video};
use crate::{Error, Result};
use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};

/// How an EXR file begins.
const EXR: [u8; 4] = [0x76, 0x2f, 0x31, 0x01];

/// Refuses to write `output` where it is one of `inputs` (files or folders, by whatever name), or a file that is not a stage's.
pub fn refuse<'a>(output: &Path, inputs: impl IntoIterator<Item = &'a PathBuf>) -> Result<()> {
    let Ok(there) = output.canonicalize() else { return Ok(()) };
    if inputs.into_iter().any(|input| input.canonicalize().is_ok_and(|input| input == there)) {
        return Err(Error::input(output, "is an input of this command too: give the output another name"));
    }
    if there.is_file() && is_foreign(&there)? {
        return Err(Error::input(output, "was not written by reprobe: remove it, or give the output another name"));
    }
    Ok(())
}

/// Whether a file is not a stage's output. One that was ours before something damaged it is not foreign, so that it can be made anew.
fn is_foreign(path: &Path) -> Result<bool> {
    let fail = |e| Error::io(path, e);
    let mut start = Vec::new();
    File::open(path).map_err(fail)?.take(HEAD as u64).read_to_end(&mut start).map_err(fail)?;
    Ok(match start.as_slice() {
        // Nothing, or what a crash of the machine left of it.
        start if start.iter().all(|&byte| byte == 0) || is_sealed(start) || png::is_ours(start) => false,
        [b'{', ..] => {
            let bytes = std::fs::read(path).map_err(fail)?;
            serde_json::from_slice::<serde_json::Value>(&bytes).is_ok_and(|value| value.get("provenance").is_none())
        }
        start if start.starts_with(b"glTF") => !gltf::is_ours(start),
        start if start.starts_with(&EXR) => ExrImage::read_provenance(path).is_ok_and(|found| found.is_none()),
        _ => !video::is_ours(path).map_err(fail)?,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::io::{Provenance, Samples, json};

    #[test]
    fn inputs_and_other_peoples_files_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        let file = |name: &str, bytes: &[u8]| {
            std::fs::write(at(name), bytes).unwrap();
            at(name)
        };
        let picture = |provenance: Option<Provenance>| {
            let channels = vec![("Y".into(), Samples::F32(vec![1.0]))];
            ExrImage { width: 1, height: 1, channels, provenance, to_rec709: None }
        };
        let ours = picture(Some(Provenance::new("curvature", "", 0, &0)));
        ours.write(&at("ours.exr")).unwrap();
        picture(None).write(&at("photograph.exr")).unwrap();
        let whole = std::fs::read(at("ours.exr")).unwrap();
        json::write(&at("probes.json"), &serde_json::json!({"provenance": {}})).unwrap();
        let sealed = std::fs::read_to_string(at("probes.json")).unwrap();
        let none: [&PathBuf; 0] = [];
        for kept in [
            file("vase.obj", b"v 0 0 0\n"),
            file("path.json", br#"{"frames": []}"#),
            file("list.json", b"[]"),
            file("parcels.json", br#"{"checksum": "crc32"}"#),
            at("photograph.exr"),
            file("holiday.mp4", b"\0\0\0\x20ftypisom"),
        ] {
            assert!(refuse(&kept, none).unwrap_err().to_string().contains("not written by reprobe"), "{}", kept.display());
        }
        for made_anew in [
            at("new.exr"),
            at("ours.exr"),
            file("cut.exr", &whole[..whole.len() / 2]),
            file("walk.mp4", b"\0\0\0\x20ftypisom\0\0\0\x17freemade by reprobe"),
            file("empty.exr", b""),
            file("zeros.exr", &[0; 100]),
            file("flipped.exr", &[&[whole[0] ^ 1], &whole[1..]].concat()),
            file("flipped.json", sealed.replace("provenance", "pzovenance").as_bytes()),
            file("beheaded.json", sealed.replace('{', "y").as_bytes()),
            at("probes.json"),
            file("cut.json", br#"{"prov"#),
            folder.path().to_owned(),
        ] {
            refuse(&made_anew, none).unwrap();
        }
        // The same file and folder by other names.
        let other = folder.path().join(".").join("ours.exr");
        assert!(refuse(&other, [&at("ours.exr")]).unwrap_err().to_string().contains("an input"));
        assert!(refuse(&folder.path().join("."), [&folder.path().to_owned()]).is_err());
    }
}
