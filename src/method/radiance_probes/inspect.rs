//! A picture of what is lost on the way to the probes and back (§5.2, bottom row of Fig. 10): over the atlas, and in a camera's view.

use super::frame_map::FrameMap;
use super::operator::Transport;
use crate::base::math::Rgb;
use crate::io::canvas::{BACKGROUND, Canvas, Colour, INK, LETTER, LINE};
use crate::io::picture::heat;
use crate::lightmap::LightMap;
use crate::scene::Camera;
use crate::transport::World;
use glam::Vec2;
use rayon::prelude::*;

/// Width of the picture, pixels.
const WIDTH: usize = 800;
/// Most of it that the atlas takes.
const ATLAS: usize = 540;
/// Space around the parts, pixels.
const GAP: usize = 8;

/// Draws norms (see [`super::round_trip`]) of some receivers; others have those of receivers beside them.
pub fn draw(world: &World, transport: &Transport, norms: &[(u32, f32)], camera: &Camera) -> Canvas {
    let mut values = vec![f32::NAN; transport.receivers.len()];
    norms.iter().for_each(|&(r, norm)| values[r as usize] = norm);
    // Receivers are few a chart; those between take the value of the one before them in the atlas's order.
    let mut last = norms.first().map_or(0.0, |n| n.1);
    for value in &mut values {
        if value.is_nan() { *value = last } else { last = *value }
    }
    let map = FrameMap::new(&world.scene.geometry, transport).filled(values.iter().map(|&v| Rgb::splat(v)));
    let (atlas, view) = (atlas(transport, &values), view(world, &map, camera));
    let top = atlas.size[1].max(8 * LINE) + 2 * GAP;
    let mut canvas = Canvas::new([WIDTH, top + view.size[1]], BACKGROUND);
    canvas.paste([GAP, GAP], &atlas);
    let x = atlas.size[0] + 3 * GAP;
    let words = format!("Share of light lost on its way to {} probes and back, whatever the lights", transport.probes.len());
    let y = GAP + canvas.paragraph([x, GAP], WIDTH - x - GAP, &words, INK) + LINE / 2;
    let marks: Vec<(f32, String)> = [0.0, 0.25, 0.5, 0.75, 1.0].map(|v: f32| (v, v.to_string())).to_vec();
    canvas.heat_bar([x + LETTER, y], [WIDTH - x - 4 * LETTER, LINE], [0.0, 1.0], &marks);
    canvas.paste([0, top], &view);
    canvas
}

fn colour(norm: f32) -> Colour {
    heat(norm)
}

fn atlas(transport: &Transport, values: &[f32]) -> Canvas {
    let [width, height] = transport.atlas.size.map(|n| n as usize);
    let cell = width.div_ceil(ATLAS).max(1);
    let size = [width.div_ceil(cell).max(1), height.div_ceil(cell).max(1)];
    let mut pixels = vec![BACKGROUND; size[0] * size[1]];
    for (r, &value) in transport.receivers.iter().zip(values) {
        let pixel = r.pixel as usize;
        pixels[pixel / width / cell * size[0] + pixel % width / cell] = colour(value);
    }
    Canvas::zoomed(size, &pixels, (ATLAS / size[0]).max(1))
}

fn view(world: &World, map: &LightMap, camera: &Camera) -> Canvas {
    let camera = camera.at_width(WIDTH as u32);
    let size = camera.size.map(|n| n as usize);
    let pixel = |i: usize| {
        let at = Vec2::new((i % WIDTH) as f32 + 0.5, (i / WIDTH) as f32 + 0.5);
        let ray = camera.ray(at, Vec2::splat(0.5));
        let Some(s) = world.seen(&ray) else { return BACKGROUND };
        let norm = map.lookup(s.triangle, s.barycentric, s.frame.n.dot(-ray.d) < 0.0).x;
        colour(norm).map(|c| (f32::from(c) * (0.55 + 0.45 * s.ng.dot(ray.d).abs())) as u8)
    };
    Canvas { size, pixels: (0..size[0] * size[1]).into_par_iter().map(pixel).collect() }
}
