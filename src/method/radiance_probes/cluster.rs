//! Receivers in groups that lie together: the leaves of a tree of boxes (§4.1).

use glam::Vec3;

/// Splits points, by their index, along the longest axis of their box at the median until no group has as many as `most`.
pub fn groups(points: &[Vec3], most: usize) -> Vec<Vec<u32>> {
    let mut done = Vec::new();
    let mut open = vec![(0..points.len() as u32).collect::<Vec<u32>>()];
    while let Some(group) = open.pop() {
        if group.len() < most.max(2) {
            done.push(group);
            continue;
        }
        let [a, b] = halves(points, group);
        open.extend([b, a]);
    }
    done
}

/// The two halves of a group along the longest axis of its box.
fn halves(points: &[Vec3], mut group: Vec<u32>) -> [Vec<u32>; 2] {
    let at = |i: &u32| points[*i as usize];
    let (low, high) = group.iter().map(at).fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(l, h), p| (l.min(p), h.max(p)));
    let axis = (high - low).max_position();
    let middle = group.len() / 2;
    group.select_nth_unstable_by(middle, |a, b| at(a)[axis].total_cmp(&at(b)[axis]).then(a.cmp(b)));
    let mut rest = group.split_off(middle);
    // In the order of the atlas, whatever the selection has done.
    group.sort_unstable();
    rest.sort_unstable();
    [group, rest]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::math::{hash_words, unit};

    #[test]
    fn groups_are_small_lie_together_and_hold_every_point_once() {
        let points: Vec<Vec3> =
            (0..5000u32).map(|i| Vec3::from_array([0u32, 1, 2].map(|k| unit(hash_words(&[i, k])) * (3 - k) as f32))).collect();
        let groups = groups(&points, 100);
        assert!(groups.iter().all(|g| (50..100).contains(&g.len())), "{:?}", groups.iter().map(Vec::len).max());
        let mut all: Vec<u32> = groups.concat();
        all.sort_unstable();
        assert_eq!(all, (0..5000).collect::<Vec<u32>>());
        let extent = |g: &Vec<u32>| {
            let p = g.iter().map(|&i| points[i as usize]);
            (p.clone().fold(Vec3::NEG_INFINITY, Vec3::max) - p.fold(Vec3::INFINITY, Vec3::min)).max_element()
        };
        // 64 cells of a box of 3 x 2 x 1.
        assert!(groups.iter().map(extent).fold(0.0, f32::max) < 0.9);
        assert_eq!(super::groups(&[], 10), vec![Vec::<u32>::new()]);
        assert!(super::groups(&[Vec3::ZERO; 300], 10).iter().all(|g| g.len() < 10), "points in one place are no trouble");
    }
}
