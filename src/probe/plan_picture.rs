//! A drawing of a scene: its free space from above, and below it from the side (+Z), on the same x.
//!
//! Ceiling and front wall are cut away: each pixel shows the first surface behind the first free voxel of its column that no surface crosses, shaded by its normal.
//! [`draw`] shows where probes stand, as white dots, and colours surfaces by how many probes see them: magenta none, then from dark to bright.

use super::coverage::{UNSEEN, seen_by};
use super::skeleton::space::Space;
use crate::base::ray::Ray;
use crate::io::canvas::{BACKGROUND, Canvas, Colour};
use crate::io::picture::heat;
use crate::material::Surface;
use crate::transport::World;
use glam::{UVec3, Vec2, Vec3};
use rayon::prelude::*;

/// Pixels along the longest side of the box, before they are doubled.
const SIZE: f32 = 320.0;
/// Each pixel of a surface is so many of the drawing along each side, and dots are as sharp as those.
const ZOOM: usize = 2;
/// From so many probes on a place is as bright as can be.
const MANY: usize = 16;
/// Radius of a probe's dot, pixels of the drawing.
const DOT: f32 = 3.0;

/// See [`Plan::new`].
type Paint<'a> = &'a (dyn Fn(&Surface, Vec3, f32) -> Colour + Sync);

/// A view along an axis: which axis goes right, which one down, and whether it goes up in truth.
struct View {
    along: usize,
    right: usize,
    down: usize,
    up: bool,
}

const ABOVE: View = View { along: 1, right: 0, down: 2, up: false };
const SIDE: View = View { along: 2, right: 0, down: 1, up: true };

/// Both views.
pub struct Plan {
    /// The drawing.
    pub canvas: Canvas,
    lower: Vec3,
    extent: Vec3,
    /// Rows of the drawing at which the views begin.
    top: [usize; 2],
}

impl Plan {
    /// Draws the surfaces in colours of `paint`, shaded by their normals. It takes a surface, its normal on the viewer's side, and its depth in
    /// the box from 0, nearest, to 1.
    pub fn new(world: &World, space: &Space, paint: Paint) -> Self {
        let voxels = &space.field.voxels;
        let (lower, extent) = (voxels.lower, voxels.upper() - voxels.lower);
        let scale = SIZE / extent.max_element();
        let views = [ABOVE, SIDE].map(|view| {
            let size = [view.right, view.down].map(|axis| (extent[axis] * scale).ceil().max(1.0) as usize);
            let place = |x: f32, y: f32| {
                let mut p = lower;
                p[view.right] += x / scale;
                p[view.down] += if view.up { extent[view.down] - y / scale } else { y / scale };
                p
            };
            let pixel =
                |i: usize| colour(world, space, paint, &view, place((i % size[0]) as f32 + 0.5, (i / size[0]) as f32 + 0.5));
            let pixels: Vec<Colour> = (0..size[0] * size[1]).into_par_iter().map(pixel).collect();
            Canvas::zoomed(size, &pixels, ZOOM)
        });
        let gap = 4 * ZOOM;
        let top = [gap, 2 * gap + views[0].size[1]];
        let width = views.iter().map(|v| v.size[0]).max().unwrap_or(1);
        let mut canvas = Canvas::new([width, top[1] + views[1].size[1] + gap], BACKGROUND);
        views.iter().zip(top).for_each(|(view, y)| canvas.paste([0, y], view));
        Self { canvas, lower, extent, top }
    }

    /// Where a point is in the view from above and in that from the side, pixels of the drawing.
    pub fn places(&self, p: Vec3) -> [Vec2; 2] {
        let scale = SIZE / self.extent.max_element() * ZOOM as f32;
        let at = (p - self.lower) * scale;
        let place = |view: &View, top: usize| {
            let y = if view.up { self.extent[view.down] * scale - at[view.down] } else { at[view.down] };
            Vec2::new(at[view.right], y + top as f32)
        };
        [place(&ABOVE, self.top[0]), place(&SIDE, self.top[1])]
    }

    /// A dot with a dark rim at a point, in both views.
    pub fn dot(&mut self, p: Vec3, radius: f32, colour: Colour) {
        self.places(p).into_iter().for_each(|place| self.canvas.dot(place, radius, colour));
    }

    /// The box that is drawn, metres: lower and upper corner.
    pub fn bounds(&self) -> (Vec3, Vec3) {
        (self.lower, self.lower + self.extent)
    }
}

/// Draws probes at `probes`.
pub fn draw(world: &World, space: &Space, probes: &[Vec3]) -> Canvas {
    let by_probes = |surface: &Surface, n: Vec3, _: f32| match seen_by(world, surface, n, probes, MANY) {
        0 => UNSEEN,
        count => heat(0.2 + 0.65 * count as f32 / MANY as f32),
    };
    let mut plan = Plan::new(world, space, &by_probes);
    for p in probes {
        plan.dot(*p, DOT, [255; 3]);
    }
    plan.canvas
}

/// What a column through `p` shows.
fn colour(world: &World, space: &Space, paint: Paint, view: &View, p: Vec3) -> Colour {
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
    let shade = 0.45 + 0.55 * n.dot(Vec3::new(0.3, 0.6, 0.74)).abs();
    let depth = (voxels.upper() - surface.p)[view.along] / (voxels.upper() - voxels.lower)[view.along];
    paint(&surface, n, depth.clamp(0.0, 1.0)).map(|c| (f32::from(c) * shade) as u8)
}
