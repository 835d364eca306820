//! Which views to render: those of a camera path, or the scene's own sensor's.

use crate::scene::{Camera, Scene, camera_path};
use crate::view::View;
use crate::{Error, Result};
use std::path::Path;

/// A choice of frames, like `0,3,5-8`.
#[derive(Debug, Clone, PartialEq)]
pub struct FrameList(Vec<std::ops::RangeInclusive<u32>>);

impl FrameList {
    /// These frames, in ascending order.
    pub fn of(frames: impl IntoIterator<Item = u32>) -> Self {
        let mut ranges: Vec<std::ops::RangeInclusive<u32>> = Vec::new();
        for frame in frames {
            match ranges.last_mut() {
                Some(last) if last.end().checked_add(1) == Some(frame) => *last = *last.start()..=frame,
                _ => ranges.push(frame..=frame),
            }
        }
        Self(ranges)
    }

    /// Whether it has a frame.
    pub fn has(&self, frame: u32) -> bool {
        self.0.iter().any(|r| r.contains(&frame))
    }
}

impl std::fmt::Display for FrameList {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        let text = |r: &std::ops::RangeInclusive<u32>| match (r.start(), r.end()) {
            (first, last) if first == last => first.to_string(),
            (first, last) => format!("{first}-{last}"),
        };
        f.write_str(&self.0.iter().map(text).collect::<Vec<_>>().join(","))
    }
}

impl std::str::FromStr for FrameList {
    type Err = String;

    fn from_str(text: &str) -> std::result::Result<Self, String> {
        let item = |part: &str| {
            let (first, last) = part.split_once('-').unwrap_or((part, part));
            let range = first.trim().parse().ok()?..=last.trim().parse().ok()?;
            (range.start() <= range.end()).then_some(range)
        };
        let ranges: Option<Vec<_>> = text.split(',').map(item).collect();
        ranges.map(Self).ok_or_else(|| "expected frame numbers from 0, like 0,3,5-8".into())
    }
}

super::option::text!(FrameList);

/// The views of a camera path, or of the scene's own sensor, at `size` if given (the horizontal field of view stays).
pub fn views(scene: &Scene, path: Option<&Path>, size: Option<[u32; 2]>, frames: Option<&FrameList>) -> Result<Vec<View>> {
    chosen(cameras(scene, path, size)?, frames)
}

/// The same for a scene that changes: a single camera stays for so many frames, and of several each has its own.
pub fn views_of_changes(
    scene: &Scene,
    path: Option<&Path>,
    size: Option<[u32; 2]>,
    frames: Option<&FrameList>,
    count: u32,
) -> Result<Vec<View>> {
    let mut cameras = cameras(scene, path, size)?;
    if let [only] = cameras.as_slice() {
        cameras = vec![only.clone(); count as usize];
    }
    chosen(cameras, frames)
}

fn cameras(scene: &Scene, path: Option<&Path>, size: Option<[u32; 2]>) -> Result<Vec<Camera>> {
    let mut cameras = match path {
        Some(file) => camera_path::load(file, scene.sensor.as_ref(), scene.unit_scale.0)?,
        None => {
            let missing = || Error::input(&scene.path, "has no sensor; give a camera path with --path");
            vec![scene.sensor.clone().ok_or_else(missing)?]
        }
    };
    if let Some(size) = size {
        cameras.iter_mut().for_each(|c| c.size = size);
    }
    Ok(cameras)
}

fn chosen(cameras: Vec<Camera>, frames: Option<&FrameList>) -> Result<Vec<View>> {
    let count = cameras.len();
    let chosen = |frame: u32| frames.is_none_or(|f| f.has(frame));
    let views: Vec<View> = (0..).zip(cameras).filter(|(i, _)| chosen(*i)).map(|(frame, camera)| View { frame, camera }).collect();
    if views.is_empty() {
        let frames = frames.map(ToString::to_string).unwrap_or_default();
        return Err(Error::Request(format!("--frames {frames}: the path has frames 0 to {}", count - 1)));
    }
    Ok(views)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frame_lists_parse_and_print() {
        assert_eq!("0,3,5-8".parse::<FrameList>().unwrap().to_string(), "0,3,5-8");
        assert_eq!(FrameList::of([0, 3, 5, 6, 7, 8]).to_string(), "0,3,5-8");
        for bad in ["", "a", "3-1", "1,,2", "-1"] {
            assert!(bad.parse::<FrameList>().is_err(), "{bad}");
        }
    }
}
