//! Which views to render: `--path`, `--size`, `--frames`.

use crate::common::Common;
use anyhow::{Context, bail};
use reprobe::scene::{Camera, Scene, camera_path as path};
use std::path::Path;

/// A frame of a path.
#[derive(Debug, Clone)]
pub struct View {
    /// Its number in the path: the name of its file.
    pub frame: u32,
    /// Its camera.
    pub camera: Camera,
}

/// Size of the largest of some views, pixels.
pub fn largest(views: &[View]) -> [u32; 2] {
    views.iter().map(|v| v.camera.size).max_by_key(|[w, h]| w * h).unwrap_or([0, 0])
}

/// A choice of frames, like `0,3,5-8`.
#[derive(Debug, Clone, PartialEq)]
pub struct FrameList(Vec<std::ops::RangeInclusive<u32>>);

impl std::fmt::Display for FrameList {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        let texts: Vec<String> = self.0.iter().map(|r| format!("{}-{}", r.start(), r.end())).collect();
        f.write_str(&texts.join(","))
    }
}

/// Parses `0,3,5-8`.
pub fn parse_frames(text: &str) -> Result<FrameList, String> {
    let item = |part: &str| {
        let (first, last) = part.split_once('-').unwrap_or((part, part));
        let range = first.trim().parse().ok()?..=last.trim().parse().ok()?;
        (range.start() <= range.end()).then_some(range)
    };
    let ranges: Option<Vec<_>> = text.split(',').map(item).collect();
    ranges.map(FrameList).ok_or_else(|| "expected frame numbers from 0, like 0,3,5-8".into())
}

/// The views of a camera path, or of the scene's own sensor, at `size` if given (the horizontal field of view stays).
pub fn views(
    common: &Common,
    scene: &Scene,
    path: Option<&Path>,
    size: Option<[u32; 2]>,
    frames: Option<&FrameList>,
) -> anyhow::Result<Vec<View>> {
    let mut cameras = match path {
        Some(file) => path::load(file, scene.sensor.as_ref(), common.unit_scale)?,
        None => {
            let sensor = scene.sensor.clone();
            vec![sensor.with_context(|| format!("{}: has no sensor; give a camera path with --path", scene.path.display()))?]
        }
    };
    if let Some(size) = size {
        cameras.iter_mut().for_each(|c| c.size = size);
    }
    let count = cameras.len();
    let chosen = |frame: u32| frames.is_none_or(|f| f.0.iter().any(|r| r.contains(&frame)));
    let views: Vec<View> = (0..).zip(cameras).filter(|(i, _)| chosen(*i)).map(|(frame, camera)| View { frame, camera }).collect();
    if views.is_empty() {
        bail!("--frames {}: the path has frames 0 to {}", frames.map(ToString::to_string).unwrap_or_default(), count - 1);
    }
    Ok(views)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frame_lists_parse_and_print() {
        assert_eq!(parse_frames("0,3,5-8").unwrap().to_string(), "0-0,3-3,5-8");
        for bad in ["", "a", "3-1", "1,,2", "-1"] {
            assert!(parse_frames(bad).is_err(), "{bad}");
        }
    }
}
