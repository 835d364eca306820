//! Camera paths: `PATH.json`, single frames or keyframes with a Catmull-Rom spline between them.

use super::Camera;
use super::camera::FovAxis;
use super::spline::Spline;
use crate::io::{json, read_text};
use crate::{Error, Result};
use glam::{DVec3, Vec3};
use serde::Deserialize;
use std::path::Path;

/// Most frames of a path.
const MAX_FRAMES: f64 = 1e6;

/// What the file holds.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
struct PathFile {
    /// Field of view, degrees, for frames that give none.
    fov: Option<f64>,
    #[serde(default)]
    fov_axis: FovAxis,
    /// Width and height, pixels.
    size: Option<[u32; 2]>,
    frames: Option<Vec<FrameEntry>>,
    keyframes: Option<Vec<Keyframe>>,
    /// Frames a second between keyframes.
    fps: Option<f64>,
}

#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(deny_unknown_fields)]
struct FrameEntry {
    origin: DVec3,
    target: DVec3,
    #[serde(default = "y_up")]
    up: DVec3,
    fov: Option<f64>,
}

#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(deny_unknown_fields)]
struct Keyframe {
    /// Seconds.
    time: f64,
    origin: DVec3,
    target: DVec3,
    #[serde(default = "y_up")]
    up: DVec3,
    fov: Option<f64>,
}

fn y_up() -> DVec3 {
    DVec3::Y
}

/// Reads a path: a camera a frame. `unit_scale` multiplies its lengths, as it does the scene's. Where the file gives no
/// field of view or size, those of the scene's `sensor` count.
pub fn load(path: &Path, sensor: Option<&Camera>, unit_scale: f32) -> Result<Vec<Camera>> {
    parse(path, &read_text(path)?, sensor, unit_scale)
}

/// Frames a second that the file names.
pub fn fps(path: &Path) -> Result<Option<f64>> {
    let file: PathFile = json::written_by_hand(path, &read_text(path)?)?;
    Ok(file.fps.filter(|fps| *fps > 0.0 && fps.is_finite()))
}

/// [`load`], of a text; `path` is for messages.
pub fn parse(path: &Path, text: &str, sensor: Option<&Camera>, unit_scale: f32) -> Result<Vec<Camera>> {
    let bad = |message: String| Error::input(path, message);
    let file: PathFile = json::written_by_hand(path, text)?;
    let Some(size) = file.size.or(sensor.map(|s| s.size)) else {
        return Err(bad("found no \"size\", and the scene has no sensor to take it from".into()));
    };
    if !size.iter().all(|n| (1..=65_536).contains(n)) {
        return Err(bad(format!("size = {size:?}: expected 1 to 65536 pixels a side")));
    }
    let (what, frames) = match (&file.frames, &file.keyframes) {
        (Some(frames), None) => ("frames", frames.clone()),
        (None, Some(keys)) => ("frames between keyframes", interpolate(keys, &file).map_err(bad)?),
        (Some(_), Some(_)) => return Err(bad("found both \"frames\" and \"keyframes\", expected one of them".into())),
        (None, None) => return Err(bad("found neither \"frames\" nor \"keyframes\"".into())),
    };
    if frames.is_empty() {
        return Err(bad("the path has no frame".into()));
    }
    let camera = |(i, frame): (usize, &FrameEntry)| {
        camera(frame, &file, size, sensor, unit_scale).map_err(|m| bad(format!("{what}[{i}]: {m}")))
    };
    frames.iter().enumerate().map(camera).collect()
}

