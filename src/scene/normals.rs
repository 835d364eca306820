//! Vertex normals that a file does not give.
//!
//! Ours, as Mitsuba: a vertex's normal is the mean of its triangles' normals, weighted by the angle that each triangle has
//! there (Thürmer and Wüthrich 1998), so that it does not depend on how a flat polygon was cut.

use glam::{Mat3, Vec3};

/// Smooth unit normals of a mesh. A vertex of no triangle with area gets +X, as in Mitsuba.
pub fn smooth(positions: &[Vec3], triangles: &[[u32; 3]]) -> Vec<Vec3> {
    let mut sums = vec![Vec3::ZERO; positions.len()];
    for t in triangles {
        let p = t.map(|i| positions[i as usize]);
        let Some(n) = unit_normal(p) else { continue };
        for k in 0..3 {
            let (a, b) = (p[(k + 1) % 3] - p[k], p[(k + 2) % 3] - p[k]);
            sums[t[k] as usize] += n * a.cross(b).length().atan2(a.dot(b));
        }
    }
    sums.into_iter().map(|n| n.try_normalize().unwrap_or(Vec3::X)).collect()
}

/// Makes normals unit, and replaces those without a direction by smooth ones.
pub fn normalize_or_smooth(normals: &mut [Vec3], positions: &[Vec3], triangles: &[[u32; 3]]) {
    let mut fallback: Option<Vec<Vec3>> = None;
    for (i, n) in normals.iter_mut().enumerate() {
        // Scaling first keeps the squared length away from under- and overflow.
        *n = (*n / n.abs().max_element())
            .try_normalize()
            .unwrap_or_else(|| fallback.get_or_insert_with(|| smooth(positions, triangles))[i]);
    }
}

/// Unit normal of a triangle; none where it has no area.
pub fn unit_normal([a, b, c]: [Vec3; 3]) -> Option<Vec3> {
    let (e, f) = (b - a, c - a);
    let scale = e.abs().max(f.abs()).max_element();
    (e / scale).cross(f / scale).try_normalize()
}

/// det(m) times the inverse transpose of `m`: defined for singular ones too.
pub fn cofactor(m: Mat3) -> Mat3 {
    Mat3::from_cols(m.y_axis.cross(m.z_axis), m.z_axis.cross(m.x_axis), m.x_axis.cross(m.y_axis))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Values of Mitsuba 3.9.1's `obj` for the same mesh.
    #[test]
    fn smooth_normals_are_those_of_mitsuba() {
        let p = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.5], [0.0, 1.0, 0.0], [0.2, 0.3, 1.0]].map(Vec3::from);
        let expected = [
            [-0.249_913_56, 0.629_288_26, 0.735_893_67],
            [0.0, 0.152_229_8, 0.988_345_1],
            [-0.235_702_28, -0.235_702_28, 0.942_809_1],
            [-0.447_213_6, 0.0, 0.894_427_2],
            [0.0, 0.957_826_26, -0.287_347_9],
        ];
        for (n, e) in smooth(&p, &[[0, 1, 2], [0, 2, 3], [0, 4, 1]]).into_iter().zip(expected) {
            assert!((n - Vec3::from(e)).length() < 2e-5, "{n} {e:?}");
        }
    }

    #[test]
    fn normals_without_direction_are_replaced() {
        let p = [Vec3::ZERO, Vec3::X, Vec3::Y];
        let mut n = [Vec3::ZERO, Vec3::new(0.0, 0.0, 1e-30), Vec3::new(0.0, 3e30, 0.0)];
        normalize_or_smooth(&mut n, &p, &[[0, 1, 2]]);
        assert_eq!(n, [Vec3::Z, Vec3::Z, Vec3::Y]);
    }

    #[test]
    fn tiny_triangles_have_normals_and_slivers_do_not() {
        assert_eq!(unit_normal([Vec3::ZERO, Vec3::X * 1e-25, Vec3::Y * 1e-25]), Some(Vec3::Z));
        assert_eq!(unit_normal([Vec3::ZERO, Vec3::X, Vec3::X * 2.0]), None);
        assert_eq!(unit_normal([Vec3::ONE; 3]), None);
    }
}
