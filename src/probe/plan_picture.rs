//! A drawing of where probes stand: the free space from above, and below it from the side (+Z), on the same x.
//!
//! Ceiling and front wall are cut away: each pixel shows the first surface behind the first free voxel of its column that no surface crosses, shaded by its normal,
//! in a colour that says how many probes see it: magenta none, then from dark to bright. Probes are white dots.

use super::skeleton::space::Space;
use crate::base::ray::Ray;
use crate::io::picture::heat;
use crate::transport::World;
use glam::{UVec3, Vec2, Vec3};
use rayon::prelude::*;

/// Pixels along the longest side of the box, before they are doubled.
const SIZE: f32 = 320.0;
/// Each pixel of a surface is so many of the drawing along each side, and dots are as sharp as those.
const ZOOM: usize = 2;
/// From so many probes on a place is as bright as can be.
const MANY: usize = 16;
/// Between the two views, and around them.
const BACKGROUND: [u8; 3] = [24, 24, 28];
/// What no probe sees.
const UNSEEN: [u8; 3] = [230, 0, 200];
/// Radius of a dot and of its rim, pixels of the drawing.
const DOT: (f32, f32) = (3.0, 5.0);

/// Rows of RGB from the top.
pub struct Drawing {
    /// Width and height, pixels.
    pub size: [usize; 2],
    /// Three bytes a pixel.
    pub rgb: Vec<u8>,
}

/// A view along an axis: which axis goes right, which one down, and whether it goes up in truth.
struct View {
    along: usize,
    right: usize,
    down: usize,
    up: bool,
}

const ABOVE: View = View { along: 1, right: 0, down: 2, up: false };
const SIDE: View = View { along: 2, right: 0, down: 1, up: true };

/// Draws probes at `probes`.
pub fn draw(world: &World, space: &Space, probes: &[Vec3]) -> Drawing {
    let views = [ABOVE, SIDE].map(|view| draw_view(world, space, probes, &view));
    let gap = 4 * ZOOM;
    let width = views.iter().map(|v| v.size[0]).max().unwrap_or(1);
    let mut rgb = Vec::new();
    for view in &views {
        rgb.extend(BACKGROUND.repeat(width * gap));
        for row in view.rgb.chunks_exact(3 * view.size[0]) {
            rgb.extend(row);
            rgb.extend(BACKGROUND.repeat(width - view.size[0]));
        }
    }
    rgb.extend(BACKGROUND.repeat(width * gap));
    Drawing { size: [width, rgb.len() / (3 * width)], rgb }
}

fn draw_view(world: &World, space: &Space, probes: &[Vec3], view: &View) -> Drawing {
    let voxels = &space.field.voxels;
    let (lower, extent) = (voxels.lower, voxels.upper() - voxels.lower);
    let scale = SIZE / extent.max_element();
    let size = [view.right, view.down].map(|axis| (extent[axis] * scale).ceil().max(1.0) as usize);
    let place = |x: f32, y: f32| {
        let mut p = lower;
        p[view.right] += x / scale;
        p[view.down] += if view.up { extent[view.down] - y / scale } else { y / scale };
        p
    };
    let pixel = |i: usize| colour(world, space, probes, view, place((i % size[0]) as f32 + 0.5, (i / size[0]) as f32 + 0.5));
    let pixels: Vec<[u8; 3]> = (0..size[0] * size[1]).into_par_iter().map(pixel).collect();
    let large = size.map(|n| n * ZOOM);
    let mut rgb: Vec<[u8; 3]> =
        (0..large[0] * large[1]).map(|i| pixels[i / large[0] / ZOOM * size[0] + i % large[0] / ZOOM]).collect();
    for p in probes {
        let at = (*p - lower) * (scale * ZOOM as f32);
        let y = if view.up { extent[view.down] * scale * ZOOM as f32 - at[view.down] } else { at[view.down] };
        dot(&mut rgb, large, Vec2::new(at[view.right], y));
    }
    Drawing { size: large, rgb: rgb.concat() }
}

/// What a column through `p` shows.
fn colour(world: &World, space: &Space, probes: &[Vec3], view: &View, p: Vec3) -> [u8; 3] {
    let voxels = &space.field.voxels;
    let in_column =
        |k: u32| UVec3::from_array(std::array::from_fn(|axis| if axis == view.along { k } else { voxels.nearest(p)[axis] }));
    let first = (0..voxels.counts[view.along]).rev().map(in_column).find(|&c| space.is_open(voxels.centre_at(c)));
    let Some(first) = first else { return BACKGROUND };
    let mut o = p;
    o[view.along] = voxels.centre_at(first)[view.along];
    let d = -Vec3::AXES[view.along];
    let Some(surface) = world.intersect(&Ray::new(o, d)) else { return BACKGROUND.map(|c| c + 24) };
    let n = if surface.ng.dot(d) > 0.0 { -surface.ng } else { surface.ng };
    let sees = |probe: &&Vec3| n.dot(**probe - surface.p) > 0.0 && !world.occluded(&surface.spawn_to(**probe));
    let count = probes.iter().filter(sees).take(MANY).count();
    let shade = 0.45 + 0.55 * n.dot(Vec3::new(0.3, 0.6, 0.74)).abs();
    let base = if count == 0 { UNSEEN } else { heat(0.2 + 0.65 * count as f32 / MANY as f32) };
    base.map(|c| (f32::from(c) * shade) as u8)
}

fn dot(rgb: &mut [[u8; 3]], size: [usize; 2], centre: Vec2) {
    let low = (centre - DOT.1).max(Vec2::ZERO);
    for y in low.y as usize..size[1].min((centre.y + DOT.1 + 1.0).max(0.0) as usize) {
        for x in low.x as usize..size[0].min((centre.x + DOT.1 + 1.0).max(0.0) as usize) {
            let r = centre.distance(Vec2::new(x as f32 + 0.5, y as f32 + 0.5));
            if r < DOT.1 {
                rgb[y * size[0] + x] = if r < DOT.0 { [255; 3] } else { [0; 3] };
            }
        }
    }
}
