//! A heat map of how many probes see each place: over the surfaces' atlas, and below it in a camera's view.
//!
//! A texel of the atlas has two sides; where both count, it shows the one that fewer probes see. Colours go by the logarithm of the number,
//! as one probe or two is a greater difference than twenty or thirty.

use super::coverage::{Sides, UNSEEN, seen_by};
use crate::base::progress::Progress;
use crate::io::canvas::{BACKGROUND, Canvas, Colour, INK, LETTER, LINE};
use crate::io::picture::heat;
use crate::scene::Camera;
use crate::transport::World;
use glam::{Vec2, Vec3};
use rayon::prelude::*;

/// Width of the picture, pixels.
const WIDTH: usize = 800;
/// Most of it that the atlas takes.
const ATLAS: usize = 540;
/// Space around the parts, pixels.
const GAP: usize = 8;
/// Texels none of whose sides the free space sees.
const UNREACHABLE: Colour = [62, 62, 68];
/// Where the ramp begins: what one probe sees is not as dark as what does not count.
const ONE: f32 = 0.25;

/// What is drawn.
pub struct Coverage<'a> {
    /// The surfaces.
    pub sides: &'a Sides,
    /// How many probes see each side, by [`Sides::times_seen`].
    pub times: &'a [u32],
    /// The probes, metres.
    pub probes: &'a [Vec3],
    /// Whose view is shown.
    pub camera: &'a Camera,
}

/// Colours of numbers up to `most`.
#[derive(Debug, Clone, Copy)]
pub struct Ramp {
    most: u32,
}

impl Ramp {
    /// For numbers up to `most`.
    pub fn to(most: u32) -> Self {
        Self { most: most.max(1) }
    }

    /// Place of a number along the ramp, from 0 (one) to 1 (the most).
    fn place(self, count: u32) -> f32 {
        let most = (self.most as f32).ln();
        if most > 0.0 { ((count.max(1) as f32).ln() / most).min(1.0) } else { 1.0 }
    }

    /// Colour of a number of probes; [`UNSEEN`] of none.
    pub fn colour(self, count: u32) -> Colour {
        if count == 0 { UNSEEN } else { heat(ONE + (1.0 - ONE) * self.place(count)) }
    }

    /// Numbers to write below it: powers of two, and the most.
    fn marks(self) -> Vec<(f32, String)> {
        let mut numbers: Vec<u32> = (0..32).map(|k| 1 << k).take_while(|&n| n <= self.most).collect();
        // Not on top of the last power.
        if numbers.last().is_some_and(|&n| self.place(n) > 0.92 && n < self.most) {
            numbers.pop();
        }
        if numbers.last() != Some(&self.most) {
            numbers.push(self.most);
        }
        numbers.into_iter().map(|n| (self.place(n), n.to_string())).collect()
    }
}

/// Draws it.
pub fn draw(world: &World, coverage: &Coverage, progress: &dyn Progress) -> Canvas {
    let counts = view_counts(world, coverage, progress);
    let most = coverage.times.iter().chain(counts.iter().flatten().map(|(count, _)| count)).copied().max().unwrap_or(1);
    let ramp = Ramp::to(most);
    let atlas = atlas(coverage, ramp);
    let view = view(coverage.camera, &counts, ramp);
    let top = atlas.size[1].max(legend_height(most)) + 2 * GAP;
    let mut canvas = Canvas::new([WIDTH, top + view.size[1]], BACKGROUND);
    canvas.paste([GAP, GAP], &atlas);
    legend(&mut canvas, [atlas.size[0] + 3 * GAP, GAP], coverage, ramp);
    canvas.paste([0, top], &view);
    canvas
}

/// The atlas, as large as there is room for.
fn atlas(coverage: &Coverage, ramp: Ramp) -> Canvas {
    let Coverage { sides, times, .. } = coverage;
    let [width, height] = sides.atlas.map(|n| n as usize);
    // Points may be of some texels only; cells are so wide that most of them hold one.
    let sparse = ((width * height) as f32 / (2 * sides.pixel.len().max(1)) as f32).sqrt().ceil() as usize;
    let cell = sparse.max(width.div_ceil(ATLAS)).max(1);
    let size = [width, height].map(|n| n.div_ceil(cell).max(1));
    let place = |texel: usize| {
        let pixel = sides.pixel[texel] as usize;
        pixel / width / cell * size[0] + pixel % width / cell
    };
    let mut pixels = vec![BACKGROUND; size[0] * size[1]];
    (0..sides.pixel.len()).for_each(|texel| pixels[place(texel)] = UNREACHABLE);
    let mut least = vec![u32::MAX; pixels.len()];
    for (side, &count) in sides.list.iter().zip(*times) {
        let at = place(side.texel as usize);
        least[at] = least[at].min(count);
        pixels[at] = ramp.colour(least[at]);
    }
    Canvas::zoomed(size, &pixels, (ATLAS / size[0]).max(1))
}

