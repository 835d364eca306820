//! What every loaded scene goes through, whatever file it came in.

use crate::scene::units::{self, UnitScale};
use crate::scene::{Scene, hash};
use crate::{Error, Result};
use std::path::Path;

/// A scene in metres: `build` makes it with its lengths multiplied by `wanted`, or by what [`units::metric`] says.
pub fn in_metres(path: &Path, wanted: Option<f32>, build: impl Fn(UnitScale) -> Result<Scene>) -> Result<Scene> {
    let build = |scale| build(scale).and_then(checked);
    let mut scene = build(UnitScale(wanted.unwrap_or(1.0)))?;
    if wanted.is_none()
        && let Some(scale) = units::metric(&scene.geometry)
    {
        // Built anew, as lengths are rounded only once that way.
        scene = build(scale)?;
        let (path, scale) = (path.display(), scale.0);
        scene.warnings.push(format!(
            "{path} is too small or too large for metres: all its lengths are taken times {scale:e}, in outputs and options too \
             (--unit-scale {scale:e}; 1 leaves them as they are)"
        ));
    }
    scene.hash = hash::content(&scene)?;
    Ok(scene)
}

/// Refuses a scene that nothing can be seen of.
fn checked(mut scene: Scene) -> Result<Scene> {
    if let Some(sensor) = &mut scene.sensor {
        sensor.drop_idle_clip(&scene.geometry);
    }
    if scene.geometry.triangles.is_empty() {
        return Err(Error::input(&scene.path, "the scene has no triangles"));
    }
    if let Some(i) = scene.geometry.positions.iter().position(|p| !p.is_finite()) {
        let (path, found) = (&scene.path, scene.geometry.positions[i]);
        return Err(Error::input(path, format!("a vertex stands at {found} in the scene, expected finite numbers")));
    }
    let area: f64 = (0..scene.geometry.triangles.len() as u32).map(|t| f64::from(scene.geometry.area_normal(t).length())).sum();
    if !(area > 0.0 && area.is_finite()) {
        return Err(Error::input(
            &scene.path,
            format!("all triangles together have an area of {}: expected more than 0", area / 2.0),
        ));
    }
    if scene.emitters.is_empty() {
        scene.warnings.push(format!("{}: the scene has no emitter, so every image of it is black", scene.path.display()));
    }
    Ok(scene)
}
