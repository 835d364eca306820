//! The steps of a `transform`, composed as Mitsuba does: each acts after those before it.

use glam::{DMat4, DVec3, DVec4};

/// No coordinate of a sane scene is larger, and products of a few stay finite in single precision.
const LARGEST: f64 = 1e15;

/// A transform under construction.
#[derive(Debug, Clone, Copy)]
pub struct Steps(DMat4);

impl Default for Steps {
    fn default() -> Self {
        Self(DMat4::IDENTITY)
    }
}

impl Steps {
    /// Moves.
    pub fn translate(&mut self, by: DVec3) -> Result<(), String> {
        self.then(DMat4::from_translation(by))
    }

    /// Scales about the origin.
    pub fn scale(&mut self, by: DVec3) -> Result<(), String> {
        self.then(DMat4::from_scale(by))
    }

    /// Turns about an axis through the origin, counter-clockwise as the axis points at the viewer.
    pub fn rotate(&mut self, axis: DVec3, degrees: f64) -> Result<(), String> {
        let axis = axis.try_normalize().ok_or("rotate: the axis has no length")?;
        self.then(DMat4::from_axis_angle(axis, degrees.to_radians()))
    }

    /// Puts +Z towards `target` from `origin`, +Y near `up`.
    pub fn look_at(&mut self, origin: DVec3, target: DVec3, up: Option<DVec3>) -> Result<(), String> {
        let z = (target - origin).try_normalize().ok_or("lookat: origin and target are the same point")?;
        let up = up.unwrap_or_else(|| z.any_orthonormal_vector());
        let x = up.cross(z).try_normalize().ok_or("lookat: up is parallel to the view, or zero")?;
        self.then(DMat4::from_cols(x.extend(0.0), z.cross(x).extend(0.0), z.extend(0.0), origin.extend(1.0)))
    }

    /// A matrix of 16 (or 9, without translation) numbers, row after row.
    pub fn matrix(&mut self, rows: &[f64]) -> Result<(), String> {
        let m = match rows.len() {
            16 => DMat4::from_cols_slice(rows).transpose(),
            9 => DMat4::from_mat3(glam::DMat3::from_cols_slice(rows).transpose()),
            n => return Err(format!("matrix: {n} numbers, expected 16 or 9")),
        };
        if m.row(3) != DVec4::W {
            return Err(format!("matrix: its last row is {}, expected 0 0 0 1 (an affine map)", m.row(3)));
        }
        self.then(m)
    }

    fn then(&mut self, step: DMat4) -> Result<(), String> {
        self.0 = step * self.0;
        match self.0.to_cols_array().into_iter().find(|x| x.is_nan() || x.abs() > LARGEST) {
            Some(x) => Err(format!("the transform holds {x:e}, expected finite numbers of at most {LARGEST:e}")),
            None => Ok(()),
        }
    }

    /// All steps in one; one that flattens space (determinant 0) is an error.
    pub fn finish(self) -> Result<DMat4, String> {
        let inverse = self.0.inverse();
        let invertible = self.0.determinant() != 0.0 && inverse.is_finite() && inverse.as_mat4().is_finite();
        if invertible { Ok(self.0) } else { Err("the transform flattens space: expected one that can be inverted".into()) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn later_steps_act_on_the_result_of_earlier_ones() {
        let mut steps = Steps::default();
        steps.scale(DVec3::splat(2.0)).unwrap();
        steps.rotate(DVec3::Y, 90.0).unwrap();
        steps.translate(DVec3::new(1.0, 0.0, 0.0)).unwrap();
        let p = steps.finish().unwrap().transform_point3(DVec3::X);
        assert!((p - DVec3::new(1.0, 0.0, -2.0)).length() < 1e-12, "{p}");
    }

    #[test]
    fn look_at_has_x_to_the_left_of_the_view() {
        let mut steps = Steps::default();
        steps.look_at(DVec3::new(0.0, 0.0, 5.0), DVec3::ZERO, Some(DVec3::Y)).unwrap();
        let m = steps.finish().unwrap();
        assert!((m.transform_vector3(DVec3::Z) + DVec3::Z).length() < 1e-12);
        assert!((m.transform_vector3(DVec3::X) + DVec3::X).length() < 1e-12);
    }

    #[test]
    fn absurd_numbers_are_errors() {
        assert!(Steps::default().scale(DVec3::splat(f64::NAN)).is_err());
        assert!(Steps::default().translate(DVec3::splat(1e30)).is_err());
        assert!(Steps::default().matrix(&[1.0; 15]).is_err());
        assert!(Steps::default().matrix(&[1.0; 16]).is_err(), "projective");
        assert!(Steps::default().rotate(DVec3::ZERO, 1.0).is_err());
        assert!(Steps::default().look_at(DVec3::X, DVec3::X, None).is_err());
        let mut flat = Steps::default();
        flat.scale(DVec3::new(1.0, 0.0, 1.0)).unwrap();
        assert!(flat.finish().is_err());
    }
}
