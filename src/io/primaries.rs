//! What red, green and blue a file means, and how they become Rec.709's.

use glam::{DMat3, DVec3, Mat3, Vec3};

/// Red, green, blue and white of Rec.709 on CIE's chromaticity diagram (x, y).
const REC709: [[f32; 2]; 4] = [[0.64, 0.33], [0.3, 0.6], [0.15, 0.06], [0.3127, 0.329]];

/// Colours of the given red, green, blue and white (x, y each) to Rec.709; `None` where they are those.
///
/// As Mitsuba and OpenEXR: through XYZ as it is, without an adaptation of one white to the other, so that luminance stays.
pub fn to_rec709(primaries: [[f32; 2]; 4]) -> Result<Option<Mat3>, String> {
    let distance: f32 = primaries.iter().flatten().zip(REC709.iter().flatten()).map(|(a, b)| (a - b).powi(2)).sum();
    if distance < 1e-6 {
        return Ok(None);
    }
    let matrix = xyz_from_rgb(REC709).inverse() * xyz_from_rgb(primaries);
    match matrix.is_finite() {
        true => Ok(Some(matrix.as_mat3())),
        false => Err(format!("{primaries:?} are no primaries: expected a red, green, blue and white that span the colours")),
    }
}

/// A colour of CIE XYZ.
pub fn rec709_from_xyz(xyz: Vec3) -> Vec3 {
    (xyz_from_rgb(REC709).inverse() * xyz.as_dvec3()).as_vec3()
}

/// The shares of red, green and blue in luminance; Rec.709's where no primaries are named.
pub fn luminance_weights(primaries: Option<[[f32; 2]; 4]>) -> [f32; 3] {
    xyz_from_rgb(primaries.unwrap_or(REC709)).row(1).as_vec3().to_array()
}

/// To XYZ, white having the luminance 1.
fn xyz_from_rgb(primaries: [[f32; 2]; 4]) -> DMat3 {
    let [r, g, b, white] = primaries.map(|[x, y]| DVec3::new(x.into(), y.into(), 1.0 - f64::from(x) - f64::from(y)));
    let unscaled = DMat3::from_cols(r, g, b);
    unscaled * DMat3::from_diagonal(unscaled.inverse() * (white / white.y))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Values: Mitsuba 3.9.1, `Bitmap` of (0.2, 0.5, 0.8) in an EXR file of these primaries.
    #[test]
    fn wide_primaries_become_what_mitsuba_makes_of_them() {
        let d60 = [0.32168, 0.33767];
        for (name, primaries, expected) in [
            ("ACES", [[0.7347, 0.2653], [0.0, 1.0], [0.0001, -0.077], d60], [-0.361_508, 0.552_621, 0.787_116]),
            ("ACEScg", [[0.713, 0.293], [0.165, 0.83], [0.128, 0.044], d60], [-0.019_857, 0.534_153, 0.784_721]),
            ("Rec.2020", [[0.708, 0.292], [0.17, 0.797], [0.131, 0.046], [0.3127, 0.329]], [-0.020_002, 0.534_860, 0.841_064]),
            ("DCI-P3", [[0.68, 0.32], [0.265, 0.69], [0.15, 0.06], [0.314, 0.351]], [0.106_818, 0.535_821, 0.719_053]),
        ] {
            let found = to_rec709(primaries).unwrap().unwrap() * Vec3::new(0.2, 0.5, 0.8);
            assert!((found - Vec3::from(expected)).abs().max_element() < 2e-6, "{name}: {found}");
        }
        // XYZ itself: the textbook's matrix.
        let xyz = to_rec709([[1.0, 0.0], [0.0, 1.0], [0.0, 0.0], [1.0 / 3.0; 2]]).unwrap().unwrap();
        assert!((xyz * Vec3::Y - Vec3::new(-1.5372, 1.876, -0.204)).abs().max_element() < 5e-4);
        assert!((rec709_from_xyz(Vec3::Y) - Vec3::new(-1.5372, 1.876, -0.204)).abs().max_element() < 5e-4);
        assert_eq!(to_rec709(REC709), Ok(None));
        assert!(to_rec709([[0.3, 0.3]; 4]).is_err());
    }
}