fn camera(
    frame: &FrameEntry,
    file: &PathFile,
    size: [u32; 2],
    sensor: Option<&Camera>,
    unit_scale: f32,
) -> std::result::Result<Camera, String> {
    let fov_x = match frame.fov.or(file.fov) {
        Some(fov) if fov > 0.0 && fov < 180.0 => file.fov_axis.fov_x(fov.to_radians() as f32, size),
        Some(fov) => return Err(format!("fov = {fov}: expected more than 0 and less than 180 degrees")),
        None => sensor.map(|s| s.fov_x).ok_or("no \"fov\", and the scene has no sensor to take it from")?,
    };
    let FrameEntry { origin, target, up, .. } = *frame;
    let (origin_f32, target_f32) = (origin.as_vec3() * unit_scale, target.as_vec3() * unit_scale);
    if !(origin_f32.is_finite() && target_f32.is_finite() && up.as_vec3().is_finite()) {
        return Err(format!("origin {origin}, target {target}, up {up}: expected finite numbers"));
    }
    let z = (target_f32 - origin_f32).try_normalize().ok_or_else(|| format!("origin and target are both {origin}"))?;
    // A milliradian: nearer than that, the direction of "up" is rounding.
    let up = up.as_vec3().try_normalize().filter(|up| up.cross(z).length() > 1e-3);
    let up: Vec3 = up.ok_or_else(|| format!("up {} is parallel to the view {z}, or zero", frame.up))?;
    let camera = Camera::look_at(origin_f32, target_f32, up, fov_x, size);
    match camera.can_see() {
        true => Ok(camera),
        false => Err(format!("a field of view of {fov_x} radians across is too small or too large")),
    }
}

