//! Draws the footprint of the GGX lobe with its fit (like Fig. 9 of the paper), and the filter's variants on adversarial noise
//! (like Fig. 10), and times the four-pass filter at 1920 x 1080.
//!
//! `cargo run --release --example filter_figures -- docs/pictures`

use glam::{Vec2, Vec3};
use image::{GrayImage, Luma, Rgb as Pixel, RgbImage};
use reprobe::base::math::hash_words;
use reprobe::method::glossy_probes::filter::{FilterInput, FilterParams, Kernel, Method, filter};
use reprobe::method::glossy_probes::footprint::{Footprint, FootprintParams, ggx};
use std::path::{Path, PathBuf};
use std::time::Instant;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let folder = PathBuf::from(std::env::args().nth(1).unwrap_or_else(|| "docs/pictures".into()));
    std::fs::create_dir_all(&folder)?;
    footprint(&folder)?;
    variants(&folder)?;
    timing();
    Ok(())
}

/// Left: the lobe in the image for alpha .075, d_c 2 m, d_r 5 m. Right: its slice (white), the core's fit (orange),
/// and the Gaussian of the truncated second moment (blue).
fn footprint(folder: &Path) -> Result<(), image::ImageError> {
    const SIZE: u32 = 320;
    let (alpha, d_c, d_r, half) = (0.075, 2.0, 5.0, 0.35f32);
    let lobe = |y: Vec2| {
        let to = |d: f32| (-y * d_c).extend(d).normalize();
        ggx(alpha, to(d_r), to(d_c))
    };
    let peak = lobe(Vec2::ZERO);
    let mut picture = RgbImage::new(2 * SIZE, SIZE);
    for y in 0..SIZE {
        for x in 0..SIZE {
            let at = (Vec2::new(x as f32, y as f32) / SIZE as f32 * 2.0 - 1.0) * half;
            let v = (lobe(at) / peak).powf(1.0 / 2.2) * 255.0;
            picture.put_pixel(x, y, Pixel([v as u8; 3]));
        }
    }
    let core = Footprint::new(&FootprintParams::default()).sigma(alpha, d_c, d_r);
    let moment = Footprint::new(&FootprintParams::paper()).sigma(alpha, d_c, d_r);
    println!("footprint: sigma {core:.4} by the core, {moment:.4} by the moment, at focal length 1");
    let gauss = |s: f32| move |y: f32| (-0.5 * (y / s).powi(2)).exp();
    type Curve<'a> = (&'a dyn Fn(f32) -> f32, [u8; 3]);
    let curves: [Curve; 3] = [
        (&gauss(moment), [90, 140, 255]),
        (&gauss(core), [255, 150, 40]),
        (&|y| lobe(Vec2::new(y, 0.0)) / peak, [255, 255, 255]),
    ];
    for (curve, colour) in curves {
        // Many points to a column, so that steep parts stay joined.
        for i in 0..SIZE * 40 {
            let t = i as f32 / (SIZE * 40) as f32;
            let v = 0.05 + 0.9 * curve((2.0 * t - 1.0) * half);
            let row = ((1.0 - v) * SIZE as f32) as u32;
            for r in row..(row + 2).min(SIZE) {
                picture.put_pixel(SIZE + (t * SIZE as f32) as u32, r, Pixel(colour));
            }
        }
    }
    picture.save(folder.join("footprint.png"))
}

struct Noise {
    size: [usize; 2],
    color: Vec<Vec3>,
    normal: Vec<Vec3>,
    depth: Vec<f32>,
    material: Vec<u32>,
    covariance: Vec<[f32; 3]>,
    energy: Vec<f32>,
}

/// Uniform noise; regions with hard edges; covariance that turns and stretches smoothly in each.
fn noise(width: usize, height: usize, scale: f32) -> Noise {
    let n = width * height;
    let random = |i: usize| hash_words(&[i as u32]) as f32 / u32::MAX as f32;
    let mut out = Noise {
        size: [width, height],
        color: (0..n).map(|i| Vec3::splat(random(i))).collect(),
        normal: vec![Vec3::Z; n],
        depth: vec![2.0; n],
        material: vec![0; n],
        covariance: vec![[0.0; 3]; n],
        energy: vec![0.5; n],
    };
    for i in 0..n {
        let p = Vec2::new((i % width) as f32, (i / width) as f32) / height as f32;
        let disc = p.distance(Vec2::new(0.42, 0.55)) < 0.3;
        out.material[i] = u32::from(disc) + 2 * u32::from(p.x + 0.45 * p.y > 0.95);
        let (s, c) = (2.0 * p.x + 3.0 * p.y + if disc { 1.0 } else { 0.0 }).sin_cos();
        let (a, b) = (scale * (6.0 + 6.0 * p.x), scale * (1.5 + 2.0 * p.y));
        out.covariance[i] = [a * a * c * c + b * b * s * s, (a * a - b * b) * c * s, a * a * s * s + b * b * c * c];
    }
    out
}

impl Noise {
    fn filter(&self, params: &FilterParams) -> Vec<Vec3> {
        let input = FilterInput {
            width: self.size[0],
            height: self.size[1],
            color: &self.color,
            normal: &self.normal,
            depth: &self.depth,
            material: &self.material,
            covariance: &self.covariance,
            energy: &self.energy,
        };
        filter(&input, params)
    }
}

/// Input, full filter, two passes, four passes; below, each one's difference to the full filter, times 8. Contrast is raised alike.
fn variants(folder: &Path) -> Result<(), image::ImageError> {
    const SIZE: usize = 256;
    let input = noise(SIZE, SIZE, 1.0);
    let run = |method| input.filter(&FilterParams { method, kernel: Kernel::Gaussian, ..FilterParams::default() });
    let full = run(Method::Full);
    let panels = [input.color.clone(), full.clone(), run(Method::TwoPass), run(Method::FourPass)];
    let mut picture = GrayImage::new(4 * SIZE as u32, 2 * SIZE as u32);
    for (k, panel) in panels.iter().enumerate() {
        let square: f32 = panel.iter().zip(&full).map(|(a, b)| (a.x - b.x).powi(2)).sum();
        println!(
            "{}: RMSE to the full filter {:.5}",
            ["input", "full", "two passes", "four passes"][k],
            (square / full.len() as f32).sqrt()
        );
        for i in 0..SIZE * SIZE {
            let (x, y) = ((k * SIZE + i % SIZE) as u32, (i / SIZE) as u32);
            let contrast = if k == 0 { 1.0 } else { 4.0 };
            let grey = |v: f32| Luma([(v.clamp(0.0, 1.0) * 255.0) as u8]);
            picture.put_pixel(x, y, grey(0.5 + contrast * (panel[i].x - 0.5)));
            picture.put_pixel(x, y + SIZE as u32, grey(0.5 + 8.0 * (panel[i].x - full[i].x)));
        }
    }
    picture.save(folder.join("filter.png"))
}

fn timing() {
    let input = noise(1920, 1080, 0.5);
    for kernel in [Kernel::Gaussian, Kernel::Ggx] {
        let start = Instant::now();
        let out = input.filter(&FilterParams { kernel, ..FilterParams::default() });
        println!("1920 x 1080, {kernel:?}: {:.3} s ({} pixels)", start.elapsed().as_secs_f64(), out.len());
    }
}