/// How many probes see the point of each pixel, and how far it faces the camera; `None` where no surface is seen.
fn view_counts(world: &World, coverage: &Coverage, progress: &dyn Progress) -> Vec<Option<(u32, f32)>> {
    let camera = coverage.camera.at_width(WIDTH as u32);
    let [width, height] = camera.size.map(|n| n as usize);
    progress.start("coverage of the view", height as u64);
    let pixel = |x: usize, y: usize| {
        let ray = camera.ray(Vec2::new(x as f32 + 0.5, y as f32 + 0.5), Vec2::splat(0.5));
        let surface = world.seen(&ray)?;
        let n = if surface.ng.dot(ray.d) > 0.0 { -surface.ng } else { surface.ng };
        let count = seen_by(world, &surface, n, coverage.probes, usize::MAX);
        Some((count as u32, -n.dot(ray.d)))
    };
    let row = |y: usize| {
        let row: Vec<_> = (0..width).map(|x| pixel(x, y)).collect();
        progress.advance(1);
        row
    };
    let rows: Vec<Vec<_>> = (0..height).into_par_iter().map(row).collect();
    progress.finish();
    rows.concat()
}

fn view(camera: &Camera, counts: &[Option<(u32, f32)>], ramp: Ramp) -> Canvas {
    let colour = |pixel: &Option<(u32, f32)>| match *pixel {
        Some((count, cos)) => ramp.colour(count).map(|c| (f32::from(c) * (0.55 + 0.45 * cos)) as u8),
        None => BACKGROUND,
    };
    Canvas { size: camera.at_width(WIDTH as u32).size.map(|n| n as usize), pixels: counts.iter().map(colour).collect() }
}

/// Numbers of probes that count together, from the least: none, one, and between powers of two.
fn classes(most: u32) -> Vec<[u32; 2]> {
    let octave = |k: u32| [1 << k, (2u32 << k) - 1];
    let mut list = vec![[0, 0]];
    list.extend((0..31).map(octave).take_while(|[low, _]| *low <= most));
    list
}

fn legend_height(most: u32) -> usize {
    (classes(most).len() + 9) * LINE
}

