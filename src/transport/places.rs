//! Places that something is learned for: how far they reach, and which way their surfaces face.

use glam::Vec3;

/// Lower and upper corner of all points but the furthest fiftieth on either side of each axis; zero where there are none.
pub(super) fn middle_of(mut points: Vec<Vec3>) -> [Vec3; 2] {
    let few = points.len() / 50;
    let mut corners = [Vec3::ZERO; 2];
    for k in 0..3 {
        points.sort_by(|a, b| a[k].total_cmp(&b[k]));
        if let (Some(low), Some(high)) = (points.get(few), points.iter().rev().nth(few)) {
            (corners[0][k], corners[1][k]) = (low[k], high[k]);
        }
    }
    corners
}

/// Which of six ways a normal points: its largest component, and that one's sign.
pub(super) fn side_of(n: Vec3) -> u32 {
    let size = n.abs();
    let axis = if size.x >= size.y && size.x >= size.z { 0 } else { 1 + usize::from(size.z > size.y) };
    2 * axis as u32 + u32::from(n[axis] > 0.0)
}
