//! Rectangles into a strip of fixed width, lowest place first (the "skyline" heuristic).
//!
//! Ours: some hundred lines less than it sounds, and fast where packing crates are not: 100 k tiny
//! rectangles take well under a second, because a skyline has at most as many steps as the strip has texels.

/// One step of the skyline.
#[derive(Clone, Copy, Debug)]
struct Step {
    x: u32,
    y: u32,
    width: u32,
}

/// Places rectangles (width, height) without overlap in a strip `width` wide; returns their upper left corners
/// and the height used. `None` where one is wider than the strip. Same input, same places.
pub fn pack(sizes: &[(u32, u32)], width: u32) -> Option<(Vec<(u32, u32)>, u32)> {
    if sizes.iter().any(|s| s.0 > width) {
        return None;
    }
    let mut order: Vec<usize> = (0..sizes.len()).collect();
    order.sort_by_key(|&i| (std::cmp::Reverse((sizes[i].1, sizes[i].0)), i));
    let mut skyline = vec![Step { x: 0, y: 0, width }];
    let mut places = vec![(0, 0); sizes.len()];
    let mut height = 0;
    for i in order {
        let (w, h) = sizes[i];
        let (at, y) = lowest(&skyline, w, width)?;
        let x = skyline[at].x;
        places[i] = (x, y);
        height = height.max(y + h);
        raise(&mut skyline, at, Step { x, y: y + h, width: w });
    }
    Some((places, height))
}

/// The step at which a rectangle of width `w` lies lowest, and how low; the leftmost of equals.
fn lowest(skyline: &[Step], w: u32, width: u32) -> Option<(usize, u32)> {
    let mut best: Option<(usize, u32)> = None;
    for (i, step) in skyline.iter().enumerate() {
        if step.x + w > width {
            break;
        }
        if best.is_some_and(|b| step.y >= b.1) {
            continue;
        }
        let end = step.x + w;
        let y = skyline[i..].iter().take_while(|s| s.x < end).map(|s| s.y).max().unwrap_or(0);
        if best.is_none_or(|b| y < b.1) {
            best = Some((i, y));
        }
    }
    best
}

fn raise(skyline: &mut Vec<Step>, at: usize, new: Step) {
    let end = new.x + new.width;
    let covered = skyline[at..].iter().take_while(|s| s.x + s.width <= end).count();
    if let Some(next) = skyline.get_mut(at + covered)
        && next.x < end
    {
        next.width -= end - next.x;
        next.x = end;
    }
    skyline.splice(at..at + covered, [new]);
    // Neighbours of one height become one step.
    if skyline.get(at + 1).is_some_and(|s| s.y == new.y) {
        skyline[at].width += skyline.remove(at + 1).width;
    }
    if at > 0 && skyline[at - 1].y == new.y {
        skyline[at - 1].width += skyline.remove(at).width;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::math::hash_words;

    #[test]
    fn rectangles_never_overlap_and_waste_little() {
        let sizes: Vec<_> = (0..3000u32)
            .map(|i| {
                let h = hash_words(&[i]);
                if i < 20 { (40 + h % 100, 30 + (h >> 8) % 80) } else { (3 + h % 9, 3 + (h >> 8) % 7) }
            })
            .collect();
        let width = 500;
        let (places, height) = pack(&sizes, width).unwrap();
        let mut used = vec![false; (width * height) as usize];
        for (&(w, h), &(x, y)) in sizes.iter().zip(&places) {
            for j in y..y + h {
                for i in x..x + w {
                    let cell = &mut used[(j * width + i) as usize];
                    assert!(!*cell, "overlap at {i}, {j}");
                    *cell = true;
                }
            }
        }
        let filled = used.iter().filter(|&&u| u).count() as f32 / used.len() as f32;
        assert!(filled > 0.9, "{filled}");
    }

    #[test]
    fn too_wide_a_rectangle_is_refused() {
        assert!(pack(&[(11, 1)], 10).is_none());
    }
}
