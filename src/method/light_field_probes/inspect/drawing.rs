//! The picture of a ray's way: in the scene from above and from the side, and on the maps of the probes that were asked.

use super::way::Way;
use crate::base::octahedral::encode;
use crate::io::canvas::{BACKGROUND, Canvas, Colour, INK, LINE};
use crate::io::picture::scalar;
use crate::method::light_field_probes::field::LightField;
use crate::method::light_field_probes::march::LocalRay;
use crate::method::light_field_probes::trace::{Found, Step};
use crate::probe::plan_picture::Plan;
use crate::probe::skeleton::space::Space;
use crate::transport::World;
use glam::{Vec2, Vec3};

/// Colours of the probes that are asked, in turn.
pub const COLOURS: [Colour; 8] = [
    [60, 180, 255],
    [255, 150, 30],
    [60, 210, 110],
    [250, 90, 200],
    [250, 230, 60],
    [170, 120, 255],
    [90, 230, 230],
    [255, 95, 80],
];
/// Surfaces of the scene before they are shaded, from the nearest to the farthest.
const GREY: [f32; 2] = [175.0, 95.0];
/// Probes that nobody asks.
const IDLE: Colour = [190, 190, 190];
/// The ray where no probe follows it, and where it ends in truth.
const WHITE: Colour = [255; 3];
/// Edge of a map, pixels.
const EDGE: usize = 192;
/// Space around the parts, pixels.
const GAP: usize = 8;
/// Least width of what stands beside the maps: two lines of the key.
const LEFT: usize = 400;
/// Least width of the picture: its title.
const LEAST_WIDTH: usize = 640;
/// Most probes whose maps are shown.
const MOST_MAPS: usize = 12;

/// Draws it; the picture's first line is `title`.
pub fn draw((world, space): (&World, &Space), field: &LightField, way: &Way, title: &str) -> Canvas {
    let plan = plan(world, space, field, way);
    let shown = way.steps.len().min(MOST_MAPS);
    let head = 2 * LINE + GAP;
    let cell = [EDGE + GAP, EDGE + 3 * LINE + GAP];
    let rows = (plan.size[1] / cell[1]).max(1).min(shown.max(1));
    let key = key_height(way);
    let columns = shown.div_ceil(rows);
    let left = plan.size[0].max(LEFT);
    let width = (left + 2 * GAP + columns * cell[0]).max(LEAST_WIDTH);
    let mut canvas = Canvas::new([width, head + (plan.size[1] + key).max(rows * cell[1])], BACKGROUND);
    canvas.text([GAP, 4], title, INK);
    canvas.text([GAP, 4 + LINE], &format!("probes: {}; BVH: {}", way.result(), way.truth_in_words()), INK);
    canvas.paste([GAP, head], &plan);
    draw_key(&mut canvas, [GAP, head + plan.size[1]], left, way);
    for (i, step) in way.steps.iter().take(shown).enumerate() {
        let at = [left + 2 * GAP + i / rows * cell[0], head + i % rows * cell[1]];
        draw_map(&mut canvas, at, field, way, (i, step));
    }
    canvas
}

fn colour_of(step: usize) -> Colour {
    COLOURS[step % COLOURS.len()]
}

/// Distances along the ray between which it is in a box; it starts there or before.
fn within(way: &Way, (lower, upper): (Vec3, Vec3)) -> f32 {
    let ray = &way.asked.ray;
    let (a, b) = ((lower - ray.o) / ray.d, (upper - ray.o) / ray.d);
    let far = a.max(b);
    far.to_array().into_iter().filter(|t| t.is_finite()).fold(ray.t_max, f32::min).max(ray.t_min)
}

/// Scene, probes and ray from above and from the side.
fn plan(world: &World, space: &Space, field: &LightField, way: &Way) -> Canvas {
    let mut plan = Plan::new(world, space, &|_, _, depth| [(GREY[0] + (GREY[1] - GREY[0]) * depth) as u8; 3]);
    let last = within(way, plan.bounds());
    let ray = &way.asked.ray;
    let line = |plan: &mut Plan, ends: [Vec3; 2], width, colour| {
        let [a, b] = ends.map(|p| plan.places(p));
        (0..2).for_each(|view| plan.canvas.line([a[view], b[view]], width, colour));
    };
    if let Some(eye) = way.asked.eye {
        line(&mut plan, [eye, ray.o], 1, [0; 3]);
        plan.dot(eye, 3.0, [0; 3]);
    }
    line(&mut plan, [ray.at(ray.t_min), ray.at(way.truth.unwrap_or(last))], 1, WHITE);
    for &probe in &field.places.used() {
        plan.dot(field.places.position(probe), 2.0, IDLE);
    }
    for (i, step) in way.steps.iter().enumerate().rev() {
        line(&mut plan, [ray.at(step.t), ray.at(Way::end(step).min(last))], 3, colour_of(i));
    }
    let mut named: Vec<[Vec2; 2]> = Vec::new();
    for (i, step) in way.steps.iter().enumerate() {
        let p = field.places.position(step.probe);
        plan.dot(p, 5.0, colour_of(i));
        let places = plan.places(p);
        for (view, place) in places.into_iter().enumerate() {
            // Above the names of those that stand at the same place in this view.
            let before = named.iter().filter(|other| other[view].distance(place) < LINE as f32).count();
            let corner = place + Vec2::new(8.0, -14.0 - (before * (LINE - 3)) as f32);
            let [x, y] = corner.max(Vec2::ZERO).to_array().map(|v| v as usize);
            plan.canvas.text([x + 1, y + 1], &step.probe.to_string(), [0; 3]);
            plan.canvas.text([x, y], &step.probe.to_string(), colour_of(i));
        }
        named.push(places);
    }
    marks(&mut plan, way);
    plan.canvas
}

