//! The steps of a `transform`, composed as Mitsuba does: each acts after those before it.

use glam::{DMat3, DMat4, DVec3, DVec4};

/// No coordinate of a sane scene is larger, and products of a few stay finite in single precision.
const LARGEST: f64 = 1e15;

/// Extent of what is flat, of the largest of the others.
const THIN: f64 = 1e-6;

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
    ///
    /// As Mitsuba 3 (and not 0.6), the axis is taken as it is: one that is not of unit length scales too.
    pub fn rotate(&mut self, axis: DVec3, degrees: f64) -> Result<(), String> {
        axis.try_normalize().ok_or("rotate: the axis has no length")?;
        let (sin, cos) = degrees.to_radians().sin_cos();
        let column = |unit: DVec3| axis * (axis.dot(unit) * (1.0 - cos)) + unit * cos + axis.cross(unit) * sin;
        self.then(DMat4::from_mat3(DMat3::from_cols(column(DVec3::X), column(DVec3::Y), column(DVec3::Z))))
    }

    /// Puts +Z towards `target` from `origin`, +Y near `up`. Without it, or where it is zero, as Mitsuba completes a basis (Duff et
    /// al. 2017).
    pub fn look_at(&mut self, origin: DVec3, target: DVec3, up: Option<DVec3>) -> Result<(), String> {
        let z = (target - origin).try_normalize().ok_or("lookat: origin and target are the same point")?;
        let up = up.filter(|up| *up != DVec3::ZERO).unwrap_or_else(|| z.any_orthonormal_pair().0);
        let x = up.cross(z).try_normalize().ok_or("lookat: up is parallel to the view, or zero")?;
        self.then(DMat4::from_cols(x.extend(0.0), z.cross(x).extend(0.0), z.extend(0.0), origin.extend(1.0)))
    }

    /// A matrix of 16 (or 9, without translation) numbers, row after row.
    pub fn matrix(&mut self, rows: &[f64]) -> Result<(), String> {
        let m = match rows.len() {
            16 => DMat4::from_cols_slice(rows).transpose(),
            9 => DMat4::from_mat3(DMat3::from_cols_slice(rows).transpose()),
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

    /// All steps in one. One that takes all extent from one axis leaves it a millionth of the largest, so that it can be inverted:
    /// what is flat looks the same. One that flattens space otherwise is an error.
    pub fn finish(mut self) -> Result<DMat4, String> {
        let axes = [0, 1, 2].map(|k| self.0.col(k).truncate());
        let largest = axes.iter().map(|a| a.length()).fold(0.0, f64::max);
        if let Some(k) = axes.iter().position(|a| *a == DVec3::ZERO) {
            let normal = axes[(k + 1) % 3].cross(axes[(k + 2) % 3]).normalize_or_zero();
            *self.0.col_mut(k) = (normal * largest * THIN).extend(0.0);
        }
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

    /// Mitsuba 3.9.1's `to_world` of `<lookat origin="1,2,3" target="..."/>`: its columns x and y.
    #[test]
    fn look_at_without_up_is_completed_as_mitsuba_does() {
        for (target, x, y) in [
            ([-1.0, 0.5, 0.0], [-0.11125, 0.91656, -0.38411], [0.85166, -0.11125, -0.51215]),
            ([1.0, 2.0, 8.0], [0.0, -1.0, 0.0], [1.0, 0.0, 0.0]),
            ([1.0, 5.0, 3.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]),
        ] {
            for up in [None, Some(DVec3::ZERO)] {
                let mut steps = Steps::default();
                steps.look_at(DVec3::new(1.0, 2.0, 3.0), DVec3::from(target), up).unwrap();
                let m = steps.finish().unwrap();
                for (k, column) in [x, y].into_iter().enumerate() {
                    assert!((m.col(k).truncate() - DVec3::from(column)).length() < 2e-5, "{target:?}: {m}");
                }
            }
        }
    }

    /// Mitsuba 3.9.1's `rotate` about (1, 1, 0) by 90 degrees and about (0, 2, 0) by 30: rows.
    #[test]
    fn rotation_axes_count_as_they_are() {
        for (axis, degrees, rows) in [
            ([1.0, 1.0, 0.0], 90.0, [[1.0, 1.0, 1.0], [1.0, 1.0, -1.0], [-1.0, 1.0, 0.0]]),
            ([0.0, 2.0, 0.0], 30.0, [[0.866_025, 0.0, 1.0], [0.0, 1.401_924, 0.0], [-1.0, 0.0, 0.866_025]]),
        ] {
            let mut steps = Steps::default();
            steps.rotate(DVec3::from(axis), degrees).unwrap();
            let m = DMat3::from_mat4(steps.finish().unwrap());
            let expected = DMat3::from_cols_array_2d(&rows).transpose();
            assert!(m.abs_diff_eq(expected, 1e-5), "{axis:?}: {m}");
        }
    }

    #[test]
    fn absurd_numbers_are_errors() {
        assert!(Steps::default().scale(DVec3::splat(f64::NAN)).is_err());
        assert!(Steps::default().translate(DVec3::splat(1e30)).is_err());
        assert!(Steps::default().matrix(&[1.0; 15]).is_err());
        assert!(Steps::default().matrix(&[1.0; 16]).is_err(), "projective");
        assert!(Steps::default().rotate(DVec3::ZERO, 1.0).is_err());
        assert!(Steps::default().look_at(DVec3::X, DVec3::X, None).is_err());
        let flattened = |by| {
            let mut flat = Steps::default();
            flat.scale(by).unwrap();
            flat.finish()
        };
        let flat = flattened(DVec3::new(1.0, 0.0, 2.0)).unwrap();
        assert!((flat.transform_point3(DVec3::ONE) - DVec3::new(1.0, 0.0, 2.0)).length() < 1e-5);
        assert!(flattened(DVec3::new(1.0, 0.0, 0.0)).is_err());
        let mut slanted = Steps::default();
        slanted.matrix(&[1.0, 1.0, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0, 1.0]).unwrap();
        assert!(slanted.finish().is_err());
    }
}