/// Frames at every 1 / fps second from the first keyframe to the last.
fn interpolate(keys: &[Keyframe], file: &PathFile) -> std::result::Result<Vec<FrameEntry>, String> {
    let (Some(first), Some(last)) = (keys.first(), keys.last()) else { return Ok(Vec::new()) };
    let spline = Spline::new(keys.iter().map(|k| k.time).collect())?;
    let some_fov = keys.iter().any(|k| k.fov.is_some());
    if some_fov && file.fov.is_none() && keys.iter().any(|k| k.fov.is_none()) {
        return Err("some keyframes give a \"fov\" and some do not: give it to all, or to the path".into());
    }
    let fps = match file.fps {
        Some(fps) if fps > 0.0 && fps.is_finite() => fps,
        Some(fps) => return Err(format!("fps = {fps}: expected more than 0")),
        None if keys.len() == 1 => 1.0,
        None => return Err("found \"keyframes\" without \"fps\"".into()),
    };
    // The last keyframe is a frame too where it falls on one, rounding aside.
    let count = ((last.time - first.time) * fps + 1e-6).floor() + 1.0;
    if count > MAX_FRAMES {
        return Err(format!("{count} frames are more than the {MAX_FRAMES} allowed"));
    }
    let column = |of: &dyn Fn(&Keyframe) -> DVec3| keys.iter().map(of).collect::<Vec<_>>();
    let (origins, targets, ups) = (column(&|k| k.origin), column(&|k| k.target), column(&|k| k.up));
    let fovs = some_fov.then(|| column(&|k| DVec3::splat(k.fov.or(file.fov).unwrap_or(0.0))));
    let frame = |i: usize| {
        let time = (first.time + i as f64 / fps).min(last.time);
        FrameEntry {
            origin: spline.at(&origins, time),
            target: spline.at(&targets, time),
            up: spline.at(&ups, time),
            fov: fovs.as_ref().map(|f| spline.at(f, time).x),
        }
    };
    Ok((0..count as usize).map(frame).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<Vec<Camera>> {
        parse(Path::new("p.json"), text, None, 1.0)
    }

    #[test]
    fn frames_become_cameras_with_their_own_fov() {
        let cameras = read(
            r#"{"fov": 70, "fov_axis": "y", "size": [1920, 1080], "frames": [
                {"origin": [0, 1, 5], "target": [0, 1, 0], "up": [0, 1, 0]},
                {"origin": [1, 1, 5], "target": [0, 1, 0], "fov": 40}]}"#,
        )
        .unwrap();
        assert_eq!(cameras.len(), 2);
        assert_eq!(cameras[0].position(), Vec3::new(0.0, 1.0, 5.0));
        let vertical = |c: &Camera| (2.0 * (0.5 * 1080.0 / c.focal_px()).atan()).to_degrees();
        assert!((vertical(&cameras[0]) - 70.0).abs() < 1e-3 && (vertical(&cameras[1]) - 40.0).abs() < 1e-3);
        let middle = cameras[1].project(Vec3::new(0.0, 1.0, 0.0)).unwrap();
        assert!((middle - glam::Vec2::new(960.0, 540.0)).length() < 1e-2, "{middle}");
    }

    #[test]
    fn the_spline_passes_through_its_keys_and_keeps_a_steady_line_straight() {
        let text = r#"{"fov": 60, "size": [8, 8], "fps": 10, "keyframes": [
            {"time": 0, "origin": [0, 0, 5], "target": [0, 0, 0]},
            {"time": 0.5, "origin": [1, 0, 5], "target": [1, 0, 0]},
            {"time": 2, "origin": [4, 0, 5], "target": [4, 0, 0]}]}"#;
        let cameras = read(text).unwrap();
        assert_eq!(cameras.len(), 21);
        for (i, c) in cameras.iter().enumerate() {
            assert!((c.position() - Vec3::new(0.2 * i as f32, 0.0, 5.0)).length() < 1e-5, "{i}: {}", c.position());
        }
    }

    #[test]
    fn what_the_file_leaves_out_is_the_sensors() {
        let sensor = Camera::look_at(Vec3::ZERO, Vec3::Z, Vec3::Y, 0.7, [64, 32]);
        let text = r#"{"frames": [{"origin": [0, 0, 1], "target": [1, 0, 0]}]}"#;
        let cameras = parse(Path::new("p.json"), text, Some(&sensor), 2.0).unwrap();
        assert_eq!((cameras[0].fov_x, cameras[0].size, cameras[0].position()), (0.7, [64, 32], Vec3::new(0.0, 0.0, 2.0)));
        assert!(read(text).unwrap_err().to_string().contains("size"));
    }

    #[test]
    fn bad_paths_say_what_is_wrong_and_where() {
        let frame = r#""fov": 60, "size": [8, 8], "frames": [{"origin": [0, 0, 5], "target": [0, 0, 0]"#;
        for (text, expected) in [
            ("{", "p.json:1"),
            ("nonsense", "p.json:1"),
            ("{\n\"fov\": \"wide\"}", "p.json:2: invalid type"),
            ("{\n\"fow\": 70}", "p.json:2: unknown field `fow`"),
            ("{}", "size"),
            (r#"{"size": [8, 8], "fov": 60}"#, "neither"),
            (r#"{"size": [8, 8], "fov": 60, "frames": []}"#, "no frame"),
            (r#"{"size": [0, 8], "fov": 60, "frames": []}"#, "size = [0, 8]"),
            (&format!("{{{frame}, \"up\": [0, 0, 2]}}]}}"), "frames[0]: up"),
            (&format!("{{{frame}, \"fov\": 180}}]}}"), "frames[0]: fov = 180"),
            (&format!("{{{frame}}}, {{\"origin\": [1, 1, 1], \"target\": [1, 1, 1]}}]}}"), "frames[1]: origin and target"),
            (&format!("{{{frame}}}, {{\"origin\": [1, 1, 1e39], \"target\": [1, 1, 1]}}]}}"), "frames[1]"),
            (&format!("{{{frame}}}, {{\"origin\": [1, 1], \"target\": [1, 1, 1]}}]}}"), "invalid length 2"),
        ] {
            let message = read(text).unwrap_err().to_string();
            assert!(message.contains(expected), "{text}: {message}");
        }
        let keys = |times: [f64; 2], rest: &str| {
            let key = |t: f64| format!(r#"{{"time": {t}, "origin": [0, 0, 5], "target": [0, 0, 0]}}"#);
            format!(r#"{{"fov": 60, "size": [8, 8], "keyframes": [{}, {}]{rest}}}"#, key(times[0]), key(times[1]))
        };
        for (text, expected) in [
            (keys([0.0, 1.0], ""), "without \"fps\""),
            (keys([0.0, 1.0], ", \"fps\": 0"), "fps = 0"),
            (keys([1.0, 1.0], ", \"fps\": 5"), "keyframes[1]: time 1 follows 1"),
            (keys([0.0, 1e12], ", \"fps\": 5"), "more than"),
        ] {
            let message = read(&text).unwrap_err().to_string();
            assert!(message.contains(expected), "{text}: {message}");
        }
    }
}