/// Where the ray starts, is lost, and ends.
fn marks(plan: &mut Plan, way: &Way) {
    let ray = &way.asked.ray;
    plan.dot(ray.at(ray.t_min), 3.0, WHITE);
    for (i, step) in way.steps.iter().enumerate() {
        if Way::said(step) == "lost" {
            let places = plan.places(ray.at(Way::end(step)));
            places.into_iter().for_each(|place| plan.canvas.cross(place, 5.0, colour_of(i)));
        }
    }
    if let Some(t) = way.truth {
        for place in plan.places(ray.at(t)) {
            plan.canvas.ring(place, [8.0, 11.0], [0; 3]);
            plan.canvas.ring(place, [8.5, 10.5], WHITE);
        }
    }
    if let (Found::Surface { t, .. }, Some(last)) = (way.found, way.steps.len().checked_sub(1)) {
        for place in plan.places(ray.at(t)) {
            plan.canvas.ring(place, [3.5, 7.0], [0; 3]);
            plan.canvas.ring(place, [4.0, 6.5], colour_of(last));
        }
    }
}

/// Two lines each.
fn key_height(way: &Way) -> usize {
    (2 * KEY.len() + usize::from(way.steps.len() > MOST_MAPS)) * LINE + GAP
}

/// What the marks mean.
const KEY: [&str; 3] = [
    "white dot: where the ray starts; black: the camera; small grey dots: probes that are not asked",
    "a colour: a probe that is asked, and the stretch that it follows; cross: where it loses the ray; coloured ring: its hit",
    "white line and ring: the ray and its hit by the BVH",
];

fn draw_key(canvas: &mut Canvas, [x, mut y]: [usize; 2], width: usize, way: &Way) {
    for words in KEY {
        y += canvas.paragraph([x, y], width, words, INK);
    }
    if let Some(more) = way.steps.len().checked_sub(MOST_MAPS).filter(|n| *n > 0) {
        canvas.text([x, y], &format!("maps of the first {MOST_MAPS} probes; {more} more were asked"), INK);
    }
}

/// A probe's distances, with the ray on them: all of it, and the stretch that the probe was asked for.
fn draw_map(canvas: &mut Canvas, [x, y]: [usize; 2], field: &LightField, way: &Way, (i, step): (usize, &Step)) {
    let surfels = &field.maps[step.probe].surfels;
    let (n, colour) = (surfels.size, colour_of(i));
    let texels = scalar(&surfels.distance);
    let pixels: Vec<Colour> = (0..EDGE * EDGE).map(|k| texels[k / EDGE * n / EDGE * n + k % EDGE * n / EDGE]).collect();
    let mut map = Canvas { size: [EDGE; 2], pixels };
    let ray = &way.asked.ray;
    let whole = way.truth.unwrap_or(ray.t_max);
    let o = ray.o - field.places.position(step.probe);
    for (ends, width, colour) in [([ray.t_min, whole], 1, WHITE), ([step.t, Way::end(step).min(ray.t_max)], 3, colour)] {
        for line in lines(o, ray.d, ends) {
            map.line(line.map(|p| p * EDGE as f32), width, colour);
        }
    }
    let place = |t: f32| encode(o + ray.d * t) * EDGE as f32;
    map.dot(place(ray.t_min), 2.0, WHITE);
    if let Some(t) = way.truth {
        map.ring(place(t), [4.0, 7.0], [0; 3]);
        map.ring(place(t), [4.5, 6.5], WHITE);
    }
    let from = step.t;
    let to = if Way::end(step).is_finite() { format!("{:.3} m", Way::end(step)) } else { "its end".into() };
    canvas.text([x, y], &format!("{}: probe {}: {}", i + 1, step.probe, Way::said(step)), colour);
    canvas.text([x, y + LINE], &format!("from {from:.3} to {to}"), INK);
    canvas.paste([x, y + 2 * LINE], &map);
    let range = surfels.distance.iter().filter(|d| d.is_finite()).fold([f32::INFINITY, 0.0], |[a, b], &d| [d.min(a), d.max(b)]);
    canvas.text([x, y + 2 * LINE + EDGE], &format!("distance {:.2} to {:.2} m", range[0], range[1]), INK);
}

/// A ray from `o` relative to a probe along `d`, as lines on the probe's map in [0, 1]²: a straight one in each octant.
fn lines(o: Vec3, d: Vec3, [from, to]: [f32; 2]) -> Vec<[Vec2; 2]> {
    let ray = LocalRay { o, d };
    let (cuts, count) = ray.cuts([from, to]);
    cuts[..count].windows(2).filter_map(|t| Some(ray.piece([t[0], t[1]])?.0)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_on_the_map_are_where_the_ray_is() {
        let (o, d) = (Vec3::new(-1.0, 0.3, 0.4), Vec3::new(0.9, -0.4, -0.2).normalize());
        let lines = lines(o, d, [0.0, 5.0]);
        assert_eq!(lines.len(), 4);
        assert!((lines[0][0] - encode(o)).length() < 1e-6 && (lines[3][1] - encode(o + d * 5.0)).length() < 1e-6);
        for k in 1..200 {
            let p = encode(o + d * (k as f32 * 0.025));
            let off = |[a, b]: &[Vec2; 2]| {
                let along = ((p - *a).dot(*b - *a) / (*b - *a).length_squared()).clamp(0.0, 1.0);
                p.distance(a.lerp(*b, along))
            };
            assert!(lines.iter().map(off).fold(1.0, f32::min) < 1e-5, "{p}");
        }
    }
}