/// What the colours mean, and what share of the area has which.
fn legend(canvas: &mut Canvas, [x, mut y]: [usize; 2], coverage: &Coverage, ramp: Ramp) {
    let width = WIDTH - x - GAP;
    y += canvas.paragraph([x, y], width, &format!("How many of {} probes see a place", coverage.probes.len()), INK);
    y += LINE / 2;
    canvas.heat_bar([x + LETTER, y], [width - 4 * LETTER, LINE], [ONE, 1.0], &ramp.marks());
    y += 3 * LINE;
    for (colour, words) in [(UNSEEN, "none"), (UNREACHABLE, "not reachable: does not count")] {
        canvas.fill([x, y], [LINE - 2, LINE - 2], colour);
        canvas.text([x + LINE + LETTER, y], words, INK);
        y += LINE + 2;
    }
    y += LINE / 2;
    y += canvas.paragraph([x, y], width, "Share of the reachable area (texels differ in size):", INK);
    let area: f64 = coverage.sides.list.iter().map(|s| f64::from(s.area)).sum::<f64>().max(f64::MIN_POSITIVE);
    for [low, high] in classes(ramp.most) {
        let high = high.min(ramp.most.max(low));
        let is_in = |count: u32| (low..=high).contains(&count);
        let part = coverage.sides.list.iter().zip(coverage.times).filter(|(_, count)| is_in(**count));
        let share = part.map(|(side, _)| f64::from(side.area)).sum::<f64>() / area;
        let name = if low == high { low.to_string() } else { format!("{low} to {high}") };
        canvas.fill([x, y], [LINE - 2, LINE - 2], ramp.colour(low));
        canvas.text([x + LINE + LETTER, y], &format!("{name:>10}  {:6.2} %", 100.0 * share), INK);
        y += LINE;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::progress::Silent;
    use crate::exchange::{LoadOptions, load};
    use crate::probe::nonuniform::{Bounds, NonuniformParams, Reachable};

    /// A room of 4 x 2 x 2 m with a wall up to its ceiling that leaves a passage of half a metre at +Z, and a camera at -X.
    const SCENE: &str = r#"<scene version="3.0.0">
        <sensor type="perspective"><float name="fov" value="80"/>
          <film type="hdrfilm"><integer name="width" value="72"/><integer name="height" value="36"/></film>
          <transform name="to_world"><lookat origin="-1.9, 0, 0" target="0, 0, 0" up="0, 1, 0"/></transform></sensor>
        <shape type="cube"><transform name="to_world"><scale x="2" y="1" z="1"/></transform></shape>
        <shape type="cube"><transform name="to_world"><scale x="0.1" y="1" z="0.75"/><translate z="-0.25"/></transform></shape>
        </scene>"#;

    #[test]
    fn colours_say_how_many_probes_see_a_place() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("scene.xml");
        std::fs::write(&path, SCENE).unwrap();
        let (world, _) = World::opaque(load(&path, &LoadOptions::default()).unwrap());
        let camera = world.scene.sensor.clone().unwrap();
        let all = (Vec3::new(-2.0, -1.0, -1.0), Vec3::new(2.0, 1.0, 1.0));
        let params = NonuniformParams { resolution: 48, texels: 3000, ..NonuniformParams::default() };
        let reachable = Reachable::new(&world, &Bounds { filled: all, seen: all }, &[camera.position()], &params).unwrap();
        let sides = &reachable.sides;
        assert!(sides.list.iter().all(|s| sides.surface[s.texel as usize].0 == s.p && sides.pixel.len() == sides.surface.len()));
        // Two on the camera's side of the wall see all of it there; the other half of the room is dark but for the passage.
        let probes = [Vec3::new(-1.0, 0.0, -0.5), Vec3::new(-1.0, 0.3, -0.5)];
        let times = sides.times_seen(&sides.rows(&world, &probes));
        let coverage = Coverage { sides, times: &times, probes: &probes, camera: &camera };
        let canvas = draw(&world, &coverage, &Silent);
        let ramp = Ramp::to(2);
        let [width, height] = canvas.size;
        let top = height - 400;
        assert_eq!(width, WIDTH);
        let at = |x: usize, y: usize| canvas.pixels[(top + y) * WIDTH + x];
        let shaded = |colour: Colour, cos: f32| colour.map(|c| (f32::from(c) * (0.55 + 0.45 * cos)) as u8);
        // The wall in the middle of the view, seen straight on.
        let middle = at(400, 200);
        assert!(middle.iter().zip(shaded(ramp.colour(2), 1.0)).all(|(a, b)| a.abs_diff(b) <= 1), "{middle:?}");
        // Through the passage, the end of the room: neither probe sees it where the camera does.
        let is_unseen = |c: Colour| c[1] == 0 && c[0] > 100 && c[2] > 90;
        let view = &canvas.pixels[top * WIDTH..];
        let unseen = view.iter().filter(|c| is_unseen(**c)).count();
        assert!(unseen > 1000 && unseen < 400 * WIDTH / 5, "{unseen}");
        // The atlas, twice as large as its texels or more: what both see, what none does, and the insides of the wall.
        let part = atlas(&coverage, ramp);
        for colour in [ramp.colour(2), UNSEEN, UNREACHABLE] {
            assert!(part.pixels.iter().filter(|c| **c == colour).count() > 200, "{colour:?}");
        }
        assert!((0..part.size[1]).all(|y| {
            (0..part.size[0]).all(|x| canvas.pixels[(y + GAP) * WIDTH + x + GAP] == part.pixels[y * part.size[0] + x])
        }));
        // Where one sees every side, nothing is left.
        let part = atlas(&Coverage { times: &vec![1; times.len()], ..coverage }, ramp);
        assert!(!part.pixels.contains(&UNSEEN) && part.pixels.contains(&ramp.colour(1)));
    }

    #[test]
    fn the_ramp_starts_at_one_and_names_its_end() {
        let ramp = Ramp::to(37);
        assert_eq!((ramp.colour(0), ramp.colour(1), ramp.colour(37)), (UNSEEN, heat(ONE), heat(1.0)));
        let words: Vec<String> = ramp.marks().into_iter().map(|m| m.1).collect();
        assert_eq!(words, ["1", "2", "4", "8", "16", "37"]);
        assert_eq!(Ramp::to(1).colour(1), heat(1.0));
        assert_eq!(classes(5), [[0, 0], [1, 1], [2, 3], [4, 7]]);
    }
}
