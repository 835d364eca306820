//! A view in the colours of what its rays through the probes meet.

use crate::io::canvas::{BACKGROUND, Canvas, Colour, INK, LINE};
use crate::method::light_field_probes::hits::{LobeRay, Verdict};
use crate::view::gbuffer::GBuffer;

/// Least width of a picture, pixels.
const WIDTH: usize = 640;
const GAP: usize = 8;
/// What shows no glossy surface.
const NOT_GLOSSY: Colour = [48, 48, 54];

/// The colour of a verdict.
pub const fn colour(verdict: Verdict) -> Colour {
    match verdict {
        Verdict::Right => [120, 126, 132],
        Verdict::Wrong => [235, 64, 52],
        Verdict::Missed => [255, 0, 255],
        Verdict::False => [64, 200, 255],
        Verdict::Lost => [255, 200, 0],
    }
}

/// Draws a view; each pixel has the mean colour of its rays' verdicts. `words` are those of the verdicts, in their order.
pub fn draw(title: &str, view: &GBuffer, rays: &[LobeRay], verdicts: &[Verdict], words: &[String]) -> Canvas {
    let size = view.size();
    let mut sums = vec![[0u32; 4]; size[0] * size[1]];
    for (lobe, verdict) in rays.iter().zip(verdicts) {
        let sum = &mut sums[lobe.pixel];
        colour(*verdict).into_iter().zip(&mut sum[..3]).for_each(|(c, s)| *s += u32::from(c));
        sum[3] += 1;
    }
    let mean = |[r, g, b, n]: [u32; 4]| if n > 0 { [r, g, b].map(|c| (c / n) as u8) } else { NOT_GLOSSY };
    let pixels: Vec<Colour> = sums.into_iter().map(mean).collect();
    let zoom = WIDTH.div_ceil(size[0]).max(1);
    let shown = size.map(|n| n * zoom);
    let head = LINE + GAP;
    let mut canvas = Canvas::new([shown[0] + 2 * GAP, head + shown[1] + GAP + (words.len() + 1) * LINE], BACKGROUND);
    canvas.text([GAP, GAP / 2], title, INK);
    canvas.paste([GAP, head], &Canvas::zoomed(size, &pixels, zoom));
    for (i, ((verdict, _), line)) in Verdict::ALL.iter().zip(words).enumerate() {
        let y = head + shown[1] + GAP + i * LINE;
        canvas.fill([GAP, y + 2], [LINE - 6, LINE - 6], colour(*verdict));
        canvas.text([GAP + LINE, y], line, INK);
    }
    canvas
}
